"""A law that is renewed: when it is asked for, what is admitted, kept and taken back, and how."""

import dataclasses
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from retuning_toys import SAMPLE_NS, ToyRetuner

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningOrder, RetuningState, Verdict
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.horizon import PlanProgramme
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.retuning import (
    Answer,
    MotionEstimate,
    Refusal,
    RenewedLaw,
    RenewingController,
    ShipFigures,
)
from utank_hil.retuning.estimate import ChangeMonitor
from utank_hil.retuning.law_bank import (
    FADE_SAMPLES,
    WARM_UP_SAMPLES,
    MonitoredLaw,
    SampleHistory,
    WarmUp,
)
from utank_hil.retuning.law_exchange import RETRY_NS
from utank_hil.retuning.renewing import (
    FIRST_EFFORT,
    LEAST_EFFORT,
    SEA_DIFFERENCE,
    TRIAL,
    sea_difference,
)
from utank_hil.retuning.trial import WindowStatistics
from utank_hil.sea import SlopeSpectrum, jonswap

CONFIG = load_config("configs/controllers/constrained_gpc.yaml", ControllerConfig)
PLANT = CONFIG.plant
SHIP = ShipFigures.of(PLANT.ship)
SLOWER = replace(SHIP, stiffness_nm_rad=SHIP.stiffness_nm_rad / 1.15**2, stiffness_deviation=0.01)
NEARLY = replace(SHIP, stiffness_nm_rad=0.99 * SHIP.stiffness_nm_rad, stiffness_deviation=0.01)
OMEGA = np.linspace(0.15, 2.0, 80)
IDLE, IDENTIFY, DESIGN, TRYING, RETUNED, REFUSED, UNDONE = RetuningState


@cache
def law_for(hs_m: float, tp_s: float, **settings: float) -> ConstrainedLaw:
    sea = jonswap(hs_m, tp_s)
    model = SeaModel(tuple(sea.frequency_hz), tuple(sea.density))
    return ConstrainedDesign("constrained_gpc", model, **settings).law(PLANT)  # type: ignore[arg-type]


def renewed(hs_m: float = 3.0, tp_s: float = 10.0, **settings: float) -> RenewedLaw:
    return RenewedLaw(law_for(hs_m, tp_s, **settings), 0.015, 2e4, 0.03)


def estimate(height: float = 1.0, ship: ShipFigures | None = None) -> MotionEstimate:
    waves = SlopeSpectrum(OMEGA, height**2 * 1e-3 * np.exp(-OMEGA))
    of_ship = Verdict.UNCERTAIN if ship is None else Verdict.GOOD
    return MotionEstimate(
        Verdict.UNCERTAIN, of_ship, ship or SHIP, waves, 0.05, 3.0 * height, 10.0, 1200.0
    )


class Rig:
    """A renewing controller on a linear ship that a wave of one period rolls."""

    def __init__(self, answer: Answer | None, first: ConstrainedLaw | None = None) -> None:
        self.retuner = ToyRetuner(answer)
        law = first or law_for(2.0, 8.0)
        self.controller = RenewingController(
            law, law.clipped(), SHIP, 0, CONFIG.limits, self.retuner
        )
        self._model = PLANT.sampled(("roll_rad", "roll_rate_rad_s", "level_m"), 0.2)
        self._state = np.zeros(len(self._model.A))
        self.command_pa, self.samples = 0.0, 0
        self.commands: list[float] = []
        self.rows: list[FloatArray] = []
        self.engaged = self.fresh = True
        self.wave: Callable[[int], float] = lambda k: 1.0
        self.passive: Callable[[int], float] = lambda k: 1.0

    def run(self, samples: int, order: RetuningOrder = RetuningOrder()) -> None:  # noqa: B008
        w = 0.6 * 0.2
        for _ in range(samples):
            k, controller = self.samples, self.controller
            if k:
                controller.applied(np.array([self.command_pa]))
            passive = 0.04 * self.passive(k) * np.sin(w * k)
            controller.update(
                k * SAMPLE_NS,
                order,
                engaged=self.engaged,
                fresh=self.fresh,
                passive_roll_rad=passive,
            )
            order = RetuningOrder()
            motion = np.array(
                [0.03 * np.sin(w * k), 0.018 * np.cos(w * k), 0.8 * np.sin(w * k - 1)]
            )
            y = self._model.C @ self._state + self.wave(k) * motion
            self.command_pa = float(controller.step(y)[0])
            self.rows.append(y)
            self.commands.append(self.command_pa)
            self._state = self._model.A @ self._state + self._model.B[:, 0] * self.command_pa
            self.samples += 1

    def run_until(self, state: RetuningState, most: int = 3000) -> None:
        while self.controller.state is not state:
            assert most > 0, f"still {self.controller.state.name}"
            self.run(1)
            most -= 1

    def run_until_it_acts(self) -> None:
        self.run(1)
        while self.command_pa == 0.0:
            self.run(1)

    def renew_until(self, state: RetuningState, told: MotionEstimate | None = None) -> None:
        """Tell an estimate after a minute, and go on until a state."""
        self.run(300)
        self.controller.note(told or estimate())
        self.run_until(state)

    @property
    def states(self) -> list[RetuningState]:
        return [event.state for event in self.controller.events]

    @property
    def reasons(self) -> str:
        return "; ".join(self.controller.events[-1].reasons)


def test_known_waves_bring_a_law_that_is_tried_and_kept() -> None:
    rig = Rig(renewed())
    rig.run(300)
    assert rig.states == []
    rig.controller.note(estimate())
    rig.run_until(RETUNED)
    assert rig.states == [DESIGN, TRYING, RETUNED]
    assert rig.controller.laws.accepted.estimate is not None
    assert "renewed for Hs 3.00 m, Tp 10.0 s" in rig.reasons
    assert "predicted roll 0.86 degrees" in rig.reasons
    (request,) = rig.retuner.records
    assert np.array_equal(request.waves.density, estimate().waves.density)  # type: ignore[union-attr]


def test_every_law_that_may_be_in_charge_is_told_what_is_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(renewed())
    rig.renew_until(RetuningState.RETUNED, estimate(ship=NEARLY))
    told: list[float] = []
    monkeypatch.setattr(rig.controller.laws.active.controller, "allow", told.append)
    rig.controller.allow(0.5)
    share = rig.controller.effort.share
    rig.run(1)
    assert told == [0.5 * share]


def test_the_same_waves_bring_nothing_and_others_a_law() -> None:
    rig = Rig(renewed())
    rig.renew_until(RETUNED)
    rig.controller.note(estimate(1 + 0.8 * SEA_DIFFERENCE))
    rig.run(300)
    assert rig.controller.state is RETUNED
    rig.controller.note(estimate(1 + 1.2 * SEA_DIFFERENCE))
    rig.run_until(DESIGN, 2)
    assert "waves differ by 24%" in rig.reasons


def test_a_longer_record_of_the_same_waves_brings_a_law() -> None:
    rig = Rig(renewed())
    rig.renew_until(RETUNED, replace(estimate(), duration_s=600.0))
    rig.controller.note(estimate())
    rig.run_until(DESIGN, 2)
    assert "longer record, 20 minutes" in rig.reasons


def test_a_changed_ship_brings_a_law_for_her() -> None:
    rig = Rig(renewed())
    rig.renew_until(RETUNED, estimate(ship=SHIP))
    rig.controller.note(estimate(ship=SLOWER))
    assert rig.controller._latest is None  # nor is a law made for waves that were seen with her
    rig.run(10)
    assert rig.controller.state is RETUNED  # once is not enough
    rig.controller.note(estimate(ship=SLOWER))
    rig.run_until(TRYING)
    rig.run_until(RETUNED)
    assert rig.retuner.records[-1].ship == SLOWER
    assert rig.controller.laws.active.found == SLOWER  # the passive twin is hers, too
    rig.controller.note(estimate())  # she can't be told: still the last one that could
    assert rig.controller._latest.ship == SLOWER


def test_difference_of_seas_is_that_of_their_amplitudes() -> None:
    one = estimate().waves
    assert sea_difference(one, one) == 0
    taller = replace(one, density=1.21 * one.density)
    assert sea_difference(taller, one) == pytest.approx(0.1)
    moved = replace(one, omega_rad_s=one.omega_rad_s + 10.0)
    assert sea_difference(one, moved) == np.inf


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"limits": replace(CONFIG.limits, pressure_pa=60e3)}, "stronger pump"),
        ({"limits": replace(CONFIG.limits, level_m=4.5)}, "larger tank"),
        ({"limits": replace(CONFIG.limits, pressure_pa=49.0)}, "next to nothing"),
        ({"limits": replace(CONFIG.limits, rate_pa_s=5e-324)}, "next to nothing"),
        ({"level_output": 1}, "other signals"),
        ({"level_output": None}, "other signals"),
    ],
)
def test_a_law_for_another_pump_or_other_signals_is_refused(
    change: dict[str, object], words: str
) -> None:
    answer = renewed()
    rig = Rig(replace(answer, law=dataclasses.replace(answer.law, **change)))  # type: ignore[arg-type]
    first = rig.controller.laws.accepted
    rig.renew_until(REFUSED)
    assert words in rig.reasons
    assert rig.controller.laws.active is first


def test_another_sample_time_or_another_answer_is_refused() -> None:
    slow = law_for(3.0, 10.0, sample_time_s=0.25)
    for answer in (RenewedLaw(slow, 0.01, 1e4, 0.03), Refusal(("no law has the margins",))):
        rig = Rig(answer)
        rig.run(300)
        rig.controller.note(estimate())
        rig.run_until(REFUSED)
        assert rig.states == [DESIGN, REFUSED]


def test_after_a_refusal_it_waits_ten_minutes() -> None:
    rig = Rig(Refusal(("no",)))
    rig.renew_until(REFUSED)
    rig.controller.note(estimate(2.0))
    wait = RETRY_NS // SAMPLE_NS
    rig.run(wait - 20)
    assert rig.controller.state is REFUSED
    rig.run(40)
    assert rig.states == [DESIGN, REFUSED, DESIGN, REFUSED]


def bad(gain: float) -> RenewedLaw:
    """A law that answers the opposite, the stronger the gain."""
    good = renewed()
    horizon = good.law.horizon
    wrong = replace(horizon, unlimited_state=-gain * horizon.unlimited_state)
    return replace(good, law=dataclasses.replace(good.law, horizon=wrong))


def test_a_bad_law_is_taken_back_and_the_one_before_is_in_charge() -> None:
    rig = Rig(bad(0.3))
    first = rig.controller.laws.accepted
    rig.renew_until(REFUSED)
    assert rig.states == [DESIGN, TRYING, REFUSED]
    assert "roll rose" in rig.reasons
    assert rig.controller.laws.active is first


def test_a_law_whose_answer_is_not_finite_is_dropped_at_once() -> None:
    rig = Rig(bad(np.nan))
    rig.renew_until(REFUSED)
    assert "not finite" in rig.reasons
    assert np.isfinite(rig.commands).all()


def test_a_law_that_rolls_her_away_is_dropped_at_once() -> None:
    for times, at_once in ((3.5, False), (8.0, True)):
        rig = Rig(renewed())
        rig.renew_until(TRYING)
        begin = rig.samples
        rig.wave = lambda k, times=times: times  # type: ignore[misc]
        rig.run_until(REFUSED)
        assert ("from the heel before" in rig.reasons) is at_once
        assert (rig.samples - begin < 15) is at_once  # three seconds


def test_a_growing_sea_takes_no_good_law_back_and_a_growing_roll_does() -> None:
    for passive_grows, state in ((True, RETUNED), (False, REFUSED)):
        rig = Rig(renewed())
        begin = 300 + round(TRIAL.trial_s / 0.2) // 4

        def growing(k: int, begin: int = begin) -> float:
            return 1.0 if k < begin else 4.0

        rig.wave = growing
        if passive_grows:
            rig.passive = growing
        rig.run(300)
        rig.controller.note(estimate())
        rig.run_until(state)


def test_undo_goes_back_and_stays_for_ten_minutes() -> None:
    rig = Rig(renewed())
    first = rig.controller.laws.accepted
    rig.renew_until(RETUNED)
    rig.run(1, RetuningOrder(undo=True))
    assert rig.controller.state is UNDONE
    assert rig.controller.laws.active is first
    rig.controller.note(estimate())
    rig.run(RETRY_NS // SAMPLE_NS - 20)
    assert rig.controller.state is UNDONE
    rig.run(40)
    assert rig.controller.state in (DESIGN, TRYING)


def test_an_order_renews_at_once_and_needs_known_waves() -> None:
    rig = Rig(renewed())
    rig.run(300)
    rig.run(2, RetuningOrder(retune=True))
    assert "waves are not known" in rig.reasons
    rig.controller.note(estimate())
    rig.run(2)
    assert rig.controller.state is REFUSED  # by itself only later
    rig.run(200, RetuningOrder(retune=True))
    assert rig.controller.state is TRYING


@pytest.mark.parametrize("verdict", [Verdict.OUTDATED, Verdict.MOTION_SMALL])
def test_nothing_is_renewed_for_waves_that_are_no_longer_known(verdict: Verdict) -> None:
    rig = Rig(renewed())
    rig.controller.note(estimate())
    rig.controller.note(MotionEstimate(verdict, verdict))
    rig.run(300)
    assert rig.states == []
    rig.run(2, RetuningOrder(retune=True))
    assert "waves are not known" in rig.reasons
    assert rig.states == [REFUSED]


def test_forbidden_or_not_in_charge_nothing_begins() -> None:
    rig = Rig(renewed())
    rig.engaged = False
    rig.controller.note(estimate())
    rig.run(300)
    rig.engaged = True
    for _ in range(300):
        rig.run(1, RetuningOrder(forbidden=True))
    assert rig.states == []
    rig.run_until(TRYING)


def test_a_law_that_only_rolls_the_ship_more_loses_its_pressure_and_gets_it_back() -> None:
    rig = Rig(None)
    rig.passive = lambda k: 0.2 if k < 1000 else 1.5
    rig.run(1000)
    assert LEAST_EFFORT <= rig.controller.effort.share < 0.2
    rig.run(2500)
    assert rig.controller.effort.share > 0.9
    assert rig.states == []
    rig.engaged = False
    rig.run(1)
    assert rig.controller.effort.share == FIRST_EFFORT


@pytest.mark.parametrize(("ship", "plans"), [(None, False), (NEARLY, True)])
def test_a_law_that_plans_is_tried_with_all_of_the_pressure(
    ship: ShipFigures | None, plans: bool
) -> None:
    rig = Rig(renewed())
    rig.passive = lambda k: 0.2
    rig.run(1000)
    rig.controller.note(estimate(ship=ship))
    rig.run_until(TRYING)
    assert rig.controller.effort.share == pytest.approx(1.0 if plans else LEAST_EFFORT, abs=0.1)
    rig.run(1, RetuningOrder(undo=True))
    assert rig.controller.effort.share == pytest.approx(FIRST_EFFORT, rel=0.01)


def test_no_command_exceeds_what_is_allowed() -> None:
    rig = Rig(None)
    rig.wave = lambda k: 5.0
    rig.controller.allow(0.3)
    rig.run(300)
    assert 0 < np.abs(rig.commands).max() <= 0.3 * CONFIG.limits.pressure_pa


def test_only_a_law_for_an_identified_ship_plans() -> None:
    for ship, plans in ((None, False), (SLOWER, True)):
        rig = Rig(renewed())
        rig.run(300)
        for _ in range(2):
            rig.controller.note(estimate(ship=ship))
        rig.run_until(TRYING)
        active = rig.controller.laws.active.controller
        assert isinstance(active, ConstrainedController) is plans


@pytest.mark.parametrize(("passive_rad", "most_pa"), [(0.02, 20e3), (0.05, 42.5e3), (0.2, 50e3)])
def test_a_growing_sea_lets_the_pressure_grow(passive_rad: float, most_pa: float) -> None:
    controller = Rig(None).controller
    controller.renewed = renewed()  # 20 kPa are predicted where the passive ship rolls 0.03 rad
    controller._baseline = WindowStatistics(0.01, 17e3, 17e3, 0.02)
    found = controller._to_compare_with(WindowStatistics(0.02, 37e3, 37e3, passive_rad))
    assert (found.pressure_pa, found.pressure_rms_pa) == pytest.approx((most_pa, most_pa))


def test_the_new_law_knows_the_past_as_if_it_had_been_stepped_all_along() -> None:
    answer = renewed()
    rig = Rig(answer)
    alone = answer.law.controller()
    rig.run(900)
    rig.controller.note(estimate(ship=NEARLY))
    rig.run_until(TRYING)
    applied = 0.0
    for y, command in zip(rig.rows, rig.commands, strict=True):
        alone.applied(np.array([applied]))
        alone.observe(y)
        applied = command
    active = rig.controller.laws.active.controller
    assert isinstance(active, ConstrainedController)
    assert active._state == pytest.approx(alone._state, rel=1e-3, abs=1e-6)


def test_a_law_that_plans_makes_no_plan_while_its_memory_is_filled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Fifty programmes in a tick may outlast it."""
    history = SampleHistory(WARM_UP_SAMPLES, 3)
    for k in range(100):
        history.add(0.0, np.array([0.2, 0.1, 4.0]) * np.sin(0.1 * k), fresh=True)
    controller, plans = law_for(2.0, 8.0).controller(), list[int]()
    solve = PlanProgramme.solve

    def counted(self: PlanProgramme, *arguments: Any) -> FloatArray | None:
        plans.append(1)
        return solve(self, *arguments)

    monkeypatch.setattr(PlanProgramme, "solve", counted)
    warm_up = WarmUp(MonitoredLaw(controller, ChangeMonitor(SHIP)), history)
    while not warm_up.done:
        warm_up.advance()
    assert not plans
    controller.step(np.zeros(3))
    assert plans  # of the state that the past has left


def test_the_exchange_makes_no_step_in_the_pressure() -> None:
    rig, same = Rig(renewed(4.0, 12.5)), Rig(None)
    rig.run(900)
    rig.controller.note(estimate(ship=NEARLY))
    rig.run_until(TRYING)
    begin = rig.samples
    rig.run(300)
    same.run(rig.samples)
    # the first sample of the trial is a fifteenth of the way from the old law's to the new one's
    apart = np.abs(np.array(rig.commands) - same.commands)[begin - 1 :]
    assert apart.max() > 5e3  # the laws do differ
    assert apart[0] < 1.5 * apart[1:].max() / FADE_SAMPLES
    steps = np.abs(np.diff(rig.commands))[begin - 2 :]
    assert steps[:5].max() < 0.6 * steps[FADE_SAMPLES:].max()


@pytest.mark.parametrize(("passive_rad", "roll_rad"), [(0.01, 0.005), (0.02, 0.01), (0.05, 0.04)])
def test_a_pump_at_its_limits_need_not_take_off_more_as_the_sea_grows(
    passive_rad: float, roll_rad: float
) -> None:
    controller = Rig(None).controller
    controller.renewed = renewed()
    controller._baseline = WindowStatistics(0.01, 20e3, 20e3, 0.02)
    tried = WindowStatistics(0.03, 20e3, 20e3, passive_rad)
    assert controller._to_compare_with(tried).roll_rad == pytest.approx(roll_rad)


def test_a_law_for_another_ship_is_compared_with_what_she_would_have_rolled() -> None:
    """The twin of the file's ship rolled 1.4 times as much: a good law was refused."""
    controller = Rig(None).controller
    controller.renewed = replace(renewed(), passive_roll_rad=0.014)
    controller._baseline = WindowStatistics(0.012, 20e3, 20e3, 0.02)
    tried = WindowStatistics(0.01, 20e3, 20e3, 0.014)
    assert controller._to_compare_with(tried).roll_rad == pytest.approx(0.0084)
    for _ in range(2):
        controller.note(estimate(ship=SLOWER))
    assert controller._to_compare_with(tried).roll_rad == pytest.approx(0.012)


@pytest.mark.parametrize("periods", [1.0, 2.5])
def test_a_slow_ship_is_tried_for_as_many_rolls(periods: float) -> None:
    slow = replace(SHIP, stiffness_nm_rad=SHIP.stiffness_nm_rad / periods**2)
    law = law_for(2.0, 8.0)
    tried = RenewingController(law, law.clipped(), slow, 0, CONFIG.limits, ToyRetuner(None))
    rolls_s = slow.roll_period_s / tried.sample_time_s
    assert tried._trial_settings.trial_s / slow.roll_period_s > 13.9
    assert tried._least_samples / rolls_s > 2.3
