"""Laws without memory: a constant gain on the newest measurement, u = -K (y - reference), or none.

PD control of the level, thesis (3.5), makes the tank the best passive one by its pump:
P = -k h - c h', with k and c such that the water in a ship held still has the frequency and damping
ratio of `passive_optimum`. The pump changes the water's stiffness and loss, but not the coupling of
ship and water. Of a tank with quadratic loss, c is what that leaves to be done (`MissingLoss`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Final, Literal

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import Checked, Problem, Range, SampleTime
from utank_hil.control.interface import BuiltLaw, Controller, DesignPlant, Memoryless
from utank_hil.control.optimal_tank import passive_optimum, ship_ratios
from utank_hil.dynamics import RollShip, Tank, coupled_matrices
from utank_hil.dynamics.sampling import LinearModel

STEP: Final = 1e-6
"""Step to either side, in the unit of each input; far below the noise of a sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class GainLaw(Checked, owner="gain law"):
    """Constant feedback of the measured outputs, u(k) = -K y(k-1), with K of shape (r, m)."""

    gain: FloatArray
    sample_time_s: SampleTime

    def _problems(self) -> list[Problem]:
        if self.gain.ndim == 2 and np.isfinite(self.gain).all():
            return []
        return [("gain", f"must be a matrix of finite numbers, got {self.gain.tolist()}")]

    def controller(self) -> "GainController":
        """A new steppable controller."""
        return GainController(self)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        response: ComplexArray = -self.gain / np.asarray(z)[:, None, None]
        return response

    def matrices(self) -> LinearModel:
        """State-space model from y to u; its states are the last measurement."""
        inputs, outputs = self.gain.shape
        return LinearModel(
            np.zeros((outputs, outputs)),
            np.eye(outputs),
            -self.gain,
            np.zeros((inputs, outputs)),
            self.sample_time_s,
        )


class GainController(Memoryless):
    """Stepping of a `GainLaw`, which has no memory."""

    def __init__(self, law: GainLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._gain = -law.gain

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return -K (y - reference)."""
        error = y if reference is None else y - reference
        return product(self._gain, error)


def slope_at_rest(controller: Callable[[], Controller], inputs: int) -> GainLaw:
    """Linearize a law at rest, as a law of constant gain.

    A law that is unstable for the smallest roll is unstable, so its slope about rest must have the
    margins of a linear law. A law that adapts is linearized with its initial parameters.

    The first command of the controller must depend on its first measurement alone. ValueError is
    raised if the slope is not finite.
    """
    columns = []
    for push in STEP * np.eye(inputs):
        up, down = (controller().step(sign * push) for sign in (1.0, -1.0))
        columns.append((up - down) / (2 * STEP))
    slope = np.column_stack(columns)
    if not np.isfinite(slope).all():
        raise ValueError("its answer at rest overflows")
    return GainLaw(-slope, controller().sample_time_s)


@dataclass(slots=True, eq=False)
class PassiveController(Memoryless, Checked, owner="passive"):
    """Zero pressure for each of `inputs` pumps, for any measurement."""

    inputs: Annotated[int, Range(least=1)] = 1
    sample_time_s: SampleTime = 0.2

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Return zero pressure, shape (r,)."""
        return np.zeros(self.inputs)


@dataclass(frozen=True, slots=True)
class PassiveDesign:
    """The passive tank as a law of a configuration."""

    kind: Literal["passive"] = "passive"

    def build(self, plant: DesignPlant) -> BuiltLaw:  # noqa: ARG002, the same for all
        """Return zero pressure; there is no loop."""
        return BuiltLaw(PassiveController, ("roll_rad",), closes_loop=False)


PD_MEASURED: Final = ("level_m", "level_rate_m_s")


def design_pd(ship: RollShip, tank: Tank, sample_time_s: float = 0.02) -> GainLaw:
    """PD law on `PD_MEASURED` that gives the tank its best frequency and damping.

    The gains assume no delay, so the sample time must be short against the roll period.
    """
    ratios, ship_frequency = ship_ratios(ship, tank)
    best = passive_optimum(ratios)
    mass, damping, stiffness = (matrix[1, 1] for matrix in coupled_matrices(ship, tank))
    frequency = best.frequency_ratio * ship_frequency
    spring = mass * frequency * frequency - stiffness
    loss = 2 * best.damping_ratio * frequency * mass - damping
    return GainLaw(np.array([[spring, loss]]) / tank.reservoir_area_m2, sample_time_s)


@dataclass(frozen=True, slots=True)
class PDDesign:
    """PD on the level as a law of a configuration."""

    kind: Literal["pd"] = "pd"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        tank = plant.calm or plant.tank
        law, quadratic = design_pd(plant.ship, tank), tank.quadratic_loss_pa_per_m2_s2
        if not quadratic:
            return BuiltLaw(law.controller, PD_MEASURED, law)
        return BuiltLaw(partial(MissingLoss, law, quadratic), PD_MEASURED, law, at_rest=True)


class MissingLoss(Memoryless):
    """PD on the level of a tank of quadratic loss: the pump adds the loss that the tank lacks.

    `quadratic` is in Pa per (m/s)^2 of the level's rate. In fast water the tank has the loss of the
    best one by itself and the pump adds none; it never drives the water for having more.
    """

    def __init__(self, law: GainLaw, quadratic: float) -> None:
        self.sample_time_s = law.sample_time_s
        self._spring, self._loss = law.gain[0].tolist()
        self._quadratic = quadratic

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return the pressure, shape (1,), for level and rate about the reference."""
        level, rate = (y if reference is None else y - reference).tolist()
        lacking = max(self._loss - self._quadratic * abs(rate), min(self._loss, 0.0))
        return np.array([-(self._spring * level + lacking * rate)])
