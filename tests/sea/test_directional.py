"""Directional spectra of wave models and buoys: heights, directions, and the sea drawn of them."""

import gzip

import numpy as np
import pytest
import xarray
from others import others_file

from firmware_sim.scenario_sea import ScenarioSea
from utank_hil.configuration import ConfigError, Section, load_config
from utank_hil.sea import Sea
from utank_hil.sea.measured import load_directional

FREQUENCY_HZ = np.arange(0.05, 0.3, 0.01)
DIRECTION_DEG = np.arange(5.0, 360.0, 10.0)
HOURS = np.array(["2026-03-01T00", "2026-03-01T03"], dtype="datetime64[ns]")


class Holder(Section):
    sea: ScenarioSea


def written(folder, mean_deg=200.0, places=1):
    """Write spectra in the layout of WAVEWATCH III: 2.5 m from one side, cos^2s about it."""
    shape = np.exp(-(((FREQUENCY_HZ - 0.1) / 0.02) ** 2))
    around = np.cos(np.radians(DIRECTION_DEG - mean_deg) / 2) ** 20
    density = np.outer(shape, around)
    density *= (2.5 / 4) ** 2 / (density.sum() * 0.01 * np.radians(10))  # m2/Hz/rad
    to_deg = (DIRECTION_DEG + 180) % 360  # WAVEWATCH III says where waves go.
    content = xarray.Dataset(
        {
            "efth": (
                ("time", "station", "frequency", "direction"),
                np.broadcast_to(density, (2, places, *density.shape)).copy(),
            ),
            "latitude": (("time", "station"), np.full((2, places), 60.0) + np.arange(places)),
            "longitude": (("time", "station"), np.full((2, places), 4.0)),
        },
        coords={"time": HOURS, "frequency": FREQUENCY_HZ, "direction": to_deg},
    )
    content["efth"][1, 0] = np.nan
    path = folder / "spectra.nc"
    content.to_netcdf(path, engine="h5netcdf")
    return path


def test_height_direction_and_missing_hours_are_those_of_the_file(tmp_path):
    spectra = load_directional(written(tmp_path))
    assert len(spectra) == 1
    assert "2026-03-01T03:00:00 has no values" in spectra.notes[0]
    spectrum = spectra.at("2026-03-01T00:00")
    assert spectrum.hs_m == pytest.approx(2.5, rel=1e-3)
    assert spectrum.tp_s == pytest.approx(10.0)
    np.testing.assert_allclose(spectrum.direction_from_deg, 200.0, atol=0.1)


def changed(folder, change):
    """Write the first spectrum of `written`, changed."""
    content = xarray.load_dataset(written(folder)).isel(time=[0])
    path = folder / "changed.nc"
    change(content).to_netcdf(path, engine="h5netcdf")
    return path


@pytest.mark.parametrize("mean_deg", [200.0, 0.0])
def test_a_sector_of_directions_has_its_own_energy_alone(tmp_path, mean_deg):
    whole = load_directional(written(tmp_path, mean_deg)).at("2026-03-01T00:00")
    content = xarray.load_dataset(tmp_path / "spectra.nc").isel(time=[0])
    apart = (content.direction - mean_deg) % 360 - 180  # it says where waves go
    sector = content.isel(direction=np.flatnonzero(abs(apart) < 16))
    sector.to_netcdf(tmp_path / "sector.nc", engine="h5netcdf")
    found = load_directional(tmp_path / "sector.nc")[0]
    share = float((sector.efth.sum() / content.efth.sum()).item())
    assert found.hs_m == pytest.approx(whole.hs_m * share**0.5, rel=1e-3)
    assert found.spread is not None
    assert found.direction_from_deg is not None
    band = np.zeros(2, dtype=np.intp)
    ends = found.spread.offset_rad(found.direction_from_deg, band, np.array([1e-6, 1 - 1e-6]))
    assert np.all(abs(np.degrees(ends)) < 21)


def test_a_band_without_values_is_no_calm(tmp_path):
    path = changed(tmp_path, lambda content: content.where(abs(content.frequency - 0.1) > 1e-6))
    with pytest.raises(ValueError, match=r"has no value at .*: choose another time"):
        load_directional(path)[0]


def test_one_direction_is_no_spread(tmp_path):
    path = changed(tmp_path, lambda content: content.isel(direction=[3, 4]))
    with pytest.raises(ValueError, match="has 2 directions: a sector has three or more"):
        load_directional(path)


def test_a_place_is_chosen_by_latitude_and_longitude(tmp_path):
    path = written(tmp_path, places=2)
    with pytest.raises(ValueError, match=r"holds 2 places: choose one .*\[60, 4\], \[61, 4\]"):
        load_directional(path)
    with pytest.raises(ValueError, match=r"no place within 0.5 degrees; the nearest is \[60, 4\]"):
        load_directional(path, (59.0, 364.0))
    assert len(load_directional(path, (61.2, 364.0))) == 2


@pytest.mark.parametrize("course_deg", [0.0, 110.0])
def test_the_sea_has_the_spread_of_the_file(tmp_path, course_deg):
    spectrum = load_directional(written(tmp_path)).at("2026-03-01T00:00")
    sea = Sea.irregular(spectrum, 1, heading_rad=spectrum.heading_rad(course_deg), components=4000)
    around = np.degrees(sea.heading_rad) - (200 + 180 - course_deg)
    energy = sea.amplitude_m**2
    vector = (energy * np.exp(1j * np.radians(around))).sum() / energy.sum()
    # cos^2s has the first Fourier coefficient s / (s + 1) (Longuet-Higgins 1963)
    assert abs(vector) == pytest.approx(10 / 11, abs=5e-3)
    assert np.degrees(np.angle(vector)) == pytest.approx(0.0, abs=0.5)


def scenario(folder, **keys):
    import yaml

    content = {"kind": "measured", "file": "./spectra.nc", "time": "2026-03-01T00:00", **keys}
    (folder / "scenario.yaml").write_text(yaml.safe_dump({"sea": content}))
    return load_config(folder / "scenario.yaml", Holder).sea


def test_a_scenario_takes_course_or_heading(tmp_path):
    written(tmp_path)
    short = scenario(tmp_path, course_deg=110.0).sea(1)
    assert np.std(short.heading_rad) > 0.2
    np.testing.assert_allclose(scenario(tmp_path, heading_deg=60.0).sea(1).heading_rad, np.pi / 3)
    for keys, said in (
        ({}, "course_deg: is required, or heading_deg"),
        ({"course_deg": 1.0, "heading_deg": 2.0}, "heading_deg: and course_deg exclude"),
        ({"course_deg": 1.0, "spreading": 2.0}, "spreading: is in the file"),
        ({"course_deg": 1.0, "time": "2026-03-01T03:00"}, "has no values"),
    ):
        with pytest.raises(ConfigError, match=said):
            scenario(tmp_path, **keys)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.nc", b"nonsense", "is no netCDF file that can be read"),
        ("a.spec", b"nonsense", "does not begin as a file of SWAN or WAVEWATCH III"),
        ("a.json", b"{", "can't be read as a file of spotter"),
        ("a.txt", b"", "must be a file of"),
    ],
)
def test_a_file_that_is_none_is_named(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=said):
        load_directional(tmp_path / name)
    packed = tmp_path / f"{name}.gz"
    packed.write_bytes(gzip.compress(content))
    with pytest.raises(ValueError, match=said) as error:
        load_directional(packed)
    assert str(packed) in str(error.value)


def test_a_packed_file_gives_the_same_sea(tmp_path):
    whole = load_directional(written(tmp_path))
    packed = tmp_path / "spectra.nc.gz"
    packed.write_bytes(gzip.compress((tmp_path / "spectra.nc").read_bytes()))
    found = load_directional(packed)
    np.testing.assert_array_equal(found.density, whole.density)
    assert found.source == str(packed)
    assert [note.replace(".nc.gz", ".nc") for note in found.notes] == list(whole.notes)
    assert scenario(tmp_path, file="./spectra.nc.gz", course_deg=1.0).sea(1).heading_rad.std() > 0.2


# wavespectra leaves the file of SWAN open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize(
    ("name", "place", "time", "hs_m", "tp_s", "mean_deg", "within"),
    [
        ("ww3file.nc", (19.95, 92.10), "2014-12-01T12:00", 0.824, 12.46, 225, 0.01),
        ("ww3file.nc", (19.80, 92.00), "2014-12-01T12:00", 0.823, 12.46, 217, 0.01),
        ("swanfile.spec", None, "2016-10-15T00:00", 4.259, 13.57, 254, 0.005),
        ("swanfile.nc", None, "2017-12-01T00:00", 0.202, 12.46, 292, 0.005),
        ("era5file.nc", (36, 216), "2019-12-01T00:00", 8.372, 13.51, 330, 0.005),
        ("spotter_20180214.json", None, "2018-02-14T10:27:19", 2.432, 10.24, 296, 0.005),
        ("buoy}2024-09-09T01h15Z.spt", None, "2024-09-09T01:15", 0.849, 6.25, 220, 0.005),
        ("42098w9999.nc", None, "2015-06-11T08:00", 1.684, 5.26, 187, 0.005),
        # Rounded directions: 36 sectors of 9.74 degrees, as the right value counts, are no circle.
        ("ww3station.spec", None, "2022-09-12T06:00", 1.142, 13.57, 114, 0.014),
    ],
)
def test_files_of_others_have_their_right_values(name, place, time, hs_m, tp_s, mean_deg, within):
    spectrum = load_directional(others_file(f"seas/{name}"), place).at(time)
    assert spectrum.hs_m == pytest.approx(hs_m, rel=within)
    assert spectrum.tp_s == pytest.approx(tp_s, abs=0.01)
    energy = spectrum.density * np.diff(spectrum.band_edges_hz)[:, 0]
    mean = np.angle((energy * np.exp(1j * np.radians(spectrum.direction_from_deg))).sum(), deg=True)
    assert abs((mean - mean_deg + 180) % 360 - 180) < 3
