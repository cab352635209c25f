"""Stimulation of roll on still water: amplitude, ramps, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rolling_ship import SHIP, TANK

from tools.thesis.capsize import controlled_run
from tools.thesis.harmonic import harmonic_response
from tools.thesis.simulate import WaveMoment
from utank_hil.control import CommandLimiter, PumpLimits
from utank_hil.control.stimulation import Stimulation
from utank_hil.dynamics import RollModel

CALM = WaveMoment([], [], [])
PLAN = Stimulation(
    ship=SHIP,
    tank=TANK,
    amplitude_rad=math.radians(3.0),
    period_s=12.5,
    ramp_s=60.0,
    pressure_pa=50e3,
    roll_limit_rad=math.radians(6.0),
    level_limit_m=4.0,
)


def record(controller, model, duration_s, **options):
    rows = []
    controlled_run(
        model,
        controller,
        CALM,
        duration_s,
        each_step=lambda time, state, command: rows.append([time, *state, command]),
        **options,
    )
    return np.array(rows).T


def amplitude(time, roll, since):
    return np.abs(roll[time > since]).max()


def test_gains_are_those_of_the_closed_form():
    roll, level = PLAN.gains
    expected = harmonic_response(SHIP, TANK, [math.tau / 12.5], pressure_pa=1.0)
    assert roll == pytest.approx(expected.roll_rad[0])
    assert level == pytest.approx(expected.level_m[0])


@pytest.mark.slow
def test_ship_rolls_with_the_wanted_amplitude_and_period():
    time, roll, *_, pressure = record(PLAN.controller(), RollModel(SHIP, TANK), 400.0)
    assert amplitude(time, roll, 350) == pytest.approx(math.radians(3.0), rel=0.03)
    late = roll[time > 300]
    rising = np.flatnonzero((late[:-1] < 0) & (late[1:] >= 0))
    assert np.diff(rising).mean() * 0.02 == pytest.approx(12.5, rel=0.005)
    assert np.abs(pressure).max() <= 50e3


@pytest.mark.slow
def test_a_ship_of_other_stiffness_and_damping_is_brought_to_the_wanted_amplitude():
    other = replace(SHIP, damping_nms_rad=3 * SHIP.damping_nms_rad, stiffness_nm_rad=4.5e8)
    time, roll, *_ = record(PLAN.controller(), RollModel(other, TANK), 1200.0)
    assert abs(amplitude(time[time < 250], roll[time < 250], 200) / math.radians(3) - 1) > 0.05
    assert amplitude(time, roll, 1100) == pytest.approx(math.radians(3.0), rel=0.03)


def test_amplitude_is_ramped_in_and_out():
    controller = PLAN.controller()
    y = np.zeros(4)
    size = 1.05 * PLAN.amplitude_rad / PLAN.gains[0]
    commands = [controller.step(y)[0] for _ in range(3000)]
    commands += [controller.step(y, np.zeros(1))[0] for _ in range(4000)]
    envelope = np.abs(commands)
    assert envelope[:500].max() < 0.2 * size
    assert envelope[2500:3000].max() > 0.8 * size
    assert envelope[5500:5900].max() < 0.2 * size
    assert (envelope[6100:] == 0).all()
    assert np.abs(np.diff(commands)).max() < 0.02 * size  # no jumps


@pytest.mark.parametrize(
    ("roll", "level", "limit"),
    [(math.radians(6.1), 0.0, "roll_rad"), (0.0, -4.1, "level_m")],
)
def test_a_limit_ends_it_at_once_and_until_reset(roll, level, limit):
    controller = PLAN.controller()
    for _ in range(3281):  # to a crest
        pressure = controller.step(np.zeros(4))[0]
    assert abs(pressure) > 0.5 * PLAN.amplitude_rad / PLAN.gains[0]
    assert not controller.ended
    assert controller.passed_limit == ""
    assert controller.step(np.array([roll, 0.0, level, 0.0]))[0] == 0
    assert controller.ended
    assert controller.passed_limit == limit
    assert all(controller.step(np.zeros(4))[0] == 0 for _ in range(4000))
    controller.reset()
    assert not controller.ended
    assert controller.passed_limit == ""
    assert max(abs(controller.step(np.zeros(4))[0]) for _ in range(1000)) > 0


def test_a_ship_that_passes_the_limit_is_pushed_no_further():
    # a third of the damping: what the model says takes her beyond
    weak = replace(SHIP, damping_nms_rad=SHIP.damping_nms_rad / 3)
    plan = replace(PLAN, ramp_s=120.0, roll_limit_rad=math.radians(3.3))
    controller = plan.controller()
    time, roll, *_, pressure = record(controller, RollModel(weak, TANK), 400.0)
    assert controller.passed_limit == "roll_rad"
    passed = time[np.abs(roll) > plan.roll_limit_rad][0]
    assert (pressure[time > passed] == 0).all()
    # nothing stops the swing that passes it, but none after it is as great
    greatest = np.abs(roll).argmax()
    assert time[greatest] < passed + plan.period_s / 4
    assert np.abs(roll[time > passed + plan.period_s]).max() < plan.roll_limit_rad


def test_a_sea_that_passes_the_limit_while_another_law_is_in_charge_does_not_end_it():
    controller = PLAN.controller()
    for k in range(2000):
        controller.step(np.array([0.12 * math.sin(0.01 * k), 0.0, 0.0, 0.0]))
        controller.applied(np.zeros(1))
    assert not controller.ended
    assert controller.passed_limit == ""


def test_after_its_time_it_ramps_out_and_ends_until_reset():
    plan = replace(PLAN, duration_s=100.0)
    controller = plan.controller()
    time, *_, pressure = record(controller, RollModel(SHIP, TANK), 180.0)
    size = np.abs(pressure[(time > 80) & (time < 100)]).max()
    assert size > 0.8 * PLAN.amplitude_rad / PLAN.gains[0]
    ramp = (time > 125) & (time < 135)  # about the half of the ramp out
    assert 0.3 * size < np.abs(pressure[ramp]).max() < 0.65 * size
    assert np.abs(np.diff(pressure)).max() < 0.02 * size  # no jumps
    assert (pressure[time > 160.1] == 0).all()
    assert controller.ended
    for _ in range(10):  # what a sea does then is no business of its
        controller.step(np.array([0.3, 0.0, 0.0, 0.0]))
        controller.applied(np.zeros(1))
    assert controller.passed_limit == ""
    controller.reset()
    assert not controller.ended


def test_time_counts_from_taking_charge():
    plan = replace(PLAN, duration_s=100.0)
    controller = plan.controller()
    for _ in range(10_000):  # 200 s
        controller.step(np.zeros(4))
        controller.applied(np.zeros(1))
    pressures = []
    for _ in range(4500):
        pressures.append(controller.step(np.zeros(4))[0])
        controller.applied(np.array(pressures[-1:]))
    assert not controller.ended
    assert np.abs(pressures[4000:]).max() > 0.8 * PLAN.amplitude_rad / PLAN.gains[0]


class SharingLimiter(CommandLimiter):
    """Allows half of the pressure between two times, as a degraded mode does."""

    between_s = (400.0, 1200.0)
    time_s = 0.0

    def limit(self, desired_pa, level_m, level_rate_m_s, share=1.0):
        self.time_s += 0.02
        if self.between_s[0] < self.time_s < self.between_s[1]:
            share = 0.5
        return super().limit(desired_pa, level_m, level_rate_m_s, share)


@pytest.mark.evidence
def test_correction_does_not_wind_up_while_pressure_is_cut():
    limits = PumpLimits(pressure_pa=14e3)
    controller = PLAN.controller()
    model = RollModel(SHIP, TANK)
    limiter = SharingLimiter(limits, TANK, 0.02)
    time, roll, *_, pressure = record(controller, model, 1500.0, limiter=limiter)
    cut = (time > 600) & (time < 1200)
    assert np.abs(pressure[cut]).max() == pytest.approx(7e3)
    assert np.abs(roll[cut]).max() < math.radians(2.8)
    # a little more than wanted, as after the ramp in: the ship takes her time to follow
    assert np.abs(roll[time > 1200]).max() < math.radians(3.3)
    assert amplitude(time, roll, 1450) == pytest.approx(math.radians(3.0), rel=0.03)


@pytest.mark.slow
def test_correction_does_not_wind_up_at_the_plan_s_own_pressure_but_may_fall_there():
    plan = replace(PLAN, pressure_pa=14e3)
    heavy = replace(SHIP, damping_nms_rad=5 * SHIP.damping_nms_rad)
    controller = plan.controller()
    time, *motion, pressure = record(controller, RollModel(heavy, TANK), 1000.0)
    assert np.abs(pressure).max() == pytest.approx(14e3, rel=1e-3)
    assert amplitude(time, motion[0], 900) < math.radians(2.8)
    # the same controller goes on with the ship that it was made for
    start = np.array([column[-1] for column in motion])
    time, roll, *_ = record(controller, RollModel(SHIP, TANK), 800.0, initial=start)
    assert amplitude(time[time < 300], roll[time < 300], 250) < math.radians(3.5)
    assert amplitude(time, roll, 700) == pytest.approx(math.radians(3.0), rel=0.03)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period_s": 0.0}, "period_s"),
        ({"amplitude_rad": math.radians(7)}, "below roll_limit_rad"),
        ({"pressure_pa": 1e3}, "pressure_pa is"),
        ({"level_limit_m": 0.1}, "level_limit_m is"),
        ({"duration_s": 59.0}, "duration_s 59.0 must be ramp_s 60.0 or more"),
        ({"duration_s": math.nan}, "duration_s must be positive"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_reason(change, message):
    with pytest.raises(ValueError, match=message):
        replace(PLAN, **change)
