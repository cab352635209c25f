"""Basis functions of a disturbance, thesis (3.12), after Goodzeit and Phan (2000).

Added to the regression they remove the wave from the data: only its shape in time must be known;
amplitude and phase are fitted with the model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class DisturbanceBasis:
    """Sine and cosine, polynomial and exponential functions of time."""

    frequencies_rad_s: Sequence[float] = ()  #: Frequencies, with a sine and a cosine each.
    #: Degree of Legendre polynomials over the record: 0 for an offset (a steady heel, the bias of a
    #: sensor), 1 for a drift as well; None for no offset.
    polynomial_degree: int | None = None
    #: Rates of functions exp(-rate t); a negative rate grows.
    decay_rates_1_s: Sequence[float] = ()

    def __post_init__(self) -> None:
        for name, values in (
            ("frequencies_rad_s", self.frequencies_rad_s),
            ("decay_rates_1_s", self.decay_rates_1_s),
        ):
            if not all(math.isfinite(v) for v in values) or len(set(values)) != len(values):
                raise ValueError(f"disturbance {name} must be finite and distinct, got {values}")
        if not all(w > 0 for w in self.frequencies_rad_s):
            raise ValueError(
                f"disturbance frequencies must be positive, got {self.frequencies_rad_s}; "
                "an offset is polynomial_degree=0"
            )
        if 0 in self.decay_rates_1_s:
            raise ValueError("disturbance decay rates must not be zero; use polynomial_degree=0")
        if self.polynomial_degree is not None and self.polynomial_degree < 0:
            raise ValueError(
                f"disturbance polynomial_degree must be 0 or more, got {self.polynomial_degree}"
            )

    @property
    def size(self) -> int:
        """Number d of functions."""
        degree = -1 if self.polynomial_degree is None else self.polynomial_degree
        return 2 * len(self.frequencies_rad_s) + degree + 1 + len(self.decay_rates_1_s)

    def evaluate(self, samples: int, sample_time_s: float) -> FloatArray:
        """Evaluate at t = 0, dt, ...; shape (d, samples), no value above 1 in magnitude."""
        time_s = np.arange(samples) * sample_time_s
        rows: list[FloatArray] = []
        for frequency in self.frequencies_rad_s:
            rows += [np.sin(frequency * time_s), np.cos(frequency * time_s)]
        if self.polynomial_degree is not None:
            span = np.linspace(-1.0, 1.0, samples)
            rows += list(np.polynomial.legendre.legvander(span, self.polynomial_degree).T)
        for rate in self.decay_rates_1_s:
            # The value is 1 at the end where the function is largest, so that none overflows.
            rows.append(np.exp(-abs(rate) * (time_s if rate > 0 else time_s[::-1])))
        return np.array(rows).reshape(len(rows), samples)
