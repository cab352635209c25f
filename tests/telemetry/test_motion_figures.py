"""Phase plane and spectra: against scipy's, and what of them reaches a recording."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import welch

from utank_hil.telemetry.motion_figures import SEGMENT, STEP_S, band_hz, spectrum
from utank_hil.telemetry.recording import _read_chunks, write_recording


@pytest.mark.parametrize("length", [SEGMENT, 1250, 1500])
def test_the_spectrum_is_welch_s(length: int) -> None:
    record = np.random.default_rng(1).standard_normal(length).cumsum()
    newest = record[(length - SEGMENT) % (SEGMENT // 2) :]  # segments are counted from the end
    frequency_hz, density = welch(newest, 1 / STEP_S, nperseg=SEGMENT)
    expected = np.interp(band_hz(), frequency_hz, density)
    np.testing.assert_allclose(spectrum(record), expected, rtol=1e-9)


@pytest.mark.slow
def test_a_recording_has_dots_in_time_and_spectra_of_what_was(tmp_path: Path) -> None:
    columns = ["time_s", "roll_rad", "roll_rate_rad_s"]
    time_s = np.arange(0.0, 200.0, 0.05)
    rows = np.column_stack([time_s, 0.1 * np.sin(time_s), 0.1 * np.cos(time_s)])
    rows[100:120, 1] = np.nan
    file = tmp_path / "a.rrd"
    write_recording(file, columns, {"run": rows})
    dots = np.concatenate([
        np.stack(chunk.to_record_batch().column("Points2D:positions").flatten().to_pylist())
        for chunk in _read_chunks(file, "Points2D:positions") if not chunk.is_static
    ])  # fmt: skip
    assert len(dots) == 200 / STEP_S - 5
    np.testing.assert_allclose(np.linalg.norm(dots, axis=1), np.degrees(0.1), rtol=1e-6)
    assert dots[0] == pytest.approx([0.0, -np.degrees(0.1)])  # a positive rate is upwards
    charts = [c for c in _read_chunks(file, "BarChart:values") if not c.is_static]
    assert sum(chart.num_rows for chart in charts) == 5  # from 100 s on, every 20 s
