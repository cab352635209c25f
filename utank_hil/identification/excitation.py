"""The excitation of an identification, and the factor that keeps the response within limits."""

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
    target = np.repeat(amplitudes, lengths)[:samples]
    step, now = limits.rate_pa_s * sample_time_s, 0.0
    pressure = np.empty_like(target)
    for k, wanted in enumerate(target):
        now += min(max(wanted - now, -step), step)
        pressure[k] = now
    # An envelope starts and ends at zero with the limited rate.
    left = np.arange(samples)
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
