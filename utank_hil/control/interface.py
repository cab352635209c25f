"""Interfaces of controllers, linear laws and designs of laws, and the plant of a design."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple, Protocol, runtime_checkable

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.parameters import Checked, NotNegative, Range, Share
from utank_hil.dynamics import LinearModel, RollShip, Tank
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.valves import ValveRange

_Limit = Annotated[float, Range(above=0, infinite=True)]


@dataclass(frozen=True, slots=True)
class PumpLimits(Checked, owner="pump limit"):
    """Limits on the pump's command."""

    pressure_pa: _Limit = 50e3  #: Greatest pressure, either way.
    rate_pa_s: _Limit = 100e3  #: Greatest rate of change of the command.
    level_m: _Limit = 3.85  #: Greatest level, either way, that the pump may drive the water to.
    power_w: _Limit = math.inf  #: Greatest hydraulic power P At h' from the pump to the water.
    #: Share of `pressure_pa` that the level barrier counts on for braking, 0 to 1.
    brake_share: Share = 0.7
    #: Sharpness of the level barrier, 1 or more; a greater one acts later and harder.
    sharpness: Annotated[float, Range(least=1, infinite=True)] = 2.2
    #: Time ahead at which the level is judged: delay and lag of the pump.
    lookahead_s: NotNegative = 0.25


_LIMITS: Final = PumpLimits()


@dataclass(frozen=True, slots=True)
class DesignPlant(Checked, owner="design plant"):
    """A ship with its tank, delay, lag and limits."""

    ship: RollShip
    tank: Tank
    #: From the sampling of a measurement to the drive's response to the resulting command.
    delay_s: NotNegative = 0.05
    lag_s: NotNegative = 0.1  #: Time constant of the pump's pressure.
    limits: PumpLimits = _LIMITS  #: On the command, for the laws that plan within them.
    valve: ValveRange | None = None  #: Range of the tank's valve, if any.
    #: The tank in small motions, where `tank` has the linear loss of its working level, else None.
    calm: Tank | None = None

    @property
    def tanks(self) -> tuple[Tank, ...]:
        """The tanks, of greater and of least loss, on which a law must have its margins."""
        return (self.tank,) if self.calm is None else (self.tank, self.calm)

    def model(self, measured: tuple[str, ...]) -> LinearModel:
        """Continuous model from pump pressure to the outputs `measured`, names of `STATES`."""
        return pump_model(self.ship, self.tank, measured)

    def sampled(self, measured: tuple[str, ...], sample_time_s: float) -> LinearModel:
        """Discrete model from command to `measured`, with lag and delay (`dynamics.sampling`)."""
        return sample(self.model(measured), sample_time_s, self.delay_s, self.lag_s)


PRESSURE: Final = "pressure_pa"
VALVE: Final = "valve_loss"


class Controller(Protocol):
    """A steppable controller.

    `step` is called with the measurement at t_k and its result is commanded at once; it acts on the
    plant from t_k + delay until the result of the next step takes over. A controller that is not
    active is stepped too and receives the actual command through `applied`, so that it can take
    over without a bump.
    """

    sample_time_s: float  #: Time between two calls of `step`.

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement `y`, shape (m,), and return the command, shape (r,).

        `reference` is the target of the outputs, zero by default.
        """

    def applied(self, u: FloatArray) -> None:
        """Take the command, shape (r,), that was sent after limits or by another law."""

    def reset(self) -> None:
        """Return to the initial state."""


class Memoryless:
    """What a controller without memory does with a sent command and a reset: nothing."""

    __slots__ = ()

    def applied(self, u: FloatArray) -> None:
        """Ignore the command; the law has no memory."""

    def reset(self) -> None:
        """Do nothing; the law has no memory."""


@runtime_checkable
class Plans(Protocol):
    """A controller that plans each sample within limits and an iteration limit."""

    #: Number of steps since its reset in which the limit was reached and the last plan was kept.
    fallbacks: int

    def allow(self, share: float) -> None:
        """Set the share of the pressure limit that the next plan may use."""


class WaveForecast(NamedTuple):
    """Forecast of the waves' roll moment over the roll stiffness, shapes (f,), f > 0."""

    time_s: FloatArray  #: From the next measurement on, increasing.
    moment_rad: FloatArray
    deviation_rad: FloatArray  #: Standard deviation of its error.


@runtime_checkable
class Foresees(Protocol):
    """A controller that takes forecasts of the waves."""

    @property
    def doubts_forecasts(self) -> bool:
        """Whether forecasts are ignored, as they do not agree with the motion."""

    def preview(self, forecast: WaveForecast | None) -> None:
        """Take what is forecast, or that nothing is, for the next step."""


@runtime_checkable
class StartsAnew(Protocol):
    """A controller that is reset when an operator arms it, or resets a fault.

    Its memory depends on its own action, as adaptation while active does. That of other controllers
    is an estimate of the ship, which a reset would lose.
    """

    starts_anew: bool  #: Marks such a controller, whatever its value.

    def reset(self) -> None:
        """Return to the initial state."""


@runtime_checkable
class EndsByItself(Protocol):
    """A controller that gives nothing more, until its reset, once it has passed a limit."""

    passed_limit: str  #: Measurement that passed its limit; empty if none did.


class LinearLaw(Protocol):
    """A linear law from outputs y to command u, in the timing of `utank_hil.control.arx`.

    u(k) depends on y(k-1), y(k-2), ..., of which y(k-1) is the newest measurement: the law of a
    steppable controller is strictly proper in this count, D = 0. `StateSpaceLaw` converts a law
    x+ = A x + B y, u = C x + D y with the newest measurement y, as control libraries give it, by
    shifting it one sample.
    """

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix at the points `z`, shape (N,); shape (N, r, m)."""

    def matrices(self) -> LinearModel:
        """Discrete state-space model from y to u."""

    def controller(self) -> Controller:
        """Return a new steppable controller, at rest."""


@dataclass(frozen=True, slots=True)
class BuiltLaw:
    """A law designed for a plant."""

    controller: Callable[[], Controller]  #: Makes a new `Controller`, at rest.
    measured: tuple[str, ...]  #: Measurements of the controller, in order; names of `STATES`.
    #: The law for the analysis of its loop, from `linear_measured` to the pressure.
    linear: LinearLaw | None = None
    at_rest: bool = False  #: The law is nonlinear, and `linear` is its slope at rest.
    adapts: bool = False  #: The law changes while it runs, and `linear` is its initial form.
    #: The law feeds measurements back. If it does and `linear` is None, its loop is judged by its
    #: impulse response.
    closes_loop: bool = True
    unjudged: str = ""  #: Reason for which its loop cannot be judged; empty otherwise.
    #: Commands of the controller, in order: `PRESSURE` of the pump in Pa, `VALVE` for the loss of
    #: the valve in Pa per (m/s)^2 of dh/dt.
    commands: tuple[str, ...] = (PRESSURE,)

    @property
    def linear_measured(self) -> tuple[str, ...]:
        """Measurements of `linear`: the first ones, as many as it has inputs."""
        inputs = 0 if self.linear is None else self.linear.matrices().B.shape[1]
        return self.measured[:inputs]

    @property
    def dissipates(self) -> bool:
        """Whether the law commands a valve alone, which can only take energy from the water."""
        return self.commands == (VALVE,)


class LawDesign(Protocol):
    """Parameters of a law: a frozen dataclass that files select by ``Literal`` names, `kind`."""

    @property
    def kind(self) -> Any:
        """Name of the law in a configuration file."""

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law; ValueError if a parameter does not suit, named by a `ParameterError`."""
