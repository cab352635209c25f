"""Judgement of one tick, as values that nobody can change."""

from dataclasses import dataclass
from typing import Final

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.safety.supervisor import Demand


@dataclass(slots=True, eq=False)
class Judgement:
    """What the controller obeys in one tick.

    Attributes
    ----------
    mode, fault : Mode, Fault
        As `Supervisor` has them.
    demand : Demand
    drive_wanted : bool
        Whether the drive should be in operation enabled.
    motion : int
        Place of the motion sensor that is to be used.
    share : float
        Share of the greatest pressure that is allowed by what is degraded.
    unconfirmed_share : float or None
        Share that is allowed in its place until the water was seen to move as roll and pressure
        push it; None from then on.
    standing : int
        Conditions of the fault table that hold, bits of `judging.standing`.
    passive_roll_rad : float
        What the ship would roll without the pump; NaN if that is not known.
    """

    mode: Final[Mode]
    fault: Final[Fault]
    demand: Final[Demand]
    drive_wanted: Final[bool]
    motion: Final[int]
    share: Final[float]
    unconfirmed_share: Final[float | None]
    standing: Final[int]
    passive_roll_rad: Final[float]
