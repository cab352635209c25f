"""Excitation signals: pump pressures that stay within the pump's limits by construction.

All start and end at zero and keep the pressure and its rate within the pump's limits at every
sample; the same seed gives the same signal. `response_scale` gives a factor, at most 1, for which a
model predicts level and added roll within their limits.
"""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import ARX, PumpLimits


def random_pulses(
    duration_s: float,
    limits: PumpLimits,
    seed: int,
    hold_s: tuple[float, float] = (1.0, 5.0),
    *,
    sample_time_s: float,
) -> FloatArray:
    """Pulses of random amplitude and length, the excitation of thesis 3.7.

    ValueError is raised if a duration or hold time is shorter than a sample.

    Parameters
    ----------
    limits : PumpLimits
        Pump limits, of which pressure and rate are used.
    hold_s : tuple of float
        Shortest and longest pulse.

    Returns
    -------
    ndarray, shape (N,)
        Pressure in Pa.
    """
    samples = _samples(duration_s, sample_time_s)
    shortest, longest = (_samples(hold, sample_time_s) for hold in hold_s)
    if longest < shortest:
        raise ValueError(f"hold_s must rise, got {hold_s}")
    rng = np.random.default_rng(seed)
    lengths = rng.integers(shortest, longest + 1, samples // shortest + 1)
    amplitudes = rng.uniform(-limits.pressure_pa, limits.pressure_pa, len(lengths))
    return _rate_limited(np.repeat(amplitudes, lengths)[:samples], limits, sample_time_s)


def prbs(
    duration_s: float, limits: PumpLimits, seed: int, clock_s: float = 1.0, *, sample_time_s: float
) -> FloatArray:
    """Pseudo-random binary signal of full pressure, with a random sign every `clock_s`.

    Parameters, result and errors as `random_pulses`.
    """
    samples = _samples(duration_s, sample_time_s)
    clock = _samples(clock_s, sample_time_s)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], samples // clock + 1)
    target = limits.pressure_pa * np.repeat(signs, clock)[:samples]
    return _rate_limited(target, limits, sample_time_s)


def multisine(
    duration_s: float,
    limits: PumpLimits,
    seed: int,
    band_rad_s: tuple[float, float] = (0.2, 1.2),
    *,
    sample_time_s: float,
) -> FloatArray:
    """Multisine: equal amplitudes and random phases at all harmonics of the duration in a band.

    The pressure is in Pa, shape (N,). ValueError is raised if the band has no harmonic or extends
    beyond the Nyquist frequency.
    """
    samples = _samples(duration_s, sample_time_s)
    low, high = _band(band_rad_s, sample_time_s)
    spacing = 2 * np.pi / (samples * sample_time_s)
    lines = spacing * np.arange(math.ceil(low / spacing), math.floor(high / spacing) + 1)
    if len(lines) == 0:
        raise ValueError(f"{duration_s} s hold no harmonic within {band_rad_s} rad/s; last longer")
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(lines))
    time_s = np.arange(samples) * sample_time_s
    return _scaled_to_limits(
        np.cos(np.outer(time_s, lines) + phases).sum(axis=1), limits, sample_time_s
    )


def chirp(
    duration_s: float,
    limits: PumpLimits,
    band_rad_s: tuple[float, float] = (0.2, 1.2),
    *,
    sample_time_s: float,
) -> FloatArray:
    """Linear chirp: a sine with a frequency that rises from one end of a band to the other.

    Result and errors are those of `multisine`.
    """
    time_s = np.arange(_samples(duration_s, sample_time_s)) * sample_time_s
    low, high = _band(band_rad_s, sample_time_s)
    phase = low * time_s + 0.5 * (high - low) / duration_s * time_s**2
    return _scaled_to_limits(np.sin(phase), limits, sample_time_s)


def response_scale(pressure_pa: FloatArray, model: ARX, response_limits: FloatArray) -> float:
    """Factor, at most 1, that keeps the response to an excitation within limits.

    ValueError is raised if the limits do not match the model's outputs or are not positive, or the
    model has more than one input.

    Parameters
    ----------
    model : ARX
        Model from pressure to outputs; the response is simulated from rest, without waves.
    response_limits : array_like, shape (m,)
        Largest magnitude of each output, such as added roll in rad and level in m.
    """
    limits = np.asarray(response_limits, dtype=np.float64)
    if limits.shape != (model.outputs,) or not (limits > 0).all():
        raise ValueError(
            f"response_limits must hold {model.outputs} positive values, got {response_limits}"
        )
    if model.inputs != 1:
        raise ValueError(f"the model must have the pressure as its one input, has {model.inputs}")
    peak = np.abs(model.simulate(np.asarray(pressure_pa)[:, None])).max(axis=0)
    return float(min(1.0, 1.0 / np.max(peak / limits, initial=1e-300)))


def _samples(duration_s: float, sample_time_s: float) -> int:
    if not (math.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
    if not (math.isfinite(duration_s) and round(duration_s / sample_time_s) >= 1):
        raise ValueError(f"{duration_s} s do not last one sample of {sample_time_s} s")
    return round(duration_s / sample_time_s)


def _band(band_rad_s: tuple[float, float], sample_time_s: float) -> tuple[float, float]:
    low, high = band_rad_s
    if not 0 < low < high < np.pi / sample_time_s:
        raise ValueError(
            f"band_rad_s must rise between 0 and {np.pi / sample_time_s:.3g}, got {band_rad_s}"
        )
    return low, high


def _rate_limited(target: FloatArray, limits: PumpLimits, sample_time_s: float) -> FloatArray:
    """Rate-limit a piecewise constant target."""
    step = limits.rate_pa_s * sample_time_s
    pressure = np.empty_like(target)
    now = 0.0
    for k, wanted in enumerate(target):
        now += min(max(wanted - now, -step), step)
        pressure[k] = now
    return _with_zero_ends(pressure, step)


def _scaled_to_limits(shape: FloatArray, limits: PumpLimits, sample_time_s: float) -> FloatArray:
    """Scale a smooth signal to the stricter of the limits on pressure and rate."""
    step = limits.rate_pa_s * sample_time_s
    peak = np.abs(shape).max()
    steepest = np.abs(np.diff(shape)).max(initial=0.0)
    scale = min(limits.pressure_pa / peak, step / max(steepest, 1e-300 * peak))
    return _with_zero_ends(shape * scale, step)


def _with_zero_ends(pressure: FloatArray, step: float) -> FloatArray:
    """Clip to an envelope that starts and ends at zero with the limited rate."""
    left = np.arange(len(pressure))
    envelope = step * np.minimum(left, left[::-1])
    ended: FloatArray = np.clip(pressure, -envelope, envelope)
    return ended
