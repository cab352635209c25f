"""Pump drive: receives pressure commands, checks them independently, and runs the pump.

The drive is the last line of defence: it goes to zero pressure when commands stop (by the timeout
sent with the last one), and refuses a command outside its own limits.

Its states are those of CiA 402 (IEC 61800-7-201), reduced to the needs of a pump: QUICK_STOP and a
fault brake the motor before it is switched off;
DISABLE_VOLTAGE and SHUTDOWN switch it off at once, as in the standard, and its rotor coasts.
"""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from firmware_sim.scenario_sections import DriveLimits
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    Catalogue,
    ControlWord,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Frame,
    PumpCommand,
)
from utank_hil.nodes.housekeeping import Housekeeping

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


_S, _C = DriveState, ControlWord

# bound once: in Python 3.11 class access to an enum member is eight times slower
_NOT_READY = DriveState.NOT_READY_TO_SWITCH_ON
_ENABLED = DriveState.OPERATION_ENABLED
_NO_FAULT = DriveFault.NONE
_STOPPING = (DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)

# state -> control word -> next state; an unlisted word changes nothing
_TRANSITIONS: dict[DriveState, dict[ControlWord, DriveState]] = {
    _S.SWITCH_ON_DISABLED: {_C.SHUTDOWN: _S.READY_TO_SWITCH_ON},
    _S.READY_TO_SWITCH_ON: {
        _C.SWITCH_ON: _S.SWITCHED_ON,
        _C.QUICK_STOP: _S.SWITCH_ON_DISABLED,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.SWITCHED_ON: {
        _C.ENABLE_OPERATION: _S.OPERATION_ENABLED,
        _C.SHUTDOWN: _S.READY_TO_SWITCH_ON,
        _C.QUICK_STOP: _S.SWITCH_ON_DISABLED,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.OPERATION_ENABLED: {
        _C.SWITCH_ON: _S.SWITCHED_ON,
        _C.SHUTDOWN: _S.READY_TO_SWITCH_ON,
        _C.QUICK_STOP: _S.QUICK_STOP_ACTIVE,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.QUICK_STOP_ACTIVE: {_C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED},
}


class DriveStates:
    """State and fault of the drive; the fault is NONE outside FAULT."""

    def __init__(self) -> None:
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self.fault = DriveFault.NONE
        self._word: ControlWord | None = None

    @property
    def stopping(self) -> bool:
        """Whether a quick stop or a fault reaction is in progress."""
        return self.state in _STOPPING

    def tick(self, *, stopped: bool = True) -> None:
        """Make the transitions that need no command; `stopped` ends a stop in progress."""
        if self.state is _NOT_READY:
            self.state = _S.SWITCH_ON_DISABLED
        elif self.stopping and stopped:
            faulted = self.state is _S.FAULT_REACTION_ACTIVE
            self.state = _S.FAULT if faulted else _S.SWITCH_ON_DISABLED

    def command(self, word: ControlWord | None) -> None:
        """Follow a control word; None, an unknown word, disables the voltage."""
        word = _C.DISABLE_VOLTAGE if word is None else word
        rising = word is not self._word
        self._word = word
        if self.state is _S.FAULT:
            if word is _C.FAULT_RESET and rising:
                self.state, self.fault = _S.SWITCH_ON_DISABLED, DriveFault.NONE
            return
        if word is _C.FAULT_RESET:
            word = _C.DISABLE_VOLTAGE  # without a fault the word means this: bit 1 is not set
        self.state = _TRANSITIONS.get(self.state, {}).get(word, self.state)

    def trip(self, fault: DriveFault) -> None:
        """Enter the fault state by way of its reaction; the first fault is kept."""
        if self.fault is DriveFault.NONE:
            self.state, self.fault = _S.FAULT_REACTION_ACTIVE, fault


NANOSECONDS = 1e-9
MISCODED_COMMANDS_TO_TRIP = 5
"""Consecutive refused commands that trip the drive (docs/safety.md). Chosen; no study."""
STOPPED_SHARE = 0.02
"""Share of the drive's pressure limit below which the pump counts as stopped. Chosen; no study."""
LONGEST_STOP_NS = 500_000_000
"""Time after which a motor that has not removed the pressure is switched off. Chosen; no study."""
MOST_CURRENT_A = 4000.0
"""Range of DRIVE_STATUS_2; a larger current is not available, and not cut to it."""
WARNED_MESSAGES = 2  #: Number of DRIVE_STATUS_2 messages that report one rejected command.
_STOP_WORDS = (ControlWord.QUICK_STOP, ControlWord.DISABLE_VOLTAGE, ControlWord.SHUTDOWN, None)
"""Control words that stop the drive; None, an unknown word, disables the voltage."""
# half a bus step of the set-point: a command at the limit may have been rounded up by it
ROUNDING_PA = 4.0


class PumpDrive:
    """Pump drive with CiA 402 states; its heartbeat has `configuration_version`."""

    name = "drive"
    period_ns = TICK_NS

    def __init__(
        self,
        plant: "Plant",
        limits: DriveLimits,
        catalogue: Catalogue,
        *,
        configuration_version: int,
    ) -> None:
        self._plant = plant
        self._limits = limits
        self._states = DriveStates()
        self._commands = catalogue.receiver(PumpCommand)
        self.hears = frozenset([self._commands.can_id])
        self._status_1 = catalogue.transmitter(DriveStatus1)
        self._status_2 = catalogue.transmitter(DriveStatus2)
        self._status_1_ticks = self._status_1.cycle_ns // TICK_NS
        self._status_2_ticks = self._status_2.cycle_ns // TICK_NS
        self._housekeeping = Housekeeping(Address.DRIVE, catalogue, configuration_version)
        self._accepted_ns = 0
        self._timeout_ns = 0
        self._moving_ns = 0
        self._echo: int | None = None
        self._setpoint_pa = 0.0
        # frames jitter, the set-point changes every cycle: one tick of grace in total
        self._grace_pa = limits.pressure_rate_pa_s * self.period_ns * NANOSECONDS
        self._credit_pa = self._grace_pa
        self._refused_in_a_row = 0
        self._warnings_left = 0
        self._shown_state = self._states.state
        self._ticks = 0
        self.refused = 0  #: Number of commands outside the drive's limits so far.

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Accept a command if it is intact and inside the drive's own limits."""
        if frame.can_id != self._commands.can_id:
            return
        lost = self._commands.lost
        command = self._commands.accept(frame)
        if command is None or self._commands.lost > lost:
            self._warnings_left = WARNED_MESSAGES
        if command is None:
            # out of sequence it may request no pressure, but it may request a stop
            intact = self._commands.intact(frame)
            if intact is not None and intact.control_word in _STOP_WORDS:
                self._states.command(intact.control_word)
            return
        if not self._permitted(command, now_ns):
            if command.control_word in _STOP_WORDS:
                # a stop request counts whatever else is wrong with the command
                self._states.command(command.control_word)
            self.refused += 1
            self._refused_in_a_row += 1
            self._warnings_left = WARNED_MESSAGES
            if self._refused_in_a_row >= MISCODED_COMMANDS_TO_TRIP:
                self._states.trip(DriveFault.COMMAND_REFUSED)
            return
        self._refused_in_a_row = 0
        left_pa = self._reach_pa(now_ns)
        if self._acts(command):
            left_pa -= self._step_away_pa(command.pressure_pa)
        self._credit_pa = min(left_pa, self._grace_pa)
        self._accepted_ns = now_ns
        self._timeout_ns = round(command.timeout_s / NANOSECONDS)
        self._echo = self._commands.counter
        self._states.command(command.control_word)
        enabled = self._states.state is _ENABLED
        self._setpoint_pa = command.pressure_pa if enabled else 0.0

    def _permitted(self, command: PumpCommand, now_ns: int) -> bool:
        limits, pressure_pa = self._limits, command.pressure_pa
        # written so that NaN (not available) fails too
        if not abs(pressure_pa) <= limits.pressure_pa + ROUNDING_PA:
            return False
        if not 0.0 < command.timeout_s <= limits.longest_timeout_ms * 1e-3:
            return False
        if not self._acts(command):
            return True
        step_pa = self._step_away_pa(pressure_pa)
        # both ends of a step may have been rounded
        return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) + 2 * ROUNDING_PA

    def _acts(self, command: PumpCommand) -> bool:
        """Whether the set-point follows the command; otherwise it stays zero."""
        enables = command.control_word is ControlWord.ENABLE_OPERATION
        state = self._states.state
        return state is _ENABLED or (enables and state is DriveState.SWITCHED_ON)

    def _step_away_pa(self, pressure_pa: float) -> float:
        """Step away from the set-point in Pa, 0 for a step toward zero."""
        setpoint_pa = self._setpoint_pa
        toward_zero = abs(pressure_pa) <= abs(setpoint_pa) and pressure_pa * setpoint_pa >= 0.0
        return 0.0 if toward_zero else abs(pressure_pa - setpoint_pa)

    def _reach_pa(self, now_ns: int) -> float:
        """Largest step in Pa that the time since the last command and the remaining grace allow.

        The time counts only up to the command's timeout, and only while the drive was enabled.
        """
        if self._states.state is not _ENABLED:
            return self._credit_pa
        since_s = min(now_ns - self._accepted_ns, self._timeout_ns) * NANOSECONDS
        return self._limits.pressure_rate_pa_s * since_s + self._credit_pa

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Check the command timeout, drive the pump and send the status."""
        states, plant = self._states, self._plant
        plant.advance(now_ns)
        if plant.power_cut:
            states.command(ControlWord.DISABLE_VOLTAGE)
        states.tick(stopped=self._stopped(now_ns))
        enabled = states.state is _ENABLED
        if enabled and now_ns - self._accepted_ns > self._timeout_ns:
            states.trip(DriveFault.COMMAND_TIMEOUT)
            enabled = False
        if not enabled:
            self._setpoint_pa = 0.0
        if states.stopping:
            # a coasting rotor would keep up pressure for half a second
            plant.brake_pump()
        else:
            self._moving_ns = now_ns
            plant.drive_pump(self._setpoint_pa, enabled=enabled)
        frames = []
        if self._ticks % self._status_1_ticks == 0 or states.state is not self._shown_state:
            frames.append(self._status_1_frame())
            self._shown_state = states.state
        if self._ticks % self._status_2_ticks == 0:
            frames.append(self._status_2_frame())
        frames.extend(self._housekeeping.frames(now_ns, faulted=states.fault is not _NO_FAULT))
        self._ticks += 1
        return frames

    @property
    def enabled(self) -> bool:
        """Whether the drive runs the pump, even at zero pressure."""
        return self._states.state is _ENABLED

    @property
    def setpoint_pa(self) -> float:
        """Pressure set-point of the pump in Pa."""
        return self._setpoint_pa

    def fail(self, fault: DriveFault) -> None:
        """Inject a fault: trip the drive, or switch it off for `DriveFault.NONE`."""
        if fault is _NO_FAULT:
            self._states.command(ControlWord.DISABLE_VOLTAGE)
        else:
            self._states.trip(fault)

    def _stopped(self, now_ns: int) -> bool:
        share = abs(self._plant.pressure_pa) / self._limits.pressure_pa
        return share < STOPPED_SHARE or now_ns - self._moving_ns > LONGEST_STOP_NS

    def _status_1_frame(self) -> Frame:
        plant = self._plant
        return self._status_1.frame(
            DriveStatus1(
                pressure_pa=plant.pressure_pa,
                speed_rad_s=plant.pump_speed_rad_s,
                state=self._states.state,
                command_echo=self._echo,
                pressure_limited=plant.pressure_limited,
                speed_limited=plant.speed_limited,
                rate_limited=plant.rate_limited,
                power_limited=plant.power_limited,
            )
        )

    def _status_2_frame(self) -> Frame:
        warned = self._warnings_left > 0
        self._warnings_left = max(self._warnings_left - 1, 0)
        current_a = self._plant.pump_power_w / self._limits.bus_voltage_v
        return self._status_2.frame(
            DriveStatus2(
                fault=self._states.fault,
                bus_voltage_v=self._limits.bus_voltage_v,
                current_a=current_a if abs(current_a) <= MOST_CURRENT_A else math.nan,
                motor_temperature_c=math.nan,
                drive_temperature_c=math.nan,
                temperature_warning=False,
                voltage_warning=False,
                command_warning=warned,
                sensor_warning=False,
            )
        )
