"""Difference of two means, paired or independent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.base.arrays import FloatArray


class CompareError(ValueError):
    """Error for inputs that cannot be compared; the message contains reason and remedy."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Figure of one run beside that of another."""

    reference: float
    value: float
    difference: float  #: `value` minus `reference`.
    #: Half width of the difference's 95 % confidence interval; None with too few values.
    half_width: float | None
    count: int  #: Number of pairs, or of values on the smaller side.
    paired: bool  #: Whether both sides met the same waves.


@dataclass(frozen=True, slots=True)
class Comparison:
    """Run beside the reference run of the same name."""

    source: str  #: Origin of the run.
    run: str
    parameters: dict[str, Any]
    figures: dict[str, Difference]
    remarks: tuple[str, ...] = ()  #: Remarks on the validity of the comparison.


def paired(reference: FloatArray, values: FloatArray) -> Difference:
    """Difference of values paired by index, shape (n,)."""
    width = mean_interval(values - reference).half_width if len(values) > 1 else None
    return _difference(reference, values, width, paired=True)


def independent(reference: FloatArray, values: FloatArray) -> Difference:
    """Difference of the means of independent values, shapes (n,) and (m,): Welch's interval."""
    count = min(len(reference), len(values))
    if count < 2:
        return _difference(reference, values, None, paired=False)
    from scipy.stats import ttest_ind

    if np.ptp(reference) == 0 == np.ptp(values):
        return _difference(reference, values, 0.0, paired=False)
    interval = ttest_ind(values, reference, equal_var=False).confidence_interval(0.95)
    width = float(interval.high - interval.low) / 2
    return _difference(reference, values, width, paired=False)


def _difference(
    reference: FloatArray, values: FloatArray, half_width: float | None, *, paired: bool
) -> Difference:
    first, second = float(np.mean(reference)), float(np.mean(values))
    count = min(len(reference), len(values))
    return Difference(first, second, second - first, half_width, count, paired)


def same_runs(reference: Sequence[str], other: Sequence[str], source: str) -> list[str]:
    """Names that both have; raise `CompareError` if there are none."""
    common = [name for name in reference if name in other]
    if not common:
        raise CompareError(
            f"{source}: has the runs {', '.join(other)}; the reference has {', '.join(reference)}: "
            "none of one name"
        )
    return common


def differing(reference: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[str, ...]:
    """Differences in code and simulation, which are not the subject of the comparison."""
    remarks = []
    for key, words in (("simulation", "kinds of simulation"), ("code", "versions of the program")):
        if reference.get(key) != other.get(key):
            remarks.append(f"different {words}: {reference.get(key)} and {other.get(key)}")
    return tuple(remarks)
