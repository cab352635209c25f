"""Pump drive by CiA 402 as a CANopen node: it follows torque or speed, and knows of no pressure.

The node: object dictionary, network management, SDO server, PDOs, heartbeats.
"""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from firmware_sim.drive import DriveStates
from utank_hil.base.elementary import exp
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import ControlWord, DriveFault, DriveState, Frame
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.drive_plan import (
    ASYNCHRONOUS,
    CONTROL_WORD,
    DISABLED,
    EMERGENCY,
    HEARTBEAT,
    MODE,
    MODE_SHOWN,
    MODES,
    MODES_SUPPORTED,
    NMT,
    PROFILE,
    RECEIVED_1,
    SDO_ANSWER,
    SDO_REQUEST,
    SENT_1,
    SENT_2,
    SPEED,
    STATUS_WORD,
    SYNC,
    TORQUE,
    Abort,
    DrivePlan,
    NetworkState,
    NodeCommand,
    Place,
    parts,
    refusal,
    value_answer,
    written_answer,
)
from utank_hil.dynamics.pump import Pump, pump_load, pump_pressure, pump_speed

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


MS_NS = 1_000_000
_STATES: dict[int, NetworkState] = {
    NodeCommand.START: NetworkState.OPERATIONAL,
    NodeCommand.STOP: NetworkState.STOPPED,
    NodeCommand.PRE_OPERATIONAL: NetworkState.PRE_OPERATIONAL,
    0x81: NetworkState.BOOT_UP,  # reset of the application
    0x82: NetworkState.BOOT_UP,  # and of the communication
}


class Entry:
    """One entry: its value without sign, its bytes, and whether it may be written."""

    __slots__ = ("size", "value", "writable")

    def __init__(self, value: int, size: int, *, writable: bool = False) -> None:
        self.value, self.size, self.writable = value, size, writable

    @property
    def signed(self) -> int:
        """The value with its sign."""
        half = 1 << 8 * self.size - 1
        return (self.value ^ half) - half


class CanopenNode:
    """What every node does; `entries` is its object dictionary.

    `written_pdo` counts the PDOs that were taken; `lost_controller` is set while the heartbeat that
    1016h names has ended.
    """

    def __init__(self, node: int, bus: int, entries: dict[Place, Entry]) -> None:
        self.node, self.entries = node, entries
        self._tag = bus << BUS_SHIFT | STANDARD
        self.state = NetworkState.BOOT_UP
        self._out: list[Frame] = []
        self.written_pdo = 0
        self.lost_controller = False
        self._beat_ns: dict[int, int] = {}  # of other nodes, from their first heartbeat on
        self._next_beat_ns = 0
        self._next_event_ns = [0, 0]
        entries[Place(0x1000)] = Entry(0, 4)
        entries[Place(0x1001)] = Entry(0, 1)
        entries[Place(0x1016)] = Entry(1, 1)
        entries[Place(0x1016, 1)] = Entry(0, 4, writable=True)
        entries[Place(0x1017)] = Entry(0, 2, writable=True)
        for index, cob in ((0x1400, RECEIVED_1), (0x1800, SENT_1), (0x1801, SENT_2)):
            entries[Place(index, 1)] = Entry(cob + node, 4, writable=True)
            entries[Place(index, 2)] = Entry(ASYNCHRONOUS, 1, writable=True)
            entries[Place(index + 0x200)] = Entry(0, 1, writable=True)
            for subindex in range(1, 9):
                entries[Place(index + 0x200, subindex)] = Entry(0, 4, writable=True)
            if index >= 0x1800:  # as delivered they are held back
                entries[Place(index, 3)] = Entry(300, 2, writable=True)
                entries[Place(index, 5)] = Entry(0, 2, writable=True)

    @property
    def hears(self) -> frozenset[int]:
        """Identifiers that the node takes; heartbeats are those of any node."""
        own = (NMT, SYNC, RECEIVED_1 + self.node, SDO_REQUEST + self.node)
        beats = (HEARTBEAT + node for node in range(1, 128) if node != self.node)
        return frozenset(self._tag | cob for cob in (*own, *beats))

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame."""
        cob, data = frame.can_id & 0x7FF, frame.data
        if frame.can_id != self._tag | cob:
            return
        if cob == NMT and len(data) == 2 and data[1] in (0, self.node):
            self.state = _STATES.get(data[0], self.state)
        elif cob == SYNC:
            self._send_pdos(range(1, 241))
        elif cob == SDO_REQUEST + self.node and len(data) == 8:
            if self.state in (NetworkState.OPERATIONAL, NetworkState.PRE_OPERATIONAL):
                self._say(SDO_ANSWER + self.node, self._serve(data))
        elif cob == self.entries[Place(0x1400, 1)].value:  # a disabled one has another
            if self.state is NetworkState.OPERATIONAL:
                self._take_pdo(data, now_ns)
        elif cob > HEARTBEAT:
            self._beat_ns[cob - HEARTBEAT] = now_ns

    def tick(self, now_ns: int) -> list[Frame]:
        """What is due: heartbeat, PDOs by event timer, and all that was said since."""
        consumed = self.entries[Place(0x1016, 1)].value
        came_ns = self._beat_ns.get(consumed >> 16 & 0x7F)
        late_ns = (consumed & 0xFFFF) * MS_NS
        self.lost_controller = came_ns is not None and 0 < late_ns < now_ns - came_ns
        if self.state is NetworkState.BOOT_UP:
            self._say(HEARTBEAT + self.node, bytes((NetworkState.BOOT_UP,)))
            self.state = NetworkState.PRE_OPERATIONAL
        cycle_ns = self.entries[Place(0x1017)].value * MS_NS
        if cycle_ns and now_ns >= self._next_beat_ns:
            self._next_beat_ns = now_ns + cycle_ns
            self._say(HEARTBEAT + self.node, bytes((self.state,)))
        for number in (0, 1):
            timer_ns = self.entries[Place(0x1800 + number, 5)].value * MS_NS
            if timer_ns and now_ns >= self._next_event_ns[number]:
                self._next_event_ns[number] = now_ns + timer_ns
                self._send_pdos(range(254, 256), (number,))
        frames, self._out = self._out, []
        return frames

    def emergency(self, code: int) -> None:
        """Send an emergency message; 0 says that errors are over."""
        self.entries[Place(0x1001)].value = int(code != 0)
        self._say(EMERGENCY + self.node, code.to_bytes(2, "little") + bytes((code != 0, *[0] * 5)))

    def taken(self, now_ns: int) -> None:
        """A PDO was taken into the entries."""

    def _say(self, cob: int, data: bytes) -> None:
        self._out.append(Frame(self._tag | cob, data))

    def _serve(self, data: bytes) -> bytes:
        command, place, value, size = parts(data)
        entry = self.entries.get(place)
        if entry is None:
            known = any(each.number == place.number for each in self.entries)
            return refusal(place, Abort.NO_SUBINDEX if known else Abort.NO_OBJECT)
        if command == 0x40:
            return value_answer(place, entry.value, entry.size)
        if command & 0xE2 != 0x22:
            return refusal(place, Abort.COMMAND_UNKNOWN)
        abort = self._write(place, entry, value, size if command & 1 else entry.size)
        return refusal(place, abort) if abort else written_answer(place)

    def _write(self, place: Place, entry: Entry, value: int, size: int) -> Abort | None:
        if not entry.writable:
            return Abort.READ_ONLY
        if size != entry.size:
            return Abort.WRONG_LENGTH
        if place.number in (0x1600, 0x1A00, 0x1A01):
            if not place.subindex:
                mapping = [self.entries.get(Place(place.number, n + 1)) for n in range(value)]
                if sum(64 if each is None else each.value & 0xFF for each in mapping) > 64:
                    return Abort.TOO_LONG_A_PDO
            elif self.entries[Place(place.number)].value:
                return Abort.NOT_IN_THIS_STATE
            else:
                what = self.entries.get(Place(value >> 16, value >> 8 & 0xFF))
                if what is None or 8 * what.size != value & 0xFF:
                    return Abort.NOT_TO_BE_MAPPED
        if place in (Place(0x1400, 1), Place(0x1800, 1), Place(0x1801, 1)):
            cob = {0x1400: RECEIVED_1, 0x1800: SENT_1, 0x1801: SENT_2}[place.number]
            if value & ~DISABLED != cob + self.node:
                return Abort.VALUE_OUT_OF_RANGE
        entry.value = value
        return None

    def _mapped(self, index: int) -> Iterator[Entry]:
        for subindex in range(1, self.entries[Place(index)].value + 1):
            what = self.entries[Place(index, subindex)].value
            yield self.entries[Place(what >> 16, what >> 8 & 0xFF)]

    def _take_pdo(self, data: bytes, now_ns: int) -> None:
        entries = list(self._mapped(0x1600))
        if len(data) < sum(each.size for each in entries):
            return  # too short a PDO is not processed, CiA 301 7.2.2.1
        at = 0
        for entry in entries:
            entry.value = int.from_bytes(data[at : at + entry.size], "little")
            at += entry.size
        self.written_pdo += 1
        self.taken(now_ns)

    def _send_pdos(self, kinds: range, numbers: tuple[int, ...] = (0, 1)) -> None:
        if self.state is not NetworkState.OPERATIONAL:
            return
        for number in numbers:
            cob = self.entries[Place(0x1800 + number, 1)].value
            if cob & DISABLED or self.entries[Place(0x1800 + number, 2)].value not in kinds:
                continue
            entries = self._mapped(0x1A00 + number)
            content = b"".join(each.value.to_bytes(each.size, "little") for each in entries)
            if content:
                self._say(cob, content)


_ENABLED: Final = DriveState.OPERATION_ENABLED
STOPPED_SHARE: Final = 0.02
"""Share of the greatest pressure below which the pump counts as stopped, as of `PumpDrive`."""
STEPS: Final = 2  #: Of the rotor in a tick: its load is integrated implicitly.
HEARTBEAT_LOST: Final = 0x8130  #: Emergency code by CiA 301.
INTERNAL_ERROR: Final = 0x6100
_VOLTAGE, _REMOTE, _AT_LIMIT = 1 << 4, 1 << 9, 1 << 11
_MODE_BITS: Final = sum({1 << each.number - 1 for each in MODES.values()})


class CanopenPumpDrive(CanopenNode):
    """The drive of a ship's file on the plant's pump.

    Rotor and water are those of `dynamics.pump`, and the plant gets the pressure.
    """

    name = "drive"
    period_ns = TICK_NS

    def __init__(self, plant: "Plant", pump: Pump, plan: DrivePlan) -> None:
        self._plant, self._pump, self._c, self._plan = plant, pump, pump.coefficients, plan
        self._per_nm = self._per_rad_s = plan.units_per_si
        if plan.mode.torque:
            self._per_rad_s = 1 / plan.speed_rad_s_per_unit
        else:  # per mille of the greatest
            self._per_nm = 1000 / pump.max_torque_nm
        entries = {
            CONTROL_WORD: Entry(0, 2, writable=True),
            STATUS_WORD: Entry(0, 2),
            MODE: Entry(0, 1, writable=True),
            MODE_SHOWN: Entry(0, 1),
            MODES_SUPPORTED: Entry(_MODE_BITS, 4),
            SPEED: Entry(0, 4),
            TORQUE: Entry(0, 2),
            Place(0x6007): Entry(1, 2, writable=True),
            Place(0x605A): Entry(2, 2, writable=True),
            Place(0x605E): Entry(2, 2, writable=True),
            Place(0x1018): Entry(4, 1),
        }
        for mode in MODES.values():
            entries[mode.target] = Entry(0, mode.bits // 8, writable=True)
            entries[mode.demand] = Entry(0, mode.bits // 8)
        for subindex in range(1, 5):
            given = plan.identity[subindex - 1] if subindex <= len(plan.identity) else None
            entries[Place(0x1018, subindex)] = Entry(given or 0, 4)
        for place, _ in plan.require:
            entries.setdefault(place, Entry(0, 4, writable=True))
        super().__init__(plan.node, plan.bus, entries)
        entries[Place(0x1000)].value = 2 << 16 | PROFILE  # servo drive
        self._states = DriveStates()
        self._speed_rad_s = self._torque_nm = self._own_pa = 0.0
        self._limited = self._connected = False
        self.refused = 0  #: It has no limits on pressure of its own.

    @property
    def enabled(self) -> bool:
        """Whether the drive runs the pump, even at zero pressure."""
        return self._states.state is _ENABLED

    @property
    def setpoint_pa(self) -> float:
        """Pressure that its rotor makes while it is enabled."""
        return self._own_pa if self.enabled else 0.0

    @property
    def _powered(self) -> bool:
        """Whether no wire cuts its power: without it the motor has no torque."""
        return not self._plant.power_cut

    def fail(self, fault: DriveFault) -> None:
        """Inject a fault: trip the drive, or switch it off for `DriveFault.NONE`."""
        if fault is DriveFault.NONE:
            self._states.command(ControlWord.DISABLE_VOLTAGE)
        else:
            self._states.trip(fault)
            self.emergency(INTERNAL_ERROR)

    def taken(self, now_ns: int) -> None:  # noqa: ARG002
        """Follow the control word."""
        faulted = self._states.state is DriveState.FAULT
        self._states.command(control_word(self.entries[CONTROL_WORD].value))
        if faulted and self._states.state is not DriveState.FAULT:
            self.emergency(0)

    def tick(self, now_ns: int) -> list[Frame]:
        """Watch the controller, drive the pump, and send what is due."""
        entries, states, plant = self.entries, self._states, self._plant
        plant.advance(now_ns)
        if plant.power_cut:
            states.command(ControlWord.DISABLE_VOLTAGE)
        entries[MODE_SHOWN].value = entries[MODE].value
        stopped = abs(plant.pressure_pa) < STOPPED_SHARE * self._pump.max_pressure_pa
        states.tick(stopped=stopped)
        connected = self.state is NetworkState.OPERATIONAL and not self.lost_controller
        if self._connected and not connected and self.enabled:
            self._abort_connection()
        self._connected = connected
        self._own_pa = pressure_pa = self._turn()
        broken = None if plant.power_cut else plant.broken_pump
        if broken is not None and (self.enabled or plant.presses_off):
            pressure_pa = broken(pressure_pa)
        plant.impose_pressure(pressure_pa)
        self._show()
        return super().tick(now_ns)

    def _abort_connection(self) -> None:
        """React as 6007h says."""
        code = self.entries[Place(0x6007)].value
        if code == 1:
            self._states.trip(DriveFault.COMMAND_TIMEOUT)
        elif code in (2, 3):
            self._states.command((ControlWord.DISABLE_VOLTAGE, ControlWord.QUICK_STOP)[code - 2])
        if code in (1, 2, 3):
            self.emergency(HEARTBEAT_LOST)

    def _turn(self) -> float:
        """Turn the rotor for a tick; return the pressure."""
        c, flow_m3_s, step_s = self._c, self._plant.flow_m3_s, TICK_S / STEPS
        mode = next((m for m in MODES.values() if m.number == self.entries[MODE].value), None)
        aim, target = None, 0.0
        if self._states.stopping:  # its ramp ends where the water turns the rotor
            aim = pump_speed(0.0, flow_m3_s, c)
        elif mode is not None and self.enabled:
            entry = self.entries[mode.target]
            self.entries[mode.demand].value = entry.value
            if mode.torque:
                target = entry.signed / self._per_nm
            else:
                aim = min(max(entry.signed / self._per_rad_s, -c.max_speed), c.max_speed)
        # a stop brakes at the motor's limit
        toward = 1.0 if self._states.stopping else 1 - exp(-step_s * c.speed_bandwidth)
        speed = self._speed_rad_s
        for _ in range(STEPS):
            load, slope = pump_load(speed, flow_m3_s, c)
            stiffness = c.inertia / step_s + slope
            demanded = target
            if aim is not None:
                demanded = load + stiffness * (aim - speed) * toward
            most_nm = min(c.max_torque, c.max_power / max(abs(speed), 1e-9)) * self._powered
            self._torque_nm = min(max(demanded, -most_nm), most_nm)
            self._limited = self._torque_nm != demanded
            speed += (self._torque_nm - load) / stiffness
        self._speed_rad_s = speed
        return pump_pressure(speed, flow_m3_s, c)

    def _show(self) -> None:
        entries = self.entries
        if not self.enabled:
            for mode in MODES.values():
                entries[mode.demand].value = 0
        bits = _REMOTE | _VOLTAGE * self._powered | _AT_LIMIT * self._limited
        entries[STATUS_WORD].value = self._states.state | bits
        for place, value in (
            (SPEED, self._speed_rad_s * self._per_rad_s),
            (TORQUE, self._torque_nm * self._per_nm),
        ):
            entries[place].value = math.floor(value + 0.5) & (1 << 8 * entries[place].size) - 1


def control_word(word: int) -> ControlWord:
    """The command of a control word, by its bits (CiA 402-2, table of device control commands)."""
    for mask, bits, command in (
        (0x80, 0x80, ControlWord.FAULT_RESET),
        (0x02, 0, ControlWord.DISABLE_VOLTAGE),
        (0x04, 0, ControlWord.QUICK_STOP),
        (0x01, 0, ControlWord.SHUTDOWN),
        (0x08, 0x08, ControlWord.ENABLE_OPERATION),
    ):
        if word & mask == bits:
            return command
    return ControlWord.SWITCH_ON
