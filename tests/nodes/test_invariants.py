"""The invariants of docs/safety.md under pairs of faults, begun in every phase of the modes.

A controller node with the emulated drive behind it, on a table. A walk, drawn from a seed, brings
it into each phase, lets each fault and each order begin there and other faults follow. Each
tick is judged by the fault table and by the bench's own knowledge of what was ordered. What only
monitors find, or a valve, a second sensor or hard-wired inputs have, is put into what is
judged: here are none of them to say it. `utank-hil faults` has the real ones.
"""

import hashlib
import math
import random
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from controller_bench import CATALOGUE, LIMITS, MS, VERSION, ControllerBench
from values import changed

from firmware_sim.drive import PumpDrive
from firmware_sim.scenario_sections import DriveLimits
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import (
    Address,
    AddressClaim,
    DriveFault,
    DriveStatus1,
    Fault,
    Frame,
    Mode,
    OperatorCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.safety import judging
from utank_hil.safety.faults import FAULTS, Condition, Reaction
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import Demand, ValveReport
from utank_hil.safety.supervisor import DISARMED_ZERO_WITHIN_MS

SEED = 1
SAFETY = SafetyLimits()
PLANT: Any = SimpleNamespace(
    advance=lambda now_ns: None, drive_pump=lambda *_, **__: None, brake_pump=lambda: None,
    pressure_pa=0.0, pump_speed_rad_s=0.0, pump_power_w=0.0, pressure_limited=False,
    speed_limited=False, rate_limited=False, power_limited=False, power_cut=False,
)  # fmt: skip


def conditions_of(reaction):
    return [each for row in FAULTS for each in row.conditions if each.reaction is reaction]


STOPPING, RAMPING = conditions_of(Reaction.STOP), conditions_of(Reaction.RAMP)


class Table(ControllerBench):
    """The bench with a drive of its own mind; every tick is judged."""

    def __init__(self, draw):
        super().__init__(start_ns=5_000_000_007)
        self.drive = PumpDrive(PLANT, DriveLimits(), CATALOGUE, configuration_version=VERSION)
        self.drive_follows = False  # of the bench: the drive says itself what it does
        self.deaf = False
        self.late_ticks = 0
        self.each_tick: dict[str, Callable[[], None]] = {}
        self.trace = hashlib.sha256()
        self._draw = draw
        self._arms = self._arms_used = 0
        self._zero_by_ns = 1 << 62
        self.cuts = 0
        self.named: set[Fault] = set()
        self.measured: dict[str, Any] = {}
        self.own: dict[str, Any] = {}
        self.found = 0
        self.spare_age_ms = 0.0
        safety = self.node.safety
        judge, update = safety.judge, safety.supervisor.update

        def judged(measured, own):
            return judge(changed(measured, **self.measured), changed(own, **self.own))

        def updated(situation, standing):
            if self.found or self.spare_age_ms:
                situation = changed(situation, found=self.found, spare_age_ms=self.spare_age_ms)
                standing = judging.standing(situation, SAFETY)
            safety.situation = situation
            update(situation, standing)

        safety.judge = judged
        safety.supervisor.update = updated
        self.began: Counter[Condition] = Counter()

    def order_is(self, **changes):
        self._arms += bool(changes.get("arm")) and not self.order.arm
        super().order_is(**changes)

    def hear(self, frames):
        frames = list(frames)
        super().hear(frames)
        for frame in frames:
            self.trace.update(b"%d %x %b" % (self.now_ns, frame.can_id, frame.data))
            if not self.deaf:
                self.drive.receive(frame, self.now_ns)
        self.drive.tick(self.now_ns)
        self.drive_state = self.drive._states.state

    def tick(self, late_ticks=0):
        for act in self.each_tick.values():
            act()
        before_pa, mode = self.node.command_pa, self.node.mode
        late_ticks, self.late_ticks = self.late_ticks, 0
        super().tick(late_ticks)
        self._judge(before_pa, mode)

    def _judge(self, before_pa, mode_before):
        node, seen = self.node, self.node.safety.situation
        self.named |= node.safety.alarms.codes | {node.fault}
        pressure_pa, mode = node.command_pa, node.mode
        now_ns = self.now_ns - TICK_NS
        # 1: zero unless armed, fresh and within limits
        assert abs(pressure_pa) <= LIMITS.pressure_pa
        if pressure_pa:
            assert mode in (Mode.ACTIVE, Mode.PASSIVE, Mode.FAULT)
            assert seen.motion.age_ms <= 250 + TICK_S * 1e3
        if mode is Mode.ACTIVE:
            assert self.order.arm
            assert not self.order.stop
            assert seen.motion.age_ms <= SAFETY.motion_age_ms
            assert not any(each.holds(seen, SAFETY) for each in RAMPING)
        # 2: at zero with whatever stops, in its time with what ramps, and no arming by itself
        if any(each.holds(seen, SAFETY) for each in STOPPING):
            assert pressure_pa == 0.0
        self._judge_ramp(mode, mode_before, now_ns)
        if mode is Mode.ACTIVE and mode_before is not Mode.ACTIVE:
            assert self._arms > self._arms_used
            self._arms_used = self._arms
        if mode_before is Mode.FAULT:
            assert mode in (Mode.FAULT, Mode.STANDBY, Mode.INIT)
        # 3: the rate limit, but for a cut
        step_pa = abs(pressure_pa - before_pa)
        if step_pa > LIMITS.rate_pa_s * TICK_S * (1 + 1e-9):
            assert pressure_pa == 0.0
            assert node.safety.supervisor.demand is Demand.ZERO
            self.cuts += 1
        # 4: the drive's own limiter never has to refuse
        assert self.drive.refused == 0

    def _judge_ramp(self, mode, mode_before, now_ns):
        if mode in (Mode.PASSIVE, Mode.FAULT) and mode_before is Mode.ACTIVE:
            within_ms = DISARMED_ZERO_WITHIN_MS if mode is Mode.PASSIVE else 1000
            self._zero_by_ns = now_ns + within_ms * MS
        if mode is Mode.FAULT:
            for each in RAMPING:
                if each.holds(self.node.safety.situation, SAFETY):
                    by_ns = now_ns + each.zero_within_ms * MS
                    self._zero_by_ns = min(self._zero_by_ns, by_ns)
        if mode is Mode.ACTIVE:
            self._zero_by_ns = 1 << 62
        elif now_ns >= self._zero_by_ns:
            assert self.node.command_pa == 0.0

    @property
    def phase(self):
        """Mode, and what is under way in it."""
        supervisor = self.node.safety.supervisor
        if supervisor.arming:
            return "ARMING"
        if supervisor._reset_until_ns is not None:
            return "RESETTING"
        moving = bool(self.node.command_pa) and supervisor.mode is not Mode.ACTIVE
        return supervisor.mode.name + (" RAMP" if moving else "")


def silent(kind):
    return lambda table: table.silent.add(kind), lambda table: table.silent.discard(kind)


def every_tick(name, act):
    return (
        lambda table: table.each_tick.__setitem__(name, lambda: act(table)),
        lambda table: table.each_tick.pop(name, None) and None,
    )


def field(**values):
    """Attributes of the bench, and what they are when all is well."""
    well = {name: getattr(Table(random.Random(0)), name) for name in values}

    def put(table, what):
        for name, value in what.items():
            setattr(table, name, value)

    return lambda table: put(table, values), lambda table: put(table, well)


def judged(part, **values):
    """What is judged and nothing on this bench says: in the `part` measured or own."""

    def begin(table):
        getattr(table, part).update(values)

    def end(table):
        for name in values:
            getattr(table, part).pop(name, None)

    return begin, end


def found(reaction):
    """What the monitors find that has a reaction: one of it after the other."""
    known = [each for each in conditions_of(reaction) if each.findings]

    def begin(table):
        its = min(known, key=table.began.__getitem__)
        table.began[its] += 1
        mask = its.findings
        bits = [1 << place for place in range(mask.bit_length()) if mask >> place & 1]
        table.found |= table._draw.choice(bits)

    def end(table):
        table.found = 0

    return begin, end


def spoilt(kind):
    def flip(of, frame):
        data = bytes([frame.data[0] ^ 0x41]) + frame.data[1:]
        return (Frame(frame.can_id, data) if of is kind else frame,)

    def begin(table):
        table.spoil = flip

    def end(table):
        table.spoil = lambda of, frame: (frame,)

    return begin, end


LEVELS = SensorTank(0.0, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD)
BEGIN_AND_END: dict[str, tuple[Callable[[Table], None], Callable[[Table], None]]] = {
    "motion silent": silent(SensorMotion),
    "tank silent": silent(SensorTank),
    "pump sensor silent": silent(SensorPump),
    "drive silent": silent(DriveStatus1),
    "panel silent": silent(OperatorCommand),
    "motion not available": field(motion=SensorMotion(math.nan, 0.0, Quality.GOOD)),
    "motion spoilt": spoilt(SensorMotion),
    "levels spoilt": spoilt(SensorTank),
    "high level": field(tank=LEVELS._replace(port_high=Switch.ON)),
    "roll over its limit": field(motion=SensorMotion(0.4, 0.0, Quality.GOOD)),
    "drive fault": field(drive_fault=DriveFault.OVERCURRENT),
    "drive deaf": field(deaf=True),
    "versions": field(versions=(CATALOGUE.version, VERSION + 1)),
    "panel's versions": field(panel_versions=(CATALOGUE.version, VERSION + 1)),
    "link": every_tick("link", lambda table: table.node.link_error(table.now_ns, "down")),
    "flood": every_tick("flood", lambda table: table.node.other_frames(40)),
    "own identifier": every_tick(
        "own", lambda table: table.send(Frame(CATALOGUE.codec(
            AddressClaim, Address.CONTROLLER).can_id, bytes(8)))
    ),
    "one late tick": (lambda table: setattr(table, "late_ticks", 6), lambda table: None),
    "late ticks": every_tick("late", lambda table: setattr(table, "late_ticks", 1)),
    "law without answer": (
        lambda table: setattr(table.law, "answer_pa", math.nan),
        lambda table: setattr(table.law, "answer_pa", 40e3),
    ),
    "drive warns": field(drive_warns=True),
    "not commissioned": judged("own", commissioned=False),
    "hard-wired stop": judged("measured", hardwired_stop=True),
    "hard-wired inputs silent": judged("measured", hardwired_age_ms=1e3),
    "spare sensor silent": field(spare_age_ms=1e3),
    "valve silent": judged("own", valve=ValveReport(age_ms=1e3)),
    "valve fault": judged("own", valve=ValveReport(fault=True)),
    "valve elsewhere": judged("own", valve=ValveReport(off_ms=1e3)),
    "little stability": judged("own", gm_low=True),
    "forecast silent": judged("measured", forecast_age_ms=1e3),
    "device reports an error": judged("measured", device_error=True),
    "forecast contradicted": judged("own", doubts_forecast=True),
    "law at its own limit": judged("own", law_passed_limit=True),
    "found, stops": found(Reaction.STOP),
    "found, ramps": found(Reaction.RAMP),
    "found, halves": found(Reaction.HALVE),
    "found, warns": found(Reaction.WARN),
}  # fmt: skip
ORDERS: dict[str, Callable[[Table], None]] = {
    "arm": lambda table: table.order_is(mode_request=Mode.ACTIVE, arm=True),
    "disarm": lambda table: table.order_is(mode_request=Mode.PASSIVE, arm=False),
    "passive, arm bit held": lambda table: table.order_is(mode_request=Mode.PASSIVE),
    "standby": lambda table: table.order_is(mode_request=Mode.STANDBY, arm=False),
    "stop": lambda table: table.order_is(mode_request=Mode.STANDBY, arm=False, stop=True),
    "reset": lambda table: table.order_is(reset=True),
    "no mode": lambda table: table.order_is(mode_request=None),
}


def restore(table):
    """End every fault and let go of every button, in STANDBY."""
    conflict, flood = "own" in table.each_tick, "flood" in table.each_tick
    for _, end in BEGIN_AND_END.values():
        end(table)
    table.law.answer_pa = table._draw.choice((-1, 1)) * table._draw.uniform(5e3, 60e3)
    table.order_is(mode_request=Mode.STANDBY, arm=False, stop=False, reset=False, acknowledge=False)
    if conflict:  # nor is waiting for it what is tried here
        table.node.inbox._nodes._conflict_ns = -(1 << 62)
    table.run(2000 if flood else 120)  # the load is that of the last whole second
    for _ in range(4):
        table.order_is(reset=True)
        table.run(60)
        table.order_is(reset=False)
        table.run(20)
        if table.node.mode is Mode.STANDBY:
            table.node.safety.supervisor._rolled_over_ns = -(1 << 62)  # nor is this
            return
        table.run(600)
    raise AssertionError(f"no STANDBY: {table.node.mode} {table.node.fault}")


def under_pressure(table):
    table.law.answer_pa = math.copysign(40e3, table.law.answer_pa)
    ORDERS["arm"](table)
    table.run(260)
    assert table.node.mode is Mode.ACTIVE, (table.node.mode, table.node.fault)


def ramping(table):
    under_pressure(table)
    ORDERS["disarm"](table)
    table.tick()


def fault_ramping(table):
    under_pressure(table)
    table.motion = SensorMotion(0.4, 0.0, Quality.GOOD)
    table.tick()
    table.motion = SensorMotion(0.0, 0.0, Quality.GOOD)


def faulted(table):
    under_pressure(table)
    table.node.link_error(table.now_ns, "down")
    table.tick()


def resetting(table):
    faulted(table)
    BEGIN_AND_END["high level"][0](table)
    table.run(40)
    ORDERS["reset"](table)
    table.tick()


def arming(table):
    table.deaf = True
    ORDERS["arm"](table)
    table.tick()


def passive(table):
    table.order_is(mode_request=Mode.PASSIVE, arm=False)
    table.run(60)


def waiting(table):
    BEGIN_AND_END["versions"][0](table)
    table.run(110)


PHASES: dict[str, Callable[[Table], None]] = {
    "INIT": waiting,
    "STANDBY": lambda table: None,
    "ARMING": arming,
    "ACTIVE": under_pressure,
    "PASSIVE RAMP": ramping,
    "PASSIVE": passive,
    "FAULT RAMP": fault_ramping,
    "FAULT": faulted,
    "RESETTING": resetting,
}


class Walk:
    """Goes through phases, faults and orders, and counts what it met."""

    def __init__(self, seed):
        self.draw = random.Random(seed)
        self.table = Table(self.draw)
        self.table.run(400)
        self.cells: Counter[tuple[str, str]] = Counter()
        self.pairs: Counter[tuple[str, str]] = Counter()

    def go(self, phase, events):
        """Reach a phase, let events begin one after the other, and end all."""
        table, draw = self.table, self.draw
        restore(table)
        PHASES[phase](table)
        assert table.phase == phase, (table.phase, phase)
        for event in events:
            self.cells[table.phase, event] += 1
            if event in ORDERS:
                ORDERS[event](table)
            else:
                BEGIN_AND_END[event][0](table)
            for _ in range(draw.choice((1, 2, 5, 20))):
                table.tick()
        self.pairs[events[0], events[-1]] += 1
        table.run(10 * draw.randint(0, 10))

    def pairs_of_faults(self, most):
        """Faults after every fault, so many of them, the first in one phase after the other."""
        faults, phases = list(BEGIN_AND_END), list(PHASES)
        pairs = [(first, then) for first in faults for then in faults if first != then]
        self.draw.shuffle(pairs)
        turn: Counter[str] = Counter()
        for first, then in pairs:
            if turn[first] == most and "found" not in first:  # that is one condition each time
                continue
            phase = phases[(turn[first] + faults.index(first)) % len(phases)]
            turn[first] += 1
            self.go(phase, (first, then))
        self.go("ACTIVE", ("panel silent",))
        self.table.run(SAFETY.panel_age_armed_ms)
        for order in ORDERS:
            for phase in phases:
                self.go(phase, (order, self.draw.choice(list(ORDERS))))


def printed(cells):
    lines = [f"{'':24}" + "".join(f"{phase:>14}" for phase in PHASES)]
    for event in (*BEGIN_AND_END, *ORDERS):
        counts = "".join(f"{cells[phase, event]:14}" for phase in PHASES)
        lines.append(f"{event:24}{counts}")
    return "\n".join(lines)


@pytest.mark.slow
@pytest.mark.evidence("every-pair")
@pytest.mark.parametrize("most", [len(PHASES), len(BEGIN_AND_END)], ids=["some", "every-pair"])
def test_invariants_hold_in_every_phase_under_pairs_of_faults(most):
    walk = Walk(SEED)
    try:
        walk.pairs_of_faults(most)
    except AssertionError:
        print(f"seed {SEED}, at {walk.table.ms:.0f} ms: {list(walk.cells)[-3:]}")
        raise
    print(printed(walk.cells))
    events = [*BEGIN_AND_END, *ORDERS]
    missed = [(phase, event) for phase in PHASES for event in events
              if not walk.cells[phase, event]]  # fmt: skip
    assert not missed
    faults = list(BEGIN_AND_END)
    followers = Counter(one for one, two in walk.pairs if two in faults and one != two)
    assert min(followers[one] for one in faults) == min(most, len(faults) - 1)
    known = {row.code for row in FAULTS}
    assert walk.table.named - {Fault.NONE} == known, known - walk.table.named
    assert all(walk.table.began[each] for row in FAULTS for each in row.conditions if each.findings)
    assert walk.table.cuts > 100
    assert len(walk.table.commands) > 5000


@pytest.mark.parametrize("event", BEGIN_AND_END)
def test_no_event_of_the_walk_goes_without_effect(event):
    """It is named while control lasts, or keeps from arming."""
    named = []
    for phase in ("ACTIVE", "STANDBY"):
        table = Table(random.Random(SEED))
        table.run(400)
        PHASES[phase](table)
        table.named.clear()
        BEGIN_AND_END[event][0](table)
        ORDERS["arm"](table)
        table.run(5100)
        named.append(bool(table.named - {Fault.NONE}))
        named.append(table.node.mode is not Mode.ACTIVE)
    assert any(named)


def test_the_same_seed_gives_the_same_trace():
    def trace(seed):
        walk = Walk(seed)
        for phase in PHASES:
            walk.go(phase, (walk.draw.choice(list(BEGIN_AND_END)), "reset"))
        return walk.table.trace.hexdigest()

    assert trace(3) == trace(3) != trace(4)
