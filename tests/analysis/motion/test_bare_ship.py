from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from utank_hil.analysis.motion.bare_ship import roll_without_tank
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap

SHIP = RollShip(inertia_kg_m2=1.9275e9, stiffness_nm_rad=4.81875e8, damping_nms_rad=4.81875e7)


def integrated(
    ship: RollShip,
    moment: Harmonics,
    time_s: np.ndarray,
    start_s: float = 0.0,
    start: Sequence[float] = (0.0, 0.0),
) -> np.ndarray:
    """Angle and rate by an adaptive Runge-Kutta method, wave by wave from its cosine."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        k = float(moment.amplitude @ np.cos(moment.frequency_rad_s * t + moment.phase_rad))
        k += ship.wind_moment_nm + ship.offset_moment_nm
        acceleration = k - ship.damping_nms_rad * x[1] - ship.stiffness_nm_rad * x[0]
        return [x[1], acceleration / ship.inertia_kg_m2]

    solution = solve_ivp(
        rates,
        (start_s, time_s[-1]),
        start,
        t_eval=time_s,
        rtol=1e-10,
        atol=1e-12,
        method="DOP853",
    )
    return np.asarray(solution.y)


@pytest.mark.slow
@pytest.mark.parametrize(
    "moment",
    [
        Harmonics(np.array([2e7]), np.array([0.5]), np.array([0.7])),  # at resonance
        Harmonics(np.array([2e7, -3e7]), np.array([0.3, 1.4]), np.array([2.0, -0.3])),
        Harmonics(np.array([1e7]), np.array([0.0]), np.array([0.0])),  # a constant heel
        Sea.irregular(jonswap(4.7, 10.0), 5, components=64).roll_moment(
            SHIP.stiffness_nm_rad, EffectiveSlope(0.5)
        ),
    ],
)
def test_closed_form_equals_integration_of_the_equation_of_motion(moment: Harmonics) -> None:
    time_s = 0.05 * np.arange(4001)
    roll = roll_without_tank(SHIP, moment, 0.05, len(time_s))
    expected = integrated(SHIP, moment, time_s)[0]
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(roll, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert abs(roll[0]) < 1e-15


def test_step_only_samples_the_answer() -> None:
    moment = Harmonics(np.array([2e7]), np.array([0.55]), np.array([0.1]))
    fine = roll_without_tank(SHIP, moment, 0.1, 1001)
    coarse = roll_without_tank(SHIP, moment, 1.0, 101)
    np.testing.assert_allclose(fine[::10], coarse, rtol=0, atol=1e-14)


@pytest.mark.parametrize("heel", [{}, {"wind_moment_nm": 3e7, "offset_moment_nm": -1e7}])
@pytest.mark.parametrize("change_s", [0.01, 60.0, 60.02, 99.99])
def test_ship_that_is_loaded_differently_rolls_on_from_where_she_is(
    change_s: float, heel: dict[str, float]
) -> None:
    later = replace(SHIP, inertia_kg_m2=1.73475e9, stiffness_nm_rad=6.74625e8, **heel)
    moment = Harmonics(np.array([2e7, -3e7]), np.array([0.5, 0.62]), np.array([2.0, -0.3]))
    step_s, count = 0.05, 2001
    time_s = step_s * np.arange(count)
    before, after = time_s[time_s < change_s], time_s[time_s >= change_s]
    # up to the change with one ship, and from her angle and rate then with the other
    first = integrated(SHIP, moment, np.append(before, change_s))
    second = integrated(later, moment, after, change_s, first[:, -1])
    expected = np.concatenate([first[0, :-1], second[0]])
    roll = roll_without_tank(SHIP, moment, step_s, count, later_ship=later, later_from_s=change_s)
    atol = 1e-8 * np.abs(expected).max()
    np.testing.assert_allclose(roll, expected, rtol=0, atol=atol)
    unchanged = roll_without_tank(SHIP, moment, step_s, count)
    np.testing.assert_allclose(roll[: len(before)], unchanged[: len(before)], rtol=0, atol=atol)
    assert change_s > 90 or np.abs(roll - unchanged).max() > 0.1 * np.abs(roll).max()


def test_change_after_the_end_changes_nothing_and_one_at_the_start_everything() -> None:
    moment = Harmonics(np.array([2e7]), np.array([0.55]), np.array([0.1]))
    stiffer = replace(SHIP, stiffness_nm_rad=6.7e8)
    roll = roll_without_tank(SHIP, moment, 0.1, 100, later_ship=stiffer, later_from_s=500.0)
    assert np.array_equal(roll, roll_without_tank(SHIP, moment, 0.1, 100))
    at_once = roll_without_tank(SHIP, moment, 0.1, 100, later_ship=stiffer)
    np.testing.assert_allclose(at_once, roll_without_tank(stiffer, moment, 0.1, 100), atol=1e-15)


def test_wind_heels_the_ship_to_where_her_stiffness_holds_it() -> None:
    calm = Harmonics(np.zeros(1), np.ones(1), np.zeros(1))
    roll = roll_without_tank(replace(SHIP, wind_moment_nm=2e7), calm, 1.0, 3000)
    assert roll[0] == 0
    assert roll.max() > 1.8 * 2e7 / 4.81875e8  # a gust overshoots
    assert roll[-1] == pytest.approx(2e7 / 4.81875e8, rel=1e-9)


def test_overdamped_ship_is_refused() -> None:
    heavy = RollShip(inertia_kg_m2=1e9, stiffness_nm_rad=2.5e8, damping_nms_rad=1.01e9)
    moment = Harmonics(np.array([2e7]), np.array([0.55]), np.array([0.1]))
    with pytest.raises(ValueError, match="overdamped"):
        roll_without_tank(heavy, moment, 0.1, 10)
