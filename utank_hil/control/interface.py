"""What every controller, every linear law and every design of a law is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.sampling import LinearModel

PRESSURE: Final = "pressure_pa"
VALVE: Final = "valve_loss"


class Controller(Protocol):
    """Steppable controller.

    Timing: `step` is called with the measurement at t_k and its answer is commanded at once; it
    acts on the plant from t_k + delay on, until the answer of the next step takes over. A
    controller that is not in charge is stepped all the same and gets through `applied` what was
    commanded instead; it can then take over without a bump.

    Attributes
    ----------
    sample_time_s : float
        Time between two calls of `step`.
    """

    sample_time_s: float

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement `y`, shape (m,), and return the command, shape (r,).

        `reference` is the target of the outputs, zero where it is not given.
        """

    def applied(self, u: FloatArray) -> None:
        """Tell the controller the command, shape (r,), that left after limits or another law."""

    def reset(self) -> None:
        """Forget the past: as newly built."""


@runtime_checkable
class Plans(Protocol):
    """A controller that searches for a plan each sample, within limits and a budget.

    Attributes
    ----------
    fallbacks : int
        How often since its reset the budget did not suffice and the last plan went on.
    """

    fallbacks: int

    def allow(self, share: float) -> None:
        """Tell the share of its pressure limit that the next plan may use."""


@runtime_checkable
class StartsAnew(Protocol):
    """A controller that is reset when an operator arms it, or resets a fault.

    Its memory is of its own doing: how far its ramp got, that it has ended, what it learnt while in
    charge. Other controllers remember the ship. They are stepped all the while, know it at once
    and would lose that by a reset.

    Attributes
    ----------
    passed_limit : str
        Which measurement, a name of `STATES`, passed a limit of the law's own: it answers zero
        pressure until it is reset. Empty if none did.
    """

    passed_limit: str

    def reset(self) -> None:
        """Forget the past: as newly built."""


class LinearLaw(Protocol):
    """A linear law from outputs y to command u, in the timing of `utank_hil.control.arx`.

    What design functions of linear controllers return, and what `utank_hil.analysis.loop` looks at.

    u(k) is made from y(k-1), y(k-2), ..., y(k-1) being the newest measurement: a law that a
    controller can step is strictly proper in this count, D = 0. A law x+ = A x + B y, u = C x + D y
    with the newest measurement as y, as control libraries give it, has to be shifted by this one
    sample first: `utank_hil.control.state_space.StateSpaceLaw` does it.
    """

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix at the points `z`, shape (N,); shape (N, r, m)."""

    def matrices(self) -> LinearModel:
        """The law from y to u as a discrete state-space model."""

    def controller(self) -> Controller:
        """A new steppable controller, at rest."""


@dataclass(frozen=True, slots=True)
class BuiltLaw:
    """A law designed for a plant.

    Attributes
    ----------
    controller : callable
        Makes a new `Controller`, at rest.
    measured : tuple of str
        What the controller measures, in order; names of `STATES`.
    linear : LinearLaw or None
        The law for the analysis of its loop, from `linear_measured` to the pressure.
    at_rest : bool
        The law is not linear, and `linear` is its slope at rest.
    adapts : bool
        The law changes while it runs, and `linear` is what it starts from.
    closes_loop : bool
        The law feeds measurements back. If it does and `linear` is None, its loop is judged by its
        impulse response.
    unjudged : str
        Why its loop can't be judged; empty where it can, or need not.
    commands : tuple of str
        What the controller commands, in order: `PRESSURE` of the pump in Pa, `VALVE` for the loss
        of the valve in Pa per (m/s)^2 of dh/dt.
    """

    controller: Callable[[], Controller]
    measured: tuple[str, ...]
    linear: LinearLaw | None = None
    at_rest: bool = False
    adapts: bool = False
    closes_loop: bool = True
    unjudged: str = ""
    commands: tuple[str, ...] = (PRESSURE,)

    @property
    def linear_measured(self) -> tuple[str, ...]:
        """The measurements that `linear` takes: the first ones, as many as it has inputs."""
        inputs = 0 if self.linear is None else self.linear.matrices().B.shape[1]
        return self.measured[:inputs]

    @property
    def dissipates(self) -> bool:
        """Whether it can only take energy out of the water, whatever it commands: a valve's law."""
        return self.commands == (VALVE,)


class LawDesign(Protocol):
    """A law in parameters: a frozen dataclass that a configuration file can hold.

    Its field `kind` is a ``Literal`` of the names by which a file chooses it.
    """

    @property
    def kind(self) -> Any:
        """Name of the law in a configuration file."""

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant.

        Raises
        ------
        ValueError
            If a parameter does not fit the plant; a `ParameterError` names it.
        """
