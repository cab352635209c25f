"""Roll stimulation: the pump rolls the ship in still water, for training and inclining tests.

The pressure is P = p(t) sin(w t). Its amplitude follows from the linear model's gain
G = abs(roll / P) at the wanted period, with a slow correction from the measured roll::

    p = m a(t) / G,    m' = (1 - abs(roll_w) / a) / T

where a(t) is the wanted amplitude, ramped in and out, and roll_w the roll's component at the
frequency w, from a lock-in with two low-pass filters. T is long against the decay of the free roll,
so that the correction does not respond to the ship's own transient. While the pressure is below the
command, and for a period after, m may fall but not grow, as growth would have no effect.

A planned end ramps out: after `duration_s`, or by a reference of 0. Beyond a roll or level limit
the pressure is zero at once and the tank passive. Either end lasts until `reset`.
"""

import math
from dataclasses import KW_ONLY, dataclass, fields
from typing import Annotated, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.elementary import sine_cosine
from utank_hil.base.parameters import Checked, Positive, Problem, Range, SampleTime, refuse
from utank_hil.control.interface import BuiltLaw, DesignPlant
from utank_hil.dynamics import STATES, RollShip, Tank, coupled_matrices

FACTOR = (0.25, 3.0)  # range of the correction m; beyond it the model is invalid
_ROLL, _LEVEL = STATES.index("roll_rad"), STATES.index("level_m")
SHORT = 0.01  # over the pressure's amplitude; a smaller shortfall is ignored


@dataclass(frozen=True, slots=True)
class StimulationDesign(Checked, owner="stimulation"):
    """Parameters of the wanted roll.

    ValueError is raised if a parameter is not positive, the amplitude is at or above the roll
    limit, or the duration ends within the ramp in.
    """

    #: Amplitude of the wanted roll.
    amplitude_rad: Annotated[float, Range(least=1e-3, most=0.5)]
    period_s: Annotated[float, Range(least=1, most=60)]  #: Period of the wanted roll.
    #: Time in which the amplitude goes from zero to full and back.
    ramp_s: Annotated[float, Range(least=1, most=600)]
    #: Roll at which the stimulation ends.
    roll_limit_rad: Annotated[float, Range(above=0, most=0.6)]
    correction_s: Positive = 120.0  #: T.
    #: Time from the beginning of the ramp in to that of the ramp out; infinite for no planned end.
    duration_s: Annotated[float, Range(above=0, infinite=True)] = math.inf
    kind: Literal["stimulate"] = "stimulate"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Plan the stimulation for a plant, within its limits; no loop is closed to reduce roll."""
        parameters = {each.name: getattr(self, each.name) for each in fields(self)}
        law = Stimulation(
            **parameters,
            ship=plant.ship,
            tank=plant.tank,
            pressure_pa=plant.limits.pressure_pa,
            level_limit_m=plant.limits.level_m,
        )
        return BuiltLaw(law.controller, STATES, closes_loop=False)

    def _problems(self) -> list[Problem]:
        problems = []
        if not self.amplitude_rad < self.roll_limit_rad:
            reason = f"{self.amplitude_rad} must be below roll_limit_rad {self.roll_limit_rad}"
            problems.append(("amplitude_rad", reason))
        if self.duration_s < self.ramp_s:
            reason = f"{self.duration_s} must be ramp_s {self.ramp_s} or more"
            problems.append(("duration_s", reason))
        return problems


@dataclass(frozen=True, slots=True)
class Stimulation(StimulationDesign):
    """A stimulation planned for a ship.

    ValueError is raised if a parameter is out of its range, or by the model the amplitude requires
    more pressure or level than is available.
    """

    _: KW_ONLY
    ship: RollShip
    tank: Tank
    pressure_pa: Positive  #: Greatest pressure.
    level_limit_m: Positive  #: Level at which the stimulation ends.
    sample_time_s: SampleTime = 0.02

    def __post_init__(self) -> None:
        StimulationDesign.__post_init__(self)
        refuse("stimulation", self._reach_problems())

    def _reach_problems(self) -> list[Problem]:
        roll, level = self.gains
        return [
            (
                "amplitude_rad",
                f"{self.amplitude_rad:.3g} at {self.period_s:.3g} s takes {needed:.4g}, {name} is "
                f"{limit:.4g}: roll less, or nearer to the natural period",
            )
            for name, needed, limit in (
                ("pressure_pa", self.amplitude_rad / roll, self.pressure_pa),
                ("level_limit_m", self.amplitude_rad * level / roll, self.level_limit_m),
            )
            if needed > limit
        ]

    @property
    def gains(self) -> tuple[float, float]:
        """Amplitudes of roll and level per amplitude of the pressure, rad/Pa and m/Pa."""
        mass, damping, stiffness = coupled_matrices(self.ship, self.tank)
        w = math.tau / self.period_s
        impedance = stiffness - w**2 * mass + 1j * w * damping
        roll, level = np.linalg.solve(impedance, [0.0, self.tank.reservoir_area_m2])
        return float(abs(roll)), float(abs(level))

    def controller(self) -> "StimulationController":
        """Return a new controller with its ramp at zero."""
        return StimulationController(self)


class StimulationController:
    """Stepping of a `Stimulation`.

    `passed_limit` is the measurement of `STATES` that passed its limit and ended the stimulation,
    or empty; `amplitude_rad` is the measured amplitude of roll at the wanted period.
    """

    starts_anew = True

    def __init__(self, plan: Stimulation) -> None:
        self.sample_time_s = plan.sample_time_s
        self._plan = plan
        self._turn = math.tau / plan.period_s * plan.sample_time_s
        self._share = plan.sample_time_s / plan.period_s  # lock-in's low-pass: one period
        self._share_of_correction = plan.sample_time_s / plan.correction_s
        self._period_steps = math.ceil(plan.period_s / plan.sample_time_s)
        self._pressure_per_roll = 1 / plan.gains[0]
        self.reset()

    def reset(self) -> None:
        """Return to the initial state, ready to ramp in."""
        self.passed_limit = ""
        self.amplitude_rad = 0.0
        self._wanted_rad = 0.0
        self._factor = 1.0
        self._steps = 0
        self._steps_in_charge = 0
        self._steps_to_growth = 0  # until the correction may grow
        self._first = self._second = complex(0.0)
        self._size_pa = self._command_pa = 0.0

    @property
    def ended(self) -> bool:
        """Whether a limit was passed, or the duration and its ramp out are over."""
        return bool(self.passed_limit) or (self._time_is_over and self._wanted_rad == 0)

    @property
    def _time_is_over(self) -> bool:
        return self._steps_in_charge * self.sample_time_s >= self._plan.duration_s

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure, shape (1,), for `y` = (roll, roll rate, level, level rate).

        `reference`, one number, overrides the wanted amplitude: 0 ramps out.
        """
        plan, y = self._plan, plausible(y)
        self._lock_in(float(y[0]))
        if not self.ended and self._steps_in_charge > 1:  # not while another law is active
            self.passed_limit = self._beyond(y)
        target = plan.amplitude_rad if reference is None else abs(float(reference[0]))
        target = 0.0 if self._time_is_over else min(target, plan.roll_limit_rad)
        change = plan.amplitude_rad * plan.sample_time_s / plan.ramp_s
        self._wanted_rad += min(max(target - self._wanted_rad, -change), change)
        if self.passed_limit:  # at once, as any pressure could increase the excess
            self._wanted_rad = 0.0
        self._correct(target)
        size = self._factor * self._wanted_rad * self._pressure_per_roll
        if size > plan.pressure_pa:
            size = plan.pressure_pa
            self._steps_to_growth = self._period_steps
        self._size_pa = size
        self._command_pa = size * sine_cosine(self._turn * self._steps)[0]
        self._steps += 1
        self._steps_in_charge += 1
        return np.array([self._command_pa])

    def applied(self, u: FloatArray) -> None:
        """Restart from zero if none of the last command was sent, and note a shortfall."""
        left, asked = float(u[0]), self._command_pa
        if left == 0 and asked != 0:  # another law is active
            self._wanted_rad = 0.0
            self._steps_in_charge = 0
        elif abs(left - asked) > SHORT * self._size_pa:
            self._steps_to_growth = self._period_steps

    def _beyond(self, y: FloatArray) -> str:
        """Name of `STATES` that is beyond its limit, or empty."""
        if abs(y[_ROLL]) > self._plan.roll_limit_rad:
            return STATES[_ROLL]
        if abs(y[_LEVEL]) > self._plan.level_limit_m:
            return STATES[_LEVEL]
        return ""

    def _correct(self, target_rad: float) -> None:
        """Adapt the correction m to the measured amplitude."""
        held = self._steps_to_growth > 0
        self._steps_to_growth -= held
        if self._wanted_rad == target_rad > 0:
            change = self._share_of_correction * (1 - self.amplitude_rad / target_rad)
            self._factor += min(change, 0.0) if held else change
            self._factor = min(max(self._factor, FACTOR[0]), FACTOR[1])

    def _lock_in(self, roll_rad: float) -> None:
        sine, cosine = sine_cosine(self._turn * self._steps)
        turned = complex(roll_rad * cosine, -roll_rad * sine)
        self._first += self._share * (turned - self._first)
        self._second += self._share * (self._first - self._second)
        in_phase, behind = self._second.real, self._second.imag
        self.amplitude_rad = 2 * math.sqrt(in_phase * in_phase + behind * behind)
