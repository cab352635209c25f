"""Exceedance of amplitudes: of a record, and by the Rayleigh distribution of a narrow band."""

import numpy as np

from utank_hil.base.arrays import FloatArray


def exceedance(signal: FloatArray, levels: FloatArray) -> FloatArray:
    """Share of single amplitudes of a record above each level, shape (k,).

    A single amplitude is the largest deviation from the mean between two crossings of it, to either
    side. The parts before the first crossing and after the last are left out. Raises `ValueError`
    if the record crosses its mean less than twice.
    """
    centred = signal - signal.mean()
    crossings = np.flatnonzero(np.diff(np.signbit(centred))) + 1
    if len(crossings) < 2:
        raise ValueError("the record holds no whole half-cycle: exceedance needs a longer one")
    size = np.abs(centred[: crossings[-1]])
    amplitudes = np.maximum.reduceat(size, crossings[:-1])
    share: FloatArray = np.mean(amplitudes[:, None] > np.asarray(levels), axis=0)
    return share


def rayleigh_exceedance(standard_deviation: float, levels: FloatArray) -> FloatArray:
    """Share exp(-x^2 / 2 s^2) of amplitudes above x, for a narrow-banded Gaussian motion.

    Longuet-Higgins (1952), "On the statistical distribution of the heights of sea waves".
    """
    share: FloatArray = np.exp(-np.square(levels) / (2 * standard_deviation**2))
    return share
