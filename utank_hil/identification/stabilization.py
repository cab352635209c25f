"""Data of a stabilization diagram: which modes stay where they are as the model order grows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.identification.era import era
from utank_hil.identification.modes import Modes, modal_assurance, modes

_FREQUENCY = 0.01  # relative changes from one order to the next that count as stable
_DAMPING = 0.05
_SHAPE = 0.98  # modal assurance


@dataclass(frozen=True, slots=True)
class StabilizationPoint:
    """A mode at one model order, against the nearest mode at the order before.

    Parameters
    ----------
    order : int
    frequency_rad_s, damping_ratio : float
    frequency_stable, damping_stable, shape_stable : bool
        Within 1 % in frequency, 5 % in damping ratio, 0.98 in modal assurance.
    """

    order: int
    frequency_rad_s: float
    damping_ratio: float
    frequency_stable: bool
    damping_stable: bool
    shape_stable: bool


def stabilization(
    markov: FloatArray, orders: Sequence[int], sample_time_s: float = 0.2
) -> tuple[StabilizationPoint, ...]:
    """Modes of ERA models of rising order.

    Parameters
    ----------
    markov : ndarray, shape (K, m, r)
    orders : sequence of int
        Rising; orders beyond the rank of the Markov parameters are refused as by `era`.
    sample_time_s : float

    Returns
    -------
    tuple of StabilizationPoint
        By order, then frequency; nothing is stable at the first order.
    """
    points = []
    before: Modes | None = None
    size = np.sqrt(np.sum(np.asarray(markov)[1:] ** 2, axis=(0, 2)))
    size[size == 0] = 1.0
    for order in orders:
        now = modes(era(markov, order, sample_time_s))
        for j, frequency in enumerate(now.frequency_rad_s):
            stable = (False, False, False)
            if before is not None:
                near = int(np.argmin(np.abs(before.frequency_rad_s - frequency)))
                shift = abs(before.frequency_rad_s[near] / frequency - 1)
                damping = now.damping_ratio[j]
                assurance = modal_assurance(now.shapes[[j]] / size, before.shapes[[near]] / size)
                stable = (
                    bool(shift <= _FREQUENCY),
                    bool(abs(before.damping_ratio[near] - damping) <= _DAMPING * abs(damping)),
                    bool(assurance[0, 0] >= _SHAPE),
                )
            points.append(
                StabilizationPoint(order, float(frequency), float(now.damping_ratio[j]), *stable)
            )
        before = now
    return tuple(points)
