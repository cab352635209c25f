"""The sensor node: motion sensor, tank level gauges, high-level switches and pump pressure."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np

from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
    Transmitter,
)
from utank_hil.parameters import NotNegative, Positive, Range, range_problems, refuse
from utank_hil.runtime.housekeeping import Housekeeping
from utank_hil.tick import TICK_NS

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it

NOISE_BLOCK = 4096

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_GOOD = Quality.GOOD
_CLOSED, _OPEN = Switch.ON, Switch.OFF

_M = TypeVar("_M", bound=tuple[Any, ...])


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of the sensors; noise is white and Gaussian, given as standard deviation.

    Attributes
    ----------
    roll_noise_rad, roll_rate_noise_rad_s : float
        Noise of the motion sensor.
    motion_delay_ms : float
        Age of the motion sensor's sample when it is sent, a multiple of its 10 ms cycle. At most
        1000, the longest delay that a law can be designed for.
    level_noise_m : float
        Noise of each level gauge.
    pressure_noise_pa : float
        Noise of the pressure sensor.
    high_level_m : float
        Level above still water at which a reservoir's high-level switch closes.
    roll_bias_rad : float
        Constant error of the roll, such as that of a sensor mounted at an angle; 0.2 at most.

    Raises
    ------
    ValueError
        If a value is out of its range, or the delay is not a multiple of the cycle.
    """

    roll_noise_rad: NotNegative = 2e-4
    roll_rate_noise_rad_s: NotNegative = 5e-4
    motion_delay_ms: Annotated[float, Range(least=0, most=1000)] = 20.0
    level_noise_m: NotNegative = 0.005
    pressure_noise_pa: NotNegative = 100.0
    high_level_m: Positive = 4.6
    roll_bias_rad: Annotated[float, Range(least=-0.2, most=0.2)] = 0.0

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if not problems and self.motion_delay_ms * 1_000_000 % TICK_NS:
            reason = f"must be a multiple of {TICK_NS / 1e6:g}, got {self.motion_delay_ms}"
            problems.append(("motion_delay_ms", reason))
        refuse("sensors", problems)


def _standard_normal(seed: int) -> Iterator[float]:
    """Standard normal numbers, drawn in blocks because one at a time is slow."""
    generator = np.random.Generator(np.random.PCG64(seed))
    while True:
        yield from reversed(generator.standard_normal(NOISE_BLOCK).tolist())


class SensorNode:
    """Measures the plant and sends the measurements in the cycles of the catalogue.

    Parameters
    ----------
    plant : Plant
        The ship to measure.
    errors : SensorErrors
    catalogue : Catalogue
    configuration_version : int
        Sent in the heartbeat, for the controller to compare with its own.
    seed : int
        Of the noise.
    """

    name = "sensors"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(
        self,
        plant: "Plant",
        errors: SensorErrors,
        catalogue: Catalogue,
        *,
        configuration_version: int,
        seed: int,
    ) -> None:
        self._plant = plant
        self._errors = errors
        self._draw = _standard_normal(seed).__next__
        delay_ticks = round(errors.motion_delay_ms * 1e6 / TICK_NS)
        self._motion: deque[tuple[float, float]] = deque(maxlen=delay_ticks + 1)
        self._messages: list[tuple[int, Callable[[Any], Frame], Callable[[], Any]]] = []
        # the noise is drawn in this order: a new message goes last
        self._publish(catalogue.transmitter(SensorMotion), self._measure_motion)
        self._publish(catalogue.transmitter(SensorTank), self._measure_tank)
        self._publish(catalogue.transmitter(SensorPump), self._measure_pump)
        self._housekeeping = Housekeeping(Address.SENSORS, catalogue, configuration_version)
        self._ticks = 0

    def _publish(self, transmitter: Transmitter[_M], measure: Callable[[], _M]) -> None:
        """Send what `measure` returns, once in the message's cycle."""
        ticks = transmitter.cycle_ns // self.period_ns
        self._messages.append((ticks, transmitter.frame, measure))

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Sensors listen to no message."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Measure, and send what is due."""
        plant = self._plant
        plant.advance(now_ns)
        self._motion.append((plant.roll_rad, plant.roll_rate_rad_s))
        frames: list[Frame] = []
        for ticks, frame, measure in self._messages:
            if self._ticks % ticks == 0:
                frames.append(frame(measure()))
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames

    def _measure_motion(self) -> SensorMotion:
        errors, draw = self._errors, self._draw
        roll_rad, rate_rad_s = self._motion[0]
        return SensorMotion(
            roll_rad + errors.roll_bias_rad + errors.roll_noise_rad * draw(),
            rate_rad_s + errors.roll_rate_noise_rad_s * draw(),
            _GOOD,
        )

    def _measure_tank(self) -> SensorTank:
        level_m, draw = self._plant.level_m, self._draw
        noise_m, limit_m = self._errors.level_noise_m, self._errors.high_level_m
        return SensorTank(
            -level_m + noise_m * draw(),
            level_m + noise_m * draw(),
            _CLOSED if -level_m > limit_m else _OPEN,
            _CLOSED if level_m > limit_m else _OPEN,
            _GOOD,
        )

    def _measure_pump(self) -> SensorPump:
        plant = self._plant
        noise_pa = self._errors.pressure_noise_pa * self._draw()
        return SensorPump(plant.pressure_pa + noise_pa, plant.flow_m3_s, _GOOD)
