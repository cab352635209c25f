"""A station that forecasts the waves, another maker's or the emulated one, on a lockstep bus."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_nodes import DATABASE, ForeignNode
from pydantic import ValidationError

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Fault, Frame, Mode, load_catalogue
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.configuration import load_config
from utank_hil.configuration.vessel import PreviewSection, Vessel
from utank_hil.nodes.forecast_heard import forecast_of
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep
from utank_hil.runners.bus_model import SimulatedBus
from utank_hil.runners.lockstep import with_more

STORM = load_config(Path("configs/scenarios/storm_all.yaml"), Scenario)
WAVES = STORM.wave_moment(1)
STIFFNESS_NM_RAD = STORM.vessel.ship.stiffness_nm_rad
SECOND_NS = 1_000_000_000


class Station(ForeignNode):
    """Another maker's: it knows the waves, and sends a round of 5.25 s in 0.22 s."""

    deviation_rad = 0.004
    silent = False
    bus = 0

    def __init__(self) -> None:
        super().__init__("preview")
        self.changed: dict[str, float] = {}
        self.round = 0
        self.spoil = bytes

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        if self.silent:
            return []
        frames = self.life(now_ns)
        if self.due("WAVE_FORECAST", now_ns):
            lead_s = 0.5 * (self.round % 11)
            self.round += 1
            at_s = now_ns * 1e-9 + lead_s + np.array([0.0, 0.25])
            moment, later = WAVES.at(at_s) / STIFFNESS_NM_RAD
            values = {"lead_s": lead_s, "moment_rad": moment, "next_moment_rad": later,
                      "deviation_rad": self.deviation_rad, "quality": 0}  # fmt: skip
            frame = self.frame("WAVE_FORECAST", **values | self.changed)
            frames.append(Frame(frame.can_id, self.spoil(frame.data)))
        return [Frame(self.bus << BUS_SHIFT | each.can_id, each.data) for each in frames]


class Bench:
    """The emulated ship in the storm, a controller that is armed, and a foreign station."""

    def __init__(self, preview: PreviewSection | None, law: str = "constrained") -> None:
        vessel = STORM.vessel.model_copy(update={"preview": preview})
        scenario = STORM.model_copy(update={"vessel": vessel})
        self.config = STORM.controllers[law].model_copy(update={"vessel": vessel})
        self.ship = build_ship_side(scenario, 1, (TimedAction(1.0, Action.ARM),))
        self.controller = build_controller_node(self.config, commissioned=True)
        self.station = Station()
        self.station.versions = (load_catalogue().version, vessel.version)
        left_out = () if preview is None else ("preview",)
        nodes = [*self.ship.without(left_out), self.station, self.controller]
        more = len(vessel.foreign.buses) - 1
        self.lockstep = Lockstep(nodes, with_more(SimulatedBus(), more, 250_000))

    def run(self, seconds: float) -> None:
        self.lockstep.run_until(self.lockstep.now_ns + round(seconds * SECOND_NS))

    @property
    def foreseen_s(self) -> float:
        return self.controller.law.foreseen_s

    @property
    def alarms(self) -> bool:
        return Fault.FORECAST_IGNORED in self.controller.safety.alarms.codes


@pytest.mark.parametrize("bus", ["", "can7"])
def test_what_another_maker_forecasts_reaches_the_law(bus: str) -> None:
    bench = Bench(PreviewSection(bus=bus))
    bench.station.bus = int(bus != "")
    bench.run(20)
    measured = bench.controller.measured
    heard = forecast_of(measured, 600.0)
    assert heard is not None
    assert (np.diff(heard.time_s) >= 0).all()
    assert heard.time_s[-1] > 4.8
    now_s = measured.now_ns * 1e-9
    true = WAVES.at(now_s + heard.time_s) / STIFFNESS_NM_RAD
    # a frame comes a millisecond and up to a tick after it was made
    np.testing.assert_allclose(heard.moment_rad, true, atol=2e-3)
    np.testing.assert_allclose(heard.deviation_rad, 0.004, atol=1e-4)
    assert 4.8 < bench.foreseen_s < 5.3
    assert bench.controller.mode is Mode.ACTIVE
    assert not bench.alarms
    assert bench.controller.inbox.foreign == 0


def test_the_law_commands_otherwise_with_a_forecast_than_without() -> None:
    benches = [Bench(PreviewSection()), Bench(None)]
    for bench in benches:
        bench.run(20)
    told, untold = (bench.controller.command_pa for bench in benches)
    assert abs(told - untold) > 100.0


@pytest.mark.parametrize(
    "how",
    ["silent", "bad quality", "no moment", "damaged", "too short", "other ship", "no heartbeat"],
)
def test_a_forecast_that_is_none_is_left_out_within_a_second_and_alarmed(how: str) -> None:
    bench = Bench(PreviewSection())
    station = bench.station
    bench.run(12)
    assert bench.foreseen_s > 4.8
    assert not bench.alarms
    match how:
        case "silent":
            station.silent = True
        case "bad quality":
            station.changed = {"quality": 2}
        case "no moment":
            station.changed = {"moment_rad": 16383 * 1e-4 - 0.8}
        case "damaged":
            station.spoil = lambda data: data[:4] + bytes([data[4] ^ 0x24]) + data[5:]
        case "too short":
            station.spoil = lambda data: data[:7]
        case "other ship":
            station.versions = (station.versions[0], station.versions[1] ^ 1)
        case "no heartbeat":
            station.life = lambda _: []  # type: ignore[method-assign]
    bench.run(2.0)
    assert bench.foreseen_s == 0.0
    assert bench.alarms
    assert bench.controller.mode is Mode.ACTIVE
    received = bench.controller.inbox.received(Fault.FORECAST_IGNORED)
    assert ("ship" in received) is (how == "other ship")


def test_points_count_for_so_long_and_no_longer() -> None:
    bench = Bench(PreviewSection())
    bench.run(8)
    bench.station.silent = True
    oldest_ms = bench.config.safety.forecast_age_ms
    assert oldest_ms == 600.0
    bench.run(0.4)
    assert forecast_of(bench.controller.measured, oldest_ms) is not None
    bench.run(0.25)
    assert forecast_of(bench.controller.measured, oldest_ms) is None


def test_a_forecast_against_the_motion_is_alarmed_and_the_law_goes_on() -> None:
    bench = Bench(PreviewSection())
    bench.station.frame = _reversed(bench.station.frame)  # type: ignore[method-assign]
    bench.run(40)
    assert bench.controller.law.doubts_forecast
    assert bench.foreseen_s == 0.0
    assert bench.alarms
    assert bench.controller.mode is Mode.ACTIVE


def _reversed(make: Any) -> Any:
    def frame(name: str, **values: float) -> Frame:
        signed = {key: -x if "moment" in key else x for key, x in values.items()}
        return make(name, **signed)  # type: ignore[no-any-return]

    return frame


def test_without_the_key_its_frames_are_foreign_and_nothing_is_told() -> None:
    bench = Bench(None)
    bench.run(5)
    assert bench.controller.measured.forecast == ()
    assert bench.controller.measured.forecast_age_ms == 0.0
    assert bench.foreseen_s == 0.0
    assert bench.controller.inbox.foreign == pytest.approx(5 * (50 + 10), abs=3)
    assert not bench.alarms
    assert bench.controller.mode is Mode.ACTIVE


def test_a_law_that_takes_none_goes_on_as_ever() -> None:
    bench = Bench(PreviewSection(), law="gpc")
    bench.run(5)
    assert bench.foreseen_s == 0.0
    assert not bench.controller.law.doubts_forecast
    assert bench.controller.mode is Mode.ACTIVE


@pytest.mark.parametrize("error", [0.0, 1.0])
def test_the_emulated_station_forecasts_with_the_error_that_it_states(error: float) -> None:
    scenario = load_config(Path("configs/scenarios/preview.yaml"), Scenario)
    assert scenario.preview is not None
    forecasts = scenario.preview.model_copy(update={"error": error})
    side = build_ship_side(scenario.model_copy(update={"preview": forecasts}), 5, ())
    assert side.preview is not None
    waves, apart, said = scenario.wave_moment(5), [], []
    for tick in range(20_000):
        now_ns = 7 * SECOND_NS + tick * TICK_NS  # a clock that does not begin at zero
        for frame in side.preview.tick(now_ns):
            message = DATABASE.get_message_by_frame_id(frame.can_id)
            if message.name == "WAVE_FORECAST":
                values = message.decode(frame.data, decode_choices=False)
                at_s = tick * 0.01 + values["lead_s"]
                apart.append(values["moment_rad"] - waves.at(at_s) / STIFFNESS_NM_RAD)
                said.append(values["deviation_rad"])
    assert len(apart) == 10_000
    rms_rad = math.sqrt(waves.variance) / STIFFNESS_NM_RAD
    assert np.std(apart) == pytest.approx(error * rms_rad, rel=0.3, abs=1e-4)
    np.testing.assert_allclose(said, error * rms_rad, atol=2e-4)


def test_a_scenario_says_what_its_station_can_not_forecast() -> None:
    content = {
        "name": "x", "vessel": "v", "duration_s": 60, "settle_s": 5,
        "sea": {"kind": "jonswap", "hs_m": 3, "tp_s": 9, "effective_slope": {"coefficient": 0.5}},
    }  # fmt: skip
    bare = STORM.vessel.model_copy(update={"pump": None})
    with pytest.raises(ValidationError, match="needs a station: give the ship preview"):
        Scenario.model_validate({**content, "vessel": bare, "preview": {"error": 1}})
    vessel = bare.model_copy(update={"preview": PreviewSection()})
    Scenario.model_validate({**content, "vessel": vessel, "preview": {"error": 1}})
    voyage = [{"time_s": 20, "heading_deg": 40}]
    with pytest.raises(ValidationError, match="keeps course, speed and sea"):
        Scenario.model_validate({**content, "vessel": vessel, "voyage": voyage})


def test_a_station_changes_no_version_and_may_be_on_the_fourth_interface_at_most() -> None:
    plain, preview = (
        load_config(Path(f"configs/ships/{name}.yaml"), Vessel)
        for name in ("thesis_first", "thesis_first_preview")
    )
    assert plain.version == preview.version
    assert not preview.foreign.any
    assert (plain.foreign.preview, preview.foreign.preview) == (None, 0)
    motion = {"profile": "sbg_ellipse", "accept_unprotected": True}
    pump = {"profile": "cia402", "bus": "c", "node": 5, "mode": "torque",
            "pressure_pa_per_unit": 80, "speed_rad_s_per_unit": 0.001}  # fmt: skip
    devices = {"motion": {**motion, "bus": "a"}, "motion_2": {**motion, "bus": "b"}, "pump": pump}
    content = yaml.safe_load(Path("configs/ships/thesis_first.yaml").read_text(encoding="utf-8"))
    content |= {"devices": devices, "redundancy": {"second_motion_sensor": True}}
    on_c = Vessel.model_validate({**content, "preview": {"bus": "c"}})
    assert on_c.foreign.buses[on_c.foreign.preview or 0] == "c"
    with pytest.raises(ValidationError, match="5th interface"):
        Vessel.model_validate({**content, "preview": {"bus": "d"}})
