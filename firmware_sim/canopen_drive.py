"""Pump drive by CiA 402 as a CANopen node: it follows torque or speed, and knows of no pressure."""

import math
from typing import TYPE_CHECKING, Final

from firmware_sim.canopen_node import CanopenNode, Entry
from firmware_sim.drive import DriveStates
from utank_hil.base.elementary import exp
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import ControlWord, DriveFault, DriveState, Frame
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_load, pump_pressure, pump_speed

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


_ENABLED: Final = DriveState.OPERATION_ENABLED
STOPPED_SHARE: Final = 0.02
"""Share of the greatest pressure below which the pump counts as stopped, as of `PumpDrive`."""
STEPS: Final = 2  #: Of the rotor in a tick: its load is integrated implicitly.
HEARTBEAT_LOST: Final = 0x8130  #: Emergency code by CiA 301.
INTERNAL_ERROR: Final = 0x6100
_VOLTAGE, _REMOTE, _AT_LIMIT = 1 << 4, 1 << 9, 1 << 11
_MODE_BITS: Final = sum({1 << each.number - 1 for each in cia.MODES.values()})


class CanopenPumpDrive(CanopenNode):
    """The drive of a ship's file on the plant's pump, with the rotor of `dynamics.pump`."""

    name = "drive"
    period_ns = TICK_NS

    def __init__(self, plant: "Plant", pump: Pump, plan: cia.DrivePlan) -> None:
        self._plant, self._pump, self._c, self._plan = plant, pump, pump.coefficients, plan
        self._per_nm = self._per_rad_s = plan.units_per_si
        if plan.mode.torque:
            self._per_rad_s = 1 / plan.speed_rad_s_per_unit
        else:  # per mille of the greatest
            self._per_nm = 1000 / pump.max_torque_nm
        entries = {
            cia.CONTROL_WORD: Entry(0, 2, writable=True),
            cia.STATUS_WORD: Entry(0, 2),
            cia.MODE: Entry(0, 1, writable=True),
            cia.MODE_SHOWN: Entry(0, 1),
            cia.MODES_SUPPORTED: Entry(_MODE_BITS, 4),
            cia.SPEED: Entry(0, 4),
            cia.TORQUE: Entry(0, 2),
            cia.Place(0x6007): Entry(1, 2, writable=True),
            cia.Place(0x605A): Entry(2, 2, writable=True),
            cia.Place(0x605E): Entry(2, 2, writable=True),
            cia.Place(0x1018): Entry(4, 1),
        }
        for mode in cia.MODES.values():
            entries[mode.target] = Entry(0, mode.bits // 8, writable=True)
            entries[mode.demand] = Entry(0, mode.bits // 8)
        for subindex in range(1, 5):
            given = plan.identity[subindex - 1] if subindex <= len(plan.identity) else None
            entries[cia.Place(0x1018, subindex)] = Entry(given or 0, 4)
        for place, _ in plan.require:
            entries.setdefault(place, Entry(0, 4, writable=True))
        cobs = {0x1400: cia.RECEIVED_1, 0x1800: cia.SENT_1, 0x1801: cia.SENT_2}
        pdos = {index: cob + plan.node for index, cob in cobs.items()}
        super().__init__(plan.node, plan.bus, entries, pdos)
        entries[cia.Place(0x1000)].value = 2 << 16 | cia.PROFILE  # servo drive
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
        self._states.command(control_word(self.entries[cia.CONTROL_WORD].value))
        if faulted and self._states.state is not DriveState.FAULT:
            self.emergency(0)

    def tick(self, now_ns: int) -> list[Frame]:
        """Watch the controller, drive the pump, and send what is due."""
        entries, states, plant = self.entries, self._states, self._plant
        plant.advance(now_ns)
        if plant.power_cut:
            states.command(ControlWord.DISABLE_VOLTAGE)
        entries[cia.MODE_SHOWN].value = entries[cia.MODE].value
        stopped = abs(plant.pressure_pa) < STOPPED_SHARE * self._pump.max_pressure_pa
        states.tick(stopped=stopped)
        connected = self.state is cia.NetworkState.OPERATIONAL and not self.lost_controller
        if self._connected and not connected and self.enabled:
            self._abort_connection()
        failed = entries[cia.Place(0x1001)].value and not self._connected
        if connected and failed and states.state is not DriveState.FAULT:  # it is heard again
            self.emergency(0)
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
        code = self.entries[cia.Place(0x6007)].value
        if code == 1:
            self._states.trip(DriveFault.COMMAND_TIMEOUT)
        elif code in (2, 3):
            self._states.command((ControlWord.DISABLE_VOLTAGE, ControlWord.QUICK_STOP)[code - 2])
        if code in (1, 2, 3):
            self.emergency(HEARTBEAT_LOST)

    def _turn(self) -> float:
        """Turn the rotor for a tick; return the pressure."""
        c, flow_m3_s, step_s = self._c, self._plant.flow_m3_s, TICK_S / STEPS
        number = self.entries[cia.MODE].value
        mode = next((each for each in cia.MODES.values() if each.number == number), None)
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
            for mode in cia.MODES.values():
                entries[mode.demand].value = 0
        bits = _REMOTE | _VOLTAGE * self._powered | _AT_LIMIT * self._limited
        entries[cia.STATUS_WORD].value = self._states.state | bits
        for place, value in (
            (cia.SPEED, self._speed_rad_s * self._per_rad_s),
            (cia.TORQUE, self._torque_nm * self._per_nm),
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
