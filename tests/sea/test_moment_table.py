import gzip

import numpy as np
import pytest

from utank_hil.sea import EffectiveSlope, Sea, jonswap
from utank_hil.sea.moment_table import MomentTable

STIFFNESS = 4.8e8
SLOPE = EffectiveSlope(0.6, depth_m=2.0, beam_m=15.0)


def write(file, omega, heading_deg):
    """The effective slope as a table."""
    lines = ["omega_rad_s, heading_deg, moment_nm_per_m, phase_deg"]
    for w in omega:
        for heading in heading_deg:
            moment = SLOPE.moment(np.array([w]), np.radians([heading]), STIFFNESS)[0]
            row = (w, heading, abs(moment), np.degrees(np.angle(moment)))
            lines.append(",".join(repr(float(value)) for value in row))
    file.write_text("\n".join(lines) + "\n")
    return file


def test_a_wave_from_starboard_heels_the_other_way(tmp_path):
    file = write(tmp_path / "table.csv", np.array([0.5, 1.0]), np.array([0.0, 90.0, 180.0]))
    table, omega = MomentTable.read(file), np.array([0.7])
    from_port, from_starboard = (table.moment(omega, np.array([side])) for side in (1.1, -1.1))
    assert abs(from_port[0]) > 0
    assert from_starboard == pytest.approx(-from_port, rel=1e-12)


@pytest.mark.evidence
def test_table_of_the_effective_slope_gives_its_moment_from_either_side(tmp_path):
    omega, heading = np.linspace(0.1, 9.0, 900), np.linspace(0, 180, 181)
    table = MomentTable.read(write(tmp_path / "table.csv", omega, heading))
    sea = Sea.irregular(jonswap(3.0, 9.0), 1, heading_rad=-1.1, spreading=8.0)
    direct = SLOPE.moment(sea.omega_rad_s, sea.heading_rad, STIFFNESS)
    np.testing.assert_allclose(
        table.moment(sea.omega_rad_s, sea.heading_rad), direct, atol=2e-3 * np.abs(direct).max()
    )
    assert not table.moment(np.array([0.05, 9.1]), np.array([1.0, 1.0])).any()


def test_rows_may_stand_in_any_order(tmp_path):
    file = write(tmp_path / "table.csv", np.array([0.5, 1.0]), np.array([0.0, 90.0, 180.0]))
    before = MomentTable.read(file)
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([head, *reversed(rows)]))
    np.testing.assert_array_equal(MomentTable.read(file).moment_nm_per_m, before.moment_nm_per_m)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.replace("phase_deg", "phase"), "needs the columns omega_rad_s"),
        (lambda text: text.replace("0.5", "half"), "line 2, omega_rad_s: 'half' is no number"),
        (lambda text: text.replace("\n0.5,0.0,", "\n0.5,0.0\n", 1), "line 2 has 2 fields"),
        (lambda text: text + "1.0,90.0,1.0,0.0\n", "once"),
        (lambda text: text.replace(",180.0,", ",170.0,"), "headings from 0 to 180"),
        (lambda text: text.replace("\n0.5", "\nnan", 1), "finite"),
        (lambda text: text.splitlines()[0] + "\n", "a line of names and no rows"),
        (lambda text: "\n".join(text.splitlines()[:2]), "two or more frequencies"),
    ],
)
def test_what_is_wrong_with_a_table_is_said(tmp_path, change, reason):
    file = write(tmp_path / "table.csv", np.array([0.5, 1.0]), np.array([0.0, 90.0, 180.0]))
    file.write_text(change(file.read_text()))
    with pytest.raises(ValueError, match=reason):
        MomentTable.read(file)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_is_read_as_any_other(tmp_path, separator):
    file = write(tmp_path / "table.csv", np.array([0.5, 1.0]), np.array([0.0, 90.0, 180.0]))
    before = MomentTable.read(file)
    text = "\ufeff" + file.read_text().replace(",", separator).replace("\n", "\r\n")
    (tmp_path / "other.csv.gz").write_bytes(gzip.compress(text.encode()))
    other = MomentTable.read(tmp_path / "other.csv.gz")
    np.testing.assert_array_equal(other.moment_nm_per_m, before.moment_nm_per_m)


def test_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"missing\.csv can't be read"):
        MomentTable.read(tmp_path / "missing.csv")
