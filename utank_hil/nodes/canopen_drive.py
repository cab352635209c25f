"""A pump drive by CiA 402 over CANopen, as the controller commands and hears it."""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from utank_hil.canbus import ControlWord, DriveState, Frame
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.measurements import Measurements
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.device import CalledTaker, HeardMessage, Taker, nobody
from utank_hil.canbus.profiles.device_plan import MessagePlan
from utank_hil.canbus.profiles.field import Field
from utank_hil.control.pressure_loop import PressureLoop
from utank_hil.nodes.canopen_setup import CanopenSetup
from utank_hil.nodes.plausibility import MILLISECOND_NS, NEVER_HEARD_NS
from utank_hil.safety.monitoring import STALE_MS

KEPT: Final = 16  #: Commands that an echo is looked for among: those of a third of a second.
MARKS: Final = 4
"""The lowest two bits of the target count the commands: 3 of 1000 of the rated torque."""
LATE_BEATS: Final = 2  #: Heartbeats that may be missing, as a consumer by CiA 301 takes them.
FAST: Final = 0.9  #: Of the greatest speed, which a drive at it reaches within its ripple.
IGNORED: Final = 3
"""Commands to stop after which a drive that still runs is stopped by network management: they may
be lost, and 6007h brakes it all the same."""
START_NS: Final = 500_000_000  #: For a node to say that it is operational.

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ENABLE: Final = ControlWord.ENABLE_OPERATION
_ENABLED: Final = DriveState.OPERATION_ENABLED
_OPERATIONAL: Final = int(cia.NetworkState.OPERATIONAL)
_STATES: Final = {int(state): state for state in DriveState}
_WARNING: Final = 1 << 7
_AT_LIMIT: Final = 1 << 11
_BOOT_UP: Final = int(cia.NetworkState.BOOT_UP)
_HALF_CYCLE_NS: Final = cia.COMMAND_MS * MILLISECOND_NS // 2
_TO_EVEN: Final = 6755399441055744.0
"""1.5 * 2**52: a number rounds as `round` does where it is added; compiled, that costs less."""
_new: Final = tuple.__new__


def _state_of(bits: int) -> DriveState | None:
    few = bits & 0x4F  # in some states quick stop's bit does not count
    return _STATES.get(few if few in (0x00, 0x40, 0x08, 0x0F) else bits & 0x6F)


_BY_WORD: Final = [_state_of(bits) for bits in range(0x70)]


def state_of(status_word: int) -> DriveState | None:
    """State by the status word 6041h; None for what the standard does not know."""
    return _BY_WORD[status_word & 0x6F]


class DriveReport(NamedTuple):
    """What the drive's PDOs say together."""

    state: DriveState
    refused: bool  #: It is in another mode than it was put in.
    held_back: bool
    warns: bool
    power_w: float


class CanopenDrive:
    """One drive: configured, started, commanded, heard.

    `deliver` gets each report of a drive that is configured, operational and alive, and None as
    long as its configuration is refused; `takers` has, by identifier, what takes its frames. With
    `hears_only` somebody else configures and commands it.
    """

    def __init__(
        self,
        plan: cia.DrivePlan,
        loop: PressureLoop | None = None,
        area_m2: float = 0.0,
        *,
        hears_only: bool = False,
    ) -> None:
        self._hears_only = hears_only
        self._plan, self._loop, self._area_m2 = plan, loop, area_m2
        self._fast_rad_s = FAST * loop.most_speed_rad_s if loop else 0.0
        self.deliver: Callable[[DriveReport | None, int], None] = nobody
        self.setup = CanopenSetup(plan.bus, plan.node, plan.steps())
        tag = plan.bus << BUS_SHIFT | STANDARD
        self._in_nm: bool = plan.mode.torque
        self._late_ns: int = LATE_BEATS * plan.heartbeat_ms * MILLISECOND_NS
        self._bits, self._per_si, self._marked = (
            plan.mode.bits,
            plan.units_per_si,
            plan.echoes_command,
        )
        # with each command: heartbeat and SYNC of the controller
        self._beat = [Frame(tag | cia.HEARTBEAT + plan.controller_node, bytes((_OPERATIONAL,)))]
        self._with = self._beat + [Frame(tag | cia.SYNC, b"")] * plan.synchronous
        self._received = tag | cia.RECEIVED_1 + plan.node
        sent, measured = (sum(b for _, b in each) // 8 for each in (plan.sent, plan.measured))
        self._echoed = Field(16, 8 * sent - 16, sent)
        scale = plan.speed_rad_s_per_unit
        self._speed = Field(0, 32, measured, signed=True, scale=scale)
        if self._in_nm:
            self._torque_field = Field(32, 16, measured, signed=True, scale=1 / plan.units_per_si)
        self._mode_field = Field(8 * measured - 8, 8, measured, signed=True)
        cycle_ns = cia.COMMAND_MS * MILLISECOND_NS
        self.watched = tuple(
            HeardMessage(MessagePlan("", (tag | cob + plan.node,), length, cycle_ns))
            for cob, length in ((cia.SENT_1, sent), (cia.SENT_2, measured))
        )
        self.takers: dict[int, Taker] = {
            tag | cia.SENT_1 + plan.node: CalledTaker(self._on_status),
            tag | cia.SENT_2 + plan.node: CalledTaker(self._on_measured),
            tag | cia.HEARTBEAT + plan.node: CalledTaker(self._on_heartbeat),
            **self.setup.takers,
        }
        # contents and times of the last commands; compiled, indices of lists cost least
        self._contents = [-1] * KEPT
        self._sent_ns = [NEVER_HEARD_NS] * KEPT
        self._count = 0
        self._echo = -1
        self.echo_ns = self._beat_ns = self._measured_ns = self._now_ns = NEVER_HEARD_NS
        self._operational = False
        self._started_ns = NEVER_HEARD_NS
        self._speed_rad_s = self._torque = self._pressure_pa = math.nan
        self._flow_m3_s = 0.0
        self._mode: int = plan.mode.number
        self._mode_shown = self._mode
        self._status = self._ignored = 0
        self._told = ""

    @property
    def words(self) -> str:
        """What is wrong with the drive, by its own words."""
        setup = self.setup
        if setup.problem or (setup.unanswered and not setup.emergency.words):
            return setup.problem or setup.unanswered
        known = setup.done or self._hears_only
        told = f"status word {self._status:#06x}" if known else "is being configured"
        said = f"node {self._plan.node}: {told}"
        if self._mode_shown != self._plan.mode.number:
            said += f", mode {self._mode_shown} and not {self._plan.mode.number}"
        emergency = setup.emergency.words
        return f"{said}, {emergency}" if emergency else said

    def frames(self, now_ns: int) -> list[Frame]:
        """What the drive's configuration needs in this tick, usually nothing."""
        self._now_ns = now_ns
        setup = self.setup
        if setup.done:
            # without a heartbeat, its start was not heard: it has forgotten all
            # pragma: no mutate start: a tick more or less
            lives = self._operational and now_ns - self._beat_ns <= START_NS
            if not lives and now_ns - self._started_ns > START_NS:
                # pragma: no mutate end
                self._restart(now_ns)
            return []
        frames = setup.frames(now_ns)
        self.watched[1].may_speak = setup.done
        if setup.done:
            self._started_ns = now_ns
        if setup.problem != self._told:
            self._told = setup.problem
            self.deliver(None, now_ns)
        return frames

    def command(
        self, pressure_pa: float, word: ControlWord, measured: Measurements, rate_m_s: float
    ) -> list[Frame]:
        """The next command, with heartbeat and SYNC of the controller."""
        target = 0.0
        if self._loop is not None and word is _ENABLE:
            self._flow_m3_s = self._area_m2 * rate_m_s
            stale = measured.pump_age_ms > STALE_MS
            self._pressure_pa = math.nan if stale else measured.pressure_pa
            target = self._loop.step(
                pressure_pa, self._pressure_pa, self._flow_m3_s, self._speed_rad_s
            )
        elif self._loop is not None:
            self._loop.reset()
        stays = word is not _ENABLE and state_of(self._status) is _ENABLED
        self._ignored = self._ignored + 1 if stays else 0
        frames = self.follow(target, word)
        if self._ignored > IGNORED:
            frames.append(self.setup.order(cia.NodeCommand.STOP))
        return frames

    def stop(self) -> list[Frame]:
        """Leave the drive braking, and its node stopped."""
        return [*self.follow(0.0, ControlWord.QUICK_STOP), self.setup.order(cia.NodeCommand.STOP)]

    @property
    def speed_rad_s(self) -> float:
        """Speed of the rotor by the last PDO; NaN before the first, and if that is long ago."""
        return self._speed_rad_s

    @property
    def at_speed(self) -> bool:
        """Whether the rotor may turn at its greatest speed, to which the status word has no bit.

        Where the drive tells no speed, it is that which the measured pressure takes at the present
        flow, and has to turn the way of the water: only there the water can outrun the rotor.
        """
        speed_rad_s, loop = self._speed_rad_s, self._loop
        if loop is not None and not math.isfinite(speed_rad_s):
            speed_rad_s = loop.speed_rad_s(self._pressure_pa, self._flow_m3_s)
            return speed_rad_s * math.copysign(1.0, self._flow_m3_s) >= self._fast_rad_s
        return not abs(speed_rad_s) < self._fast_rad_s  # so if it is not known

    @property
    def state(self) -> DriveState | None:
        """State by the last status word."""
        return state_of(self._status)

    def follow(self, target: float, word: ControlWord) -> list[Frame]:
        """Heartbeat, SYNC and command with a target in N m or rad/s, by the mode."""
        if not self.setup.done:
            return list(self._beat)
        bits = self._bits
        most = (1 << bits - 1) - MARKS
        counts = int(min(max(target * self._per_si, -most), most) + _TO_EVEN - _TO_EVEN)
        # pragma: no mutate start: whichever remainder goes with a count
        counts += ((self._count - counts + MARKS // 2) % MARKS) - MARKS // 2
        # pragma: no mutate end
        self._count += 1
        content = word | (counts & (1 << bits) - 1) << 16
        place = self._count % KEPT  # the oldest one's
        self._contents[place] = content if self._marked else content >> 16
        self._sent_ns[place] = self._now_ns
        command = _new(Frame, (self._received, content.to_bytes(2 + bits // 8, "little")))
        # SYNC first: what it asks for is sampled before the command, whoever is in front on the bus
        return [*self._with, command]

    def _on_status(self, frame: Frame, now_ns: int) -> None:
        data = frame.data
        if not self.watched[0].passes(data):
            return
        self._status = data[0] | data[1] << 8
        if now_ns - self._measured_ns > self._late_ns:  # pragma: no mutate: a tick more or less
            self._speed_rad_s = self._torque = math.nan
        state = state_of(self._status)
        if self._marked or state is _ENABLED:
            self._heard(self._echoed.raw(data))
        else:  # there is no demand
            self.echo_ns = now_ns
        # pragma: no mutate start: a tick more or less
        alive = self._operational and now_ns - self._beat_ns <= self._late_ns
        # pragma: no mutate end
        if state is None or not alive or not (self._hears_only or self.setup.done):
            return
        report = (
            state,
            self._mode_shown != self._mode,
            self._status & _AT_LIMIT != 0,
            self._status & _WARNING != 0,
            self._torque * self._speed_rad_s,
        )
        self.deliver(_new(DriveReport, report), now_ns)

    def _heard(self, echo: int) -> None:
        """Take an echo: it tells when the newest command left that has arrived."""
        if echo == self._echo:
            return
        self._echo = echo
        # after SYNC it is a cycle old; else the middle of what its phase can be
        phase_ns = 0 if len(self._with) > 1 else _HALF_CYCLE_NS
        for ago in range(KEPT):
            place = (self._count - ago) % KEPT
            if self._contents[place] == echo:
                self.echo_ns = self._sent_ns[place] - phase_ns
                return

    def _on_measured(self, frame: Frame, now_ns: int) -> None:
        data = frame.data
        if not self.watched[1].passes(data):
            return
        self._measured_ns = now_ns
        self._speed_rad_s = self._speed.value(data)
        if self._in_nm:
            self._torque = self._torque_field.value(data)
        self._mode_shown = self._mode_field.raw(data)

    def _on_heartbeat(self, frame: Frame, now_ns: int) -> None:
        if len(frame.data) != 1:
            return
        self._beat_ns = now_ns
        state = frame.data[0] & 0x7F
        self._operational = state == _OPERATIONAL
        if state == _BOOT_UP:
            self._restart(now_ns)

    def _restart(self, now_ns: int) -> None:
        """Configure it anew; what it said before, as that it runs, says nothing of now."""
        self.setup.restart(now_ns)
        self._status = 0  # pragma: no mutate: any in which it does not run
