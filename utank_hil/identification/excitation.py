"""Excitations of an identification, and the factor that keeps the response within limits."""

import math
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import sine_cosine
from utank_hil.control import ARX, PumpLimits

BAND_RAD_S: Final = (0.2, 1.2)  #: Band of ship and tank: roll periods of 5 to 31 s.


def random_pulses(
    duration_s: float,
    limits: PumpLimits,
    seed: int,
    hold_s: tuple[float, float] = (1.0, 5.0),
    *,
    sample_time_s: float,
) -> FloatArray:
    """Pulses of random amplitude and length, the excitation of thesis 3.7.

    They start and end at zero and keep the limits of pressure and rate at every sample; the same
    seed gives the same signal. ValueError is raised if a duration or hold time is
    shorter than a sample.

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
    """Pseudo-random binary signal: a random sign every `clock_s`; else as `random_pulses`."""
    samples = _samples(duration_s, sample_time_s)
    clock = _samples(clock_s, sample_time_s)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], samples // clock + 1)
    target = limits.pressure_pa * np.repeat(signs, clock)[:samples]
    return _rate_limited(target, limits, sample_time_s)


def multisine(
    duration_s: float,
    limits: PumpLimits,
    seed: int,
    band_rad_s: tuple[float, float] = BAND_RAD_S,
    *,
    sample_time_s: float,
) -> FloatArray:
    """Multisine: equal amplitudes and random phases at all harmonics of the duration in a band.

    The pressure is in Pa, shape (N,). ValueError is raised if the band has no harmonic or extends
    beyond the Nyquist frequency.
    """
    samples = _samples(duration_s, sample_time_s)
    low, high = _band(band_rad_s, sample_time_s)
    spacing = 2 * math.pi / (samples * sample_time_s)
    lines = [spacing * n for n in range(math.ceil(low / spacing), math.floor(high / spacing) + 1)]
    if not lines:
        raise ValueError(f"{duration_s} s hold no harmonic within {band_rad_s} rad/s; last longer")
    phases = np.random.default_rng(seed).uniform(0, 2 * math.pi, len(lines)).tolist()
    turned = list(zip(lines, phases, strict=True))
    shape = [
        sum(sine_cosine(w * k * sample_time_s + phase)[1] for w, phase in turned)
        for k in range(samples)
    ]
    return _scaled_to_limits(np.array(shape), limits, sample_time_s)


def chirp(
    duration_s: float,
    limits: PumpLimits,
    band_rad_s: tuple[float, float] = BAND_RAD_S,
    *,
    sample_time_s: float,
) -> FloatArray:
    """Linear chirp: a sine that rises from one end of a band to the other; see `multisine`."""
    low, high = _band(band_rad_s, sample_time_s)
    times_s = [k * sample_time_s for k in range(_samples(duration_s, sample_time_s))]
    rise = 0.5 * (high - low) / duration_s
    shape = [sine_cosine(low * t + rise * t * t)[0] for t in times_s]
    return _scaled_to_limits(np.array(shape), limits, sample_time_s)


def _band(band_rad_s: tuple[float, float], sample_time_s: float) -> tuple[float, float]:
    low, high = band_rad_s
    if not 0 < low < high < math.pi / sample_time_s:
        most = f"{math.pi / sample_time_s:.3g}"
        raise ValueError(f"band_rad_s must rise between 0 and {most}, got {band_rad_s}")
    return low, high


def _scaled_to_limits(shape: FloatArray, limits: PumpLimits, sample_time_s: float) -> FloatArray:
    """Scale a smooth signal to the stricter of the limits on pressure and rate."""
    step = limits.rate_pa_s * sample_time_s
    peak = np.abs(shape).max()
    steepest = np.abs(np.diff(shape)).max(initial=0.0)
    return _with_zero_ends(
        shape * min(limits.pressure_pa / peak, step / max(steepest, 1e-300 * peak)), step
    )


def _rate_limited(target: FloatArray, limits: PumpLimits, sample_time_s: float) -> FloatArray:
    step, now = limits.rate_pa_s * sample_time_s, 0.0
    pressure = np.empty_like(target)
    for k, wanted in enumerate(target):
        now += min(max(wanted - now, -step), step)
        pressure[k] = now
    return _with_zero_ends(pressure, step)


def _with_zero_ends(pressure: FloatArray, step: float) -> FloatArray:
    """Clip to an envelope that starts and ends at zero with the limited rate."""
    left = np.arange(len(pressure))
    envelope = step * np.minimum(left, left[::-1])
    ended: FloatArray = np.clip(pressure, -envelope, envelope)
    return ended


def response_scale(pressure_pa: FloatArray, model: ARX, response_limits: FloatArray) -> float:
    """Factor, at most 1, that keeps the response to an excitation within limits.

    It is a multiple of 2^-20: the last digits of a prediction, which follow the processor, do not
    move a command.

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
    most = float(min(1.0, 1.0 / np.max(peak / limits, initial=1e-300)))
    return math.ldexp(math.floor(math.ldexp(most, 20)), -20)


def _samples(duration_s: float, sample_time_s: float) -> int:
    if not (math.isfinite(sample_time_s) and sample_time_s > 0):
        raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
    if not (math.isfinite(duration_s) and round(duration_s / sample_time_s) >= 1):
        raise ValueError(f"{duration_s} s do not last one sample of {sample_time_s} s")
    return round(duration_s / sample_time_s)
