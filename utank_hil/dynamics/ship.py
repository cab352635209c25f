"""The ship in roll: inertia, damping and restoring."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RollShip:
    """A ship that only rolls, without its tank water.

    Parameters
    ----------
    inertia_kg_m2 : float
        Roll inertia I about the centre of gravity, added inertia included.
    stiffness_nm_rad : float
        Hydrostatic restoring moment k1 per roll angle.
    damping_nms_rad : float
        Linear roll damping d1.

    Raises
    ------
    ValueError
        If inertia or stiffness is not positive, or the damping is negative.
    """

    inertia_kg_m2: float
    stiffness_nm_rad: float
    damping_nms_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("inertia_kg_m2", "stiffness_nm_rad"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"ship {name} must be positive and finite, got {value}")
        if not (math.isfinite(self.damping_nms_rad) and self.damping_nms_rad >= 0):
            raise ValueError(
                f"ship damping_nms_rad must be zero or more, got {self.damping_nms_rad}"
            )

    @property
    def natural_frequency_rad_s(self) -> float:
        """Natural roll frequency without the tank."""
        return math.sqrt(self.stiffness_nm_rad / self.inertia_kg_m2)
