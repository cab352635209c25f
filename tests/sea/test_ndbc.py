import re
from pathlib import Path

import numpy as np
import pytest

from utank_hil.sea import load_ndbc

SEAS = Path(__file__).parents[2] / "configs" / "seas"
DENSITY = SEAS / "ndbc_41010_2019-02_spectral_density.txt"
DIRECTION = SEAS / "ndbc_41010_2019-02_mean_direction.txt"
STORM = "2019-02-10T05:40"

HEADER = "#YY  MM DD hh mm  .0500  .1000  .1500\n"


@pytest.fixture
def write(tmp_path):
    def writer(text, name="spectra.txt"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return writer


def as_45_day_layout(path, separation=True):
    """Rewrite a yearly file the way the centre's 45-day files look, newest first."""
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    frequencies = [float(word) for word in header.split()[5:]]
    rows = []
    for line in lines:
        words = line.split()
        # half up, as the centre prints 0.0325 as 0.033
        pairs = [
            f"{value} ({int(frequency * 1000 + 0.5) / 1000:.3f})"
            for value, frequency in zip(words[5:], frequencies, strict=True)
        ]
        rows.append(" ".join(words[:5] + ["9.999"] * separation + pairs))
    title = "#YY  MM DD hh mm Sep_Freq  < spec_1 (freq_1) spec_2 (freq_2) spec_3 (freq_3) ... >"
    return "\n".join([title, *rows[::-1]]) + "\n"


def test_storm_peak_has_the_published_height_and_period():
    spectra = load_ndbc(DENSITY)
    peak = int(np.argmax(spectra.hs_m))
    assert len(spectra) == 99
    assert spectra.time[peak] == np.datetime64(STORM)
    assert spectra.hs_m[peak] == pytest.approx(4.7, abs=0.05)
    assert spectra.tp_s[peak] == pytest.approx(10.0)


def test_height_is_four_root_m0_with_the_bandwidths_of_the_centre():
    table = np.loadtxt(DENSITY)
    # 13 bands of 5 mHz, 26 of 10 mHz, 7 of 20 mHz; the centre's sum leaves the first band out
    widths = np.array([0.005] * 13 + [0.010] * 26 + [0.020] * 7)
    expected = 4 * np.sqrt(table[:, 6:] @ widths)
    np.testing.assert_allclose(load_ndbc(DENSITY).hs_m, expected, atol=0.02)


def test_one_spectrum_agrees_with_the_series():
    spectra = load_ndbc(DENSITY)
    for one, hs, tp in zip(spectra, spectra.hs_m, spectra.tp_s, strict=True):
        assert one.hs_m == pytest.approx(hs, rel=1e-12)
        assert one.tp_s == tp


@pytest.mark.parametrize("separation", [True, False])
def test_both_layouts_give_the_same_spectra(write, separation):
    yearly = load_ndbc(DENSITY, DIRECTION)
    density = write(as_45_day_layout(DENSITY, separation), "41010.data_spec")
    direction = write(as_45_day_layout(DIRECTION, separation=False), "41010.swdir")
    recent = load_ndbc(density, direction)
    assert np.all(recent.time == yearly.time)
    np.testing.assert_allclose(recent.frequency_hz, yearly.frequency_hz, rtol=1e-12)
    np.testing.assert_array_equal(recent.density, yearly.density)
    np.testing.assert_array_equal(recent.direction_from_deg, yearly.direction_from_deg)
    np.testing.assert_allclose(recent.hs_m, yearly.hs_m, rtol=1e-12)


def test_directions_join_by_time_and_follow_into_the_spectrum(write):
    lines = DIRECTION.read_text(encoding="utf-8").splitlines()
    kept = write("\n".join([lines[0], lines[5], lines[2]]))
    spectra = load_ndbc(DENSITY, kept)
    assert spectra.direction_from_deg is not None
    known = np.isfinite(spectra.direction_from_deg).all(axis=1)
    assert list(np.flatnonzero(known)) == [1, 4]
    assert spectra[4].direction_from_deg[0] == float(lines[5].split()[5])
    with pytest.raises(ValueError, match="no direction"):
        spectra[0].heading_rad(0.0)


@pytest.mark.parametrize(
    ("header", "stamp"),
    [
        ("YYYY MM DD hh mm .0500 .1000", "2003 02 06 05 30"),
        ("YYYY MM DD hh .0500 .1000", "2003 02 06 05"),
        ("YY MM DD hh .05 .10", "98 02 06 05"),
    ],
)
def test_older_years_are_read(write, header, stamp):
    spectra = load_ndbc(write(f"{header}\n{stamp} 1.0 2.0\n"))
    year = "1998" if stamp.startswith("98") else "2003"
    minute = "30" if "mm" in header else "00"
    assert spectra.time[0] == np.datetime64(f"{year}-02-06T05:{minute}")


def test_rows_come_out_in_time_order_and_empty_ones_are_left_out(write):
    path = write(
        HEADER
        + "2020 01 01 03 00 1.00 1.00 1.00\n"
        + "# station moved\n\n"
        + "2020 01 01 02 00 99.00 999.0 MM\n"
        + "2020 01 01 01 00 2.00 2.00 2.00\n"
    )
    spectra = load_ndbc(path)
    assert list(spectra.density[:, 0]) == [2.0, 1.0]
    assert spectra.time[0] < spectra.time[1]


def test_missing_ends_count_as_calm_and_a_gap_makes_the_hour_unknown(write):
    path = write(
        HEADER
        + "2020 01 01 01 00 MM 2.00 2.00\n"
        + "2020 01 01 02 00 2.00 99.00 2.00\n"
        + "2020 01 01 03 00 0.00 2.00 2.00\n"
        + "2020 01 01 04 00 2.00 2.00 MM\n"
        + "2020 01 01 05 00 2.00 2.00 0.00\n"
    )
    spectra = load_ndbc(path)
    assert np.isnan(spectra.density[0, 0])
    assert spectra.hs_m[0] == spectra.hs_m[2]
    assert spectra.hs_m[3] == spectra.hs_m[4]
    assert spectra[0].density[0] == 0
    assert np.isnan(spectra.hs_m[1])
    assert np.isnan(spectra.tp_s[1])
    with pytest.raises(ValueError, match=r"spectra\.txt: .*T02:00:00 has no value at 0\.1 Hz"):
        spectra[1]


def test_selection_is_exact_unless_told_how_far():
    spectra = load_ndbc(DENSITY)
    assert spectra.at(STORM).hs_m == spectra.at(np.datetime64("2019-02-10T05:40:00")).hs_m
    assert spectra.at("2019-02-10T05:12", within_s=1800).hs_m == spectra.at(STORM).hs_m
    with pytest.raises(ValueError, match="nearest is of 2019-02-10T05:40:00"):
        spectra.at("2019-02-10T05:41")
    with pytest.raises(ValueError, match="no spectrum within"):
        spectra.at("NaT", within_s=1e9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no spectra in the file"),
        (HEADER, "no spectra in the file"),
        ("2020 01 01 01 00 1 2 3\n", "line 1: no header line"),
        (HEADER + "2020 01 01 01 00 1 2\n", "line 2: 2 values for 3 frequencies"),
        (HEADER + "2020 01 01 01 00 1 x 3\n", "line 2: 'x' is not a number"),
        (HEADER + "2020 13 01 01 00 1 2 3\n", "line 2: bad time '2020 13 01 01 00'"),
        (HEADER + "2020 01 01 01 00 1 -2 3\n", "line 2: density -2 is outside 0 to inf"),
        (HEADER + "2020 01 01 01 00 1 inf 3\n", "line 2: 'inf' is not a finite number"),
        (HEADER + "2020 01 01 01 00 1 2 3\n2020 01 01 01 00 1 2 3\n", "line 3: .* in line 2 too"),
        (HEADER + "2020 01 01 01 00 MM MM MM\n", "every density in the file is marked as missing"),
        ("#YY MM DD hh mm .1 .1\n2020 01 01 01 00 1 2\n", "line 1: frequencies must be"),
        ("#YY MM DD hh mm .1\n2020 01 01 01 00 1\n", "line 1: frequencies must be two or more"),
        ("#YY MM DD .1 .2\n2020 01 01 1 1\n", "line 1: header must be year"),
        ("2020 01 01 01 1.0 (0.1) 2.0 (0.2)\n", "line 1: not of the form"),
        ("2020 01 01 01 00 9.999 1.0 (0.2) 2.0 (0.1)\n", "line 1: frequencies must be"),
        (
            "2020 01 01 01 00 9.999 1.0 (0.1) 2.0 (0.2)\n2020 01 01 02 00 9.999 1.0 (0.1) 1 (0.3)",
            "line 2: frequencies differ from those of line 1",
        ),
    ],
)
def test_bad_files_are_refused_with_file_line_and_reason(write, text, message):
    with pytest.raises(ValueError, match=re.escape("spectra.txt") + ".*" + message):
        load_ndbc(write(text))


def test_directions_on_another_grid_or_out_of_range_are_refused(write):
    other = write(HEADER + "2019 02 06 00 40 1 2 3\n")
    with pytest.raises(ValueError, match=r"spectra\.txt: frequencies differ"):
        load_ndbc(DENSITY, other)
    text = DIRECTION.read_text(encoding="utf-8").replace(" 136 ", " 436 ", 1)
    with pytest.raises(ValueError, match="line 2: direction 436 is outside 0 to 360"):
        load_ndbc(DENSITY, write(text))
