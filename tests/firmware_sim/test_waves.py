import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from firmware_sim.plant import Plant
from firmware_sim.waves import PassingWaves
from utank_hil.configuration import Vessel, load_config
from utank_hil.sea import EffectiveSlope, Sea, jonswap
from utank_hil.sea.sea import PassingSea, encounter_frequency

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
SLOPE = EffectiveSlope(0.5)
SEA = Sea.irregular(jonswap(3.0, 9.0), 2, components=64, heading_rad=1.2, spreading=10.0)
STIFFNESS = 4.8e8


def moment(omega, heading):
    return SLOPE.moment(omega, heading, STIFFNESS)


def moments(waves, seconds: int) -> np.ndarray:
    """As the plant interpolates from them, at every second."""
    plant = Plant(VESSEL.ship, VESSEL.tank, None, waves)
    found = []
    for now_s in range(seconds + 1):
        plant.advance(now_s * 1_000_000_000)
        found.append(plant.wave_moment_nm)
    return np.array(found)


@pytest.mark.evidence
def test_ship_that_keeps_course_and_speed_meets_the_sum_of_harmonics() -> None:
    waves = PassingWaves(PassingSea.of(SEA), lambda _: 0.0, lambda _: 5.0, moment)
    sailing = Sea(SEA.amplitude_m, SEA.omega_rad_s, SEA.heading_rad, SEA.phase_rad, 5.0)
    expected = sailing.roll_moment(STIFFNESS, SLOPE).at(np.arange(601.0))
    found = moments(waves, 600)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_ship_that_turns_and_speeds_up_meets_what_its_track_through_the_waves_says() -> None:
    """Against the elevation's phase at the place that the ship has reached."""

    def turn_rad(time_s: float) -> float:
        return 1.5 * math.sin(time_s / 80.0)

    def speed_m_s(time_s: float) -> float:
        return 4.0 + time_s / 100.0

    waves = PassingWaves(PassingSea.of(SEA), turn_rad, speed_m_s, moment)
    found = moments(waves, 300)
    step_s = 0.01
    time = np.arange(0, 300 + step_s / 2, step_s)
    # place of the ship in axes that lie in its first course, to port positive clockwise turns
    turn = np.array([turn_rad(t) for t in time])
    speed = np.array([speed_m_s(t) for t in time])
    along = cumulative_trapezoid(speed * np.cos(turn), dx=step_s, initial=0)
    across = cumulative_trapezoid(speed * np.sin(turn), dx=step_s, initial=0)
    number = SEA.omega_rad_s**2 / 9.80665
    expected = []
    for index in range(0, len(time), 100):
        heading = SEA.heading_rad - turn[index]
        place = along[index] * np.cos(SEA.heading_rad) + across[index] * np.sin(SEA.heading_rad)
        angle = SEA.omega_rad_s * time[index] - number * place + SEA.phase_rad
        complex_moment = SEA.amplitude_m * moment(SEA.omega_rad_s, heading)
        expected.append((complex_moment * np.exp(1j * angle)).real.sum())
    scale = np.std(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-3 * scale)
    assert np.std(found - np.array(expected)) < 1e-3 * scale


def test_sea_that_grows_from_almost_nothing_does_not_jump() -> None:
    calm, storm = jonswap(0.01, 5.0), jonswap(5.0, 11.0)
    sea = PassingSea.drawn([0.0, 60.0], [calm, storm], 1, heading_rad=[1.5, 1.5], components=64)
    plant = Plant(
        VESSEL.ship, VESSEL.tank, None, PassingWaves(sea, lambda _: 0.0, lambda _: 0.0, moment)
    )
    found = []
    for tick in range(9000):
        plant.advance(tick * 10_000_000)
        found.append(plant.wave_moment_nm)
    # no step is larger than the waves' own slope makes it: 3 rad/s at four deviations
    assert np.abs(np.diff(found)).max() < 0.01 * 3 * 4 * np.std(found[6000:])
    assert np.abs(found[:100]).max() < 0.1 * np.abs(found[6000:]).max()


@pytest.mark.parametrize("heading", [0.3, 1.0])
def test_encounter_of_a_passing_sea_is_that_of_the_ship(heading: float) -> None:
    regular = Sea.regular(1.0, 0.8, heading_rad=heading)
    waves = PassingWaves(PassingSea.of(regular), lambda _: 0.0, lambda _: 6.0, moment)
    found = moments(waves, 200)
    encounter = float(encounter_frequency(0.8, heading, 6.0))
    expected = moment(np.array([0.8]), np.array([heading])) * np.exp(
        1j * encounter * np.arange(201)
    )
    np.testing.assert_allclose(found, expected.real, rtol=0, atol=1e-8 * np.abs(expected).max())
