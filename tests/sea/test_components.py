"""Files of wave components: the same to the bit, and errors with their place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.sea import Sea, jonswap
from utank_hil.sea.components import read_components, write_components


@given(seed=st.integers(0, 10_000), count=st.integers(1, 300))
def test_waves_are_read_as_they_were_written(tmp_path_factory, seed, count):
    sea = Sea.irregular(jonswap(4.0, 10.0), seed, components=count)
    again = read_components(write_components(sea, tmp_path_factory.mktemp("sea") / "sea.csv"))
    for name in ("omega_rad_s", "amplitude_m", "phase_rad", "heading_rad"):
        assert np.array_equal(getattr(again, name), getattr(sea, name))


def test_each_wave_may_have_a_heading_of_its_own(tmp_path):
    file = tmp_path / "sea.csv"
    file.write_text("omega_rad_s,amplitude_m,phase_rad,heading_deg\n0.5,1,0,45\n0.7,2,1,-90\n")
    np.testing.assert_allclose(np.degrees(read_components(file).heading_rad), [45, -90])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("omega_rad_s,amplitude_m\n0.5,1\n", "needs the columns omega_rad_s, amplitude_m, phase"),
        ("omega_rad_s,amplitude_m,phase_rad,x\n0.5,1,0,1\n", "it has omega_rad_s, .*, x"),
        ("omega_rad_s,amplitude_m,phase_rad\n0.5,1,0\n0,1,0\n", "line 3: omega_rad_s is 0"),
        ("omega_rad_s,amplitude_m,phase_rad\n0.5,-1,0\n", "line 2: amplitude_m is -1"),
        ("omega_rad_s,amplitude_m,phase_rad\n0.5,,0\n", "line 2: amplitude_m is nan"),
        ("omega_rad_s,amplitude_m,phase_rad\n" + "0.5,1,0\n" * 5000, "5000 waves; 4096 are"),
    ],
)
def test_what_is_no_sea_is_refused_at_its_place(tmp_path, text, words):
    file = tmp_path / "sea.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_components(file)


def test_a_file_that_is_missing_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere\.csv can't be read"):
        read_components(tmp_path / "nowhere.csv")
