"""Least record length for an ARX model, and least model order for a ship.

The configuration and the retuner use the same checks, so that a record that would be refused is
never taken. Imports little, because the configuration needs it at every start of a controller.
"""

import math
from typing import Final

from utank_hil.base.parameters import Problem

VALIDATION_SHARE: Final = 0.2
"""Share of the record, at its end, for the validation of the model."""
LEAST_PREDICTIONS: Final = 100
"""Least number of predictions on validation data."""
LAGS: Final = 25
"""Largest lag of the whiteness test, in samples."""

_OFFSET_AND_WAVE: Final = 3  # disturbance functions fitted with the model


def record_problems(
    order: int, samples: int, outputs: int, sample_time_s: float, shortest_period_s: float
) -> list[Problem]:
    """Problems of a record's length and the model's order, known before any measurement.

    Parameters
    ----------
    order : int
        Order of the ARX model.
    samples : int
        Length of the record.
    outputs : int
        Number of measured outputs.
    shortest_period_s : float
        Shortest roll period of the stability booklet.

    Returns
    -------
    list of (str, str)
        Key, "order" or "identification_s", and reason.
    """
    problems = []
    if order * sample_time_s < shortest_period_s:
        # such a model is fitted to the waves, with small stated errors
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
    """Least number of samples of a record, for estimation and validation of a model."""
    skipped = max(order, LAGS)  # samples without a prediction, at the start of each part
    columns = (order + 1) * (outputs + 1) - outputs + _OFFSET_AND_WAVE
    judged = (LEAST_PREDICTIONS + skipped) / VALIDATION_SHARE
    fitted = (order + columns + 1) / (1 - VALIDATION_SHARE)
    least = math.floor(max(judged, fitted)) - 2
    while not _enough(least, order, skipped, columns):  # the parts are whole samples
        least += 1
    return least


def estimation_samples(samples: int) -> int:
    """Number of samples for the estimation of the model; the rest is for its validation."""
    return round((1 - VALIDATION_SHARE) * samples)


def _enough(samples: int, order: int, skipped: int, columns: int) -> bool:
    first = estimation_samples(samples)
    return first - order > columns and samples - first - skipped >= LEAST_PREDICTIONS
