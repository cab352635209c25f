"""Stabilization diagram: changes of the modes with the model order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.era import era
from utank_hil.identification.modal import ModalParameters, modal_assurance, modal_parameters

_FREQUENCY = 0.01  # Stable modes change by less than these from one order to the next,
_DAMPING = 0.05  # as usual for stabilization diagrams (Peeters and De Roeck 1999).
_SHAPE = 0.98  # Modal assurance of a stable mode.


@dataclass(frozen=True, slots=True)
class StabilizationPoint:
    """A mode at one model order, compared with the nearest mode at the order before."""

    order: int
    frequency_rad_s: float
    damping_ratio: float
    frequency_stable: bool  #: Whether it changes by 1 % or less in frequency,
    damping_stable: bool  #: by 5 % or less in damping ratio,
    shape_stable: bool  #: and has a modal assurance of 0.98 or more.


def stabilization(
    markov: FloatArray, orders: Sequence[int], sample_time_s: float
) -> tuple[StabilizationPoint, ...]:
    """Return the modes of ERA models of increasing order, by order, then frequency.

    No mode is stable at the first order. The orders are at most the rank of `markov`, shape (K, m,
    r).
    """
    points = []
    before: ModalParameters | None = None
    size = np.sqrt(np.sum(np.asarray(markov)[1:] ** 2, axis=(0, 2)))
    size[size == 0] = 1.0
    for order in orders:
        now = modal_parameters(era(markov, order, sample_time_s=sample_time_s))
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
