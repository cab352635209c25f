"""Repetition: whether the samples of a motion sensor are some that came before.

A gateway that hangs, or a replay, sends intact frames whose counters go on. The noise of a sensor
is several steps of the message, so that no second stretch of samples is equal to an earlier one.
Samples that are all the same are judged by themselves: a sensor without noise sends them where
nothing moves. Only after samples that differed they say that it is frozen.
"""

import math
from typing import Final

REPEATED_SAMPLES: Final = 32
"""So many in a row, each unlike the one before it, equal those some constant time ago."""
FROZEN_SAMPLES: Final = 100
"""So many in a row are the same."""
NOISY_SHARE: Final = 0.9
"""Of the samples before them differed from their neighbours, by the sensor's noise."""
MIXED: Final = 7.0
"""Roll and seven times its rate make one number: one comparison in a tick in the place of two."""


class Repetition:
    """The samples so far, and how many in a row are those of an earlier time.

    Parameters
    ----------
    samples : int
        How far back a sample is remembered.

    Attributes
    ----------
    found : bool
        Whether the samples repeat.
    frozen : bool
        Whether the last samples were all the same to the last bit, and those before them were not.
    """

    def __init__(self, samples: int) -> None:
        self._last_place = samples - 1
        self._kept = [math.nan] * samples
        self._place_of: dict[float, int] = {}
        self._place = self._lag = self._run = self._same = 0
        self.found = self.frozen = False

    def take(self, roll_rad: float, rate_rad_s: float) -> None:
        """Take the next sample."""
        sample = roll_rad + MIXED * rate_rad_s
        place, kept, place_of = self._place, self._kept, self._place_of
        before = place_of.get(sample)
        if before is not None or self._lag:
            self._follow(sample, place, before)
        place_of.pop(kept[place], None)
        kept[place] = sample
        place_of[sample] = place
        self._place = place + 1 if place < self._last_place else 0

    def _follow(self, sample: float, place: int, before: int | None) -> None:
        """Count a sample that came before, or with which what was counted ends."""
        kept = self._kept  # a place below zero counts from the end, as in a ring
        if self._lag and kept[place - self._lag] == sample:
            if sample != kept[place - 1]:
                self._run += 1
            elif self._lag == 1:
                self._same += 1
        else:
            self._run = self._same = 0
            self._lag = 0 if before is None else (place - before) % len(kept) or len(kept)
        self.found = self._run >= REPEATED_SAMPLES
        if self._same < FROZEN_SAMPLES:
            self.frozen = False
        elif self._same == FROZEN_SAMPLES:
            self.frozen = self._was_noisy(place)

    def _was_noisy(self, place: int) -> bool:
        """Whether the samples that are kept from before a standstill differed."""
        kept = self._kept
        first = place - FROZEN_SAMPLES - 1  # of those that are the same; a ring goes on below zero
        older = range(first, place - self._last_place, -1)
        differed = sum(kept[k - 1] < kept[k] or kept[k - 1] > kept[k] for k in older)
        return differed > NOISY_SHARE * len(older)
