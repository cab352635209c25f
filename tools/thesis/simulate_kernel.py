"""Compiled run of one ship in a sum of waves; imports numba, so import it late.

The wave moment is a sum of components ``amplitude cos(frequency t + phase)``. It is advanced by
rotating one phasor per component, without cosines, and recomputed from the cosines every `REFRESH`
steps, so that rounding errors do not accumulate.
"""

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.kernels import (
    CAPSIZED_S,
    MAX_LEVEL,
    MAX_ROLL,
    Held,
    rk4,
    sine_cosine,
    step_with_impacts,
    unpacked,
)

REFRESH = 256  # This is a power of two.
NONE = (0.0, 0.0, 0.0)


@njit(error_model="numpy")
def advance(
    row: FloatArray,
    per_piece: float,
    restoring: FloatArray,
    amplitude: FloatArray,
    frequency: FloatArray,
    phase: FloatArray,
    pressure: FloatArray,
    valve_loss: FloatArray,
    hold: int,
    capsize: float,
    first: int,
    steps: int,
    dt: float,
    state: FloatArray,
    summary: FloatArray,
    impacts: FloatArray,
    out: FloatArray,
    stride: int,
) -> None:
    """Advance one ship from step `first` by `steps`; updates `state`, `summary`, `impacts`, `out`.

    `row` holds `RollCoefficients`. Each sample of pressure and valve loss is held for `hold` steps,
    the last one to the end. `out` (k, 4) receives the state before every `stride`-th step. A
    capsized ship keeps the state in which it passed the angle `capsize`.
    """
    c = unpacked(row)
    waves = len(amplitude)
    re, im = np.empty(waves), np.empty(waves)
    half_cos, half_sin = np.empty(waves), np.empty(waves)
    full_cos, full_sin = np.empty(waves), np.empty(waves)
    for j in range(waves):
        half_sin[j], half_cos[j] = sine_cosine(frequency[j] * dt / 2)
        full_sin[j], full_cos[j] = sine_cosine(frequency[j] * dt)
    now = (state[0], state[1], state[2], state[3])
    alive = summary[CAPSIZED_S] == np.inf
    max_roll, max_level = summary[MAX_ROLL], summary[MAX_LEVEL]
    start = 0.0
    # Counters are used, because integer division costs as much as a sine.
    until_output, row_out = 0, 0
    sample, held = first // hold, first % hold
    pump = c.area * pressure[min(sample, len(pressure) - 1)]
    valve = c.area * valve_loss[min(sample, len(valve_loss) - 1)]
    for i in range(steps):
        if until_output == 0:
            until_output = stride
            if row_out < out.shape[0]:
                for k in range(4):
                    out[row_out, k] = now[k]
            row_out += 1
        until_output -= 1
        if not alive:
            continue
        step = first + i
        if i == 0 or step & (REFRESH - 1) == 0:
            start = 0.0
            for j in range(waves):
                sine, cosine = sine_cosine(frequency[j] * (step * dt) + phase[j])
                re[j], im[j] = amplitude[j] * cosine, amplitude[j] * sine
                start += re[j]
        middle, end = 0.0, 0.0
        for j in range(waves):
            middle += re[j] * half_cos[j] - im[j] * half_sin[j]
            turned = re[j] * full_cos[j] - im[j] * full_sin[j]
            im[j] = re[j] * full_sin[j] + im[j] * full_cos[j]
            re[j] = turned
            end += turned
        if held == hold:
            held = 0
            sample += 1
            pump = c.area * pressure[min(sample, len(pressure) - 1)]
            valve = c.area * valve_loss[min(sample, len(valve_loss) - 1)]
        held += 1
        in_step = ((start, middle, end), NONE, NONE)
        ship = Held(c, per_piece, restoring, pump, valve)
        after = rk4(ship, now, in_step, dt)
        if abs(after[2]) > c.level_limit:
            after = step_with_impacts(ship, now, in_step, dt, step * dt, impacts, summary)
        now, start = after, end
        max_roll, max_level = max(max_roll, abs(now[0])), max(max_level, abs(now[2]))
        if not abs(now[0]) < capsize:
            summary[CAPSIZED_S] = (step + 1) * dt
            alive = False
    summary[MAX_ROLL], summary[MAX_LEVEL] = max_roll, max_level
    for k in range(4):
        state[k] = now[k]
