"""Smallest record length for an ARX model, and smallest model order for a ship.

Configuration and retuner use the same checks, so no record is taken that would be refused. The
configuration needs this at every start of a controller, so it imports little.
"""

import math
from typing import Final

from utank_hil.base.parameters import Problem

VALIDATION_SHARE: Final = 0.2  #: Share of the record, at its end, that validates the model.
LEAST_PREDICTIONS: Final = 100
"""Smallest number of predictions on validation data. Chosen; no study."""
LAGS: Final = 25  #: Largest lag of the whiteness test, in samples.

_OFFSET_AND_WAVE: Final = 3  # These are the disturbance functions that are fitted with the model.


def record_problems(
    order: int, samples: int, outputs: int, sample_time_s: float, shortest_period_s: float
) -> list[Problem]:
    """Return problems of a record's length and the model's order, known before any measurement.

    `order` is that of the ARX model, `samples` the length of the record, `shortest_period_s` the
    shortest roll period of the stability booklet. Returns key, "order" or "identification_s", and
    reason of each.
    """
    problems = []
    if order * sample_time_s < shortest_period_s:
        # Such a model is fitted to the waves, with small stated errors.
        problems.append(
            (
                "order",
                f"{order} remembers {order * sample_time_s:g} s, less than the shortest roll "
                f"period of {shortest_period_s:g} s: raise it to "
                f"{math.ceil(shortest_period_s / sample_time_s)} or more",
            )
        )
    least = least_samples(order, outputs)
    if samples < least:
        problems.append(
            (
                "identification_s",
                f"is too short: order {order} needs {least * sample_time_s:.0f} s, it has "
                f"{samples * sample_time_s:.0f}",
            )
        )
    return problems


def least_samples(order: int, outputs: int) -> int:
    """Return the smallest record, in samples, for estimation and validation of a model."""
    skipped = max(order, LAGS)  # These samples at the start of each part have no prediction.
    columns = (order + 1) * (outputs + 1) - outputs + _OFFSET_AND_WAVE
    judged = (LEAST_PREDICTIONS + skipped) / VALIDATION_SHARE
    fitted = (order + columns + 1) / (1 - VALIDATION_SHARE)
    least = math.floor(max(judged, fitted)) - 2
    while not _enough(least, order, skipped, columns):  # The parts are whole samples.
        least += 1
    return least


def estimation_samples(samples: int) -> int:
    """Return the number of samples that estimate the model; the rest validates it."""
    return round((1 - VALIDATION_SHARE) * samples)


def _enough(samples: int, order: int, skipped: int, columns: int) -> bool:
    first = estimation_samples(samples)
    return first - order > columns and samples - first - skipped >= LEAST_PREDICTIONS
