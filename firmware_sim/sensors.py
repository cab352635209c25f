"""The sensor node: motion sensor, tank level gauges, high-level switches and pump pressure."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from firmware_sim.plant import Plant
from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.parameters import NotNegative, Positive, Range, range_problems, refuse
from utank_hil.runtime.housekeeping import Housekeeping
from utank_hil.tick import TICK_NS

NOISE_BLOCK = 4096

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_GOOD = Quality.GOOD
_CLOSED, _OPEN = Switch.ON, Switch.OFF


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """What the sensors add to the truth; noise is white and Gaussian, given as standard deviation.

    Attributes
    ----------
    roll_noise_rad, roll_rate_noise_rad_s : float
        Noise of the motion sensor.
    motion_delay_ms : float
        Age of the motion sensor's sample when it is sent, a whole number of its 10 ms cycles; a
        second at most, the longest delay that a law can be designed for.
    level_noise_m : float
        Noise of each level gauge.
    pressure_noise_pa : float
        Noise of the pressure sensor.
    high_level_m : float
        Level above still water at which a reservoir's high-level switch closes.
    roll_bias_rad : float
        Steady error of the motion sensor's roll, which is mounted askew by so much; 0.2 at most.

    Raises
    ------
    ValueError
        If a value is out of its range, or the delay no whole number of cycles.
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
    """Measures the plant and sends what it measured.

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
        plant: Plant,
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
        self._motion_sender = catalogue.transmitter(SensorMotion)
        self._tank_sender = catalogue.transmitter(SensorTank)
        self._pump_sender = catalogue.transmitter(SensorPump)
        self._tank_ticks = self._tank_sender.cycle_ns // TICK_NS
        self._pump_ticks = self._pump_sender.cycle_ns // TICK_NS
        self._housekeeping = Housekeeping(Address.SENSORS, catalogue, configuration_version)
        self._ticks = 0

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Sensors listen to nobody."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Measure, and send what is due."""
        plant, errors, draw = self._plant, self._errors, self._draw
        plant.advance(now_ns)
        self._motion.append((plant.roll_rad, plant.roll_rate_rad_s))
        roll_rad, rate_rad_s = self._motion[0]
        frames = [
            self._motion_sender.frame(
                SensorMotion(
                    roll_rad + errors.roll_bias_rad + errors.roll_noise_rad * draw(),
                    rate_rad_s + errors.roll_rate_noise_rad_s * draw(),
                    _GOOD,
                )
            )
        ]
        if self._ticks % self._tank_ticks == 0:
            frames.append(self._tank_frame(plant.level_m))
        if self._ticks % self._pump_ticks == 0:
            frames.append(
                self._pump_sender.frame(
                    SensorPump(
                        plant.pressure_pa + errors.pressure_noise_pa * draw(),
                        plant.flow_m3_s,
                        _GOOD,
                    )
                )
            )
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames

    def _tank_frame(self, level_m: float) -> Frame:
        noise_m, limit_m, draw = (
            self._errors.level_noise_m,
            self._errors.high_level_m,
            self._draw,
        )
        return self._tank_sender.frame(
            SensorTank(
                -level_m + noise_m * draw(),
                level_m + noise_m * draw(),
                _CLOSED if -level_m > limit_m else _OPEN,
                _CLOSED if level_m > limit_m else _OPEN,
                _GOOD,
            )
        )
