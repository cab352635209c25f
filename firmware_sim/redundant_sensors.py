"""What a ship may have beside its sensors: a second motion sensor, and hard-wired inputs."""

from collections import deque
from collections.abc import Iterable
from typing import TYPE_CHECKING

from firmware_sim.sensor_errors import SensorErrors
from firmware_sim.sensors import standard_normal
from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    HardwiredInputs,
    Quality,
    SensorMotion,
    Switch,
)
from utank_hil.runtime.housekeeping import Housekeeping
from utank_hil.tick import TICK_NS

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


class SecondMotionNode:
    """A motion sensor like the first one, with noise of its own and without its bias.

    Parameters
    ----------
    plant : Plant
        The ship to measure.
    errors : SensorErrors
        Of the first one.
    catalogue : Catalogue
    configuration_version : int
        Sent in the heartbeat.
    seed : int
        Of the noise.
    """

    name = "sensors_2"
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
        self._draw = standard_normal(seed).__next__
        delay_ticks = round(errors.motion_delay_ms * 1e6 / TICK_NS)
        self._motion: deque[tuple[float, float]] = deque(maxlen=delay_ticks + 1)
        self._transmitter = catalogue.transmitter(SensorMotion, Address.SENSORS_2)
        self._housekeeping = Housekeeping(Address.SENSORS_2, catalogue, configuration_version)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Sensors listen to no message."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Measure and send."""
        plant, errors, draw = self._plant, self._errors, self._draw
        plant.advance(now_ns)
        self._motion.append((plant.roll_rad, plant.roll_rate_rad_s))
        roll_rad, rate_rad_s = self._motion[0]
        motion = SensorMotion(
            roll_rad + errors.roll_noise_rad * draw(),
            rate_rad_s + errors.roll_rate_noise_rad_s * draw(),
            Quality.GOOD,
        )
        return [self._transmitter.frame(motion), *self._housekeeping.frames(now_ns)]


class HardwiredNode:
    """High-level switches and a stop loop by wires of their own.

    Parameters
    ----------
    plant : Plant
        The ship whose levels move the switches.
    high_level_m : float
        Level above still water at which a reservoir's switch closes.
    catalogue : Catalogue
    configuration_version : int
        Sent in the heartbeat.

    Attributes
    ----------
    stop_pressed : bool
        Whether somebody holds the hard-wired stop, which opens its loop.
    """

    name = "hardwired"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(
        self,
        plant: "Plant",
        high_level_m: float,
        catalogue: Catalogue,
        *,
        configuration_version: int,
    ) -> None:
        self._plant = plant
        self._high_level_m = high_level_m
        self._transmitter = catalogue.transmitter(HardwiredInputs)
        self._cycle_ticks = self._transmitter.cycle_ns // self.period_ns
        self._housekeeping = Housekeeping(Address.HARDWIRED, catalogue, configuration_version)
        self._ticks = 0
        self.stop_pressed = False

    def receive(self, frame: Frame, now_ns: int) -> None:
        """It listens to no message."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Read the inputs, and send them when they are due."""
        self._plant.advance(now_ns)
        frames: list[Frame] = []
        if self._ticks % self._cycle_ticks == 0:
            level_m, limit_m = self._plant.level_m, self._high_level_m
            inputs = HardwiredInputs(
                _switch(-level_m > limit_m),
                _switch(level_m > limit_m),
                _switch(self.stop_pressed),
                Quality.GOOD,
            )
            frames.append(self._transmitter.frame(inputs))
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames


def _switch(on: bool) -> Switch:
    return Switch.ON if on else Switch.OFF
