"""The pump pulses of a commissioning: how strong, how long, and the law that gives them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.commissioning.precision import deviations

ROW_TICKS: Final = 5
ROW_S: Final = ROW_TICKS * TICK_S
"""A row is the mean of so much time, also where the loop left out a tick of it."""
MOST_S: Final = 600.0
"""Of pulses, unless once takes longer."""
LEVEL_SHARE: Final = 0.2
"""Greatest level of the plan, as a share of the limit of the level."""
MOST_ROLL_RAD: Final = 0.035
"""Greatest roll of the plan, 2 degrees."""
PRESSURE_SHARE: Final = 0.12
"""Greatest pressure, as a share of its limit: below what the monitors judge a pump by."""
NARROW: Final = 0.3
"""Opening to which a valve is brought."""
STROKE_SPARE_S: Final = 1.0

SHAPE: Final = ((1.0, 1.0), (-1.0, 0.5), (1.0, 0.5), (-1.0, 0.5), (0.0, 2.0))
"""Pulses as a sign and a length in periods of the tank; to starboard first, then water at rest."""
SHAPE_PERIODS: Final = sum(periods for _, periods in SHAPE)


@dataclass(frozen=True, slots=True)
class PulsePlan:
    """What the pump is to do, and what the files say that comes of it."""

    pressure_pa: float  #: Pressure of each pulse.
    period_s: float  #: Period of the tank.
    #: level_m, roll_rad: greatest level and roll that the linear model predicts.
    level_m: float
    roll_rad: float
    of_noise: FloatArray  #: Its `deviations` of the scales by noise.
    push_pa: float = 0.0  #: Pressure before the stop that is timed.
    times: int = 1  #: How often `SHAPE` is gone through.

    @property
    def duration_s(self) -> float:
        """Length of all pulses and of the rest after them."""
        return self.times * self.period_s * SHAPE_PERIODS

    @property
    def most_times(self) -> int:
        """How often `SHAPE` is gone through at most."""
        return max(int(MOST_S / (self.period_s * SHAPE_PERIODS)), 1)

    def pressure_at(self, time_s: float) -> float:
        """Pressure at a time since the first pulse began; zero after the last one."""
        if time_s < self.duration_s:
            time_s %= self.period_s * SHAPE_PERIODS
        for sign, periods in SHAPE:
            time_s -= periods * self.period_s
            if time_s < 0:
                return sign * self.pressure_pa
        return 0.0


def plan_pulses(plant: DesignPlant) -> PulsePlan:
    """Pulses for a plant, as strong as the shares of this module allow."""
    period_s = 2 * math.pi / plant.tank.natural_frequency_rad_s
    unit = PulsePlan(1.0, period_s, 0.0, 0.0, np.zeros((2, 2)))
    step_s = round(period_s / 200 / TICK_S + 0.5) * TICK_S
    model = plant.sampled(("level_m", "roll_rad"), step_s)
    state = np.zeros(len(model.A))
    peak = np.zeros(2)
    for index in range(math.ceil(unit.duration_s / step_s)):
        peak = np.maximum(peak, np.abs(model.C @ state))
        state = model.A @ state + model.B[:, 0] * unit.pressure_at(index * step_s)
    level_per_pa, roll_per_pa = peak.tolist()
    limits = plant.limits
    pressure_pa = min(
        LEVEL_SHARE * limits.level_m / level_per_pa,
        MOST_ROLL_RAD / roll_per_pa,
        PRESSURE_SHARE * limits.pressure_pa,
    )
    level_m, roll_rad = level_per_pa * pressure_pa, roll_per_pa * pressure_pa
    push_pa = PRESSURE_SHARE * limits.pressure_pa
    rows = range(round(unit.duration_s / ROW_S))
    command_pa = np.array([pressure_pa * unit.pressure_at(row * ROW_S) for row in rows])
    of_noise = deviations(command_pa, plant, ROW_S)
    return PulsePlan(pressure_pa, period_s, level_m, roll_rad, of_noise, push_pa)


@dataclass(frozen=True, slots=True)
class ValveStroke:
    """A valve's way to a narrow opening, and back."""

    opening: float  #: The narrow opening.
    loss: float  #: Loss of that opening in Pa per (m/s)^2.
    hold_s: float  #: Time for either way.

    @property
    def duration_s(self) -> float:
        """Time of both ways."""
        return 2 * self.hold_s

    def loss_at(self, time_s: float) -> float:
        """Loss at a time since the stroke began; the valve is open before and after."""
        return self.loss if 0 <= time_s < self.hold_s else 0.0


def plan_stroke(valve: Valve, tank: Tank) -> ValveStroke:
    """The stroke that shows a valve's way; a second longer than it needs."""
    loss = valve.loss(tank, NARROW)
    return ValveStroke(valve.opening(tank, loss), loss, valve.opening_time_s + STROKE_SPARE_S)


class PulseLaw:
    """A law that answers what it was set to; `commands` are as in `BuiltLaw`."""

    sample_time_s = TICK_S

    def __init__(self, commands: tuple[str, ...]) -> None:
        self.commands = commands
        self._command = np.zeros(len(commands))

    def set(self, command: Mapping[str, float]) -> None:
        """Take what the next steps are to answer, by name; others are left out."""
        self._command = np.array([command[name] for name in self.commands])

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """The command as it was set."""
        return self._command

    def applied(self, u: FloatArray) -> None:
        """Nothing depends on it."""

    def reset(self) -> None:
        """Zero."""
        self._command = np.zeros(len(self.commands))
