"""Puts one device of another maker through its profile, as a node beside nothing else."""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, Final

from utank_hil import canbus
from utank_hil.base.tick import TICK_NS, Schedule
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.acting import device_of
from utank_hil.canbus.profiles.device import SILENT_NS
from utank_hil.canbus.profiles.device_plan import DevicePlan, MessageEncoder
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.actuators import DriveSequence
from utank_hil.nodes.canopen_drive import KEPT, CanopenDrive, state_of
from utank_hil.nodes.canopen_setup import CanopenSetup, SensorSetup
from utank_hil.nodes.commissioning.checks import SETTLED_S, Check, stopped_ms
from utank_hil.safety.safety_limits import SafetyLimits

SECOND_NS: Final = 1_000_000_000
RATE_SHARE: Final = 0.05
"""A device's clock is 1 % off at most; what is further off was set to another rate."""
LOST_SHARE: Final = 1e-3  #: As of BUS_DEGRADED.
TURNED_SHARE: Final = 0.25
"""Of the roll: its integrated rate may differ by so much, for a sensor that is tilted by hand."""
BACK_S: Final = 5.0  #: For a device to measure again after its power is back.
GOOD: Final = (canbus.Quality.GOOD, canbus.Quality.DEGRADED)
MOVES: Final[dict[type[tuple[Any, ...]], tuple[tuple[str, float, str, str], ...]]] = {
    canbus.SensorMotion: (
        ("roll_rad", math.radians(1.0), "rad",
         "Heel the ship, or tilt the sensor, to starboard by two degrees or more"),
    ),
    canbus.SensorTank: (
        ("port_level_m", 0.05, "m", "Raise the port level, or its float, by 0.1 m"),
        ("starboard_level_m", 0.05, "m", "Raise the starboard level by 0.1 m"),
    ),
    canbus.OperatorCommand: (
        ("stop", 1.0, "", "Press stop, and hold it"),
        ("acknowledge", 1.0, "", "Let it go, press acknowledge, and hold that"),
        ("arm", 1.0, "", "Let it go, and turn the key to arm"),
    ),
    canbus.SensorPump: (
        ("pressure_pa", 500.0, "Pa", "Press with 0.1 m of water on the starboard side"),
    ),
}  # fmt: skip
"""What is moved by hand: value, least move in its unit, and what to do."""

Script = Iterator[list[canbus.Frame]]
Ask = Callable[[str], Callable[[], bool]]
"""Asks a person to do something; what is returned says, each tick, whether it is done."""


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
    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Take what is the device's."""

    def tick(self, now_ns: int) -> list[canbus.Frame]:
        """Go on with the script."""
        self.now_ns = now_ns
        frames = next(self._script, None)
        self.done = frames is None
        return frames or []

    @abstractmethod
    def _frames(self) -> list[canbus.Frame]:
        """The frames of a tick in which nothing is asked of the device."""

    def _wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> Script:
        end_ns = self.now_ns + round(seconds * SECOND_NS)
        while self.now_ns < end_ns and not until():
            yield self._frames()

    def _by_hand(self, what: str) -> Script:
        done = self._ask(what)
        while not done():  # however long: nothing may turn that nobody waits for
            yield self._frames()

    def _configure(self, setup: CanopenSetup) -> Script:
        yield from self._wait(ANSWERED_S, lambda: setup.done or bool(setup.problem))
        if not setup.unanswered:
            yield from self._wait(CONFIGURED_S, lambda: setup.done or bool(setup.problem))
        why = setup.problem or setup.unanswered or "Its answers by SDO come too slowly."
        self._flag("set_up", "configured by SDO, read back, started", why, right=setup.done)

    def _flag(self, name: str, what: str, remedy: str, *, right: bool) -> None:
        """Add a check that is right or not."""
        self.checks.append(Check(name, what, float(right), 1.0, 0.0, "1", remedy))


class SensorTrial(Trial):
    """A sensor: its pace, what it says, its signs by hand, its silence."""

    def __init__(self, plan: DevicePlan[Any], ask: Ask, listen_s: float, key: bytes = b"") -> None:
        self._plan, self._device, self._listen_s = plan, device_of(plan, key), listen_s
        self._device.deliver = lambda message, now_ns: self._heard.append((now_ns, message))
        self._heard: list[tuple[int, tuple[Any, ...]]] = []
        self._setup = SensorSetup(self._device) if plan.steps else None
        self._wakes = Schedule(SILENT_NS)
        super().__init__(ask)

    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Take what is the device's."""
        taker = self._device.takers.get(frame.can_id)
        if taker is not None:
            taker.take(frame, now_ns)

    def _frames(self) -> list[canbus.Frame]:
        frames = [] if self._setup is None else self._setup.frames(self.now_ns)
        if self._wakes.due(self.now_ns) and (wake := self._device.wake(self.now_ns)) is not None:
            frames.append(wake)
        return frames

    def script(self) -> Script:
        """Listen, move by hand, take the plug off, and put it back."""
        if self._setup is not None:
            yield from self._configure(self._setup.setup)
        yield from self._wait(BACK_S, lambda: bool(self._heard))
        rejected, late, lost = self._rejected(), self._late(), self._device.lost
        self._heard = []
        yield from self._wait(self._listen_s)
        if self._heard:
            self._judge_pace()
        else:
            missing = [each.name for each in self._device.watched if not each.heard]
            remedy = f"Never heard: {', '.join(missing)}. " if missing else ""
            remedy += "Look at power, bus, bit rate, its identifiers or node: utank-hil bus --ship."
            self._flag("heard", "whole measurements come", remedy, right=False)
        self.checks += [
            Check("rejected", "frames of wrong length, checksum or order",
                  (self._rejected() - rejected).total(), 0.0, 0.0, "1",
                  f"{', '.join(self._rejected() - rejected)}: compare the profile's layout with "
                  "the device's; look for a second sender."),
            Check("late", "frames that came too late by their stamp", self._late() - late, 0.0,
                  0.0, "1", "Look at what holds frames up, as a gateway; compare stamps[].us."),
            Check("lost", "measurements lost by the counter",
                  (self._device.lost - lost) / max(len(self._heard), 1), 0.0, LOST_SHARE, "1",
                  "Look at cables, termination and load: utank-hil bus. A counter of all "
                  "contents of an identifier has counts: identifier in protection."),
        ]  # fmt: skip
        remedy = "Compare n2k_name, or identity."
        self._flag("name", "the device is who it is to be", remedy, right=self._device.named)
        if not self._heard:
            return
        yield from self._moves()
        yield from self._by_hand("Take the device off the bus or its power")
        yield from self._wait(self._plan.age_ms * 1e-3)  # what was under way
        self._heard = []
        yield from self._wait(1.0)
        self.checks.append(
            Check("silence", "measurements of a device that is off", len(self._heard), 0.0, 0.0,
                  "1", "If it was off, a gateway or another sender repeats it: utank-hil bus.")
        )  # fmt: skip
        yield from self._by_hand("Connect the device again")
        self._heard = []
        yield from self._wait(BACK_S, lambda: any(self._usable(m) for _, m in self._heard))
        back = any(self._usable(message) for _, message in self._heard)
        remedy = "It has to send by itself after its power is back: save its settings in it."
        self._flag("back", "it measures again by itself", remedy, right=back)

    def _moves(self) -> Script:
        for move in MOVES[self._plan.kind]:
            yield from self._move(*move)

    def _rejected(self) -> Counter[str]:
        """Frames that were rejected, by message and reason."""
        return Counter({
            f"{each.name} {why.value}": count
            for each in self._device.watched for why, count in each.rejected.items()
        })  # fmt: skip

    def _late(self) -> int:
        return sum(each.stamp.late for each in self._device.watched if each.stamp is not None)

    def _usable(self, message: tuple[Any, ...]) -> bool:
        if isinstance(message, canbus.OperatorCommand):  # it is delivered only if it is usable
            return True
        if isinstance(message, canbus.ValveStatus):
            return message.state is canbus.ValveState.FOLLOWING and math.isfinite(message.opening)
        count = 1 if self._plan.kind is canbus.SensorPump else 2  # a flow need not be there
        values = message[:count]
        return message[-1] in GOOD and all(map(math.isfinite, values))

    def _judge_pace(self) -> None:
        cycle_ms, heard = self._plan.cycle_ns * 1e-6, self._heard
        gaps_ms = [(after - before) * 1e-6 for (before, _), (after, _) in pairwise(heard)]
        count, rate_hz, heard_ms = len(gaps_ms), 1e3 / cycle_ms, sum(gaps_ms)
        jitter_ms = math.sqrt(sum((gap - cycle_ms) ** 2 for gap in gaps_ms) / max(count, 1))
        good = sum(self._usable(message) for _, message in heard) / max(len(heard), 1)
        self.checks += [
            Check("rate", "measurements a second", count * 1e3 / heard_ms if heard_ms else 0.0,
                  rate_hz, RATE_SHARE * rate_hz, "Hz", "Set the device's rate, or cycle_ms."),
            Check("jitter", "gaps about the cycle, RMS", jitter_ms if count else math.nan, 0.0,
                  cycle_ms / 2, "ms", "Lower the bus load; let the device send by its clock."),
            Check("gap", "longest gap", max(gaps_ms, default=math.nan), cycle_ms,
                  self._plan.age_ms - cycle_ms, "ms", "Lower the bus load, or raise age_ms."),
            Check("usable", "measurements that are valid and in range", good, 1.0, 0.0, "1",
                  "Look at the device's status, its wiring, and valid_when, least and most."),
        ]  # fmt: skip

    def _move(self, value: str, least: float, unit: str, what: str) -> Script:
        turns = self._plan.kind is canbus.SensorMotion
        self._heard = []
        yield from self._wait(1.0)
        at_rest, begun = self._mean(value), len(self._heard) - 1
        rest_rate = self._mean("roll_rate_rad_s") if turns else 0.0
        yield from self._by_hand(what)
        moving, self._heard = self._heard[max(begun, 0) :], []
        yield from self._wait(1.0)
        moved, right = self._mean(value) - at_rest, self._device.proved or value != "arm"
        remedy = "Turn the device, exchange its channels, or change sign."
        if not right:
            remedy = "Its proof is wrong: compare key, challenge and proof."
        elif abs(moved) < least:
            remedy = f"It has to move by {least:.3g} {unit} in the time given; else look at scale."
        words = f"{value} moved by {round(moved, 4) + 0.0:g} {unit}"
        self._flag(f"{value}_sign", words, remedy, right=right and moved >= least)
        if turns:
            turned = math.fsum(
                (after_ns - before_ns) * 1e-9 * ((before[1] + after[1]) / 2 - rest_rate)
                for (before_ns, before), (after_ns, after) in pairwise(moving)
            )
            self.checks.append(
                Check("roll_rate", "integrated rate over the roll",
                      turned / moved if moved else math.nan, 1.0, TURNED_SHARE, "1",
                      "Change sign, scale or the axis of roll_rate_rad_s.")
            )  # fmt: skip

    def _mean(self, value: str) -> float:
        values = [float(getattr(message, value)) for _, message in self._heard]
        return sum(values) / len(values) if values else math.nan


WAY_SHARE: Final = 0.15
"""Of its time from end to end: as VALVE_NOT_FOLLOWING lets it be off."""
AT_PLACE: Final = 0.1  #: Of its way.
SILENCE_MS: Final = 100.0  #: For a valve to notice its last command, as the native one.


class ValveTrial(SensorTrial):
    """A valve: its pace, its way under command, and where it goes when nobody commands it."""

    def __init__(self, plan: DevicePlan[Any], valve: Valve, ask: Ask, listen_s: float) -> None:
        assert plan.command is not None
        self._valve, self._command = valve, MessageEncoder(plan.command)
        self._told, self._speaks = valve.fail_opening, False
        super().__init__(plan, ask, listen_s)

    def _frames(self) -> list[canbus.Frame]:
        frames = super()._frames()
        if not self._speaks or self.now_ns // TICK_NS % (cia.COMMAND_MS * 1_000_000 // TICK_NS):
            return frames
        beat = [] if self._plan.beat is None else [self._plan.beat]
        command = self._command.frame((self._told, 1.0, 0.0), self.now_ns)
        return [*frames, *beat, command]

    def _moves(self) -> Script:
        yield from self._by_hand("The valve will move: nobody at its spindle")
        fails, self._speaks = self._valve.fail_opening, True
        yield from self._wait(2 * self._valve.opening_time_s)
        self._told = 1.0 - fails
        remedy = "Set opening_time_s of the ship's valve."
        yield from self._way("way_ms", "from its fail position to the other end", 0.0, remedy)
        self._told, self._speaks = fails, False
        what = "to its fail position, without commands"
        remedy = "It must go there by itself: spring, own timeout, 1016h and 1029h."
        yield from self._way("silence_ms", what, SILENCE_MS, remedy)

    def _way(self, name: str, what: str, late_ms: float, remedy: str) -> Script:
        begin_ns, self._heard = self.now_ns, []
        right_ms = 1e3 * self._valve.opening_time_s
        yield from self._wait(3 * self._valve.opening_time_s + SILENCE_MS * 1e-3)
        away = [now_ns for now_ns, message in self._heard
                if not abs(message[0] - self._told) < AT_PLACE]  # fmt: skip
        back = bool(self._heard) and abs(self._heard[-1][1][0] - self._told) < AT_PLACE
        took_ms = (max(away, default=begin_ns) - begin_ns) * 1e-6 if back else math.nan
        off_ms = late_ms + WAY_SHARE * right_ms
        self.checks.append(Check(name, what, took_ms, right_ms, off_ms, "ms", remedy))


SHARE: Final = 0.2  #: Of the greatest torque or speed, for a second: it moves the water by little.
TURN_S: Final = 1.0
VARIES: Final = 0.05  #: Of it, from command to command: each echo is then that of one alone.
HEARD_SHARE: Final = 0.2  #: Of frames in `TURN_S`: so many may be missing, or be more.
ANSWERED_S: Final = 10.0  #: For a node to answer at all, that is tried every two seconds.
CONFIGURED_S: Final = 36.0  #: Forty entries, three answers each of 0.3 s, as slow as they may be.
STATE_S: Final = 2.0  #: For a change of state; a drive that charges its capacitors takes one.
IDENTITY: Final = cia.Place(0x1018, 1)  #: Read-only by CiA 301.
_ENABLED: Final = canbus.DriveState.OPERATION_ENABLED


class DriveTrial(Trial):
    """A drive with its pump in still water; it is left braked, and its node stopped."""

    def __init__(self, plan: cia.DrivePlan, pump: Pump, ask: Ask) -> None:
        self._plan, self._drive = plan, CanopenDrive(plan)
        self._target = SHARE * (pump.max_torque_nm if plan.mode.torque else pump.max_speed_rad_s)
        self._word, self._pushes, self._speaks = canbus.ControlWord.DISABLE_VOLTAGE, False, True
        self._tag = plan.bus << BUS_SHIFT | STANDARD
        self._answer: cia.Answer | None = None
        self._state: canbus.DriveState | None = None
        self._speed_rad_s = math.nan
        self._beats = self._count = 0
        super().__init__(ask)

    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Take what is the drive's; what it says by SDO counts as what it says by PDO."""
        taker = self._drive.takers.get(frame.can_id)
        if taker is None:
            return
        taker.take(frame, now_ns)
        cob = (frame.can_id ^ self._tag) - self._plan.node
        if cob == cia.SENT_1:
            self._state = self._drive.state
        elif cob == cia.SENT_2:
            self._speed_rad_s = self._drive.speed_rad_s
        elif cob == cia.HEARTBEAT:
            self._beats += len(frame.data) == 1
        elif cob == cia.SDO_ANSWER and (got := cia.answer(frame.data)) is not None:
            self._answer = got
            if got.place == cia.STATUS_WORD and got.value is not None:
                self._state = state_of(got.value)
            elif got.place == cia.SPEED and got.value is not None:
                speed = (got.value ^ 1 << 31) - (1 << 31)
                self._speed_rad_s = speed * self._plan.speed_rad_s_per_unit

    def stop(self, now_ns: int) -> list[canbus.Frame]:  # noqa: ARG002
        """Leave the drive braking, however the trial ends."""
        return self._drive.stop()

    def _frames(self) -> list[canbus.Frame]:
        cycle = self.now_ns // TICK_NS % (cia.COMMAND_MS * 1_000_000 // TICK_NS)
        if self._speaks:
            frames = self._drive.frames(self.now_ns)
            return frames if cycle else frames + self._command()
        if cycle:
            return []
        # A dead controller sends nothing. SYNC and SDO are no sign of its life; they show how the
        # drive stops, in the state of its node that 1029h chooses, too.
        place = (cia.SPEED, cia.STATUS_WORD)[self.now_ns // (cia.COMMAND_MS * 1_000_000) % 2]
        return [*self._command()[1:-1], self._request(cia.read_request(place))]

    def _command(self) -> list[canbus.Frame]:
        self._count += 1
        target = self._target * (1 - VARIES * (self._count % KEPT) / KEPT)
        return self._drive.follow(target if self._pushes else 0.0, self._word)

    def _request(self, data: bytes) -> canbus.Frame:
        return canbus.Frame(self._tag | cia.SDO_REQUEST + self._plan.node, data)

    def script(self) -> Script:
        """Configure, try what must be refused, turn and stop in two ways."""
        yield from self._by_hand("The pump will turn: water and ship still, nobody at the shaft")
        yield from self._configure(self._drive.setup)
        if not self._drive.setup.done:
            return
        yield from self._wait(STATE_S, lambda: self._state is canbus.DriveState.SWITCH_ON_DISABLED)
        yield from self._hear()
        if not all(each.passed for each in self.checks):  # what follows is judged by these
            return
        yield from self._refusals()
        yield from self._stop("quick_stop", "quick stop to standstill", speaks=True)
        yield from self._stop(
            "lost_controller", "controller's last frame to standstill", speaks=False
        )

    def _hear(self) -> Script:
        """Count for a second what it sends by itself."""
        watched, beats = self._drive.watched, self._beats
        before = [(each.heard, sum(each.rejected.values())) for each in watched]
        yield from self._wait(TURN_S)
        due = 1e3 * TURN_S / self._plan.heartbeat_ms
        remedy = "Without its heartbeat no controller arms: look at 1017h, and what loses frames."
        self.checks.append(Check("heartbeat", "heartbeats a second", self._beats - beats, due,
                                 HEARD_SHARE * due, "1", remedy))  # fmt: skip
        due = 1e3 * TURN_S / cia.COMMAND_MS
        for number, (each, (heard, wrong)) in enumerate(zip(watched, before, strict=True)):
            came, bad = each.heard - heard, sum(each.rejected.values()) - wrong
            name = f"TPDO{number + 1} {each.can_id & STANDARD - 1:#x}"
            remedy = (f"{came} came, {bad} of them not of {each.length} bytes: compare COB-ID "
                      f"({0x1800 + number:X}h:1) and mapping ({0x1A00 + number:X}h).")  # fmt: skip
            self.checks.append(Check(f"tpdo{number + 1}", f"whole frames a second of {name}",
                                     came - bad, due, HEARD_SHARE * due, "1", remedy))  # fmt: skip

    def _refusals(self) -> Script:
        self._word = canbus.ControlWord.ENABLE_OPERATION
        yield from self._wait(10 * cia.COMMAND_MS * 1e-3)
        what = "it is not enabled out of its order of states"
        remedy = "By CiA 402-2 it goes through ready and switched on: look at its settings."
        self._flag("leap", what, remedy, right=self._state is not _ENABLED)
        self._word, self._answer = canbus.ControlWord.DISABLE_VOLTAGE, None
        yield [self._request(cia.write_request(IDENTITY, 0, 4))]
        yield from self._wait(STATE_S, lambda: self._answer is not None)
        refused = self._answer is not None and self._answer.abort != 0
        remedy = "1018h must be read-only: anything could pass for this drive."
        self._flag("read_only", "its identity can't be written", remedy, right=refused)

    def _stop(self, name: str, what: str, *, speaks: bool) -> Script:
        sequence = DriveSequence()
        sequence.request_reset()
        end_ns = self.now_ns + round(2 * STATE_S * SECOND_NS)
        while self._state is not _ENABLED and self.now_ns < end_ns:
            self._word = sequence.next_word(self._state, wanted=True)
            yield from self._wait(2 * cia.COMMAND_MS * 1e-3)
        if self._state is not _ENABLED:
            remedy = f"It stays {self._drive.words}: look at supply, enable input and fault."
            self._flag(f"{name}_enabled", "it can be enabled", remedy, right=False)
            return
        self._pushes = True
        yield from self._wait(TURN_S / 2)  # a demand may be on its way
        ages_ms, end_ns = [0.0], self.now_ns + round(TURN_S / 2 * SECOND_NS)
        while self.now_ns < end_ns:
            ages_ms.append((self.now_ns - self._drive.echo_ns) * 1e-6)
            yield self._frames()
        if speaks:
            age_ms = max(ages_ms) if max(ages_ms) < 1e3 * TURN_S else math.nan
            remedy = "Choose another echo in the ship's file; look at what delays or loses PDOs."
            self.checks.append(Check("echo_ms", "oldest command whose echo was the last", age_ms,
                                     0.0, SafetyLimits().echo_age_ms, "ms", remedy))  # fmt: skip
        if self._state is not _ENABLED:
            self._pushes, self._word = False, canbus.ControlWord.DISABLE_VOLTAGE
            remedy = (f"It stopped by itself, {self._drive.words}: read its fault; raise "
                      "heartbeat_ms where this computer or the bus was late.")  # fmt: skip
            self._flag(f"{name}_stays", "it stays enabled for a second", remedy, right=False)
            return
        speed_rad_s = self._speed_rad_s
        turns = speed_rad_s * self._target > 0
        remedy = "Look at the sign of pressure_pa_per_unit or speed_rad_s_per_unit, and the echo."
        said = f"it turns as commanded, {speed_rad_s:.3g} rad/s"
        self._flag(f"{name}_turns", said, remedy, right=turns)
        self._pushes, self._word, self._speaks = False, canbus.ControlWord.QUICK_STOP, speaks
        shares: list[float] = []
        end_ns = self.now_ns + round(SETTLED_S * SECOND_NS)
        while self.now_ns < end_ns:
            shares.append(self._speed_rad_s / speed_rad_s if turns else math.nan)
            yield self._frames()
        self.checks.append(
            Check(f"{name}_ms", what, stopped_ms(shares), 0.0, self._plan.stop_within_ms,
                  "ms", "Shorten heartbeat_ms and the ramp of the stop (6085h); see 6007h, 605Ah.")
        )  # fmt: skip
        yield from self._wait(STATE_S / 2)
        remedy = "It must not run on: set 6007h, 605Ah and 605Eh, or take another drive."
        self._flag(f"{name}_off", "it is off afterwards", remedy, right=self._state is not _ENABLED)
        self._speaks, self._word = True, canbus.ControlWord.DISABLE_VOLTAGE
