"""Hull data against motions that the same code printed, and code against code."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from beam_sea import motions, roll_resonance
from others import others_file

from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.dynamics.hull.hull_data import excitation_at, radiation_at

# centre of buoyancy and volume by WAMIT's own `.out`; the density is that of MSS
FPSO = Given(density_kg_m3=1025.0, mass_kg=1025 * 97960.9, gravity_centre_m=(0.788631, 0.0, -1.0))
SHIPX = np.array([-1.0, -1, 1, -1, -1, 1])


def hulls(name):
    return others_file(f"hulls/{name}")


def relative_rms(found, expected):
    axes = tuple(range(found.ndim - 1))
    return np.sqrt(np.sum(abs(found - expected) ** 2, axes) / np.sum(abs(expected) ** 2, axes))


def test_wamit_moves_the_ship_as_wamit_itself_did():
    hull = read_hull(hulls("wamit-fpso/fpso.1"), FPSO)
    rows = np.loadtxt(hulls("wamit-fpso/fpso.4"))
    rows = rows[(rows[:, 0] >= 8) & (rows[:, 0] <= 40)]
    grid = sorted({(period, heading) for period, heading in rows[:, :2]})
    printed = {(row[0], row[1], int(row[2])): row[5] + 1j * row[6] for row in rows}
    expected = np.array([[printed[(*at, i)] for i in range(1, 7)] for at in grid])
    found = np.array([motions(hull, 2 * np.pi / period, b, 0.0) for period, b in grid])
    assert np.all(relative_rms(found, expected) < [1e-3, 2e-4, 3e-4, 1.5e-3, 1e-3, 5e-4])
    assert hull.infinite_added_mass[1, 1] == pytest.approx(2.07e4 * 1025, rel=5e-3)
    assert hull.hydrostatic[3, 3] == pytest.approx(0.77917e6 * 1025 * 9.81, rel=1e-4)


MASS = """1025
0.788631 0 1
1
1 0 0 0 1 0
0 1 0 -1 0 0.788631
0 0 1 0 -0.788631 0
0 -1 0 265.69 0 0
1 0 -0.788631 0 2916 0
0 0.788631 0 0 0 2916"""


@pytest.mark.parametrize(
    ("place", "old", "new"),
    [
        ("-1 0.00 0.00 -2.00 0.00", "-1.00\n16.3", "1.00\n16.3"),
        ("-1 0.00 0.00 -2.00 0.00", "-1.00\n16.3 0.00 0.00\n0.00 54.0 0.00\n0.00 0.00 54.0", MASS),
        ("-1 0.00 0.00 0.00 0.00", "-1.00\n16.3 0.00 0.00\n0.00 54.0 0.00\n0.00 0.00 54.0",
         "0.00\n0 0 0\n0 0 0\n0 0 0"),
    ],
)  # fmt: skip
def test_the_centre_of_gravity_in_wamit_is_above_the_bodys_own_origin(tmp_path, place, old, new):
    for file in hulls("wamit-fpso").iterdir():
        shutil.copyfile(file, tmp_path / file.name)
    for name, before, after in (("pot", "-1 0.00 0.00 0.00 0.00", place), ("frc", old, new)):
        text = (tmp_path / f"fpso.{name}").read_text()
        assert before in text
        (tmp_path / f"fpso.{name}").write_text(text.replace(before, after))
    form_2 = "1025" in new
    (tmp_path / "fpso.cfg").write_text(f"IALTFRC={1 + form_2}\n")
    given = Given(density_kg_m3=1025.0) if form_2 else FPSO
    hull, known = read_hull(tmp_path / "fpso.1", given), read_hull(hulls("wamit-fpso/fpso.1"), FPSO)
    if form_2:
        np.testing.assert_allclose(hull.mass_kg, 1.0)
    np.testing.assert_allclose(hull.gravity_centre_m[2], known.gravity_centre_m[2])
    if place.count("2"):
        per_mass = [each.inertia_kg_m2[0, 0] / each.mass_kg for each in (hull, known)]
        assert per_mass[0] == pytest.approx(per_mass[1])
    else:  # radii of zero: the centre of the run is no ship's, but the weight's part has it
        c_44 = known.hydrostatic[3, 3] + known.mass_kg * known.gravity_m_s2
        assert hull.hydrostatic[3, 3] == pytest.approx(c_44)


def test_shipx_moves_the_ship_as_veres_itself_did():
    """With the tanks and the roll damping of the run, which are no part of the hull, put back."""
    hull = read_hull(hulls("shipx-supply/input.re7"))
    numbers = [
        [float(word) for word in line.split()]
        for line in hulls("shipx-supply/input.re7").read_text().splitlines()[18:]
    ]
    moved = [
        [float(word) for word in line.split()]
        for line in hulls("shipx-supply/input.re1").read_text().splitlines()[11:]
    ]
    stiff = {}
    found, expected = [], []
    for m in range(19):
        heading = numbers[m * (1 + 36 * 38)][0]
        for n in range(36):
            at = m * (1 + 36 * 38) + 1 + 38 * n
            omega = numbers[at][0]
            tank_a, tank_b = (np.array(numbers[at + 1 + 6 * k : at + 7 + 6 * k]) for k in (1, 3))
            linear, _, quadratic = numbers[at + 37]
            if omega < hull.frequency_rad_s[0]:
                continue
            added, damping = radiation_at(hull, omega)
            sign = np.outer(SHIPX, SHIPX)
            damping = damping + sign * tank_b
            damping[3, 3] += linear + quadratic
            stiff = -(omega**2) * (hull.mass_matrix + added + sign * tank_a) + 1j * omega * damping
            force = excitation_at(hull, omega, heading + 180)
            found.append(np.linalg.solve(stiff + hull.hydrostatic + 1e-9 * np.eye(6), force))
            row = m * (1 + 36 * 7) + 1 + 7 * n + 1
            expected.append(SHIPX * [complex(*each[1:]) for each in moved[row : row + 6]])
    assert np.all(relative_rms(np.array(found), np.array(expected)) < 3e-4)
    assert hull.gravity_centre_m == pytest.approx([0, 0, 1.3], abs=1e-5)
    gyration = np.sqrt(np.diag(hull.inertia_kg_m2) / hull.mass_kg)
    assert gyration == pytest.approx([6.72, 20.7, 20.7], rel=1e-3)
    assert any("tanks" in note for note in hull.notes)


@pytest.mark.parametrize(
    ("one", "other", "given"),
    [
        ("shipx-supply/supply.mat", "shipx-supply/input.re7", None),
        ("wamit-fpso/fpso.mat", "wamit-fpso/fpso.1", FPSO),
    ],
)
def test_a_structure_of_mss_is_the_ship_it_was_made_from(one, other, given):
    """In sway, roll and yaw: MSS makes up surge of ShipX, and loses x_G of WAMIT."""
    theirs = roll_resonance(read_hull(hulls(one)), 0.05)
    ours = roll_resonance(read_hull(hulls(other), given), 0.05)
    assert theirs.period_s == pytest.approx(ours.period_s, rel=1e-4)
    assert theirs.radiation_ratio == pytest.approx(ours.radiation_ratio, rel=1e-3)
    assert theirs.effective_slope == pytest.approx(ours.effective_slope, rel=1e-3)
    assert theirs.sway_phase_rad == pytest.approx(ours.sway_phase_rad, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "given", "ratio", "peak_s", "roll", "sway"),
    [
        ("wamit-fpso/fpso.1", FPSO, 0.03, 13.57, 7.4, 0.69),
        ("wamit-fpso/fpso.1", FPSO, 0.05, 13.64, 4.7, 0.73),
        ("wamit-fpso/fpso.1", FPSO, 0.10, 13.95, 2.5, 0.77),
        ("shipx-supply/input.re7", None, 0.03, 10.46, 8.5, 0.80),
        ("shipx-supply/input.re7", None, 0.05, 10.51, 5.5, 0.81),
        ("shipx-supply/input.re7", None, 0.10, 10.71, 3.0, 0.82),
    ],
)
def test_resonance_in_beam_sea_is_that_computed_elsewhere(name, given, ratio, peak_s, roll, sway):
    hull = read_hull(hulls(name), given).about_gravity_centre()
    found = roll_resonance(hull, ratio)
    stiffness, omega = hull.hydrostatic[3, 3], 2 * np.pi / peak_s
    damping = 2 * ratio * stiffness * found.period_s / (2 * np.pi)
    moved = motions(hull, omega, 90.0, damping)
    assert abs(moved[3]) * 9.81 / omega**2 == pytest.approx(roll, rel=0.04)
    assert abs(moved[1]) == pytest.approx(sway, abs=0.02)
    assert found.period_s == pytest.approx(peak_s, rel=0.035)  # the peak lies at longer waves
    total = found.radiation_ratio + found.viscous_ratio
    assert found.effective_slope / (2 * total) == pytest.approx(roll, rel=0.04)


CYLINDERS = {
    "wamit": ("wamit-cylinder/cyl.1", Given(density_kg_m3=1000.0)),
    "nemoh": ("nemoh3-cylinder/Nemoh.cal", None),
    "aqwa": ("aqwa-cylinder/cylinder.AH1", None),
    "capytaine": ("capytaine-cylinder/cylinder_hydrodynamics.nc", None),
}


@pytest.fixture(scope="module")
def cylinders():
    return {code: read_hull(hulls(name), given) for code, (name, given) in CYLINDERS.items()}


@pytest.mark.parametrize("omega", [2.1746891, 3.0285647, 4.0959091, 5.1632543])
@pytest.mark.parametrize("code", ["nemoh", "aqwa", "capytaine"])
def test_four_codes_agree_on_one_cylinder(cylinders, code, omega):
    """At frequencies of the coarsest, and where 50 m of water are as deep as 3 m."""
    if code == "capytaine" and omega < 4:
        return
    ours, theirs = cylinders["wamit"], cylinders[code]
    share = theirs.density_kg_m3 / ours.density_kg_m3
    (a, b), (a_, b_) = radiation_at(ours, omega), radiation_at(theirs, omega)
    own, other = excitation_at(ours, omega, 0.0), excitation_at(theirs, omega, 0.0)
    for i, j in [(0, 0), (2, 2), (4, 4), (0, 4)]:
        assert a_[i, j] == pytest.approx(share * a[i, j], rel=0.025)
        assert b_[i, j] == pytest.approx(share * b[i, j], rel=0.045)
    for i in (0, 2, 4):
        assert abs(other[i]) == pytest.approx(share * abs(own[i]), rel=0.014)
        assert np.degrees(np.angle(other[i] / own[i])) == pytest.approx(0, abs=0.5)


def test_what_each_file_lacks_is_said(cylinders):
    assert cylinders["aqwa"].inertia_kg_m2 is None  # a placeholder stands there
    assert cylinders["aqwa"].mass_kg == pytest.approx(247.77)
    assert cylinders["capytaine"].gravity_centre_m is None
    assert len(cylinders["capytaine"].frequency_rad_s) == 524  # one holds no numbers
    assert cylinders["wamit"].mass_kg is cylinders["wamit"].inertia_kg_m2 is None
    assert cylinders["nemoh"].mass_kg == pytest.approx(241.76, rel=1e-4)
    assert all(each.viscous_roll_nms_rad is None for each in cylinders.values())


def test_nemoh_keeps_moving_degree_and_force_apart():
    hull = read_hull(hulls("nemoh2-nonsymmetrical/Nemoh.cal"))
    # first zone: the ship moves in surge; the third pair of its row is the force in heave
    assert hull.added_mass[0, 2, 0] == pytest.approx(0.1261875e4)
    assert hull.damping[0, 2, 0] == pytest.approx(0.7055808e1)
    assert hull.hydrostatic is hull.mass_kg is None
    assert hull.inertia_kg_m2 is hull.gravity_centre_m is None
    assert np.all(np.linalg.eigvalsh(hull.damping + hull.damping.transpose(0, 2, 1))[:, -1] > 0)
    long = hull.excitation[0, 0]  # heave in phase with the crest, surge a quarter before it
    assert np.angle(long[2]) == pytest.approx(0, abs=0.02)
    assert np.angle(long[0]) == pytest.approx(np.pi / 2, abs=0.05)


def test_another_folder_layout_of_nemoh_3_is_the_same(tmp_path):
    shutil.copytree(hulls("nemoh2-nonsymmetrical"), tmp_path, dirs_exist_ok=True)
    (tmp_path / "Nemoh.cal").write_text((tmp_path / "Nemoh_v3.cal").read_text())
    old, new = (
        read_hull(hulls("nemoh2-nonsymmetrical/Nemoh.cal")),
        read_hull(tmp_path / "Nemoh.cal"),
    )
    np.testing.assert_array_equal(old.excitation, new.excitation)


@pytest.mark.parametrize(
    ("name", "file", "old", "new", "words"),
    [
        ("wamit-cylinder/cyl.1", "cyl.3", None, None, "excitation is missing: put the .3"),
        ("wamit-cylinder/cyl.1", "cyl.1", " -1.000000E+00     1     1 ", " nan  1  1 ",
         "line 2 .*finite"),
        ("wamit-cylinder/cyl.1", "cyl.1", " -1.000000E+00     1     1 ", " -1.0  0  1 ", "mode 0"),
        ("wamit-cylinder/cyl.1", "cyl.3", "     1  3.07", "     7  3.07", "cyl.3: mode 7"),
        ("wamit-cylinder/cyl.1", "cyl.hst", "     1     3 ", "     1     0 ", "cyl.hst: mode 0"),
        ("wamit-cylinder/cyl.1", "cyl.1", "\n -1.000000E+00     1     3 ",
         "\n -1.0 1 3 0.0\n -1.0 1 3 ",
         "has rows twice"),
        ("wamit-cylinder/cyl.1", "cyl.1", "\n  2.991979E-01     6     6 ", "\n .2 6 6 ", "is cut"),
        ("wamit-cylinder/cyl.1", "cyl.3", "2.991979E-01  0.000000E+00     6", "0.2 0 6", "is cut"),
        ("nemoh3-cylinder/Nemoh.cal", "results/ExcitationForce.tec", "beta", "b", "has no beta"),
        ("aqwa-cylinder/cylinder.AH1", "cylinder.AH1", "  1  3  50 ", "  1  3  inf ", "AH1"),
        ("nemoh3-cylinder/Nemoh.cal", "Nemoh.cal", "\n1\t\t\t\t! Number of", "\ninf ! Number of",
         "Nemoh.cal"),
        ("wamit-cylinder/cyl.1", "cyl.cfg", "IRR =1", "IPEROUT=3", "is a wave number"),
        ("wamit-cylinder/cyl.1", "cyl.pot", " 0 0.0 0.0 0.0 ", " 0 0.0 0.0 90.0 ", "is turned"),
        ("aqwa-cylinder/cylinder.AH1", "cylinder.AH1", "\nCOG\n", "\nHYDSTIFFNESS\n", "twice"),
        ("aqwa-cylinder/cylinder.AH1", "cylinder.AH1", "  1  3  50 ", "  2  3  50 ", "2 bodies"),
        ("aqwa-cylinder/cylinder.AH1", "cylinder.AH1", "\nCOG\n", "\nCOB2\n", "block COG is miss"),
        ("shipx-supply/input.re7", "input.re8", "5.385920", "0.000000", "of another run"),
        ("shipx-supply/input.re7", "input.re8", None, None, "put the .re8 beside"),
        ("nemoh3-cylinder/Nemoh.cal", "Nemoh.cal", "0. 1. 0. 0. 0. 0.0", "0. 1. 0. 1. 0. 0.0",
         "different points|and their forces"),
        ("nemoh3-cylinder/Nemoh.cal", "results/ExcitationForce.tec", "w (rad/s)", "f (Hz)",
         "not Hz"),
        ("nemoh3-cylinder/Nemoh.cal", "results/ExcitationForce.tec", None, None, "is missing: one"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_file_is_refused_in_words(tmp_path, name, file, old, new, words):
    folder = tmp_path / "hull"
    shutil.copytree(hulls(name).parent, folder)
    folder.chmod(0o755)
    for each in [*folder.rglob("*"), folder]:
        each.chmod(0o755)
    path = folder / file
    if old is None:
        path.unlink()
    else:
        text = path.read_text(encoding="latin-1")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="latin-1")
    with pytest.raises(ValueError, match=words):
        read_hull(
            folder / Path(name).name, Given(density_kg_m3=1000.0) if "cyl.1" in name else None
        )


def test_what_is_wrong_names_the_file_where_its_folder_is_the_present_one(tmp_path, monkeypatch):
    text = hulls("aqwa-cylinder/cylinder.AH1").read_text(encoding="latin-1")
    rows = text.split("MASS\n", 1)[1].splitlines()
    (tmp_path / "a.ah1").write_text(text.replace(rows[1], rows[1].rsplit(maxsplit=1)[0], 1))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"^a\.ah1: setting an array"):
        read_hull(Path("a.ah1"))


def test_wamit_needs_a_density():
    with pytest.raises(ValueError, match="density_kg_m3 is missing"):
        read_hull(hulls("wamit-fpso/fpso.1"))


def test_a_figure_that_the_file_has_otherwise_is_refused():
    with pytest.raises(ValueError, match=r"remove mass_kg: it is [\d.e+]+ in the file"):
        read_hull(hulls("shipx-supply/input.re7"), Given(mass_kg=7e6))


def test_what_the_file_lacks_can_be_given():
    given = Given(gravity_centre_m=(0.0, 0.0, -0.2), gyration_m=(0.2, 0.2, 0.25))
    hull = read_hull(hulls("capytaine-cylinder/cylinder_hydrodynamics.nc"), given)
    assert hull.inertia_kg_m2[0, 0] == pytest.approx(241.76 * 0.04, rel=1e-4)
    assert hull.gravity_centre_m[2] == -0.2


def test_a_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"known are Capytaine \.nc, WAMIT \.1"):
        read_hull(tmp_path / "hull.stl")
    (tmp_path / "hull.nc").write_text("nothing of that kind")
    with pytest.raises(ValueError, match="can't be read as netCDF"):
        read_hull(tmp_path / "hull.nc")


def test_two_bodies_of_capytaine_are_refused_in_words(tmp_path):
    xarray = pytest.importorskip("xarray")
    one = xarray.open_dataset(hulls("capytaine-cylinder/cylinder_hydrodynamics.nc"))
    xarray.concat([one, one], "radiating_dof", data_vars="minimal").to_netcdf(tmp_path / "two.nc")
    with pytest.raises(ValueError, match="of one body"):
        read_hull(tmp_path / "two.nc")


def test_viscous_damping_of_a_strip_theory_file_is_read():
    assert roll_resonance(read_hull(hulls("shipx-supply/input.re7"))).viscous_ratio > 5e-4
