"""Judgement of one tick, as values that nobody can change."""

from dataclasses import dataclass
from typing import Final

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.safety.supervisor import Demand


@dataclass(slots=True, eq=False)
class Judgement:
    """What the controller obeys in one tick."""

    #: mode, fault: as `Supervisor` has them.
    mode: Final[Mode]
    fault: Final[Fault]
    demand: Final[Demand]
    drive_wanted: Final[bool]  #: Whether the drive should be in operation enabled.
    motion: Final[int]  #: Place of the motion sensor that is to be used.
    share: Final[float]  #: Share of the greatest pressure that is allowed by what is degraded.
    #: Share that is allowed in its place until the water was seen to move as roll and pressure push
    #: it; None from then on.
    unconfirmed_share: Final[float | None]
    standing: Final[int]  #: Conditions of the fault table that hold, bits of `judging.standing`.
    #: What the ship would roll without the pump; NaN if that is not known.
    passive_roll_rad: Final[float]
