"""Hydrodynamic data of meshes against published coefficients and closed forms."""

import math
from functools import cache
from pathlib import Path

import capytaine as cpt
import numpy as np
import pytest
from beam_sea import motions, roll_resonance
from bodies import Side, box, hemisphere, wigley
from others import others_file

from firmware_sim.hull import compute
from firmware_sim.hull.compute import Loading, compute_hull, energy_errors, write_hull
from firmware_sim.hull.mesh import MeshError, form_mesh
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.dynamics.hull.hull_data import (
    HullData,
    excitation_at,
    free_roll,
    radiation_at,
    with_roll_period,
)
from utank_hil.dynamics.hull.lateral import LateralHull
from utank_hil.dynamics.roll_damping import HullForm

RHO, G = 1025.0, 9.80665


OMEGA = np.array([0.08, 0.5, 0.7, 0.9])


def computed(side: Side, omega: np.ndarray = OMEGA, **loading: float) -> HullData:
    said = compute_hull(cpt.Mesh(*side), Loading(**{"gm_m": 1.0, **loading}), "body", omega)
    assert said[2] == []
    return said[1]


@cache
def barge(length: float) -> HullData:
    return computed(box(length, 20.0, 10.0, panels=(14, 4, 4)), gm_m=0.8)


def test_hemisphere_radiates_as_hulme_computed_it() -> None:
    """Hulme, J. Fluid Mech. 121 (1982) 443, tables 1 and 2; per 2/3 pi rho a^3, and times w.

    Panels of constant strength err by their size: two meshes tell the limit.
    """
    a, at = 5.0, np.array([0.5, 1.0, 1.4])
    omega, unit = np.sqrt(at * G / a), 2 / 3 * math.pi * RHO * a**3
    coarse, fine = (
        computed(hemisphere(panels=(2 * n, n)), omega, gm_m=None, gravity_m=-1.0) for n in (8, 12)
    )
    sway = [(0.6439, 0.0987), (0.5740, 0.3535), (0.4038, 0.4060)]
    heave = [(0.5861, 0.3391), (0.4284, 0.2484), (0.3924, 0.1756)]
    for degree, table in ((1, sway), (2, heave)):
        for row, expected in enumerate(table):
            near, far = (
                [each[row, degree, degree] / unit for each in (of.added_mass, of.damping)]
                for of in (fine, coarse)
            )
            limit = np.array(near) + (np.array(near) - far) / (12 / 8 - 1)
            assert limit / [1, omega[row]] == pytest.approx(expected, rel=0.025)
            assert near / np.array([1, omega[row]]) == pytest.approx(expected, rel=0.06)


def test_barge_s_middle_has_the_added_mass_of_the_textbook_s_square() -> None:
    """Newman, Marine Hydrodynamics (1977), table 4.3: 4.754 rho a^2 for a square of side 2 a.

    In heave at infinite frequency the barge is half of it; the ends are in both barges.
    """
    long, short = (barge(length).infinite_added_mass[2, 2] for length in (160.0, 120.0))
    assert (long - short) / 40.0 == pytest.approx(4.754 / 2 * RHO * 10.0**2, rel=0.02)


def test_barge_floats_by_the_hydrostatics_of_a_box() -> None:
    hull = barge(120.0)
    assert hull.mass_kg == pytest.approx(RHO * 120 * 20 * 10, rel=1e-6)
    keel_to_metacentre = 5.0 + 20.0**2 / (12 * 10)
    assert hull.gravity_centre_m == pytest.approx([0, 0, keel_to_metacentre - 0.8 - 10], abs=1e-6)
    stiffness = hull.about_gravity_centre().hydrostatic
    assert stiffness[3, 3] == pytest.approx(hull.mass_kg * G * 0.8, rel=1e-6)
    assert stiffness[2, 2] == pytest.approx(RHO * G * 120 * 20, rel=1e-6)


@pytest.mark.parametrize("body", ["box", "wigley"])
def test_long_beam_wave_pushes_a_hull_as_its_slope(body: str) -> None:
    """Sway force i g k (M + A22), roll moment -i k (C44 + g (m z_G - A24)), motion -i and -i k."""
    hull = barge(120.0) if body == "box" else computed(wigley(panels=(16, 5)), gm_m=1.6)
    omega = hull.wave_frequency_rad_s[0]
    k, force = omega**2 / G, excitation_at(hull, omega, 90.0)
    added, _ = radiation_at(hull, omega)
    sway = 1j * G * k * (hull.mass_kg + added[1, 1])
    height = hull.gravity_centre_m[2]
    stiffness = hull.hydrostatic[3, 3] + G * (hull.mass_kg * height - added[1, 3])
    assert force[1] / sway == pytest.approx(1.0, abs=0.03)
    assert force[3] / (-1j * k * stiffness) == pytest.approx(1.0, abs=0.04)
    moved = motions(hull, omega, 90.0, 0.0)
    assert moved[1] == pytest.approx(-1j, abs=0.05)
    assert moved[3] / (-1j * k) == pytest.approx(1.0, abs=0.1)


def test_half_a_hull_with_a_lid_is_the_whole_one_computed_before() -> None:
    ours = computed(wigley(), np.array([0.2, 0.84, 1.16]), gm_m=None, gravity_m=0.0)
    whole = read_hull(Path("tests/dynamics/data/wigley.nc"), Given(gyration_m=(4.56, 15, 15)))
    lateral = [1, 3, 5]
    scale = np.max(np.einsum("naa->na", np.abs(whole.added_mass)), axis=0)
    scale = np.sqrt(np.outer(scale, scale))
    for omega in (0.84, 1.16):
        (added, damping), (expected, lost) = (radiation_at(of, omega) for of in (ours, whole))
        assert np.all(np.abs(added - expected) < 0.01 * scale)
        assert np.all(np.abs(damping - lost) < 0.01 * omega * scale)
        there = excitation_at(whole, omega, 60.0)[lateral]
        here = excitation_at(ours, omega, 60.0)[lateral]
        assert np.all(np.abs(here / there - 1) < 0.02)


def test_energy_adds_up_and_a_frequency_at_which_it_does_not_is_named(monkeypatch) -> None:
    hull = barge(120.0)
    assert energy_errors(hull).max() < 0.06
    # the first irregular frequency of a box: k = pi/B sqrt(1 + (B/L)^2), w^2 = g k coth(k T)
    k = math.pi * math.hypot(1 / 20, 1 / 40)
    irregular = math.sqrt(G * k / math.tanh(10 * k))
    monkeypatch.setattr(compute, "_lid", lambda side: None)
    side = cpt.Mesh(*box(40.0, 20.0, 10.0, panels=(14, 5, 5)))
    omega = np.array([0.3, 0.45, 0.6, 0.8, irregular - 0.01, irregular, irregular + 0.01])
    _, found, said = compute_hull(side, Loading(gm_m=0.8), "box", omega)
    assert said
    assert any(f"{irregular:.3g} rad/s" in text for text in said)
    assert list(found.frequency_rad_s[:4]) == [0.3, 0.45, 0.6, 0.8]
    assert len(found.frequency_rad_s) == 7 - len(said)


def test_a_barge_whose_roll_hardly_radiates_keeps_the_waves_it_rolls_in() -> None:
    side = cpt.Mesh(*box(60.0, 12.0, 3.5, panels=(20, 8, 5)))  # sides and bottom cancel in roll
    omega = np.array([0.3, 0.75, 1.11, 1.6])
    _, found, said = compute_hull(side, Loading(gm_m=1.5, roll_period_s=8.0), "barge", omega)
    assert not said
    assert found.frequency_rad_s == pytest.approx(omega)


@pytest.mark.parametrize("loading", [{"roll_period_s": 8.0}, {"gyration_m": 4.4}])
@pytest.mark.parametrize(
    ("first", "refused"), [([0.3, 0.6], True), ([0.3, 0.75], False), ([], True)]
)
def test_lost_frequencies_around_the_roll_are_refused(first, refused, loading, monkeypatch) -> None:
    """The roll is at 0.785 rad/s; of seven frequencies 0.75 to 0.9 are lost, or all below 1."""
    kept = np.array([*first, 1.0, 1.3, 1.6])
    omega = np.unique([0.3, 0.6, 0.75, 0.9, *kept])
    lost = np.setdiff1d(omega, kept)
    monkeypatch.setattr(
        compute, "energy_errors", lambda hull, _: np.isin(hull.frequency_rad_s, lost)[:, None]
    )
    side = cpt.Mesh(*box(60.0, 12.0, 3.5, panels=(14, 6, 4)))
    if not refused:
        assert len(compute_hull(side, Loading(gm_m=1.5, **loading), "barge", omega)[2]) == len(lost)
        return
    words = r"^frequency_rad_s has none near the free roll, 0\.7.*0\.9 rad/s.*finer panels"
    with pytest.raises(MeshError, match=words):
        compute_hull(side, Loading(gm_m=1.5, **loading), "barge", omega)


def test_file_holds_the_ship_with_the_period_that_was_asked_for(tmp_path: Path) -> None:
    side = cpt.Mesh(*wigley(panels=(16, 5)))
    data, hull, _ = compute_hull(side, Loading(gm_m=1.2, roll_period_s=7.5), "w", OMEGA)
    write_hull(tmp_path / "wigley.nc", data)
    read = read_hull(tmp_path / "wigley.nc")
    assert free_roll(read).period_s == pytest.approx(7.5, rel=1e-6)
    np.testing.assert_allclose(read.inertia_kg_m2, hull.inertia_kg_m2, rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(read.excitation, hull.excitation)
    assert read.notes == ("roll damping is that of waves alone: add the viscous part",)


@pytest.mark.parametrize(
    ("panels", "loading", "reason"),
    [
        ((6, 2), {}, "has too few panels: the largest has a radius of .* m: divide them"),
        ((16, 5), {"displacement_t": 1900}, "displaces 1.* t, and the ship has 1900 t: check"),
        ((16, 5), {"gm_m": None, "gravity_m": 4.0}, "centre of gravity must be below it"),
        (
            (16, 5),
            {"roll_period_s": 480},
            "480 s has a radius of gyration of 239 m on a beam of 12",
        ),
        ((16, 5), {"gyration_m": 1.5}, r"^has a radius of gyration of 1.5 m .*0\.3048 for feet"),
    ],
)
def test_what_does_not_belong_together_is_refused(panels, loading, reason: str) -> None:
    with pytest.raises(MeshError, match=reason):
        computed(wigley(panels=panels), None, **loading)


def test_period_that_added_mass_alone_exceeds_is_refused() -> None:
    with pytest.raises(ValueError, match=r"added mass alone rolls slower than 7\.2 s"):
        with_roll_period(computed(wigley(panels=(16, 5)), gm_m=0.2), 7.2)


FPSO = Given(density_kg_m3=1025.0, mass_kg=1025 * 97960.9, gravity_centre_m=(0.788631, 0.0, -1.0))


@pytest.mark.parametrize(
    ("file", "given", "size"),
    [
        ("wamit-fpso/fpso.1", FPSO, (200.0, 44.0, 12.0)),
        ("shipx-supply/input.re7", None, (82.8, 19.2, 6.0)),
    ],
)
def test_usual_hull_of_main_particulars_sways_as_that_of_the_ship_s_own_lines(
    file: str, given: Given | None, size: tuple[float, float, float]
) -> None:
    """WAMIT's and VERES' data of two ships against the form that `init --hull` would make."""
    lines = read_hull(others_file(f"hulls/{file}"), given)
    about_g, period_s = lines.about_gravity_centre(), free_roll(lines).period_s
    gm_m = about_g.hydrostatic[3, 3] / (lines.mass_kg * lines.gravity_m_s2)
    form = HullForm.usual(*size, lines.mass_kg / 1e3, gm_m)
    omega = 2 * math.pi / period_s * np.array([0.8, 0.9, 1.0, 1.1, 1.25])
    loading = Loading(gm_m, roll_period_s=period_s)
    usual = compute_hull(form_mesh(form), loading, "usual", omega)[1]
    theirs, ours = roll_resonance(lines, 0.05), roll_resonance(usual, 0.05)
    assert ours.effective_slope == pytest.approx(theirs.effective_slope, rel=0.03)
    assert ours.sway_share == pytest.approx(theirs.sway_share, rel=0.04)
    assert ours.sway_phase_rad == pytest.approx(theirs.sway_phase_rad, abs=math.radians(9))
    for at in omega[[0, -1]]:
        added, expected = (radiation_at(of, at)[0][1, 1] for of in (usual, lines))
        assert added == pytest.approx(expected, rel=0.1)
        force, there = (abs(excitation_at(of, at, 90.0)[1]) for of in (usual, lines))
        assert force == pytest.approx(there, rel=0.08)
    assert LateralHull(usual).effective_slope == pytest.approx(ours.effective_slope, rel=1e-3)
