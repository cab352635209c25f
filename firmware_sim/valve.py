"""Valve of a semi-active tank: receives openings, checks them independently, and moves.

It goes to its fail position when commands stop (by the timeout sent with the last one) or its power
fails, and stays there until it is commanded to the fail position once more. So neither a restarted
valve nor one after a fault reset follows commands by itself.
"""

from collections.abc import Iterable
from typing import Final

from firmware_sim.plant import Plant
from firmware_sim.sensors import ForeignFrames
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import (
    Address,
    Catalogue,
    FailPosition,
    Frame,
    ValveCommand,
    ValveControl,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.canbus.profiles.device import HeardMessage
from utank_hil.canbus.profiles.device_plan import COMMANDS, DevicePlan
from utank_hil.canbus.profiles.drive_plan import NetworkState
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.housekeeping import Housekeeping

NANOSECONDS: Final = 1e-9
LONGEST_TIMEOUT_S: Final = 0.1
"""Longest command timeout that the valve accepts, as that of the drive."""
MISCODED_COMMANDS_TO_TRIP: Final = 5
"""Consecutive rejected commands that cause a fault, as in the drive."""
STUCK_OFF: Final = 0.05
"""Deviation from the target above which the valve must move. Chosen; no study."""
STUCK_NS: Final = 200_000_000  #: Time in ns in which it must move. Chosen; no study.
_OPENING, _FOLLOW, _ = range(len(COMMANDS))
_AT_END: Final = 1e-3
"""Distance from an end position below which its limit switch is set. Chosen; no study."""


class ValveNode:
    """Valve with its actuator; its heartbeat has `configuration_version`."""

    name = "valve"
    period_ns = TICK_NS

    def __init__(
        self,
        plant: Plant,
        tank: Tank,
        valve: Valve,
        catalogue: Catalogue,
        *,
        configuration_version: int,
    ) -> None:
        self._plant = plant
        self._tank = tank
        self._valve = valve
        self._catalogue = catalogue
        self._configuration_version = configuration_version
        self._most_step = TICK_S / valve.opening_time_s
        self._fail_position = FailPosition[valve.fail_position.upper()]
        self.opening = valve.fail_opening  #: Position: 0 is shut except for leakage, 1 is open.
        self.stuck = False  #: Injected fault: while set, the valve does not move.
        #: Injected fault: while cleared, the valve is silent and moves to its fail position; set
        #: again, it restarts.
        self.powered = True
        self.refused = 0  #: Number of rejected commands so far.
        self._start()
        self.hears = frozenset([self._commands.can_id])
        plant.set_valve_loss(valve.loss(tank, self.opening))

    def _start(self) -> None:
        self._commands = self._catalogue.receiver(ValveCommand)
        self._statuses = self._catalogue.transmitter(ValveStatus)
        self._status_ticks = self._statuses.cycle_ns // TICK_NS
        self._housekeeping = Housekeeping(
            Address.VALVE, self._catalogue, self._configuration_version
        )
        self._state = ValveState.FAIL_POSITION
        self._fault = ValveFault.NONE
        self._may_follow = False
        self._resetting = True  # a bit already set at power-on is not an edge
        self._asked = self._valve.fail_opening
        self._echo: int | None = None
        self._accepted_ns = self._timeout_ns = 0
        self._refused_in_a_row = 0
        self._free_ns: int | None = None
        self._moving = False
        self._ticks = 0

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Accept a command if it is intact and can be followed."""
        if not self.powered or frame.can_id != self._commands.can_id:
            return
        command = self._commands.accept(frame)
        if command is None:
            # out of sequence it may not open the valve, but it may request the fail position
            intact = self._commands.intact(frame)
            if intact is not None and intact.control is ValveControl.FAIL_POSITION:
                self._go_to_fail_position()
            return
        if command.control is ValveControl.FAIL_POSITION:
            # a request for the fail position counts whatever else is wrong with it
            self._go_to_fail_position()
        # written so that NaN (not available) fails too
        if not (
            command.control is not None
            and 0.0 <= command.opening <= 1.0
            and 0.0 < command.timeout_s <= LONGEST_TIMEOUT_S
        ):
            self.refused += 1
            self._refused_in_a_row += 1
            if self._refused_in_a_row >= MISCODED_COMMANDS_TO_TRIP:
                self._trip(ValveFault.COMMAND_REFUSED)
            return
        self._refused_in_a_row = 0
        self._echo = self._commands.counter
        self._accepted_ns = now_ns
        self._timeout_ns = round(command.timeout_s / NANOSECONDS)
        resetting = command.control is ValveControl.RESET
        if resetting and not self._resetting and self._state is ValveState.FAULT:
            self._state, self._fault = ValveState.FAIL_POSITION, ValveFault.NONE
            self._may_follow = False
            self._free_ns = now_ns  # a fault reset restarts the time allowed for moving
        self._resetting = resetting
        if command.control is ValveControl.FOLLOW and self._may_follow:
            self._state = ValveState.FOLLOWING
            self._asked = command.opening

    @property
    def following(self) -> bool:
        """Whether it follows the commands and is not on its way to the fail position."""
        return self._state is ValveState.FOLLOWING

    def _go_to_fail_position(self) -> None:
        if self._state is not ValveState.FAULT:
            self._state = ValveState.FAIL_POSITION
            self._may_follow = True

    def _trip(self, fault: ValveFault) -> None:
        if self._state is not ValveState.FAULT:
            self._state, self._fault = ValveState.FAULT, fault
        self._may_follow = False

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Check the command timeout, move and send the status."""
        self._plant.advance(now_ns)
        if not self.powered:
            self._start()
            self._move(self._valve.fail_opening, now_ns)
            return ()
        if self._state is ValveState.FOLLOWING and now_ns - self._accepted_ns > self._timeout_ns:
            self._trip(ValveFault.COMMAND_TIMEOUT)
        following = self._state is ValveState.FOLLOWING
        self._move(self._asked if following else self._valve.fail_opening, now_ns)
        frames = []
        if self._ticks % self._status_ticks == 0:
            frames.append(self._statuses.frame(self._status()))
        frames.extend(self._housekeeping.frames(now_ns, faulted=self._state is ValveState.FAULT))
        self._ticks += 1
        return frames

    def _move(self, target: float, now_ns: int) -> None:
        before = self.opening
        if not self.stuck:
            step = min(max(target - before, -self._most_step), self._most_step)
            self.opening = min(max(before + step, 0.0), 1.0)
            self._plant.set_valve_loss(self._valve.loss(self._tank, self.opening))
        self._moving = self.opening != before
        if self._free_ns is None or self._moving or abs(target - before) < STUCK_OFF:
            self._free_ns = now_ns
        elif self.powered and now_ns - self._free_ns > STUCK_NS:
            self._trip(ValveFault.STUCK)

    def _status(self) -> ValveStatus:
        return ValveStatus(
            opening=self.opening,
            state=self._state,
            fault=self._fault,
            command_echo=self._echo,
            fail_position=self._fail_position,
            moving=self._moving,
            open_limit=self.opening > 1 - _AT_END,
            shut_limit=self.opening < _AT_END,
        )


class ForeignValve(ValveNode):
    """Valve of another maker, commanded and heard by its plan.

    It follows as long as it is commanded, and by CANopen as long as it is operational and hears the
    controller's heartbeat; else it goes to its fail position.
    """

    def __init__(
        self,
        plant: Plant,
        tank: Tank,
        valve: Valve,
        plan: DevicePlan[ValveStatus],
        catalogue: Catalogue,
    ) -> None:
        assert plan.command is not None
        self._plan, self._command = plan, plan.command
        self._heard = HeardMessage(self._command)
        super().__init__(plant, tank, valve, catalogue, configuration_version=0)
        self._frames = ForeignFrames(plan, self._statuses, catalogue.codec(ValveStatus))
        #: What it sends, by the identifier of the message that it stands for.
        self.devices = {self._statuses.can_id: self._frames}
        self.hears = self._frames.hears.union(self._command.can_ids)
        self.canopen = () if self._frames.server is None else (self._frames.server,)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a command that is whole and in order."""
        if not self.powered:
            return
        self._frames.receive(frame, now_ns)
        if frame.can_id not in self._command.can_ids or not self._frames.measures:
            return
        if not self._heard.passes(frame.data):
            self.refused += 1
            return
        told = {each.place: each.value(frame.data) for each in self._command.signals}
        self._asked = told[_OPENING]
        self._accepted_ns = now_ns
        self._state = ValveState.FOLLOWING if told.get(_FOLLOW, 1.0) else ValveState.FAIL_POSITION

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Move, and send where it stands."""
        self._plant.advance(now_ns)
        server, frames = self._frames.server, list[Frame]()
        if not self.powered:
            self._start()
            if server is not None:
                server.state = NetworkState.BOOT_UP
        else:
            frames = self._frames.tick(now_ns)
        late = now_ns - self._accepted_ns > round(LONGEST_TIMEOUT_S / NANOSECONDS)
        deaf = server is not None and server.lost_controller
        if late or deaf or not self._frames.measures:
            self._state = ValveState.FAIL_POSITION
        self._move(self._asked if self.following else self._valve.fail_opening, now_ns)
        if self.powered and self._frames.measures:
            frames += self._frames.frames(self._status(), now_ns, self._ticks)
        self._ticks += 1
        return frames
