"""Puts one device of another maker through its profile, as a node beside nothing else."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, Final

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Quality, SensorMotion, SensorPump, SensorTank
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.canbus.profiles.device_plan import FIELDS, DevicePlan
from utank_hil.nodes.commissioning.checks import Check

SECOND_NS: Final = 1_000_000_000
RATE_SHARE: Final = 0.05
"""A device's clock is 1 % off at most; what is further off was set to another rate."""
LOST_SHARE: Final = 1e-3  #: As of BUS_DEGRADED.
TURNED_SHARE: Final = 0.25
"""Of the roll: its integrated rate may differ by so much, for a sensor that is tilted by hand."""
BACK_S: Final = 5.0  #: For a device to measure again after its power is back.
PATIENCE_S: Final = 3600.0  #: For a person.
GOOD: Final = (Quality.GOOD, Quality.DEGRADED)
MOVES: Final[dict[type[tuple[Any, ...]], tuple[tuple[str, float, str, str], ...]]] = {
    SensorMotion: (("roll_rad", math.radians(1.0), "rad",
                    "Heel the ship, or tilt the sensor, to starboard by two degrees or more"),),
    SensorTank: (("port_level_m", 0.05, "m", "Raise the port level, or its float, by 0.1 m"),
                 ("starboard_level_m", 0.05, "m", "Raise the starboard level by 0.1 m")),
    SensorPump: (("pressure_pa", 500.0, "Pa", "Press with 0.1 m of water on the starboard side"),),
}  # fmt: skip
"""What is moved by hand: value, least move in its unit, and what to do."""

Script = Iterator[list[Frame]]
Ask = Callable[[str], Callable[[], bool]]
"""Asks a person to do something; what is returned says, each tick, whether it is done."""


def flag(name: str, what: str, remedy: str, *, right: bool) -> Check:
    """A check that is right or not."""
    return Check(name, what, float(right), 1.0, 0.0, "1", remedy)


class Trial(ABC):
    """A node that follows a script; `checks` fill on the way, `done` ends it."""

    name = "conform"
    period_ns = TICK_NS

    def __init__(self, ask: Ask) -> None:
        self._ask = ask
        self.checks: list[Check] = []
        self.done = False
        self.now_ns = 0
        self._script = self.script()

    @abstractmethod
    def script(self) -> Script:
        """The frames of each tick, as long as the trial lasts."""

    @abstractmethod
    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what is the device's."""

    def tick(self, now_ns: int) -> list[Frame]:
        """Go on with the script."""
        self.now_ns = now_ns
        frames = next(self._script, None)
        self.done = frames is None
        return frames or []

    @abstractmethod
    def _frames(self) -> list[Frame]:
        """The frames of a tick in which nothing is asked of the device."""

    def _wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> Script:
        end_ns = self.now_ns + round(seconds * SECOND_NS)
        while self.now_ns < end_ns and not until():
            yield self._frames()

    def _by_hand(self, what: str) -> Script:
        yield from self._wait(PATIENCE_S, self._ask(what))


class SensorTrial(Trial):
    """A sensor: its pace, what it says, its signs by hand, its silence."""

    def __init__(self, plan: DevicePlan[Any], ask: Ask, listen_s: float) -> None:
        self._plan, self._device, self._listen_s = plan, ProfiledDevice(plan), listen_s
        self._device.deliver = lambda message, now_ns: self._heard.append((now_ns, message))
        self._heard: list[tuple[int, tuple[Any, ...]]] = []
        self._woken_ns = 0
        super().__init__(ask)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what is the device's."""
        take = self._device.takes.get(frame.can_id)
        if take is not None:
            take(frame, now_ns)

    def _frames(self) -> list[Frame]:
        wake = self._device.wake(self.now_ns)
        if wake is None or self.now_ns - self._woken_ns < SECOND_NS:
            return []
        self._woken_ns = self.now_ns
        return [wake]

    def script(self) -> Script:
        """Listen, move by hand, take the plug off, and put it back."""
        yield from self._wait(BACK_S, lambda: bool(self._heard))
        rejected, lost, self._heard = self._rejected(), self._device.lost, []
        yield from self._wait(self._listen_s)
        self._judge_pace()
        self.checks += [
            Check("rejected", "frames of wrong length, checksum or order",
                  self._rejected() - rejected, 0.0, 0.0, "1",
                  "Compare the profile's layout with the device's; look for a second sender."),
            Check("lost", "measurements lost by the counter",
                  (self._device.lost - lost) / max(len(self._heard), 1), 0.0, LOST_SHARE, "1",
                  "Look at cables, termination and load: utank-hil bus."),
            flag("name", "the device claims its NAME", "Compare n2k_name.",
                 right=self._device.named),
        ]  # fmt: skip
        if not self._heard:
            return
        for move in MOVES[self._plan.kind]:
            yield from self._move(*move)
        yield from self._by_hand("Take the device off the bus or its power")
        yield from self._wait(self._plan.age_ms * 1e-3)  # what was under way
        self._heard = []
        yield from self._wait(1.0)
        self.checks.append(
            Check("silence", "measurements of a device that is off", len(self._heard), 0.0, 0.0,
                  "1", "Another sender or a gateway repeats its frames: see utank-hil bus.")
        )  # fmt: skip
        yield from self._by_hand("Connect the device again")
        self._heard = []
        yield from self._wait(BACK_S, lambda: any(self._usable(m) for _, m in self._heard))
        back = any(self._usable(message) for _, message in self._heard)
        remedy = "It has to send by itself after its power is back: save its settings in it."
        self.checks.append(flag("back", "it measures again by itself", remedy, right=back))

    def _rejected(self) -> int:
        return sum(sum(each.rejected.values()) for each in self._device.watched)

    def _usable(self, message: tuple[Any, ...]) -> bool:
        values = message[: 1 if self._plan.kind is SensorPump else 2]  # a flow need not be there
        return message[-1] in GOOD and all(map(math.isfinite, values))

    def _judge_pace(self) -> None:
        cycle_ms, heard = self._plan.cycle_ns * 1e-6, self._heard
        gaps_ms = [(after - before) * 1e-6 for (before, _), (after, _) in pairwise(heard)]
        count, rate_hz = len(gaps_ms), 1e3 / cycle_ms
        jitter_ms = math.sqrt(sum((gap - cycle_ms) ** 2 for gap in gaps_ms) / max(count, 1))
        good = sum(self._usable(message) for _, message in heard) / max(len(heard), 1)
        self.checks += [
            Check("rate", "measurements a second", count * 1e3 / sum(gaps_ms) if count else 0.0,
                  rate_hz, RATE_SHARE * rate_hz, "Hz", "Set the device's rate, or cycle_ms."),
            Check("jitter", "gaps about the cycle, RMS", jitter_ms if count else math.nan, 0.0,
                  cycle_ms / 2, "ms", "Lower the bus load; let the device send by its clock."),
            Check("gap", "longest gap", max(gaps_ms, default=math.nan), cycle_ms,
                  self._plan.age_ms - cycle_ms, "ms", "Lower the bus load, or raise age_ms."),
            Check("usable", "measurements that are valid and in range", good, 1.0, 0.0, "1",
                  "Look at the device's status, its wiring, and valid_when, least and most."),
        ]  # fmt: skip

    def _move(self, value: str, least: float, unit: str, what: str) -> Script:
        place = FIELDS[self._plan.kind].index(value)
        self._heard = []
        yield from self._wait(1.0)
        at_rest, rest_rate, begun = self._mean(place), self._mean(1), len(self._heard) - 1
        yield from self._by_hand(what)
        moving, self._heard = self._heard[max(begun, 0) :], []
        yield from self._wait(1.0)
        moved = self._mean(place) - at_rest
        self.checks.append(
            flag(f"{value}_sign", f"{value} moved by {moved:.3g} {unit}",
                 "Turn the device, exchange its channels, or change sign.", right=moved >= least)
        )  # fmt: skip
        if self._plan.kind is SensorMotion:
            turned = math.fsum(
                (after_ns - before_ns) * 1e-9 * ((before[1] + after[1]) / 2 - rest_rate)
                for (before_ns, before), (after_ns, after) in pairwise(moving)
            )
            self.checks.append(
                Check("roll_rate", "integrated rate over the roll",
                      turned / moved if moved else math.nan, 1.0, TURNED_SHARE, "1",
                      "Change sign, scale or the axis of roll_rate_rad_s.")
            )  # fmt: skip

    def _mean(self, place: int) -> float:
        values = [message[place] for _, message in self._heard]
        return sum(values) / len(values) if values else math.nan
