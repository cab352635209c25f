"""Arrays of amplitudes, frequencies and phases of many seas, one row per ship."""

from collections.abc import Iterable

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.simulate import WaveComponents, WaveMoment


def stacked_seas(seas: Iterable[WaveComponents]) -> WaveMoment:
    """Stack wave moments for the ships of a batch.

    Parameters
    ----------
    seas : iterable of utank_hil.sea.Harmonics or WaveMoment
        Shape (m,) each, such as ``Sea.irregular(spectrum, seed).roll_moment(stiffness)`` for some
        seeds.

    Returns
    -------
    WaveMoment
        Arrays of shape (n, m).

    Raises
    ------
    ValueError
        If there is no sea, one of them is not of shape (m,), or they differ in their number of
        components.
    TypeError
        If `seas` is not a collection of seas.
    """
    if hasattr(seas, "amplitude"):
        raise TypeError(
            f"seas must be a collection of single seas, got one {type(seas).__name__}: "
            "put it in a list"
        )
    rows: list[list[FloatArray]] = []
    for number, sea in enumerate(seas):
        if not hasattr(sea, "amplitude"):
            raise TypeError(
                f"seas[{number}] is of type {type(sea).__name__} and has no amplitude, "
                "frequency_rad_s and phase_rad: of a Sea take its roll_moment"
            )
        row = [np.asarray(x, float) for x in (sea.amplitude, sea.frequency_rad_s, sea.phase_rad)]
        shapes = {x.shape for x in row} | ({rows[0][0].shape} if rows else set())
        if len(shapes) > 1 or row[0].ndim != 1:
            raise ValueError(
                f"seas[{number}]: amplitude, frequency and phase must be of one shape (m,), the "
                f"same for all seas, got {', '.join(map(str, sorted(shapes)))}"
            )
        rows.append(row)
    if not rows:
        raise ValueError("seas is empty: give one sea or more")
    return WaveMoment(*(np.stack(column) for column in zip(*rows, strict=True)))
