"""How long a record an ARX model takes, and how long a memory a ship: known before any pulse.

Both the configuration and the retuner ask here, so that no ship is pulsed for a record that can
only be refused. Loads nothing: every start of a controller reads its configuration.
"""

import math
from typing import Final

from utank_hil.parameters import Problem

HELD_OUT: Final = 0.2
"""Part of the record, its end, that the model is judged on."""
LEAST_PREDICTIONS: Final = 100
"""On held-out data, for a verdict on the model."""
LAGS: Final = 25
"""Samples over which prediction errors are to be uncorrelated."""

_OFFSET_AND_WAVE: Final = 3  # functions of time that are fitted beside the model


def record_problems(
    order: int, samples: int, outputs: int, sample_time_s: float, shortest_period_s: float
) -> list[Problem]:
    """What makes a record useless whatever is in it.

    Parameters
    ----------
    order : int
        Of the ARX model.
    samples : int
        Of the record.
    outputs : int
        Measured.
    sample_time_s : float
    shortest_period_s : float
        Shortest roll period of the stability booklet.

    Returns
    -------
    list of (str, str)
        "order" and "identification_s", each with the reason.
    """
    problems = []
    if order * sample_time_s < shortest_period_s:
        # such a model takes waves for the ship, and is sure of it
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
    """Samples with which an order can be fitted to the first part and judged on the rest."""
    lost = max(order, LAGS)  # predictions, at the start of each part
    columns = (order + 1) * (outputs + 1) - outputs + _OFFSET_AND_WAVE
    judged = (LEAST_PREDICTIONS + lost) / HELD_OUT
    fitted = (order + columns + 1) / (1 - HELD_OUT)
    least = math.floor(max(judged, fitted)) - 2
    while not _enough(least, order, lost, columns):  # the parts are whole samples
        least += 1
    return least


def first_part(samples: int) -> int:
    """Samples that the model is made from."""
    return round((1 - HELD_OUT) * samples)


def _enough(samples: int, order: int, lost: int, columns: int) -> bool:
    first = first_part(samples)
    return first - order > columns and samples - first - lost >= LEAST_PREDICTIONS
