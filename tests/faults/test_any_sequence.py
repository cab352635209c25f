"""Any sequence of orders at two stations, of faults and recoveries: the invariants hold throughout.

The whole ship in lockstep. Each tick of the controller is judged by the fault table and by the
frames that it heard, which are decoded here, apart from it.
"""

from functools import cache
from typing import Final

import pytest
from fault_bench import CATALOGUE, MS, SECOND, storm
from hypothesis import event, given
from hypothesis import strategies as st
from test_combined_faults import FAULTS, NODE_OF, faults_of, ship

from firmware_sim.faulty_bench import FaultyBench
from utank_hil.assembly import build_law
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import Address, ControllerStatus, Mode, OperatorCommand, Station
from utank_hil.nodes.panel import Action, OperatorPanel
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.safety.faults import FAULTS as TABLE
from utank_hil.safety.faults import Reaction

pytestmark = pytest.mark.slow

RAMP_MS: Final = 1010
STATUS: Final = CATALOGUE.receiver(ControllerStatus).can_id
STATIONS: Final = {
    CATALOGUE.receiver(OperatorCommand, address).can_id: CATALOGUE.receiver(
        OperatorCommand, address
    )
    for address in (Address.OPERATOR, Address.OPERATOR_2)
}


@cache
def ships():
    """Pump and valve in a swell, and the pump alone in the storm, each with all there is twice."""
    twice = {"redundancy": Redundancy(True, True, True)}
    found = []
    storms = storm()
    gpc = storms.controllers["gpc"]
    for scenario, config, law in (ship(), (storms, gpc, build_law(gpc))):
        vessel = config.vessel.model_copy(update=twice)
        config = config.model_copy(update={"vessel": vessel})
        found.append((scenario.model_copy(update={"vessel": vessel}), config, law))
    return found


def holding(node, *reactions, awaited=True, drive_on=True):
    """Faults of the table of which a condition with one of these reactions holds."""
    seen, limits = node.safety.situation, node.safety.supervisor.limits
    return {
        row.code
        for row in TABLE
        for each in row.conditions
        if each.reaction in reactions
        and (awaited or each.awaited is None)
        and (drive_on or not each.of_drive_that_should_be_on)
        and each.holds(seen, limits)
    }


class Judged:
    """A controller on the bus, each tick of which is judged."""

    name = "controller"
    period_ns = TICK_NS

    def __init__(self, node, limits):
        self.node, self._limits = node, limits
        self.other_frames, self.link_error, self.stop = (
            node.other_frames, node.link_error, node.stop
        )  # fmt: skip
        self._arms = dict.fromkeys(STATIONS, True)
        self._armed = self._reset = self._stopped = False
        self._left_ns = -SECOND * 10
        self._ready = False

    def receive(self, frame, now_ns):
        receiver = STATIONS.get(frame.can_id)
        order = None if receiver is None else receiver.intact(frame)
        if order is not None:
            self._stopped |= order.stop
            self._reset |= order.reset
            self._armed |= order.arm and not self._arms[frame.can_id]
            self._arms[frame.can_id] = order.arm
        self.node.receive(frame, now_ns)

    def tick(self, now_ns):
        node = self.node
        before, before_pa = node.mode, node.command_pa
        frames = list(node.tick(now_ns))
        mode, pressure_pa = node.mode, node.command_pa
        situation = node.safety.situation
        # zero unless armed by an operator, fresh and within limits
        if before is Mode.ACTIVE and mode is not before:
            self._left_ns = now_ns
        if mode is Mode.ACTIVE:
            assert before is mode or self._armed
            assert situation.motion.age_ms <= node.safety.supervisor.limits.motion_age_ms
            self._armed = False
        elif pressure_pa:
            assert now_ns - self._left_ns < RAMP_MS * MS
            assert abs(pressure_pa) <= abs(before_pa)
        assert abs(pressure_pa) <= self._limits.pressure_pa
        # at once with a stop that was heard, and with what stops
        if self._stopped or holding(node, Reaction.STOP):
            assert pressure_pa == 0.0
            assert mode is not Mode.ACTIVE
        # what ends control is latched
        if before is Mode.ACTIVE and holding(node, Reaction.STOP, Reaction.RAMP):
            assert mode is Mode.FAULT
        # by its rate else
        rate_pa = self._limits.rate_pa_s * TICK_S * (1 + 1e-9)
        assert abs(pressure_pa - before_pa) <= rate_pa or pressure_pa == 0.0
        # a fault is left by a reset alone
        if before is Mode.FAULT and mode is not before:
            assert mode is Mode.STANDBY
            assert self._reset
            self._reset = False
        if mode is not Mode.FAULT:
            self._reset = False
        self._stopped = False
        if any(frame.can_id == STATUS for frame in frames):
            self._judge_alarms(mode)
        return frames

    def _judge_alarms(self, mode):
        """By docs/safety.md, *Alarms*: what is there is in the list."""
        node = self.node
        due = holding(node, Reaction.WARN)
        due |= holding(node, Reaction.STOP, awaited=mode is not Mode.INIT, drive_on=False)
        if mode in (Mode.ACTIVE, Mode.FAULT):
            due |= holding(node, Reaction.RAMP, Reaction.HALVE)
        if mode is Mode.FAULT:
            due.add(node.fault)
        self._ready |= mode is not Mode.INIT
        if self._ready:
            assert due <= node.safety.alarms.codes


PRESSES: Final = st.tuples(
    st.sampled_from([Station.OPERATOR] * 3 + [Station.OPERATOR_2]),
    st.sampled_from([*[Action.ARM] * 4, Action.STOP, Action.STOP, *Action]),
)
WHEN: Final = {
    "at_s": st.sampled_from([0.0, 0.003, 0.1]),
    "for_s": st.sampled_from([0.004, 0.03, 0.06, 0.15, 0.5, 1.2, None]),
}
MESSAGES: Final = (
    "SENSOR_MOTION", "SENSOR_MOTION_2", "SENSOR_TANK", "SENSOR_PUMP", "DRIVE_STATUS_1",
    "DRIVE_STATUS_2", "HARDWIRED_INPUTS", "OPERATOR_CMD", "PUMP_CMD", "HEARTBEAT_DRIVE",
)  # fmt: skip
WAITS_MS: Final = st.sampled_from([10, 20, 40, 90, 200, 500, 1100, 2500])


@st.composite
def faults(draw):
    """Any fault of a message or of its node, that may end."""
    message = draw(st.sampled_from(MESSAGES))
    kinds = faults_of(message, NODE_OF[CATALOGUE.named(message).source])
    kind = draw(st.sampled_from(sorted({*kinds} - {"second_panel", "killed", "valve"})))
    return {"kind": kind, **draw(st.fixed_dictionaries({**kinds[kind], **WHEN}))}


STEPS: Final = st.lists(
    st.tuples(st.one_of(PRESSES, PRESSES, faults()), WAITS_MS), min_size=3, max_size=14
)


def run(which, warm_ms, steps):
    """Arm, let pressure build up, and do all that is drawn."""
    scenario, config, law = ships()[which]
    second = OperatorPanel(
        CATALOGUE, configuration_version=config.vessel.version, station=Station.OPERATOR_2
    )
    second.name = "panel 2"
    bench = FaultyBench(
        scenario, config, law, seed=1, script=(),
        tapped=lambda node: Judged(node, config.limits),
    )  # fmt: skip
    bench.join([second])
    panels = {Station.OPERATOR: bench.ship.panel, Station.OPERATOR_2: second}
    now_ns = 500 * MS
    bench.run(now_ns)
    panels[Station.OPERATOR].press(Action.ARM)
    now_ns += warm_ms * MS
    bench.run(now_ns)
    modes, senders = {bench.node.mode}, {"flood", "impostor"}
    for step, wait_ms in steps:
        if isinstance(step, dict):
            if step["kind"] in senders or step["kind"] not in ("flood", "impostor"):
                bench.place(FAULTS.validate_python([step]))
            senders.discard(step["kind"])  # two would have one name
        else:
            station, action = step
            if not panels[station].why_not(action, now_ns):
                panels[station].press(action)
        now_ns += wait_ms * MS
        bench.run(now_ns)
        modes.add(bench.node.mode)
    return bench, modes


@given(st.sampled_from([0, 1, 1, 1]), st.sampled_from([300, 1500, 12_000]), STEPS)
def test_no_pressure_unless_armed_and_no_alarm_is_lost(which, warm_ms, steps):
    _, modes = run(which, warm_ms, steps)
    event(", ".join(sorted(mode.name for mode in modes)))
