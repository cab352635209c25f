import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from others import field_case, others_file

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
    if path == DIRECTION:
        title = "#YY  MM DD hh mm alpha1_1 (freq_1) alpha1_2 (freq_2) alpha1_3 (freq_3) ... >"
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
        (HEADER + "2020 01 01 01 00 1 x 3\n", "line 2: 'x' is not a finite number"),
        (HEADER + "2020 13 01 01 00 1 2 3\n", "line 2: bad time '2020 13 01 01 00'"),
        (HEADER + "2020 01 01 01 00 1 -2 3\n", "line 2: density -2 is below 0"),
        (HEADER + "2020 01 01 01 00 1 inf 3\n", "line 2: 'inf' is not a finite number"),
        (HEADER + "2020 01 01 01 00 1 2 3\n2020 01 01 01 00 1 2 9\n", "line 3: .* in line 2 too"),
        (HEADER + "2020 01 01 01 00 1 1_0 3\n", "line 2: '1_0' is not a finite number"),
        (HEADER + "2020 01 01 01 00 640 640 640\n", "line 2: waves of 39.2 m are higher"),
        ("YY MM DD hh .3 .4\n20 01 01 01 .1 .9\n", "line 2: density 0.9 at 0.4 Hz is more than"),
        (
            "#YY  MM DD hh mm alpha1_1 (freq_1) ... >\n2020 01 01 01 00 9 (0.1) 8 (0.2)\n",
            "line 1 says that it holds mean directions .alpha1., and a file of spectral densities",
        ),
        (HEADER + "2020 01 01 01 00 MM MM MM\n", "every value in the file is marked as missing"),
        ("#YY MM DD hh mm .1 .1\n2020 01 01 01 00 1 2\n", "line 1: frequencies must be"),
        ("#YY MM DD hh mm .1\n2020 01 01 01 00 1\n", "line 1: frequencies must be two or more"),
        ("#YY MM DD .1 .2\n2020 01 01 1 1\n", "line 1: header must be year"),
        ("2020 01 01 01 1.0 (0.1) 2.0 (0.2)\n", "line 1: not of the form"),
        ("2020 01 01 01 00 9.999 1.0 (0.2) 2.0 (0.1)\n", "line 1: frequencies must be"),
    ],
)
def test_bad_files_are_refused_with_file_line_and_reason(write, text, message):
    with pytest.raises(ValueError, match=re.escape("spectra.txt") + ".*" + message):
        load_ndbc(write(text))


def test_directions_on_another_grid_or_of_another_quantity_are_refused(write):
    other = write(HEADER + "2019 02 06 00 40 101 102 103\n")
    with pytest.raises(ValueError, match=r"spectra\.txt: frequencies differ"):
        load_ndbc(DENSITY, other)
    with pytest.raises(ValueError, match=r"spectra\.txt: no value is above 44.*alpha1"):
        load_ndbc(DENSITY, write(DENSITY.read_text(encoding="utf-8")))
    text = DIRECTION.read_text(encoding="utf-8")
    for letter, found in (("j", "r1"), ("w", "spectral densities")):
        with pytest.raises(ValueError, match=f"the name says that it holds {found}"):
            load_ndbc(DENSITY, write(text, f"41010{letter}2019.txt"))
    one_wrong = load_ndbc(DENSITY, write(text.replace(" 136 ", " 436 ", 1), "41010d2019.txt"))
    assert "line 2: direction 436 is outside 0 to 360" in one_wrong.notes[0]
    assert np.isnan(one_wrong.direction_from_deg[0]).all()
    assert np.isfinite(one_wrong.direction_from_deg[1]).all()


def test_damaged_rows_are_named_and_the_others_used(write):
    rows = {
        "01": "1.0 2.0 3.0", "02": "1.0 2.0", "03": "1.0 2.0 9.0", "04": "1 2 -3", "05": "2 2 2",
    }  # fmt: skip
    text = HEADER + "".join(f"2020 01 01 {hour} 00 {row}\n" for hour, row in rows.items())
    text += "2020 01 01 05 00 2 2 2\n2020 01 01 03 00 4 4 4\n"
    text += "#YY MM DD hh mm .05 .10\n2020 01 01 06 00 1 2\n2020 01 01 07 00 1"
    spectra = load_ndbc(write(text))
    assert [str(time)[11:13] for time in spectra.time] == ["01", "05", "06"]
    assert spectra.at("2020-01-01T06:00").frequency_hz.tolist() == [0.05, 0.10]
    assert spectra.at("2020-01-01T01:00").density.tolist() == [1, 2, 3]
    assert np.isfinite(spectra.hs_m).all()
    assert spectra.tp_s.tolist() == [1 / 0.15, 1 / 0.05, 1 / 0.1]
    lines = [re.search("line ([0-9]+)", note)[1] for note in spectra.notes]
    assert lines == ["3", "11", "5", "7", "8"]
    with pytest.raises(ValueError, match=r"(?s)no spectrum of.*5 rows are left out.*line 3"):
        spectra.at("2020-01-01T02:00")


def test_directions_of_other_bands_are_left_out(write):
    density = HEADER + "2020 01 01 01 00 1 2 3\n#YY MM DD hh mm .05 .10\n2020 01 01 02 00 1 2\n"
    direction = HEADER + "2020 01 01 01 00 1 2 300\n2020 01 01 02 00 5 6 7\n"
    spectra = load_ndbc(write(density), write(direction, "41010d2020.txt"))
    np.testing.assert_array_equal(spectra.direction_from_deg, [[1, 2, 300], [np.nan] * 3])
    assert "directions of 2020-01-01T02:00:00 are of other frequencies" in spectra.notes[0]


def test_a_compressed_file_is_read(tmp_path):
    (tmp_path / "sea.txt.gz").write_bytes(gzip.compress(DENSITY.read_bytes()))
    zipped = load_ndbc(tmp_path / "sea.txt.gz")
    np.testing.assert_array_equal(zipped.density, load_ndbc(DENSITY).density)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("station.data_spec",), ""),
        (("station.swdir",), "line 1 says that it holds mean directions"),
        (("station.swr1",), "line 1 says that it holds r1"),
        (("year_direction.txt",), "line 2: .*is it a file of densities"),
        (("year_r1.txt",), "line 2: .*is it a file of densities"),
        (("station.data_spec", "station.swdir"), ""),
        (("station.data_spec", "station.swr1"), "line 1 says that it holds r1"),
        (("station.data_spec", "station.data_spec"), "line 1 says that it holds spectral"),
        (("station.data_spec", "year_r1.txt"), "no value is above 85"),
    ],
)
def test_a_file_of_another_quantity_is_refused(names, said):
    files = [field_case(f"35-ndbc-file-of-another-quantity/{name}") for name in names]
    if said:
        with pytest.raises(ValueError, match=said):
            load_ndbc(*files)
    else:
        assert load_ndbc(*files).hs_m[0] == pytest.approx(1.16, abs=1.5)


@pytest.mark.parametrize(
    ("name", "hours", "notes"),
    [("bands.data_spec", 2, 0), ("year.txt", 2, 0), ("double.txt", 2, 1), ("cut.txt", 1, 1)],
)
def test_files_that_change_or_are_damaged_are_read(name, hours, notes):
    spectra = load_ndbc(field_case(f"13-ndbc-bands-change/{name}"))
    assert (len(spectra), len(spectra.notes)) == (hours, notes)
    assert all(spectrum.hs_m > 0 for spectrum in spectra)


@pytest.mark.parametrize(
    ("density", "direction", "heights_m"),
    [
        ("41010.data_spec", "41010.swdir", {"2020-06-02T02:50": 2.994, "2020-06-08T03:50": 1.119}),
        (
            "41010w2019part.txt.gz", "41010d2019part.txt.gz",
            {"2019-02-10T05:40": 4.710, "2019-02-06T00:40": 1.905},
        ),
    ],
)  # fmt: skip
def test_heights_of_the_buoy_of_others(density, direction, heights_m):
    spectra = load_ndbc(others_file(f"seas/{density}"), others_file(f"seas/{direction}"))
    assert not spectra.notes
    for time, height_m in heights_m.items():
        assert spectra.at(time).hs_m == pytest.approx(height_m, abs=1e-3)
