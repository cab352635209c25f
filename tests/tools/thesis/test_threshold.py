import math
from dataclasses import replace

import numpy as np
import pytest

from tools.thesis.capsize import capsize_threshold, equilibria, safe_basin, without_tank
from tools.thesis.reference import simulate_reference
from tools.thesis.simulate import WaveMoment, simulate
from utank_hil.dynamics import RollModel, RollShip, Tank

# Table 4.1
PATTI = RollShip(1.468e6, 2.366e6 * 0.2138, 3.206e3, 9.882e4, restoring_odd_nm=(-2.366e6 * 0.6713,))
TANK = Tank(5.0, 2.0, 2.0, 0.19, damping_ratio=0.1)
MODEL = RollModel(PATTI, TANK)
VANISHING = math.sqrt(0.2138 / 0.6713)


def test_without_a_tank_the_saddles_lie_at_the_root_of_c1_over_c3():
    found = equilibria(without_tank(MODEL))
    assert [e.stable for e in found] == [False, True, False]
    np.testing.assert_allclose([e.roll_rad for e in found], [-VANISHING, 0, VANISHING], atol=1e-7)


def test_the_tank_s_free_surface_narrows_the_range_of_stability():
    port, centre, starboard = equilibria(MODEL)
    assert centre.stable
    assert not port.stable
    assert port.roll_rad == pytest.approx(-starboard.roll_rad)
    assert 0.3 < starboard.roll_rad < VANISHING
    assert starboard.level_m == pytest.approx(2.5 * math.tan(starboard.roll_rad))
    assert np.abs(MODEL.derivative([starboard.roll_rad, 0, starboard.level_m, 0])).max() < 1e-9


def test_wind_heels_the_equilibrium_and_shrinks_the_lee_side():
    model = without_tank(RollModel(replace(PATTI, wind_moment_nm=3e4), TANK))
    port, centre, starboard = equilibria(model)
    assert centre.roll_rad > 0.05
    assert starboard.roll_rad < VANISHING < -port.roll_rad


@pytest.mark.evidence
def test_the_calm_basin_is_bounded_by_the_heteroclinic_cycle():
    """Undamped: survives if and only if its energy lies below the saddle's."""
    ship = replace(PATTI, damping_nms_rad=0.0, quadratic_damping_nms2_rad2=0.0)
    model = without_tank(RollModel(ship, TANK))
    roll = np.linspace(-0.5, 0.5, 21)
    rate = np.linspace(-0.35, 0.35, 21)
    safe = safe_basin(model, roll, rate, 200.0)

    def potential(phi):
        return 2.366e6 * (0.2138 / 2 * phi**2 - 0.6713 / 4 * phi**4)

    energy = 0.5 * 1.468e6 * rate[:, None] ** 2 + potential(roll)
    margin = energy / potential(VANISHING) - 1
    clear = np.abs(margin) > 1e-3
    np.testing.assert_array_equal(safe[clear], (margin < 0)[clear])
    assert 0.2 < safe.mean() < 0.9


@pytest.mark.evidence
def test_threshold_separates_survival_from_capsize():
    bare = without_tank(MODEL)
    found = capsize_threshold(bare, 0.6, 6e4, duration_s=200.0, cells=300)
    assert 0 < found.capsizing_nm - found.safe_nm <= 1e-3 * found.capsizing_nm
    for amplitude, capsizes in ((found.safe_nm, False), (found.capsizing_nm, True)):
        run = simulate(bare, 200.0, wave=WaveMoment([amplitude], [0.6], [0.0]))
        assert math.isfinite(run.capsized_s) == capsizes


# first windows of amplitudes in which the boat without a tank capsizes, far below the amplitudes
# from which she always does
WINDOWS = [(90, 4.06e4, 4.11e4), (150, 4.38e4, 4.41e4)]


@pytest.mark.evidence
@pytest.mark.parametrize(("phase_deg", "low_nm", "high_nm"), WINDOWS)
def test_threshold_is_the_first_window_and_not_one_above_it(phase_deg, low_nm, high_nm):
    phase = math.radians(phase_deg)
    found = capsize_threshold(without_tank(MODEL), 0.6, 4.5e4, phase_rad=phase, cells=450)
    assert low_nm < found.capsizing_nm < high_nm


@pytest.mark.evidence("90-40500.0-False", "150-43900.0-False")
@pytest.mark.parametrize(
    ("phase_deg", "amplitude_nm", "capsizes"),
    [(90, 4.05e4, False), (90, 4.13e4, True), (150, 4.39e4, False), (150, 4.45e4, True)],
)
def test_first_windows_are_the_reference_integrator_s(phase_deg, amplitude_nm, capsizes):
    phase = math.radians(phase_deg)
    run = simulate_reference(
        without_tank(MODEL),
        300.0,
        (0.0, 0.0, 0.0, 0.0),
        wave_moment_nm=lambda t: amplitude_nm * math.cos(0.6 * t + phase),
    )
    assert math.isfinite(run.capsized_s) == capsizes


@pytest.mark.evidence
def test_printed_threshold_without_a_tank_is_the_least_at_starts_of_about_140_degrees_only():
    """At 142 degrees she survives it; at 135 she does not, at 150 not even less (above)."""
    bare, printed = without_tank(MODEL), 5.086e4
    at = [
        capsize_threshold(bare, 0.6, 6e4, phase_rad=math.radians(phase), cells=600)
        for phase in (135, 142)
    ]
    assert at[0].capsizing_nm < printed < at[1].safe_nm


@pytest.mark.evidence
def test_printed_threshold_with_the_tank_lies_within_the_range_over_the_phase():
    model = RollModel(PATTI, replace(TANK, lz_m=0.0, damping_ratio=0.1))
    sine, cosine = (
        capsize_threshold(model, 0.6, 2e5, phase_rad=phase, cells=500)
        for phase in (math.pi / 2, 0.0)
    )
    assert sine.capsizing_nm < 8.646e4 < cosine.safe_nm


@pytest.mark.evidence
def test_the_tank_raises_the_threshold_by_half():
    """Lz -1 m, damping ratio 0.3: one of the tanks that the source may have meant."""
    bare = capsize_threshold(without_tank(MODEL), 0.6, 2e5, cells=500).capsizing_nm
    tank = RollModel(PATTI, replace(TANK, lz_m=-1.0, damping_ratio=0.3))
    assert capsize_threshold(tank, 0.6, 2e5, cells=500).capsizing_nm > 1.5 * bare


def test_nothing_capsizes_below_the_highest_amplitude_tried():
    found = capsize_threshold(MODEL, 0.6, 1e3, duration_s=60.0, cells=50)
    assert found == (1e3, math.inf)
