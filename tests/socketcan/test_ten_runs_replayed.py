"""Ten short runs in real time on ``vcan0``, each replayed bit for bit.

Ship and controller are two processes. What the machine does to their times is in the recording, so
a busy one excuses no difference; only that a run did not meet what it is for.
"""

import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from multiprocessing.synchronize import Barrier
from typing import Final

import pytest
from busy_machine import first_that_can_be_judged, judged_by, lost
from two_processes import CHANNEL, patient_controller

from firmware_sim.run import Job, run_controller
from firmware_sim.ship_side import build_ship_side
from tools.reference_recordings.cases import Case, config_of, scenario_of, ship_nodes
from utank_hil.assembly import build_law
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import ControllerStatus, Fault, Mode, load_catalogue
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.panel import Action
from utank_hil.runners import RealTimeLoop, heard_by
from utank_hil.telemetry.frame_log import FrameLog, Kind
from utank_hil.telemetry.replay import entries_of, replay_log
from utank_hil.telemetry.replay_head import recorded_config

pytestmark = [pytest.mark.socketcan, pytest.mark.timeout(900)]

STATUS: Final = load_catalogue().codec(ControllerStatus)
READY_S: Final = 180.0
ARM: Final = ((0.3, Action.ARM),)
AGAIN: Final = ((3.5, Action.RESET), (4.0, Action.DISARM), (4.3, Action.ARM))


def _fault(kind, message, at_s, for_s, **keys):
    return {"kind": kind, "message": message, "at_s": at_s, "for_s": for_s, **keys}


RUNS: Final[tuple[tuple[Case, set[Mode | Fault]], ...]] = (
    (Case("modes", "gpc", 5, (
        (0.3, Action.PASSIVE), (1.2, Action.ARM), (2.5, Action.DISARM), (3.2, Action.STANDBY),
        (3.7, Action.ARM), (4.5, Action.STOP),
    )), set(Mode) - {Mode.INIT, Mode.FAULT}),
    (Case("planned", "constrained_gpc", 3), {Mode.ACTIVE}),
    (Case("fuzzy", "fuzzy_robust", 3), {Mode.ACTIVE}),
    (Case("linearized", "feedback_linearization", 3), {Mode.ACTIVE}),
    (Case("valve-and-pump", "pump_with_valve", 3, scenario="semi_active"), {Mode.ACTIVE}),
    (Case("motion-silent", "dpc", 6, (*ARM, *AGAIN), (_fault("lost", "SENSOR_MOTION", 1.5, 1.2),)),
     {Mode.ACTIVE, Fault.MOTION_SILENT}),
    (Case("frames-lost-and-damaged", "lqg", 5, ARM, (
        _fault("corrupted", "SENSOR_MOTION", 1.5, 0.02), _fault("lost", "SENSOR_TANK", 2.0, 2.0),
    )), {Mode.ACTIVE, Fault.TANK_SILENT}),
    (Case("spike-then-high-level", "dpc", 4, ARM, (
        _fault("offset", "SENSOR_MOTION", 1.5, 0.01, signals=("roll_rad",), by=0.5),
        _fault("value", "SENSOR_TANK", 2.0, 1.0, values={"port_high": "ON"}),
    )), {Mode.ACTIVE, Fault.LEVEL_LIMIT}),
    (Case("drive-fault", "pd", 5, (*ARM, (2.5, Action.ACCEPT), (4.0, Action.RESET)), (
        _fault("value", "DRIVE_STATUS_2", 1.5, 2.0, values={"fault": "OVERCURRENT"}),
    )), {Mode.ACTIVE, Fault.DRIVE_FAULT}),
    (Case("operator-silent", "gpc", 8, ARM, (_fault("lost", "OPERATOR_CMD", 1.5, 6.0),)),
     {Mode.ACTIVE, Fault.OPERATOR_SILENT}),
)  # fmt: skip
"""Each with what the controller has to tell of itself, so that the run is what it is for."""
SOON: Final = {"modes", "valve-and-pump", "motion-silent", "spike-then-high-level"}
"""Runs of `make test`."""


class Together:
    """Has both sides begin when both are ready, and run to their end."""

    both: Barrier

    def stopped(self, done_s):
        return False

    def begin_ns(self):
        self.both.wait(READY_S)
        return time.monotonic_ns()


def prepare(both):
    Together.both = both


def run_ship(case):
    plant = build_ship_side(scenario_of(case), 0, ()).plant
    for now_ns in (0, TICK_NS):
        plant.advance(now_ns)  # its compiled code is loaded
    ship, joining = ship_nodes(case, Together().begin_ns())
    port = SocketCanPort(CHANNEL, heard_by(ship))
    try:
        RealTimeLoop([*ship, *joining], port).run(duration_ns=round(case.seconds * 1e9))
    finally:
        port.close()


@pytest.fixture(scope="module")
def processes():
    """Two that have imported all: in a user-mode kernel that takes longer than a run."""
    context = get_context("fork")
    with ProcessPoolExecutor(2, context, prepare, (context.Barrier(2),)) as pool:
        yield pool


def recorded(case, told, processes, to):
    """The frame log of a run in which the controller told all that."""
    patient = load_config(patient_controller(to, 100.0), ControllerConfig)
    names = ("safety", "command_timeout_ms")
    config = config_of(case).model_copy(update={name: getattr(patient, name) for name in names})
    scenario = scenario_of(case)
    file = to / f"{case.name}.frames"
    job = Job(case.name, scenario, config, build_law(config), (), scenario.seed, case.seconds, file)
    controller = processes.submit(run_controller, job, CHANNEL, Together())
    processes.submit(run_ship, case).result()
    statistics = controller.result().loop
    sent = (STATUS.decode(data) for number, data, kind, _ in entries(file)
            if kind == Kind.SENT and number == STATUS.can_id)  # fmt: skip
    statuses = [status for status in sent if status is not None]
    modes = [status.mode for status in statuses]
    # all is silent at first
    begin = modes.index(Mode.ACTIVE) if Mode.ACTIVE in modes else len(modes)
    seen = {*modes, *(status.fault for status in statuses[begin:])}
    left_out = statistics.skipped / (statistics.skipped + statistics.ticks)
    with judged_by(lambda: lost(left_out, statistics.lateness.max_ns * 1e-9)):
        assert told <= seen, f"{case.name}: {told - seen} not met"
    return file


def entries(file):
    return entries_of(FrameLog(file).blocks())


def test_there_are_ten():
    names = {case.name for case, _ in RUNS}
    assert len(names) == len(RUNS) == 10
    assert names > SOON


@pytest.mark.parametrize(
    ("case", "told"),
    [
        pytest.param(*run, id=run[0].name, marks=[pytest.mark.evidence] * (run[0].name not in SOON))
        for run in RUNS
    ],
)
def test_a_run_in_real_time_is_replayed_bit_for_bit(case, told, processes, tmp_path):
    file = first_that_can_be_judged(lambda to: recorded(case, told, processes, to), tmp_path)
    log = FrameLog(file)
    with recorded_config(log.head) as config:
        result, why, law = replay_log(log, config, file.parent)
    assert (why, law.why_not_recorded, law.differences) == ([], "", [])
    assert result.first is None, result.first
    print(f"{result.ticks} ticks, {result.frames} frames")
    assert result.frames > 100
