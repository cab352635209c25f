"""Feedback linearization of roll with the tank's pump, thesis section 4.3.2.

The pump enters both accelerations of the nonlinear model (`utank_hil.dynamics.nonlinear`)::

    phi'' = f_phi + g_phi P,    h'' = f_h + g_h P,    g_phi = -m_c At / det,  g_h = m_phi At / det

both positive. The output s = phi + kL l sin(h / l), the roll angle itself for kL = 0, has relative
degree 2, and with c = cos(h / l)::

    s'' = f_phi + kL (c f_h - sin(h / l) h'^2 / l) + (g_phi + kL c g_h) P

    P = (-w^2 s - 2 zeta w s' - f_phi - kL (c f_h - sin(h / l) h'^2 / l)) / (g_phi + kL c g_h)

gives s'' + 2 zeta w s' + w^2 s = 0 in still water, exactly and at any angle. (4.11) is this with
kL = 0 and the opposite sign of its v; the thesis has l = 1 m.

The zero dynamics, the water's motion under s = 0, are::

    kL = 0:        h'' + g / (H + Lz) h = K_wave / m_c                        (4.10), no damping
    small angles:  (m_phi kL - m_c) h'' + b kL h' + (k_phi kL + rho g At L) h = -K_wave

so with kL = 0 the level oscillates undamped after a disturbance, and kL > 0 damps it by the ship's
damping, at the cost of the roll phi = -kL h. Sampling, delay and the pump's lag make kL = 0
unstable, and a small kL too with a tank as large as Patti-B's. So the pump may also brake the level
(`level_brake`), at the cost of some roll: P = ... - c_b h' gives::

    s'' + 2 zeta w s' + w^2 s = -2 zeta_h w_0 abs(m_c) / m_phi h',    w_0 = sqrt(g / (H + Lz))

which makes the zero dynamics h'' + 2 zeta_h w_0 h' + w_0^2 h = ... as long as the ship's own
stiffness is small against m_phi w_0^2. Neither law includes the reservoirs' limits: the pressure is
reduced to zero, and the tank left passive, while the swing sqrt(h^2 + (h' / w_t)^2), the amplitude
of the free water (w_t its natural frequency), goes from a soft to a hard limit.
"""

import math
from dataclasses import KW_ONLY, dataclass, field, fields
from typing import Literal

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import sine_cosine
from utank_hil.base.parameters import Checked, NotNegative, Positive, Problem, SampleTime, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.control.gain import slope_at_rest
from utank_hil.control.interface import BuiltLaw, DesignPlant, Memoryless
from utank_hil.dynamics import GRAVITY_M_S2, STATES, RollModel, RollShip, Tank


@dataclass(frozen=True, slots=True)
class FeedbackLinearizationDesign(Checked, owner="feedback linearization"):
    """Parameters of the law."""

    frequency_rad_s: Positive  #: w of the linear response of the output s.
    damping_ratio: Positive  #: zeta of that response.
    soft_level_m: Positive  #: Swing of the level up to which the law acts fully.
    #: Swing from which it does not act; both limits are within the reservoirs, or both beyond them
    #: for the law as printed, without reduction.
    hard_level_m: Positive
    shift_rad_m: NotNegative = 0.0  #: kL, zero or more.
    shift_length_m: Positive = 1.0  #: l.
    level_damping_ratio: NotNegative = 0.0  #: zeta_h; 0 for the exact linear response.
    kind: Literal["feedback_linearization"] = "feedback_linearization"

    def _problems(self) -> list[Problem]:
        if self.soft_level_m < self.hard_level_m:
            return []
        reason = f"must be below hard_level_m, got {self.soft_level_m} and {self.hard_level_m}"
        return [("soft_level_m", reason)]

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant; it does not include the plant's delay and lag."""
        parameters = {each.name: getattr(self, each.name) for each in fields(self)}
        law = FeedbackLinearization(**parameters, ship=plant.ship, tank=plant.tank)
        slope = slope_at_rest(law.controller, len(STATES))
        return BuiltLaw(law.controller, STATES, slope, at_rest=True)


@dataclass(frozen=True, slots=True)
class FeedbackLinearization(FeedbackLinearizationDesign):
    """The law and its model; it measures roll, roll rate, level and level rate.

    ValueError is raised if a parameter is out of its range, the reservoirs end between the soft and
    the hard limit of the level, or the pump does not affect the shifted output within the hard
    limit.
    """

    _: KW_ONLY
    ship: RollShip
    tank: Tank
    sample_time_s: SampleTime = TICK_S
    model: RollModel = field(init=False, repr=False, compare=False)
    _brake_pa_s_m: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        FeedbackLinearizationDesign.__post_init__(self)
        end_m = self.tank.level_limit_m
        if self.soft_level_m < end_m < self.hard_level_m:
            reason = (
                f"{self.hard_level_m}: the reservoirs end at {end_m:g} m, where the law would "
                "still act: lower it to that"
            )
            refuse("feedback linearization", [("hard_level_m", reason)])
        object.__setattr__(self, "model", RollModel(self.ship, self.tank))
        brake = level_brake(self.model, self.level_damping_ratio)
        object.__setattr__(self, "_brake_pa_s_m", brake)
        reach = min(self.hard_level_m, self.tank.level_limit_m)
        levels = np.linspace(0.0, reach, 201)
        grips = [self._grip(level) for level in levels.tolist()]
        if min(grips) < 0.1 * grips[0]:
            reason = (
                f"{self.shift_rad_m}: the pump loses its grip on phi + kL l sin(h / l) within "
                f"{reach} m of level: lower it, or raise shift_length_m"
            )
            refuse("feedback linearization", [("shift_rad_m", reason)])

    def pressure_pa(self, state: FloatArray, target_rad: float = 0.0) -> float:
        """Linearizing pressure, before reduction, for a target of the output and `STATES`."""
        _, phi_ddot, _, h_ddot = self.model.derivative(state).tolist()  # without the pump
        output, rate, drift = self._output(state.tolist(), phi_ddot, h_ddot)
        w = self.frequency_rad_s
        wanted = -w * w * (output - target_rad) - 2 * self.damping_ratio * w * rate
        brake = self._brake_pa_s_m * float(state[3])
        return (wanted - drift) / self._grip(float(state[2])) - brake

    def share(self, level_m: float, level_rate_m_s: float) -> float:
        """Share of the linearizing pressure allowed at this swing of the level, 0 to 1."""
        rate_m = level_rate_m_s / self.tank.natural_frequency_rad_s
        swing = math.sqrt(level_m * level_m + rate_m * rate_m)
        x = (self.hard_level_m - swing) / (self.hard_level_m - self.soft_level_m)
        x = min(max(x, 0.0), 1.0)
        return x * x * (3 - 2 * x)

    def controller(self) -> "FeedbackLinearizationController":
        """A new steppable controller."""
        return FeedbackLinearizationController(self)

    def _output(
        self, state: list[float], phi_ddot: float, h_ddot: float
    ) -> tuple[float, float, float]:
        """Output s, its rate, and its acceleration for given accelerations."""
        phi, phi_dot, h, h_dot = state
        shift, length = self.shift_rad_m, self.shift_length_m
        sin, cos = sine_cosine(h / length)
        return (
            phi + shift * length * sin,
            phi_dot + shift * cos * h_dot,
            phi_ddot + shift * (cos * h_ddot - sin * h_dot * h_dot / length),
        )

    def _grip(self, level_m: float) -> float:
        """Acceleration of s per pressure: g_phi + kL cos(h / l) g_h."""
        c = self.model.coefficients
        roll_inertia = c.inertia + c.inertia_h2 * level_m * level_m
        determinant = roll_inertia * c.level_inertia - c.coupling * c.coupling
        _, cos = sine_cosine(level_m / self.shift_length_m)
        shifted = self.shift_rad_m * cos * roll_inertia
        return c.area * (shifted - c.coupling) / determinant


def level_brake(model: RollModel, damping_ratio: float) -> float:
    """Pressure per level rate, in Pa s/m, against the flow, that gives the zero dynamics zeta_h."""
    c, tank = model.coefficients, model.tank
    frequency = math.sqrt(GRAVITY_M_S2 / (tank.height_m + tank.lz_m))
    inertia = (c.inertia * c.level_inertia - c.coupling * c.coupling) / (c.inertia * c.area)
    return 2 * damping_ratio * frequency * inertia


class FeedbackLinearizationController(Memoryless):
    """Stepping of a `FeedbackLinearization`, which has no memory."""

    def __init__(self, law: FeedbackLinearization) -> None:
        self.sample_time_s = law.sample_time_s
        self._law = law

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Reduced pressure, shape (1,), for the state `y`, shape (4,) and a scalar target of s."""
        law = self._law
        share = law.share(float(y[2]), float(y[3]))
        if share == 0.0:
            return np.zeros(1)
        target = 0.0 if reference is None else float(reference[0])
        return np.array([share * law.pressure_pa(y, target)])
