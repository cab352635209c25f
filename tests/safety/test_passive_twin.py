"""The twin beside ships that were integrated without it."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.safety.passive_twin import (
    AMPLIFIED,
    DECAY_PERIODS,
    LASTS_PERIODS,
    MEMORY_PERIODS,
    PassiveTwin,
)

STEP_S = 0.05
FIRST = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
PATTI = load_config(Path("configs/ships/patti_b.yaml"), Vessel)
LEAST_RAD = math.radians(0.5)


def motion(ship, tank, moment_nm, pressure_pa, seconds):
    """Roll, rate, level and its rate at every step, by fourth-order Runge-Kutta; shape (n, 4)."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    inverse = np.linalg.inv(mass)
    quadratic = np.array([
        ship.quadratic_damping_nms2_rad2,
        tank.reservoir_area_m2 * tank.quadratic_loss_pa_per_m2_s2,
    ])  # fmt: skip

    def rates(t, x):
        q, v = x[:2], x[2:]
        effort = -damping @ v - stiffness @ q - quadratic * np.abs(v) * v
        effort[0] += moment_nm(t) - sum(
            k * q[0] ** (3 + 2 * n) for n, k in enumerate(ship.restoring_odd_nm)
        )
        effort[1] += tank.reservoir_area_m2 * pressure_pa(t)
        return np.concatenate([v, inverse @ effort])

    x, rows, h = np.zeros(4), [], STEP_S
    for k in range(round(seconds / h)):
        t = k * h
        rows.append(x[[0, 2, 1, 3]])
        k1 = rates(t, x)
        k2 = rates(t + h / 2, x + h / 2 * k1)
        k3 = rates(t + h / 2, x + h / 2 * k2)
        k4 = rates(t + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return h * np.arange(len(rows)), np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vessel", "moment_nm", "pressure_pa"),
    [(FIRST, 2e7, 30e3), (PATTI, 8e3, 2e3)],
    ids=["linear", "quadratic damping and softening"],
)
def test_twin_rolls_as_the_passive_ship_in_the_same_waves(vessel, moment_nm, pressure_pa):
    ship = vessel.ship
    tank = replace(vessel.tank, quadratic_loss=0.5)

    def waves(t):
        return moment_nm * (math.sin(0.55 * t) + 0.7 * math.sin(0.8 * t + 1))

    def pump(t):
        return pressure_pa * (math.sin(0.6 * t) + 0.5 * math.sin(0.3 * t))

    t, driven = motion(ship, tank, waves, pump, 120.0)
    _, passive = motion(ship, tank, waves, lambda _: 0.0, 120.0)
    twin = PassiveTwin(ship, tank, STEP_S, LEAST_RAD)
    rolls = []
    for time_s, (roll, rate, _, level_rate) in zip(t, driven, strict=True):
        twin.update(roll, rate, level_rate, pump(time_s))
        rolls.append(twin.roll_rad)
    scale = passive[:, 0].std()
    assert np.abs(driven[:, 0] - passive[:, 0]).max() > 0.5 * scale
    assert np.abs(np.array(rolls) - passive[:, 0]).max() < 0.03 * scale


def rolled(own, twin_too, seconds, excused=False, doubt=lambda _: False):
    """Judgements over time of a ship that the pump rolls `own` and the waves `twin_too`."""
    ship, tank = FIRST.ship, FIRST.tank
    twin = PassiveTwin(ship, tank, STEP_S, LEAST_RAD)
    # the pressure whose roll is `own` at 0.6 rad/s, by the model's own response
    mass, damping, stiffness = coupled_matrices(ship, tank)
    w = 0.6
    response = np.linalg.solve(
        stiffness - w**2 * mass + 1j * w * damping, [0.0, tank.reservoir_area_m2]
    )[0]
    judged = []
    for k in range(round(seconds / STEP_S)):
        t = k * STEP_S
        roll = twin_too * math.sin(w * t) + own * math.sin(w * t + np.angle(response))
        if excused:
            twin.excuse()
        pressure_pa = own / abs(response) * math.sin(w * t)
        twin.update(roll, 0.0, 0.0, pressure_pa, counts=not doubt(t))
        judged.append((t, twin.amplified))
    return judged


PERIOD_S = 2 * math.pi / FIRST.tank.natural_frequency_rad_s


def test_law_that_rolls_the_ship_is_found_and_not_before_a_period():
    judged = rolled(0.1, 0.02, 40 * PERIOD_S)
    first = next(t for t, amplified in judged if amplified)
    assert LASTS_PERIODS * PERIOD_S <= first <= 12 * PERIOD_S
    assert judged[-1][1]


def test_a_ratio_that_the_first_waves_may_give_counts_only_once_more_is_remembered():
    little, much = (
        next(t for t, amplified in rolled(own_rad, 0.1, 40 * PERIOD_S) if amplified)
        for own_rad in (0.13, 0.3)  # 1.45 and 2.9 times the twin's roll in the end
    )
    assert 12 * PERIOD_S < little < 16 * PERIOD_S
    assert much < 8 * PERIOD_S


def test_a_roll_that_is_in_doubt_now_and_then_hides_no_law_that_loses():
    judged = rolled(0.1, 0.02, 40 * PERIOD_S, doubt=lambda t: t % 10.0 < 5.0)
    first = next(t for t, amplified in judged if amplified)
    assert first <= 24 * PERIOD_S  # twice as long
    assert not any(amplified for t, amplified in judged if t % 10.0 < 5.0 and t < first)


def test_a_roll_in_doubt_is_neither_judged_nor_remembered():
    judged = rolled(0.1, 0.02, 40 * PERIOD_S, doubt=lambda t: t > 3 * PERIOD_S)
    assert not any(amplified for _, amplified in judged)


def test_little_roll_waves_alone_and_roll_on_purpose_are_not_judged():
    assert not any(amplified for _, amplified in rolled(0.005, 0.0, 20 * PERIOD_S))
    assert not any(amplified for _, amplified in rolled(0.0, 0.1, 20 * PERIOD_S))
    assert not any(amplified for _, amplified in rolled(0.1, 0.0, 20 * PERIOD_S, excused=True))


def test_loss_of_an_open_valve_slows_the_water_of_the_twin():
    made = []
    for open_loss in (0.0, 50e3):
        twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD, open_loss)
        rolls = []
        for k in range(4000):
            twin.update(0.0, 0.0, 0.0, 20e3 * math.sin(0.6 * k * STEP_S))
            rolls.append(twin.roll_rad)
        made.append(np.std(rolls[2000:]))
    assert made[1] < 0.9 * made[0]


def gz_table(points):
    """Patti-B with her softening curve as a table of righting levers."""
    step_rad, displacement_n = math.radians(10.0), 2.366e6
    angle_rad = step_rad * np.arange(points)
    gz_m = 0.2138 * angle_rad - 0.6713 * angle_rad**3
    return replace(
        PATTI.ship, restoring_odd_nm=(), displacement_n=displacement_n,
        gz_step_rad=step_rad, gz_m=tuple(gz_m.tolist()),
    )  # fmt: skip


@pytest.mark.parametrize("ship", [PATTI.ship, gz_table(5), gz_table(8)], ids=["odd", "5", "8"])
@pytest.mark.parametrize("pressure_pa", [3.3e3, -10e3, 20e3])
def test_twin_that_capsizes_by_a_pressure_that_is_not_hers_begins_anew(ship, pressure_pa):
    twin = PassiveTwin(ship, PATTI.tank, STEP_S, LEAST_RAD)
    period_s = 2 * math.pi / PATTI.tank.natural_frequency_rad_s
    capsized = 0
    for k in range(round(600.0 / STEP_S)):
        twin.update(0.05 * math.sin(0.5 * k * STEP_S), 0.0, 0.0, pressure_pa)
        capsized += twin._losing_s <= 0.051 - 8.0 * period_s
        assert abs(twin.roll_rad) < 1.1
        assert not twin.amplified
    assert capsized >= 1
    # and it judges again once the pressure is right
    for k in range(round(60 * period_s / STEP_S)):
        twin.update(0.05 * math.sin(0.5 * k * STEP_S), 0.0, 0.0, 0.0)
    assert twin.share == pytest.approx(1 / AMPLIFIED, rel=0.05)


def made_by_pump(t, phasor_rad):
    """Pressure whose steady roll at 0.6 rad/s is `phasor_rad`, and the roll that it makes."""
    ship, tank, w = FIRST.ship, FIRST.tank, 0.6
    mass, damping, stiffness = coupled_matrices(ship, tank)
    area = [0.0, tank.reservoir_area_m2]
    response = np.linalg.solve(stiffness - w**2 * mass + 1j * w * damping, area)[0]
    phasor = phasor_rad / response
    pressure_pa = np.abs(phasor) * np.sin(w * t + np.angle(phasor))
    inverse = np.linalg.inv(mass)
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    force = np.concatenate([np.zeros(2), inverse @ area])[:, None]
    _, roll_rad, _ = scipy.signal.lsim((system, force, np.eye(1, 4), 0.0), pressure_pa, t)
    return pressure_pa, roll_rad


def test_sound_law_is_kept_through_a_lull_and_given_up_if_it_goes_on():
    begins_s, ends_s = 30 * PERIOD_S, 41 * PERIOD_S
    t = np.arange(0.0, 60 * PERIOD_S, STEP_S)
    # the pump halves the roll of the waves; in the lull it doubles them
    waves_rad = np.where(t < begins_s, 0.1, 0.04) * np.sin(0.6 * t)
    pressure_pa, made_rad = made_by_pump(t, np.where(t < begins_s, -0.05, 0.04))
    twin, ratios, amplified = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD), [], []
    for own_rad, effort_pa in zip(waves_rad + made_rad, pressure_pa, strict=True):
        twin.update(own_rad, 0.0, 0.0, effort_pa)
        ratios.append(twin.ship_rms_rad / twin.rms_rad if twin.rms_rad else 0.0)
        amplified.append(twin.amplified)
    patient = t[np.argmax((t > begins_s) & (np.array(ratios) > AMPLIFIED))]
    assert patient < ends_s < t[np.argmax(amplified)] < begins_s + 17 * PERIOD_S


def test_a_law_that_halves_the_roll_is_kept_through_minutes_of_a_lull():
    """As GPC on the day of the storm: over the first limit, its record below the passive roll."""
    begins_s = 60 * PERIOD_S
    t = np.arange(0.0, 75 * PERIOD_S, STEP_S)
    lull = t > begins_s
    waves_rad = np.where(lull, 0.06, 0.08) * np.sin(0.6 * t)
    pressure_pa, made_rad = made_by_pump(t, np.where(lull, 0.03, -0.04))
    twin, ratios = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD), []
    for own_rad, effort_pa in zip(waves_rad + made_rad, pressure_pa, strict=True):
        twin.update(own_rad, 0.0, 0.0, effort_pa)
        ratios.append(twin.ship_rms_rad / twin.rms_rad if twin.rms_rad else 0.0)
        assert not twin.amplified
    assert ratios[-1] > 1.1 * AMPLIFIED


@pytest.mark.parametrize("room", [1.0, 1.1])
def test_room_is_a_factor_on_the_ratios_at_which_a_law_has_lost(room):
    t = np.arange(0.0, 60 * PERIOD_S, STEP_S)
    amplified = {}
    for more in (1.2, 1.3, 1.4):
        pressure_pa, made_rad = made_by_pump(t, np.full(len(t), 0.04 * (more - 1)))
        twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD, room=room)
        for own_rad, effort_pa in zip(0.04 * np.sin(0.6 * t) + made_rad, pressure_pa, strict=True):
            twin.update(own_rad, 0.0, 0.0, effort_pa)
        amplified[more] = twin.amplified
        assert twin.share == pytest.approx(more / (room * AMPLIFIED), rel=0.02)
    assert amplified == {1.2: False, 1.3: room < 1.04, 1.4: True}


def test_roll_that_was_made_on_purpose_is_forgotten_and_a_bad_law_after_it_is_found():
    ends_s, bad_s = 20 * PERIOD_S, 45 * PERIOD_S
    t = np.arange(0.0, 60 * PERIOD_S, STEP_S)
    waves_rad = 0.015 * np.sin(0.6 * t)
    pressure_pa, made_rad = made_by_pump(t, np.select([t < ends_s, t > bad_s], [0.1, 0.05]))
    twin, amplified = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD), []
    for time_s, own_rad, effort_pa in zip(t, waves_rad + made_rad, pressure_pa, strict=True):
        if time_s < ends_s:
            twin.excuse()
        twin.update(own_rad, 0.0, 0.0, effort_pa)
        amplified.append(twin.amplified)
    assert bad_s < t[np.argmax(amplified)] < bad_s + 6 * PERIOD_S


@pytest.mark.parametrize("after_periods", [-0.5, 0.0, 0.5, 1.0, 1.5, 2.0])
def test_sound_law_is_kept_through_a_lull_after_roll_that_was_made_on_purpose(after_periods):
    """Of all that it did nothing but the lull is remembered."""
    ends_s, begins_s = 20 * PERIOD_S, (20 + DECAY_PERIODS + after_periods) * PERIOD_S
    t = np.arange(0.0, 40 * PERIOD_S, STEP_S)
    lull = (t > begins_s) & (t < begins_s + 1.5 * PERIOD_S)
    # the pump halves the roll of the waves; in the lull what it does is all the roll
    waves_rad = np.where(lull, 0.01, 0.1) * np.sin(0.6 * t)
    pressure_pa, made_rad = made_by_pump(t, np.full(len(t), -0.05))
    twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD)
    for time_s, own_rad, effort_pa in zip(t, waves_rad + made_rad, pressure_pa, strict=True):
        if time_s < ends_s:
            twin.excuse()
        twin.update(own_rad, 0.0, 0.0, effort_pa)
        assert not twin.amplified
    assert twin.share < 0.6  # it is judged


def test_share_is_1_where_the_law_has_lost_and_unknown_where_nothing_is_judged():
    t = np.arange(0.0, 40 * PERIOD_S, STEP_S)
    pressure_pa, made_rad = made_by_pump(t, np.full(len(t), 0.04))
    twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD)
    assert math.isnan(twin.share)
    shares = []
    for own_rad, effort_pa in zip(0.1 * np.sin(0.6 * t) + made_rad, pressure_pa, strict=True):
        twin.update(own_rad, 0.0, 0.0, effort_pa)
        shares.append(math.nan if twin.amplified else twin.share)
    last = np.flatnonzero(np.isfinite(shares))[-1]  # before it is found, which takes T / 4
    assert t[last] < 39 * PERIOD_S
    assert shares[last] == pytest.approx(1.0, abs=0.03)
    twin.excuse()
    assert math.isnan(twin.share)


def test_mean_squares_are_those_of_some_roll_periods():
    twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, LEAST_RAD)
    for k in range(round(5 * MEMORY_PERIODS * PERIOD_S / STEP_S)):
        twin.update(0.1 + 0.05 * math.sin(0.6 * k * STEP_S), 0.0, 0.0, 0.0)
    assert twin.ship_rms_rad == pytest.approx(0.05 / math.sqrt(2), rel=0.05)
    assert twin.rms_rad == twin.ship_rms_rad


LOADED = replace(
    FIRST.ship,
    inertia_kg_m2=1.2 * FIRST.ship.inertia_kg_m2,
    stiffness_nm_rad=1.7 * FIRST.ship.stiffness_nm_rad,
)


@pytest.mark.evidence
def test_twin_of_a_loaded_ship_takes_over_without_a_bump_and_rolls_as_she_does():
    def waves(t):
        return 2e7 * (math.sin(0.55 * t) + 0.7 * math.sin(0.8 * t + 1))

    def pump(t):
        return 30e3 * (math.sin(0.6 * t) + 0.5 * math.sin(0.3 * t))

    tank = FIRST.tank
    t, driven = motion(LOADED, tank, waves, pump, 600.0)
    _, passive = motion(LOADED, tank, waves, lambda _: 0.0, 600.0)
    twin, stays = (PassiveTwin(FIRST.ship, tank, STEP_S, LEAST_RAD) for _ in range(2))
    rolls = []
    for time_s, (roll, rate, _, level_rate) in zip(t, driven, strict=True):
        if len(rolls) == len(t) // 2:
            before = twin.roll_rad, twin.rms_rad, twin.ship_rms_rad, twin.amplified
            twin.take(LOADED, tank)
            assert (twin.roll_rad, twin.rms_rad, twin.ship_rms_rad, twin.amplified) == before
        twin.update(roll, rate, level_rate, pump(time_s))
        stays.update(roll, rate, level_rate, pump(time_s))
        rolls.append((twin.roll_rad, stays.roll_rad))
    # a twin's roll steps no more at the take-over than the sea makes it do elsewhere
    steps = np.abs(np.diff(np.array(rolls)[:, 0]))
    assert steps[len(t) // 2 - 1] <= steps.max() * (1 + 1e-9)
    errors = np.abs(np.array(rolls) - passive[:, :1])[-len(t) // 4 :].max(axis=0)
    scale = passive[:, 0].std()
    assert errors[0] < 0.03 * scale
    assert errors[1] > 0.3 * scale
