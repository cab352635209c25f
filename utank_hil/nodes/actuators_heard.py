"""Drive of the pump and valve as the controller hears them."""

import math
from typing import Final

from utank_hil.base.tick import NEVER_NS
from utank_hil.canbus import (
    Catalogue,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Receiver,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.canbus.profiles.device import hear
from utank_hil.nodes.canopen_drive import CanopenDrive, DriveReport
from utank_hil.nodes.plausibility import NEVER_HEARD_NS
from utank_hil.nodes.routing import Routing
from utank_hil.safety.monitors.senders import Heard

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_ENABLED: Final = DriveState.OPERATION_ENABLED
_DRIVE_FAULT: Final = DriveState.FAULT
_DRIVE_BRAKES: Final = DriveState.FAULT_REACTION_ACTIVE
_NO_DRIVE_FAULT: Final = DriveFault.NONE
_VALVE_FOLLOWS: Final = ValveState.FOLLOWING
_VALVE_FAULT: Final = ValveState.FAULT
_NO_VALVE_FAULT: Final = ValveFault.NONE
ABSENT_NS: Final = NEVER_NS
"""Time of receipt of what is not on board: it is never late."""


class DriveHeard:
    """What the pump's drive says: two messages of the native one, or the report of a CANopen drive.

    Without a `pump` nothing is heard, and the drive counts as enabled.
    """

    def __init__(
        self, routing: Routing, catalogue: Catalogue, *, pump: bool, canopen: CanopenDrive | None
    ) -> None:
        self.state: DriveState | None = None if pump else _ENABLED
        self.held_back = self.at_speed = self.warns = False
        self.power_w = 0.0
        self.echo: int | None = None
        self.echo_ns = self._heard_ns = NEVER_HEARD_NS if pump else ABSENT_NS
        self._fault: DriveFault | None = _NO_DRIVE_FAULT
        self._canopen = canopen
        self._first: Receiver[DriveStatus1] | None = None
        self._second_heard = True
        self.watched: tuple[Heard, ...] = ()  #: Counters of both messages.
        self.slow: tuple[int, ...] = ()  #: Its second message: no age tells of its silence.
        if pump and canopen is not None:
            canopen.deliver = self._take_report
            for can_id, taker in canopen.takers.items():
                hear(routing.takers, can_id, taker)
            self.watched = canopen.watched
            routing.watched += canopen.watched
            self.slow = (canopen.watched[1].can_id,)
        elif pump:
            self._second_heard = False
            self._first = routing.subscribe(catalogue.receiver(DriveStatus1), self._take_first)
            second = routing.subscribe(catalogue.receiver(DriveStatus2), self._take_second)
            self.slow = (second.can_id,)
            self.watched = self._first, second

    @property
    def native(self) -> bool:
        """Whether it is the native drive that is heard."""
        return self._first is not None

    @property
    def valid(self) -> bool:
        """Whether the drive's frames arrive intact and in order; of a native one the first's."""
        if self._canopen is not None:
            status, measured = self._canopen.watched
            return status.valid and measured.valid
        return self._first is None or self._first.valid

    @property
    def heard_ns(self) -> int:
        """Time of the newest state; none before both messages have come."""
        return self._heard_ns if self._second_heard else NEVER_HEARD_NS

    @property
    def faulty(self) -> bool:
        """Whether the drive says of itself that it is in fault."""
        state = self.state
        return state is _DRIVE_FAULT or state is _DRIVE_BRAKES or self._fault is not _NO_DRIVE_FAULT

    @property
    def words(self) -> str:
        """What it says of its state."""
        if self._canopen is not None:
            return self._canopen.words
        if self._first is None:
            return ""
        return (
            f"drive: state {_said(self.state)} in DRIVE_STATUS_1, fault {_said(self._fault)} in "
            "DRIVE_STATUS_2"
        )

    def _take_first(self, status: DriveStatus1, now_ns: int) -> None:
        if status.state is None:  # as if the frame had not come
            return
        self.state = status.state
        self.at_speed = status.speed_limited
        self.held_back = status.power_limited or status.speed_limited
        self._heard_ns = now_ns
        if status.command_echo != self.echo:
            self.echo_ns, self.echo = now_ns, status.command_echo

    def _take_second(self, status: DriveStatus2, now_ns: int) -> None:  # noqa: ARG002
        self._fault, self._second_heard = status.fault, True
        self.warns = (
            status.temperature_warning
            or status.voltage_warning
            or status.command_warning
            or status.sensor_warning
        )
        self.power_w = status.bus_voltage_v * status.current_a

    def _take_report(self, report: DriveReport | None, now_ns: int) -> None:
        drive = self._canopen
        assert drive is not None
        if report is None:  # configured, or refused
            refused = bool(drive.setup.problem)
        else:
            self.state, refused, self.held_back, self.warns, self.power_w = report
            self.at_speed = self.held_back and drive.at_speed  # CiA 402 has one bit for all limits
            self._heard_ns = now_ns
        self._fault = DriveFault.INTERNAL if refused else _NO_DRIVE_FAULT


class ValveHeard:
    """What the valve says."""

    def __init__(self) -> None:
        self.opening = 1.0  # open, before it is known and where there is none
        self.echo: int | None = None
        self.echo_ns = self.heard_ns = NEVER_HEARD_NS
        self._state: ValveState | None = None
        self._fault: ValveFault | None = _NO_VALVE_FAULT

    @property
    def follows(self) -> bool:
        """Whether it follows commands."""
        return self._state is _VALVE_FOLLOWS

    @property
    def faulty(self) -> bool:
        """Whether the valve says of itself that it is in fault."""
        return self._state is _VALVE_FAULT or self._fault is not _NO_VALVE_FAULT

    def take(self, status: ValveStatus, now_ns: int) -> None:
        """Take a message that was accepted."""
        self._state, self._fault = status.state, status.fault
        if math.isfinite(status.opening):
            self.opening, self.heard_ns = status.opening, now_ns
        if status.command_echo != self.echo:
            self.echo_ns, self.echo = now_ns, status.command_echo


def _said(value: DriveState | DriveFault | None) -> str:
    return "not available" if value is None else f"{value:d} ({value.name})"
