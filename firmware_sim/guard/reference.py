"""The guard in Python: the same verdicts as guard.c, bit for bit, which tests hold it to.

Numbers are those of the frames, times ticks of 10 ms; see guard.h and guard.c.
"""

from collections.abc import Iterable
from enum import IntFlag
from typing import TYPE_CHECKING, Final

from firmware_sim.guard.devices_heard import OLDEST, DevicesHeard
from firmware_sim.guard.parameters import GuardParameters
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Mode
from utank_hil.canbus.e2e import profile2_crc
from utank_hil.canbus.profiles.guarded import Stream

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


class GuardNode:
    """The guard, on the safe torque off of the emulated drive."""

    name = "guard"
    period_ns = TICK_NS

    def __init__(self, parameters: GuardParameters, plant: "Plant | None" = None) -> None:
        self.guard = Guard(parameters)
        self.hears = frozenset(each.can_id for each in parameters.messages).union(
            *(part.can_ids for part in parameters.parts)
        )
        self._plant = plant  # without one it only judges

    def receive(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        """Take one frame from the bus."""
        self.guard.receive(frame)

    def tick(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002
        """Judge; cut the drive's power, or let it on. Nothing is sent."""
        reasons = self.guard.tick()
        if self._plant is not None:
            self._plant.cut_power("guard", cut=reasons != 0)
        return ()


COMMAND_AGE: Final = 15
FRESH: Final = 10
RELEASE: Final = 120
FOLLOW: Final = 60
WINDOW: Final = 30
PERSIST: Final = 10
HEEL_TICKS: Final = 6000
HEEL_SCALE: Final = 4096
NO_TORQUE: Final = (0x00, 0x40, 0x21, 0x23, 0x08)  #: CiA 402 states.
ENABLE: Final = 0x0F
ASKS: Final = 0x08  #: Beside arm, stop and reset: whether ACTIVE is asked for.


class Reason(IntFlag):
    """Reasons to cut; none allows."""

    WAITING = 1
    STOP = 2
    DISARMED = 4
    SILENT = 8
    COMMANDED = 16
    PRESSURE = 32
    LEVEL = 64
    ROLL = 128


class Guard:
    """May the drive's power stay on."""

    def __init__(self, parameters: GuardParameters) -> None:
        self.parameters = parameters
        self.reasons = int(Reason.WAITING)
        self._streams = {each.can_id: index for index, each in enumerate(parameters.messages)}
        self._devices = DevicesHeard(
            parameters.parts, tuple(each.unchanged for each in parameters.messages)
        )
        self._age = [OLDEST] * len(Stream)
        self._expected = [16] * len(Stream)
        self._candidate, self._run = [16] * len(Stream), [0] * len(Stream)
        self._command = self._drive_pa = self._pump_pa = 0
        self._roll = self._rate = self._heel = self._level = 0
        self._least, self._most, self._window = [0, 0], [0, 0], 0
        self._off = self._unarmed = self._high = self._rolled = 0
        self._state = 0
        self._switches = {Stream.TANK: False, Stream.HARDWIRED: False}
        self._loop_open = self._armed = self._reset = False
        self._stop_heard = self._bad_command = False
        self._bits: list[tuple[int, int, int]] = [(2, 0, 2), (2, 0, 2)]

    def receive(self, frame: Frame) -> None:
        """Take one frame from the bus."""
        self._receive_native(frame)
        for stream in self._devices.heard(frame):
            self._take_device(stream)

    def _receive_native(self, frame: Frame) -> None:
        stream, data = self._streams.get(frame.can_id), frame.data
        if stream is None or len(data) != 8:
            return
        if data[0] != profile2_crc(data, self.parameters.messages[stream].data_ids):
            return
        cycles = self._accepted(stream, data[1] & 15)
        w1, w2 = int.from_bytes(data[2:4], "little"), int.from_bytes(data[4:6], "little")
        if stream in (Stream.ORDER, Stream.ORDER_2):
            asks = ASKS if data[1] >> 4 == Mode.ACTIVE else 0
            self._order(stream, data[2] & 7 | asks, counts=cycles > 0)
        elif stream == Stream.HARDWIRED:
            is_open = data[2] & 3 != 0
            self._loop_open |= is_open
            self._stop_heard |= is_open
            if cycles:
                self._switches[Stream.HARDWIRED] = data[1] & 0xF0 != 0
                if data[2] >> 4 <= 1:
                    self._loop_open, self._age[stream] = is_open, 0
        elif cycles:
            self._take(stream, data, cycles, w1, w2)

    def _accepted(self, stream: int, counter: int) -> int:
        """Cycles since the last frame that counted, 0 if this one does not."""
        cycles, expected = 16, self._expected[stream]
        if expected != 16:
            missing = (counter - expected) & 15
            if missing <= 3:
                cycles = missing + 1
            else:
                again = counter == self._candidate[stream]
                self._run[stream] = self._run[stream] + 1 if again else 1
                self._candidate[stream] = (counter + 1) & 15
                if self._run[stream] < 3:
                    return 0
        self._expected[stream], self._run[stream] = (counter + 1) & 15, 0
        return cycles

    def _take(self, stream: int, data: bytes, cycles: int, w1: int, w2: int) -> None:
        pressure, limits, usable = w1 - 32768, self.parameters, data[1] >> 4 <= 1
        known = abs(pressure) <= 31250
        if stream == Stream.COMMAND:
            last = self._command
            nearer = abs(pressure) <= abs(last) and pressure * last >= 0
            step = abs(pressure - last)
            if abs(pressure) > limits.pressure or (not nearer and step > limits.step * cycles):
                self._bad_command = True
            self._command = pressure
        elif stream == Stream.DRIVE:
            self._state = data[6]
            if not known:
                return
            self._drive_pa = pressure
        elif stream == Stream.TANK:
            good = data[6] & 15 <= 1 and 2000 <= w1 <= 62000 and 2000 <= w2 <= 62000
            self._take_values(stream, [w1, w2, data[1] & 0xF0, 0], whole=good)
            return
        elif stream == Stream.PUMP:
            self._take_values(stream, [pressure], whole=known and usable)
            return
        else:
            good = usable and max(w1, w2) <= 64000
            self._take_values(stream, [w1 - 32000, w2 - 32000], whole=good)
            return
        self._age[stream] = 0

    def _take_values(self, stream: int, values: list[int], *, whole: bool) -> None:
        """Take the values of a stream, `whole` if they are good and of now."""
        if stream == Stream.TANK:
            self._switches[Stream.TANK] = any(values[2:])
        if not whole:
            return
        if stream == Stream.TANK:
            self._level = values[1] - values[0]
        elif stream == Stream.PUMP:
            self._pump_pa = values[0]
        else:
            self._roll, self._rate = values[:2]
        self._age[stream] = 0

    def _take_device(self, stream: Stream) -> None:
        """Take what a device of another maker says."""
        values, whole = self._devices.values[stream], self._devices.whole(stream)
        if stream == Stream.COMMAND:
            self._command = self.parameters.pressure if values[0] & 0x8F == ENABLE else 0
            self._age[stream] = 0
        elif stream == Stream.DRIVE:  # in some states the bit of quick stop does not count
            self._state = values[0] & (0x6F if values[0] & 7 else 0x4F)
            self._age[stream] = 0
        elif stream == Stream.ORDER:
            bits = sum(1 << place for place, value in enumerate(values[:3]) if value)
            self._order(stream, bits | ASKS, counts=whole)
        else:
            self._take_values(stream, values, whole=whole)

    def _order(self, stream: int, byte: int, *, counts: bool) -> None:
        """Obey a stop and a disarm of any whole frame, arm and reset of one that counts."""
        station = stream - Stream.ORDER
        arm, stop, reset, asks = byte & 1, byte >> 1 & 1, byte >> 2 & 1, byte & ASKS
        had_arm, _, had_reset = self._bits[station]
        if stop:
            self._stop_heard = True
        if stop or (not (arm and asks) and had_arm == 1):
            self._armed = False
        if counts:
            if station == 0 or self.parameters.second_station:
                if arm and had_arm == 0 and asks and not stop:
                    self._armed = True
                if reset and had_reset == 0:
                    self._reset = True
            self._bits[station] = arm, stop, reset
            self._age[stream] = 0

    def _younger(self, first: Stream, second: Stream) -> int:
        return min(self._age[first], self._age[second])

    @property
    def _silent(self) -> bool:
        old = [
            each.patience and age > each.patience
            for each, age in zip(self.parameters.messages, self._age, strict=True)
        ]
        for first, second in ((Stream.MOTION, Stream.MOTION_2), (Stream.ORDER, Stream.ORDER_2)):
            waits = self.parameters.messages[second].patience
            old[first], old[second] = old[first] and (not waits or old[second]), False
        return any(old)

    def tick(self) -> int:
        """Return the reasons to cut, 0 if the drive's power may stay on; called every 10 ms."""
        limits = self.parameters
        self._age = [min(age + 1, OLDEST) for age in self._age]
        self._devices.tick()
        self._note(self._commanded)
        if self._younger(Stream.MOTION, Stream.MOTION_2) <= FRESH:
            away = self._roll * HEEL_SCALE - self._heel
            self._heel += abs(away) // HEEL_TICKS * (1 if away > 0 else -1)
        heard = self._age[Stream.DRIVE] <= limits.messages[Stream.DRIVE].patience
        live = not heard or self._state not in NO_TORQUE
        self._unarmed = _longer(self._unarmed, not self._armed)
        pressing = live and self._command != 0
        if limits.torque_drive and self._unarmed > RELEASE:
            pressing = False  # enabled without pressure, as in PASSIVE; what it presses tells
        error = limits.error
        # a drive may say that it is off and press: what it does counts; off, its rotor turns freely
        if not (heard and live):
            error += abs(self._level) * limits.free_rotor // 2000
        off = heard and self._is_off(self._drive_pa, error)
        off |= self._age[Stream.PUMP] <= FRESH and self._is_off(self._pump_pa, error)
        high = any(self._switches.values()) or abs(self._level) > limits.level
        rolled = abs(self._roll) > limits.roll or abs(self._rate) > limits.roll_rate
        self._off = _longer(self._off, off)
        self._high = _longer(self._high, high)
        self._rolled = _longer(self._rolled, rolled)
        heeled = abs(self._heel) > limits.heel * HEEL_SCALE
        silent = self._silent
        stop = self._stop_heard or self._loop_open or any(bits[1] for bits in self._bits)
        holds = {
            Reason.STOP: stop,
            Reason.DISARMED: pressing and self._unarmed > RELEASE,
            Reason.SILENT: pressing and silent,
            Reason.COMMANDED: live and self._bad_command,
            Reason.PRESSURE: self._off > FOLLOW,
            Reason.LEVEL: self._high > PERSIST,
            Reason.ROLL: self._rolled > PERSIST or heeled,
        }
        reasons = sum(int(reason) for reason, held in holds.items() if held)
        if self.reasons == Reason.WAITING and not silent:
            self.reasons = 0
        if not heard:  # nobody knows what the drive does; it is waited for again
            self.reasons |= int(Reason.WAITING)
        if self._reset and not reasons:
            self.reasons &= int(Reason.WAITING)
        self.reasons |= reasons
        if self.reasons:
            self._armed = False
        self._reset = self._stop_heard = self._bad_command = False
        return self.reasons

    @property
    def _commanded(self) -> int:
        return self._command if self._age[Stream.COMMAND] <= COMMAND_AGE else 0

    def _note(self, command: int) -> None:
        self._window += 1
        if self._window >= WINDOW:
            self._window = 0
            self._least, self._most = [0, self._least[0]], [0, self._most[0]]
        self._least[0] = min(self._least[0], command)
        self._most[0] = max(self._most[0], command)

    def _is_off(self, pressure: int, error: int) -> bool:
        """Whether a pressure is off all commands of half a second, and off zero."""
        least, most = min(self._least), max(self._most)
        if self.parameters.torque_drive:
            most = 0 if self._unarmed > RELEASE else self._commanded
            least = -most
        return not least - error <= pressure <= most + error


def _longer(lasted: int, holds: bool) -> int:
    return min(lasted + 1, OLDEST) if holds else 0
