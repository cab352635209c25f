"""The waves' roll moment as rotating phasors, one for each component."""

from typing import Protocol

import numpy as np

from utank_hil.arrays import ComplexArray
from utank_hil.sea import Harmonics
from utank_hil.tick import TICK_S

AHEAD_TICKS = 2
"""The plant interpolates the moment between four ticks, of which the last is so far ahead."""


class Waves(Protocol):
    """Wave components at the ship."""

    def at(self, tick: int) -> tuple[ComplexArray, ComplexArray]:
        """Phasors at `AHEAD_TICKS` after a tick, and their turn in a tick.

        The caller turns the phasors by one tick after each call, four times after the first of all:
        those begin `AHEAD_TICKS` + 1 before.
        """


class SteadyWaves:
    """Components that stay as they are.

    Parameters
    ----------
    moment : Harmonics
        Roll moment in N m, from the start on.
    """

    def __init__(self, moment: Harmonics) -> None:
        frequency, phase = moment.frequency_rad_s, moment.phase_rad
        self._rotations = np.exp(1j * frequency * TICK_S)
        self._phasors = moment.amplitude * np.exp(1j * (phase - AHEAD_TICKS * frequency * TICK_S))

    def at(self, tick: int) -> tuple[ComplexArray, ComplexArray]:  # noqa: ARG002, always the same
        """The same phasors at every tick, turned by the caller."""
        return self._phasors, self._rotations
