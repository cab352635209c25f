"""Heel removal at the quay: water is pumped across now and then, and a shut valve holds it.

While cargo is worked the ship heels slowly, and the anti-roll tank is used as a heeling tank. With
the water held where it is, a level h heels a ship of stiffness k by ::

    heel = rho g At L h / k          (`heel_per_m`; k with the water at rest)

Each pumping begins with the valve shut and ends so:

1. The mean heel is off its target by more than `start_rad`: the level that takes most of it away
   follows from the stiffness, within the level that tank and pump can hold.
2. The valve opens a little. It throttles so much that the water creeps: it does not swing, and what
   it does while the valve shuts after a fault is small.
3. As soon as the valve has left its seat the pump holds the water against gravity, and presses
   `FLOW_SHARE` of its limit more towards that level.
4. At the level the valve shuts, then the pressure ends. After a pause, in which the heel becomes
   known, this goes on until the heel is within `stop_rad`.

The water's balance with a throttle of loss z is quasi-static: P = 2 rho g h - rho g L heel + z v^2.
"""

import math
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Annotated, Final, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.elementary import exp
from utank_hil.base.parameters import Checked, ParameterError, Problem, Range, SampleTime
from utank_hil.control.interface import PRESSURE, VALVE, BuiltLaw, DesignPlant
from utank_hil.control.semi_active import valve_range
from utank_hil.dynamics.linear import coupled_matrices

SETTLED_PERIODS: Final = 5.0
"""Roll periods after which the mean heel has followed a step to 4 %."""
LEVEL_SHARE: Final = 0.9
"""Of `PumpLimits.level_m`: the rest is for what sloshes while the ship rolls a little."""
FLOW_SHARE: Final = 0.2
"""Of the pump's pressure limit: what moves the water, beside what holds it."""
SLOW: Final = 4.0
"""The throttled water follows the pressure with twice this many times its natural frequency."""
STEP_SHARE: Final = 0.7
"""Of the heel that is left: so pumpings converge on ships of 0.35 of the stiffness and more."""
LEAST_STEP_M: Final = 0.02
"""A level that gauges tell from noise; a smaller step is not begun."""
SEATED: Final = 100.0
"""A valve of so many times the loss that is asked for, a tenth of the opening, counts as shut."""
PATIENCE: Final = 3.0
"""So many times the time that a pumping should take it may take."""


class MeanHeel:
    """Mean of the roll: two low-passes. With a lag of a roll period they leave 2.5 % of it."""

    def __init__(self, lag_s: float, period_s: float) -> None:
        self._share = 1 - exp(-period_s / lag_s)
        self._first_rad = math.nan
        self.heel_rad = math.nan

    def update(self, roll_rad: float) -> None:
        """Take the roll of a period."""
        if self.heel_rad != self.heel_rad:
            self._first_rad = self.heel_rad = roll_rad
        self._first_rad += self._share * (roll_rad - self._first_rad)
        self.heel_rad += self._share * (self._first_rad - self.heel_rad)


@dataclass(frozen=True, slots=True)
class HeelingTank:
    """What heel removal needs to know of ship and tank."""

    roll_period_s: float
    heel_per_m: float  #: Heel in rad by a level of 1 m that is held.
    hold_pa_m: float  #: Pressure that holds a level in an upright ship.
    push_pa_rad: float  #: Pressure of the water by a heel.
    flow_pa: float  #: Pressure that moves the water.
    flow_m_s: float  #: Rate of the level that it makes.
    most_m: float  #: Greatest level, either way.

    @classmethod
    def of(cls, plant: DesignPlant) -> "HeelingTank":
        """What follows from a plant."""
        tank, limits = plant.tank, plant.limits
        (k11, k12), (_, k22) = coupled_matrices(plant.ship, tank)[2].tolist()
        hold_pa_m, flow_pa = k22 / tank.reservoir_area_m2, FLOW_SHARE * limits.pressure_pa
        inertia = tank.density_kg_m3 * tank.effective_length_m
        return cls(
            2 * math.pi / plant.ship.natural_frequency_rad_s,
            -k12 / k11,
            hold_pa_m,
            -k12 / tank.reservoir_area_m2,
            flow_pa,
            flow_pa / (SLOW * tank.natural_frequency_rad_s * inertia),
            min(LEVEL_SHARE * limits.level_m, (limits.pressure_pa - flow_pa) / hold_pa_m),
        )

    @property
    def throttle_loss(self) -> float:
        """Loss of the valve while water is moved, in Pa per (m/s)^2 of dh/dt."""
        return self.flow_pa / (self.flow_m_s * self.flow_m_s)

    def balance_pa(self, level_m: float, roll_rad: float) -> float:
        """Pressure that holds the water in place."""
        return self.hold_pa_m * level_m - self.push_pa_rad * roll_rad


@dataclass(frozen=True, slots=True)
class HeelRemovalDesign(Checked, owner="heel removal"):
    """Heel removal at the quay as a law of a configuration."""

    target_rad: Annotated[float, Range(least=-0.1, most=0.1)] = 0.0  #: The heel that is wanted.
    #: Deviation of the mean heel from which on water is moved.
    start_rad: Annotated[float, Range(least=1e-3, most=0.04)] = 0.0087
    #: Deviation within which that ends.
    stop_rad: Annotated[float, Range(least=5e-4, most=0.02)] = 0.0026
    #: Least time from one pumping to the next; five roll periods if they take longer.
    pause_s: Annotated[float, Range(least=0, most=3600)] = 60.0
    #: Root mean square of the roll from which on the ship is not in harbour: nothing is armed, and
    #: what was armed ends.
    most_roll_rad: Annotated[float, Range(above=0, most=0.05)] = 0.0175
    sample_time_s: SampleTime = 0.1
    kind: Literal["heel_removal"] = "heel_removal"

    def _problems(self) -> list[Problem]:
        if self.stop_rad < self.start_rad:
            return []
        return [("stop_rad", f"must be below start_rad, {self.start_rad:g}, got {self.stop_rad:g}")]

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        valve = valve_range(plant)
        if valve.lets_go:
            raise ParameterError("", [("kind", f"needs a valve that holds; it {valve.lets_go}")])
        tank = HeelingTank.of(plant)
        can_rad = tank.heel_per_m * tank.most_m
        if can_rad < self.start_rad:
            reason = (
                f"is {self.start_rad:g}, and tank and pump remove {can_rad:.2g} rad at most: "
                "lower it, and stop_rad"
            )
            raise ParameterError("", [("start_rad", reason)])
        make = partial(HeelRemoval, self, tank, valve.shut_loss)
        return BuiltLaw(
            make, ("roll_rad", "level_m"), closes_loop=False, commands=(PRESSURE, VALVE)
        )


class Phase(Enum):
    """What is being done with the water."""

    HOLDS = "the valve is shut"
    MOVES = "the valve opens, and the pump moves the water"
    SHUTS = "the pump holds the water until the valve is shut"


class HeelRemoval:
    """Heel removal: pressure and valve loss, shape (2,), for roll and level."""

    starts_anew = True

    def __init__(self, design: HeelRemovalDesign, tank: HeelingTank, shut_loss: float) -> None:
        self.sample_time_s = design.sample_time_s
        self._design, self._tank, self._shut_loss = design, tank, shut_loss
        self._pause_s = max(design.pause_s, SETTLED_PERIODS * tank.roll_period_s)
        self.reset()

    def reset(self) -> None:
        """Begin with a shut valve and an unknown heel."""
        self.phase = Phase.HOLDS
        self._mean = MeanHeel(self._tank.roll_period_s, self.sample_time_s)
        self._loss = self._shut_loss
        self._since_s = self._longest_s = 0.0
        self._wanted_m = self._way = 0.0
        self._working = False

    def applied(self, u: FloatArray) -> None:
        """Take where the valve stands, by its loss."""
        self._loss = float(u[1])

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Return the pressure, and the loss that is wanted of the valve."""
        roll_rad, level_m = plausible(y).tolist()
        self._mean.update(roll_rad)
        self._since_s += self.sample_time_s
        tank = self._tank
        if self.phase is Phase.HOLDS and self._since_s >= self._pause_s:
            self._decide(level_m)
        elif self.phase is Phase.MOVES and (
            self._way * (self._wanted_m - level_m) <= 0 or self._since_s > self._longest_s
        ):
            self._enter(Phase.SHUTS)
        seated = self._loss > SEATED * tank.throttle_loss
        if self.phase is Phase.SHUTS and seated:
            self._enter(Phase.HOLDS)
        moves = self.phase is Phase.MOVES
        pressure_pa = 0.0
        if self.phase is not Phase.HOLDS and not seated:
            pressure_pa = tank.balance_pa(level_m, roll_rad)
            pressure_pa += self._way * tank.flow_pa * moves
        return np.array([pressure_pa, tank.throttle_loss if moves else self._shut_loss])

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._since_s = 0.0

    def _decide(self, level_m: float) -> None:
        """Begin a pumping if the heel asks for one and there is room for it."""
        design, tank = self._design, self._tank
        off_rad = self._mean.heel_rad - design.target_rad
        self._working = abs(off_rad) > (design.stop_rad if self._working else design.start_rad)
        if not self._working:
            return
        wanted_m = level_m - STEP_SHARE * off_rad / tank.heel_per_m
        self._wanted_m = min(max(wanted_m, -tank.most_m), tank.most_m)
        step_m = self._wanted_m - level_m
        if abs(step_m) < LEAST_STEP_M or step_m * off_rad > 0:  # nearly, or at its limit
            return
        self._way = math.copysign(1.0, step_m)
        self._longest_s = PATIENCE * (abs(step_m) / tank.flow_m_s + self._pause_s)
        self._enter(Phase.MOVES)
