"""Stimulation of roll on still water: amplitude, ramps, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from utank_hil.analysis.survival import controlled_run
from utank_hil.control.stimulate import Stimulation
from utank_hil.dynamics import RollModel, RollShip, Tank, WaveMoment, harmonic_response

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
CALM = WaveMoment([], [], [])
PLAN = Stimulation(
    SHIP,
    TANK,
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


def test_ship_rolls_with_the_wanted_amplitude_and_period():
    time, roll, *_, pressure = record(PLAN.controller(), RollModel(SHIP, TANK), 400.0)
    assert amplitude(time, roll, 350) == pytest.approx(math.radians(3.0), rel=0.03)
    late = roll[time > 300]
    rising = np.flatnonzero((late[:-1] < 0) & (late[1:] >= 0))
    assert np.diff(rising).mean() * 0.02 == pytest.approx(12.5, rel=0.005)
    assert np.abs(pressure).max() <= 50e3


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


@pytest.mark.parametrize(("roll", "level"), [(math.radians(6.1), 0.0), (0.0, -4.1)])
def test_a_limit_ends_it_until_reset(roll, level):
    controller = PLAN.controller()
    for _ in range(3000):
        controller.step(np.zeros(4))
    assert not controller.ended
    controller.step(np.array([roll, 0.0, level, 0.0]))
    assert controller.ended
    commands = [controller.step(np.zeros(4))[0] for _ in range(4000)]
    assert max(map(abs, commands[3050:])) == 0
    controller.reset()
    assert not controller.ended
    assert max(abs(controller.step(np.zeros(4))[0]) for _ in range(1000)) > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period_s": 0.0}, "period_s"),
        ({"amplitude_rad": math.radians(7)}, "below roll_limit_rad"),
        ({"pressure_pa": 1e3}, "pressure_pa is"),
        ({"level_limit_m": 0.1}, "level_limit_m is"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_reason(change, message):
    with pytest.raises(ValueError, match=message):
        replace(PLAN, **change)
