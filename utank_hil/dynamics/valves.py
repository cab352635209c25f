"""Valve losses of a semi-active tank: a throttle in the duct or in the air pipe.

Both losses are quadratic in the flow speed, so the models take one number, the pressure loss per
``|dh/dt| dh/dt``. The air is treated as incompressible, which holds while the pressure across its
valve is well below atmospheric. A shut air valve (an air spring) is not modelled; a tight gate in
the duct holds the water where it is.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from utank_hil.base.parameters import Checked, Positive, Problem, Range
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

AIR_DENSITY_KG_M3 = 1.225  # ISO 2533, at sea level
STOPPING_S = 1e-3
"""Time to stop the water below which a valve is as good as closed. Chosen; no study."""
LOCKED = 1e30
"""Loss that stands for a shut, tight valve in the models: the water does not move at all."""


@dataclass(frozen=True, slots=True)
class ValveRange:
    """Range of a valve's loss."""

    open_loss: float  #: Smallest loss in Pa per (m/s)^2 of dh/dt.
    shut_loss: float  #: Greatest loss.
    #: Why the valve does not hold the water in place, without power too; empty if it does.
    lets_go: str = "is not known to hold the water"

    def __post_init__(self) -> None:
        if not 0 <= self.open_loss < self.shut_loss < math.inf:
            raise ValueError(
                f"a valve needs 0 <= open_loss < shut_loss, got {self.open_loss}, {self.shut_loss}"
            )


@dataclass(frozen=True, slots=True)
class Valve(Checked, owner="valve"):
    """Valve of a semi-active tank, with its actuator."""

    #: "duct": a gate in the duct. "air": an orifice in the air pipe between the reservoirs.
    kind: Literal["air", "duct"]
    #: Time from shut to open, and back.
    opening_time_s: Annotated[float, Range(least=0.05, most=60)]
    #: Open share that remains when the valve is shut.
    leakage: Annotated[float, Range(above=0, below=1)]
    #: "open" or "shut": the position without a command or power.
    fail_position: Literal["open", "shut"] = "open"
    pipe_area_m2: Positive | None = None  #: Area of an air valve, fully open.
    #: Coefficient of an air valve, see `air_valve_loss`.
    discharge_coefficient: Annotated[float, Range(above=0, most=1)] = 0.6

    def _problems(self) -> list[Problem]:
        if self.kind == "air" and self.pipe_area_m2 is None:
            return [("pipe_area_m2", "is required but missing: kind is air")]
        if self.kind == "duct" and self.pipe_area_m2 is not None:
            return [("pipe_area_m2", "is for kind: air; a gate in the duct has its area")]
        return []

    @property
    def fail_opening(self) -> float:
        """Opening of the fail position."""
        return 1.0 if self.fail_position == "open" else 0.0

    def loss(self, tank: Tank, opening: float) -> float:
        """Return the loss in Pa per (m/s)^2 of dh/dt at an opening from 0 (leakage) to 1."""
        share = self.leakage + (1 - self.leakage) * opening
        if self.pipe_area_m2 is None:
            return duct_valve_loss(tank, share)
        return air_valve_loss(tank, self.pipe_area_m2, share, self.discharge_coefficient)

    def opening(self, tank: Tank, loss: float) -> float:
        """Return the opening, 0 to 1, with the loss nearest to the given one."""
        if self.pipe_area_m2 is None:
            area_ratio = tank.reservoir_area_m2 / tank.duct_area_m2
            speed_ratio = math.sqrt(2 * loss / tank.density_kg_m3)
            share = area_ratio / (area_ratio + speed_ratio)
        else:
            least_loss = air_valve_loss(tank, self.pipe_area_m2, 1.0, self.discharge_coefficient)
            share = math.sqrt(least_loss / loss) if loss > least_loss else 1.0
        return min(max((share - self.leakage) / (1 - self.leakage), 0.0), 1.0)

    def range(self, tank: Tank) -> ValveRange:
        """Losses of the valve, open and shut, and whether it holds the water."""
        shut_loss, lets_go = self.loss(tank, 0.0), ""
        if self.kind == "air":
            lets_go = "is kind: air, and air yields: it must be kind: duct"
        elif self.fail_position == "open":
            lets_go = "has fail_position: open, and without power the water runs: it must be shut"
        elif shut_loss < locked_loss(tank):
            tight = self.leakage * math.sqrt(shut_loss / locked_loss(tank))
            lets_go = f"has leakage: {self.leakage:g}: to be tight it must be {tight:.1g} or less"
        return ValveRange(self.loss(tank, 1.0), shut_loss, lets_go)


def locked_loss(tank: Tank) -> float:
    """Loss from which a shut valve counts as tight.

    With a reservoir's full height across it the flow settles within half of `STOPPING_S`; on the
    first ship the level moves by less than 2 mm/s then.
    """
    head_pa = 2 * tank.density_kg_m3 * GRAVITY_M_S2 * tank.level_limit_m
    settling = tank.density_kg_m3 * tank.effective_length_m / STOPPING_S
    return settling * settling / head_pa


def added_damping_ratio(tank: Tank, loss: float, level_m: float) -> float:
    """Damping ratio that a valve adds to the free oscillation of the water in a fixed ship.

    It is that of the linear loss with the same energy per cycle of amplitude h = `level_m` at the
    natural frequency: 8 / (3 pi) omega h loss, with the loss in Pa per (m/s)^2 of dh/dt.
    """
    inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
    return 4 / (3 * math.pi) * level_m * loss / inertia_pa_s2_m


def valve_problems(tank: Tank, valve: Valve) -> list[Problem]:
    """Return why a tank can't have a valve: it must let some water pass, or be tight."""
    speed_m_s = tank.natural_frequency_rad_s * tank.level_limit_m
    inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
    shut_loss = valve.loss(tank, 0.0)
    if shut_loss * speed_m_s * STOPPING_S < inertia_pa_s2_m:
        return []
    if valve.kind == "duct" and shut_loss >= locked_loss(tank):
        return []
    reason = f"would stop the water within {1e3 * STOPPING_S:g} ms, as a closed one: raise it"
    return [("leakage" if valve.pipe_area_m2 is None else "pipe_area_m2", reason)]


def duct_valve_loss(tank: Tank, opening: float) -> float:
    """Loss in Pa per (m/s)^2 of dh/dt of a gate in the duct, by the Borda-Carnot law (1 / s - 1)^2.

    It adds to the tank's quadratic loss. The opening is the open fraction s of the duct's area,
    above 0 and up to 1; ValueError is raised for others.
    """
    _check_opening(opening)
    area_ratio = tank.reservoir_area_m2 / tank.duct_area_m2
    faster = (1 / opening - 1) * area_ratio
    return tank.density_kg_m3 / 2 * faster * faster


def air_valve_loss(
    tank: Tank, pipe_area_m2: float, opening: float, discharge_coefficient: float = 0.6
) -> float:
    """Loss in Pa per (m/s)^2 of dh/dt of an orifice in the air pipe between the reservoirs.

    It adds to the tank's quadratic loss.

    `opening` is the open fraction, above 0 and up to 1, of the pipe's area; `discharge_coefficient`
    is the contraction of the jet, 0.6 for a sharp edge. ValueError is raised if an argument is out
    of its range.
    """
    _check_opening(opening)
    for name, value in (
        ("pipe_area_m2", pipe_area_m2),
        ("discharge_coefficient", discharge_coefficient),
    ):
        if not value > 0:
            raise ValueError(f"air valve {name} must be positive, got {value}")
    jet_area = discharge_coefficient * opening * pipe_area_m2
    faster = tank.reservoir_area_m2 / jet_area
    return AIR_DENSITY_KG_M3 / 2 * faster * faster


def _check_opening(opening: float) -> None:
    if not 0 < opening <= 1:
        raise ValueError(f"valve opening must be above 0 and at most 1, got {opening}")
