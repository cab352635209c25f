"""Estimates of waves and ship: on the bus, in telemetry, in the log, and as an alarm."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Fault, SeaEstimate, ShipEstimate, Verdict, load_catalogue
from utank_hil.canbus.events import AlarmEvent
from utank_hil.configuration import load_config
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import (
    Answer,
    EstimateSettings,
    MotionEstimate,
    Refusal,
    RetuningEvent,
    ShipFigures,
    estimator,
)
from utank_hil.retuning.adaptive import AdaptiveController
from utank_hil.runners import Lockstep
from utank_hil.sea import SlopeSpectrum

STORM = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "storm.yaml"
OMEGA = np.linspace(0.2, 2.0, 50)
WAVES = SlopeSpectrum(OMEGA, 1e-3 * np.exp(-OMEGA))
SHIP = ShipFigures(1e9, 2e9, 5e7, 0.02, 0.01)
FOUND = MotionEstimate(Verdict.GOOD, Verdict.GOOD, SHIP, WAVES, 0.05, 3.2, 9.1, 1200.0)


@pytest.fixture(autouse=True)
def _the_first_estimate_after_half_a_minute(monkeypatch):
    monkeypatch.setattr(estimator, "SEA_PERIODS", 1.38)


@dataclass
class Desk:
    """Answers at once."""

    alive: bool = True
    replies: tuple[Answer, ...] = (FOUND,)
    records: list[FloatArray] = field(default_factory=list)

    def submit(self, number, record, now_ns):
        self.records.append(record)

    def answer(self, number, now_ns):
        return self.replies[min(number, len(self.replies)) - 1]


class Listener:
    """Hears the two messages."""

    name, period_ns = "listener", 1_000_000_000

    def __init__(self):
        catalogue = load_catalogue()
        self._receivers = [catalogue.receiver(SeaEstimate), catalogue.receiver(ShipEstimate)]
        self.heard: list[SeaEstimate | ShipEstimate] = []

    def receive(self, frame, now_ns):
        for receiver in self._receivers:
            if frame.can_id == receiver.can_id:
                message = receiver.accept(frame)
                assert message is not None
                self.heard.append(message)

    def tick(self, now_ns):
        return ()


class Voyage:
    """The storm with a ship whose GM is watched, and all that is said of her."""

    def __init__(self, limit_m):
        chosen = load_config(STORM, Scenario)
        config = chosen.controllers["gpc"]
        ship = replace(config.vessel.ship, displacement_n=1e8)
        vessel = config.vessel.model_copy(update={"ship": ship, "least_gm_m": limit_m})
        config = config.model_copy(
            update={"vessel": vessel, "sea_estimate": EstimateSettings(every_s=30.0)}
        )
        self.desk, listener = Desk(), Listener()
        self.heard = listener.heard
        self.rows: list[FloatArray] = []
        self.events: list[RetuningEvent | AlarmEvent] = []
        node = build_controller_node(
            config,
            commissioned=True,
            estimating=self.desk,
            sink=lambda row: self.rows.append(row.copy()),
            event_sink=lambda event, _start_ns: self.events.append(event),
        )
        ship_side = build_ship_side(chosen, 1, chosen.operator)
        self._lockstep = Lockstep([*ship_side.nodes, node, listener])

    def run_until(self, time_s):
        self._lockstep.run_until(round(time_s * 1e9))

    @property
    def shown(self):
        return dict(zip(SIGNALS, self.rows[-1], strict=True))

    @property
    def warned(self):
        alarms = [event.code for event in self.events if isinstance(event, AlarmEvent)]
        return Fault.STABILITY_LOW in alarms

    @property
    def said(self):
        return [event.reasons for event in self.events if isinstance(event, RetuningEvent)]


def test_an_estimate_is_shown_wherever_people_look():
    voyage = Voyage(9.3)
    voyage.run_until(34.0)
    (request,) = voyage.desk.records
    # a ship that rolls, as she was measured
    assert np.ptp(request.record[1:, 1:], axis=0).min() > 0
    sea = [each for each in voyage.heard if isinstance(each, SeaEstimate)]
    told = [each for each in voyage.heard if isinstance(each, ShipEstimate)]
    assert sea[0].verdict is Verdict.RECORD_SHORT
    assert np.isnan(sea[0].significant_height_m)
    assert sea[-1].verdict is Verdict.GOOD
    assert sea[-1][1:5] == pytest.approx((3.2, 9.1, WAVES.rms_rad, 0.05), abs=0.02)
    assert told[-1].roll_period_s == pytest.approx(SHIP.roll_period_s, abs=0.01)
    assert told[-1].gm_m == pytest.approx(9.5, abs=0.1)
    shown = voyage.shown
    assert shown["significant_height_m"] == 3.2
    assert shown["gm_m"] == pytest.approx(told[-1].gm_m, abs=0.005)
    assert shown["sea_verdict"] == Verdict.GOOD
    (said,) = voyage.said
    assert "3.20 m, 9.1 s" in said[0]
    assert voyage.warned


@pytest.mark.evidence("9.0", "None")
@pytest.mark.parametrize("limit_m", [None, 9.0])
def test_when_estimates_end_that_is_shown_and_an_alarm_where_they_watch_the_stability(limit_m):
    voyage = Voyage(limit_m)
    voyage.run_until(34.0)
    assert not voyage.warned
    voyage.desk.alive = False  # the process was killed
    voyage.run_until(123.0)
    for told in voyage.heard[-2:]:
        assert told.verdict is Verdict.OUTDATED
        assert np.isnan(told[1:5]).all()
        assert told.age_s == pytest.approx(93, abs=10)  # in steps of ten
    shown = voyage.shown
    assert shown["ship_verdict"] == Verdict.OUTDATED
    for name in ("significant_height_m", "wave_moment_rms_rad", "roll_period_s", "gm_m"):
        assert np.isnan(shown[name])
    assert shown["ship_age_s"] == pytest.approx(93, abs=1)
    assert voyage.warned == (limit_m is not None)
    dead, old = voyage.said[-1]
    assert "dead" in dead
    assert "the last estimate is 90 s old" in old


def test_a_failure_of_the_estimates_is_an_event_once_and_so_is_its_end():
    chosen = load_config(STORM, Scenario)
    config = chosen.controllers["gpc"]
    config = config.model_copy(update={"sea_estimate": EstimateSettings(every_s=30.0)})
    killed = Refusal(("the retuner was killed by signal 9, and was restarted",))
    events: list[RetuningEvent | AlarmEvent] = []
    node = build_controller_node(
        config,
        estimating=Desk(replies=(killed, killed, FOUND)),
        event_sink=lambda event, _start_ns: events.append(event),
    )
    ship_side = build_ship_side(chosen, 1, ())
    Lockstep([*ship_side.nodes, node]).run_until(128_000_000_000)
    failed, back, usual = [each for each in events if isinstance(each, RetuningEvent)]
    assert failed.reasons == (f"no estimates of sea and ship: {killed.reasons[0]}",)
    assert back.reasons[0] == "there are estimates of sea and ship again"
    assert "3.20 m, 9.1 s" in back.reasons[1]
    assert "3.20 m, 9.1 s" in usual.reasons[0]


def test_every_estimate_is_handed_to_who_retunes(monkeypatch):
    handed: list[MotionEstimate] = []
    monkeypatch.setattr(AdaptiveController, "note", lambda _, estimate: handed.append(estimate))
    chosen = load_config(STORM.with_name("load_change.yaml"), Scenario)
    config = chosen.controllers["gpc"]
    config = config.model_copy(update={"sea_estimate": EstimateSettings(every_s=30.0)})
    other = replace(FOUND, hs_m=2.0)
    node = build_controller_node(
        config, retuner=Desk(alive=False), estimating=Desk(replies=(FOUND, other))
    )
    ship_side = build_ship_side(chosen, 1, ())
    Lockstep([*ship_side.nodes, node]).run_until(64_000_000_000)
    assert handed == [FOUND, other]
