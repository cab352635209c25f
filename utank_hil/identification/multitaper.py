"""Sine-taper spectral coefficients of a record (Riedel and Sidorenko, 1995).

The squared magnitudes of the coefficients of one frequency, averaged over the tapers, estimate the
one-sided density there with two degrees of freedom per taper. Frequencies `bandwidth_rad_s` apart
are nearly independent.
"""

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray

_PADDING = 8  # finer grid of the transform: a coefficient is that of its frequency


def bandwidth_rad_s(samples: int, sample_time_s: float, tapers: int) -> float:
    """Full bandwidth of a coefficient."""
    return (tapers + 1) * np.pi / (samples * sample_time_s)


def coefficients(
    signals: FloatArray, sample_time_s: float, omega_rad_s: FloatArray, tapers: int
) -> ComplexArray:
    """Spectral coefficients, (m, tapers, F); their squares are one-sided density per rad/s.

    The signals, shape (N, m), have no gaps; a straight line is subtracted from each. The
    frequencies, shape (F,), are below the Nyquist frequency.
    """
    count = len(signals)
    time = np.linspace(-1.0, 1.0, count)
    line = np.column_stack([np.ones(count), time])
    signals = signals - line @ np.linalg.lstsq(line, signals, rcond=None)[0]
    padded = _PADDING * count
    index = np.rint(omega_rad_s * padded * sample_time_s / (2 * np.pi)).astype(np.intp)
    order = np.arange(1, tapers + 1)[:, None]
    taper = np.sin(np.pi * order * np.arange(1, count + 1) / (count + 1))
    scale = np.sqrt(2 / (count + 1) * sample_time_s / np.pi)
    found = [
        [np.fft.rfft(scale * each * signal, padded)[index] for each in taper]
        for signal in signals.T
    ]
    return np.array(found)
