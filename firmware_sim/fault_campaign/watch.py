"""Observer of the bench after a fault: a passive node, and a log of the bus."""

import math
from collections.abc import Iterable
from itertools import pairwise, zip_longest

from firmware_sim.fault_campaign.campaign import Row
from firmware_sim.faulty_bench import FaultyBench
from utank_hil import canbus
from utank_hil.base.tick import TICK_NS
from utank_hil.nodes.controller import ControllerNode
from utank_hil.safety.situation import Demand

Heard = tuple[int, int, bytes]  #: Time in ns, identifier and data of a frame on the bus.

_CATALOGUE = canbus.load_catalogue()
ROUNDING_PA = 8.0
"""Resolution of the pressure in PUMP_CMD: each of two commands is rounded by half of it."""
JITTER_S = 0.002  #: Extra delay of a command in s on a loaded bus of 250 kbit/s: four frames.


class BusLog:
    """Log of every frame on the bus, and of the controller's commands and status."""

    node: ControllerNode  #: Sender of the commands; must be set before the first frame.

    def __init__(self) -> None:
        self.frames: list[Heard] = []
        #: Time, pressure, and whether the pressure was to be cut.
        self.commands: list[tuple[int, float, bool]] = []
        self.shown: list[tuple[int, canbus.ControllerStatus]] = []
        self.told: list[tuple[int, canbus.Fault]] = []  #: Faults sent in ALARM.

    def __call__(self, time_ns: int, sender: str, frame: canbus.Frame) -> None:
        """Record a frame."""
        self.frames.append((time_ns, frame.can_id, frame.data))
        message = _CATALOGUE.decoded(frame) if sender == "controller" else None
        if isinstance(message, canbus.PumpCommand):
            cut = self.node.safety.supervisor.demand is Demand.ZERO
            self.commands.append((time_ns, message.pressure_pa, cut))
        elif isinstance(message, canbus.ControllerStatus):
            self.shown.append((time_ns, message))
        elif isinstance(message, canbus.Alarm) and message.code:
            self.told.append((time_ns, message.code))

    def commanded_until(self, since_ns: int) -> int:
        """Time in ns of the last command other than zero."""
        pressed = [time_ns for time_ns, pressure_pa, _ in self.commands if abs(pressure_pa) > 0]
        return max([since_ns, *pressed])

    def steepest_pa_s(self, since_ns: int) -> float:
        """Largest rate of the commands, cuts excepted, corrected for rounding."""
        commands = [each for each in self.commands if each[0] >= since_ns]
        return max(
            (
                (abs(later_pa - pressure_pa) - ROUNDING_PA) / ((later - time) * 1e-9 + JITTER_S)
                for (time, pressure_pa, _), (later, later_pa, cut) in pairwise(commands)
                if not cut
            ),
            default=0.0,
        )


def first_difference(
    reference: list[Heard], heard: list[Heard], end_ns: int
) -> tuple[Heard | None, Heard | None] | None:
    """First frames, before a time, in which two logs differ; None if there are none."""
    for there, here in zip_longest(reference, heard):
        if there != here:
            known = [each[0] for each in (there, here) if each is not None]
            return (there, here) if min(known) < end_ns else None
    return None


class Watch:
    """Observer of controller, drive and ship in each tick, after all of them.

    The operator of `row` acts at times after the first tick. `degraded_most` is the permitted
    pressure in Pa while it is halved, and the time in ns to reach it.
    """

    name = "watch"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(
        self, bench: FaultyBench, row: Row, degraded_most: tuple[float, int] = (math.inf, 0)
    ) -> None:
        self._bench = bench
        self._within_ns = (row.limit.found_ms or math.inf) * 1e6
        self._counts_from = row.limit.counts_from
        self._codes = {canbus.Fault[name] for name in row.expect.codes}
        self._script = sorted(row.fault.operator, key=lambda timed: timed.time_s)
        self._degraded_most = degraded_most
        self._start_ns: int | None = None
        self._noted = self._count()
        now_ns = bench.lockstep.now_ns
        #: First time at which the controller was in charge ("active"), latched a fault ("found"),
        #: halved the pressure ("halved"), rejected, missed or discarded a frame ("noted"), or
        #: raised one of the row's alarms ("alarm"). The last time in charge with all of the
        #: pressure, before a fault was latched ("full").
        self.first_ns: dict[str, int] = {}
        if bench.node.mode is canbus.Mode.ACTIVE:
            self.first_ns["active"] = now_ns
        #: First time at which the condition of `Limit.counts_from` held; for the pressure, at which
        #: it held until detection, or for the row's deadline.
        self.over_ns: int | None = None
        #: Last time at which the drive's set-point was not zero, or the valve followed.
        self.pressed_ns = self._undegraded_ns = now_ns - TICK_NS
        self.code = canbus.Fault.NONE  #: First latched fault; while there is none, the fault shown.
        self.armed_again = self._waited = False
        self.beyond_share_pa = 0.0  #: Largest excess of the drive's set-point over `degraded_most`.
        self.rolls: list[float] = []  #: Roll in each tick.

    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Ignore the frame."""

    def _count(self) -> int:
        """Number of frames that the controller refused or missed so far."""
        inbox = self._bench.node.inbox
        streams = sum(sum(each.rejected.values()) + each.lost for each in inbox.watched)
        return streams + inbox.foreign + inbox.discarded

    def _apart(self, name: str) -> float:
        """Deviation of a received value from the truth, or of the ship from upright."""
        ship, node = self._bench.ship, self._bench.node
        if name == "over_roll_rad":
            return abs(ship.plant.roll_rad)
        if name == "pressure_pa":
            return abs(node.measured.pressure_pa - ship.drive.setpoint_pa) if ship.drive else 0.0
        source = node.motion if hasattr(node.motion, name) else node.measured
        return abs(float(getattr(source, name)) - float(getattr(ship.plant, name)))

    def tick(self, now_ns: int) -> Iterable[canbus.Frame]:
        """Observe one tick."""
        if self._start_ns is None:
            self._start_ns = now_ns
        ship, node, first_ns = self._bench.ship, self._bench.node, self.first_ns
        while self._script and now_ns - self._start_ns >= self._script[0].time_s * 1e9:
            ship.panel.press(self._script.pop(0).action)
        supervisor = node.safety.supervisor
        mode, active = supervisor.mode, supervisor.mode is canbus.Mode.ACTIVE
        if mode is canbus.Mode.FAULT and "found" not in first_ns:
            first_ns["found"], self.code = now_ns, supervisor.fault
        self.armed_again |= active and "found" in first_ns
        self._look_at_share(now_ns, degraded=active and supervisor.degraded)
        if active and not supervisor.degraded and "found" not in first_ns:
            first_ns["full"] = now_ns
        if "found" not in first_ns and (node.fault is not canbus.Fault.NONE or self._waited):
            self.code = node.fault
        self._waited = mode is canbus.Mode.INIT  # a fault that delayed INIT and is over is no fault
        listed = now_ns % (10 * TICK_NS) == 0
        for name, holds in (
            ("active", active),
            ("halved", active and supervisor.degraded),
            ("noted", "noted" not in first_ns and self._count() > self._noted),
            ("alarm", listed and not node.safety.alarms.codes.isdisjoint(self._codes)),
        ):
            if holds:
                first_ns.setdefault(name, now_ns)
        if (ship.drive and ship.drive.setpoint_pa) or (ship.valve and ship.valve.following):
            self.pressed_ns = now_ns
        self._look_at_difference(now_ns)
        self.rolls.append(ship.plant.roll_rad)
        return ()

    def _look_at_difference(self, now_ns: int) -> None:
        for name, limit in self._counts_from.items():
            if self._apart(name) <= limit:
                # the pressure may cross its set-point briefly; a lasting deviation was to be found
                long = self.over_ns is not None and now_ns - self.over_ns > self._within_ns
                if name == "pressure_pa" and "found" not in self.first_ns and not long:
                    self.over_ns = None
            elif self.over_ns is None:
                self.over_ns = now_ns

    def _look_at_share(self, now_ns: int, *, degraded: bool) -> None:
        """Update the excess of the drive's set-point over the halved pressure limit."""
        drive, (most_pa, within_ns) = self._bench.ship.drive, self._degraded_most
        if not degraded or drive is None:
            self._undegraded_ns = now_ns
        elif now_ns - self._undegraded_ns > within_ns + TICK_NS:
            beyond_pa = abs(drive.setpoint_pa) - most_pa - ROUNDING_PA
            self.beyond_share_pa = max(self.beyond_share_pa, beyond_pa)
