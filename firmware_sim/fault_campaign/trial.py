"""Trial of one row in one sea: a ship under way, the fault, and the outcome.

All rows of a seed share the ship and waves up to the fault. This part is simulated once, and each
row continues in a copy of the process.
"""

import math
import multiprocessing
import os
import pickle
import traceback
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar, cast, get_args

import numpy as np

from firmware_sim.fault_campaign.campaign import TIME_OF, Campaign, Row, Setup, StatusFlag
from firmware_sim.fault_campaign.own_ship import MOST_S
from firmware_sim.fault_campaign.watch import BusLog, Heard, Watch, first_difference
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.plant import Plant
from firmware_sim.ship_side import build_ship_side
from firmware_sim.truth import TRUTH, true_values
from firmware_sim.worker_pool import end_with
from utank_hil.assembly import estimator_work
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Mode
from utank_hil.control import BuiltLaw
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import SimulatedRetuner

T = TypeVar("T")

SECOND_NS: Final = 1_000_000_000
SAMPLE_TICKS: Final = 5
"""Ticks between samples of a passive ship's roll and of a recording: 50 ms."""
COLUMNS: Final = (*SIGNALS, *TRUTH[1:])
RECORDED_S: Final = 10.0
"""Time in s before the fault at which a recording begins. Chosen; no study."""
SAMPLE_NS: Final = SAMPLE_TICKS * TICK_NS
_LOOK_S: Final = 0.1  # Interval in s at which Ctrl-C is checked while a copy works.
REARMED_S: Final = 20.0
"""Time in s after the fault for which the campaign's first sea checks that nothing arms again."""
WHOLE_S: Final = 600.0  #: Time in s over which the roll is to be compared.
AWAITED_NS: Final = 2 * SECOND_NS  #: Longer than a ramp to zero, whose end is to be seen.
COMMANDS_NS: Final = 40_000_000  #: Two cycles of PUMP_CMD.
FLAGS: Final = get_args(StatusFlag)


@dataclass(frozen=True, slots=True)
class Window:
    """Time after the fault over which the roll is compared with the passive ship's."""

    #: Time for rows that end with the pump off, after which the ship alone is integrated.
    stopped_s: float = WHOLE_S
    running_s: float = WHOLE_S  #: Time for rows whose controller stays in charge.


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a row in one sea; what was said on the bus counts from the fault on."""

    row: str
    seed: int
    #: found, halved, noted, alarm: first times of the events of `Watch.first_ns` in ms from the
    #: row's time zero; None where there is none.
    found: float | None = None
    halved: float | None = None
    noted: float | None = None
    alarm: float | None = None
    full: float | None = None  #: Last time with all of the pressure before a latched fault in ms.
    zero: float | None = None  #: Final stop of drive or valve in ms.
    commanded: float = 0.0  #: Last command with a pressure other than zero in ms.
    #: mode, code: final mode, and the fault that was latched or shown.
    mode: str = ""
    code: str = ""
    was_active: bool = False
    armed_again: bool = False
    status: str = ""  #: Mode and fault in the last CTRL_STATUS.
    alarms: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    beyond_share_pa: float = 0.0  #: Largest excess of the set-point over the halved limit.
    refused: int = 0
    steepest_pa_s: float = 0.0  #: Largest rate of the commands, cuts excepted.
    #: variance, passive_variance: roll variances in rad^2 of the ship and of the passive one.
    variance: float = math.nan
    passive_variance: float = math.nan
    #: The same without the fault. Where an own ship's control has ended, its pump is off from the
    #: fault on: that ship rolls on from what the law had it do. Where control continues, over a
    #: window shorter than that of `--full`: in a lull a sound law may roll the ship more than the
    #: passive one. NaN elsewhere.
    sound_variance: float = math.nan
    window_s: float = math.nan
    wire: str = ""  #: First frame that the fault changed; empty if none differs.
    error: str = ""
    rows: FloatArray | None = None  #: Recording with columns `COLUMNS`, if asked for.


@dataclass
class Sea:
    """All rows of one setup in the waves of one seed."""

    campaign: Campaign
    setup: Setup
    law: BuiltLaw
    seed: int
    window: Window
    recorded: bool = False
    patient: bool = False  #: Whether a bench runs on for `REARMED_S` after the pump is off.
    #: Whether to end early, with an `InterruptedError`.
    stopped: Callable[[], bool] = lambda: False

    def __post_init__(self) -> None:
        self._fault_s = self.campaign.fault_at_s(self.seed)
        self._fault_ns = round(self._fault_s * SECOND_NS)
        #: Ship under way, up to the fault, and the log of its bus.
        self._underway = self._start()
        self._underway[0].run(self._fault_ns)

    def _start(self) -> tuple[FaultyBench, BusLog]:
        log, config = BusLog(), self.setup.config
        work = estimator_work(config)
        self._rows: list[FloatArray] = []

        def record(row: FloatArray) -> None:
            self._rows.append(np.array([*row, *true_values(bench.ship.plant)]))

        bench = FaultyBench(
            self.setup.scenario_of(self._fault_s),
            config,
            self.law,
            seed=self.seed,
            script=(TimedAction(self.campaign.arm_s, Action.ARM),),
            trace=log,
            sink=record if self.recorded else None,
            sink_every=SAMPLE_TICKS,
            estimating=work and SimulatedRetuner(work[0]),
            commissioned=self.setup.commissioned,
        )
        log.node = bench.node
        return bench, log

    def _copied(self, work: Callable[[], T]) -> T:
        return in_a_copy(work, self.stopped)

    def prepare(self, rows: list[Row]) -> None:
        """Simulate the references of the rows: the bus without a fault, and the passive ship."""
        followed_s = max((row.fault.followed_s for row in rows if row.fault.on_bus), default=0.0)
        running_s = self.window.running_s if self.window.running_s < WHOLE_S else 0.0
        frames, self._sound = self._copied(lambda: self._without_fault(followed_s, running_s))
        log = self._underway[1]
        log.frames += frames
        self._reference, log.frames = (
            log.frames,
            [each for each in log.frames if each[0] < self._fault_ns],
        )
        longest_s = max(
            self.window.stopped_s,
            self.window.running_s,
            REARMED_S if self.patient else 0.0,
            *(max(row.fault.followed_s, row.limit.roll_window_s or 0.0) for row in rows),
        )
        self._passive = [
            self._copied(partial(self._passive_roll, longest_s, enabled=enabled))
            for enabled in (False, True)
        ]
        self._cut = self._copied(lambda: self._cut_roll(longest_s))

    def _cut_roll(self, seconds: float) -> FloatArray:
        """Roll of the sound ship if its pump is off from the fault on: no stop is sooner."""
        plant = self._underway[0].ship.plant
        plant.drive_pump(0.0, enabled=False)
        return _rolls(plant, self._fault_ns, self._fault_ns + round(seconds * SECOND_NS))

    def _without_fault(self, seconds: float, roll_s: float) -> tuple[list[Heard], FloatArray]:
        """Frames for a time, and the roll for another or the same."""
        bench, log = self._underway
        known, rolls = len(log.frames), []
        end_ns, roll_end_ns = (self._fault_ns + round(s * SECOND_NS) for s in (seconds, roll_s))
        for time_ns in range(self._fault_ns, max(end_ns, roll_end_ns), SAMPLE_NS):
            bench.run(time_ns + SAMPLE_NS)
            rolls.append(bench.ship.plant.roll_rad)
        return [heard for heard in log.frames[known:] if heard[0] < end_ns], np.array(rolls)

    def _passive_roll(
        self, seconds: float, *, enabled: bool, opening: float | None = None
    ) -> FloatArray:
        """Roll of a ship passive from the start, its pump enabled at zero pressure or off.

        The valve is in its fail position, or stuck at `opening`.
        """
        scenario = self.setup.scenario_of(self._fault_s)
        plant = build_ship_side(scenario, self.seed, ()).plant
        valve = scenario.vessel.valve
        if opening is not None and valve is not None:
            plant.set_valve_loss(valve.loss(scenario.vessel.tank, opening))
        plant.advance(0)
        plant.drive_pump(0.0, enabled=enabled)
        return _rolls(plant, 0, self._fault_ns + round(seconds * SECOND_NS))

    def outcome(self, row: Row) -> Outcome:
        """Run a row in a copy of this process."""
        reference = self._reference
        if row.fault.operator and row.fault.inject:
            reference = self._copied(lambda: self._operated(row))
        return self._copied(lambda: self._outcome(row, reference))

    def _watched(self, row: Row, faults: tuple[AnyFault, ...]) -> tuple[FaultyBench, BusLog, Watch]:
        bench, log = self._start() if row.fault.from_start else self._underway
        watch = Watch(bench, row, self._degraded_most(bench))
        bench.place(faults)
        bench.join([watch])
        return bench, log, watch

    def _operated(self, row: Row) -> list[Heard]:
        bench, log, _ = self._watched(row, ())
        bench.run(bench.lockstep.now_ns + round(row.fault.followed_s * SECOND_NS))
        return log.frames

    def _outcome(self, row: Row, reference: list[Heard]) -> Outcome:
        bench, log, watch = self._watched(row, row.fault.inject)
        start_ns, refused = bench.lockstep.now_ns, bench.ship.refused_commands
        watched_ns = start_ns + round(row.fault.followed_s * SECOND_NS)
        bench.run(watched_ns)
        self._await(row, bench, watch, start_ns)
        alone_ns = bench.lockstep.now_ns
        if self.patient and _stopped_at(bench):
            alone_ns = max(alone_ns, start_ns + round(REARMED_S * SECOND_NS))
            bench.run(alone_ns)
        stopped = _stopped_at(bench)
        times, was_active = times_of(row, watch, log, start_ns), "active" in watch.first_ns
        refused = bench.ship.refused_commands - refused
        steepest_pa_s = log.steepest_pa_s(start_ns)
        window_s = self.window.stopped_s if stopped else self.window.running_s
        window_s = max(row.limit.roll_window_s or window_s, (alone_ns - start_ns) / SECOND_NS)
        end_ns = start_ns + round(window_s * SECOND_NS)
        if stopped:  # nothing acts on the ship any more: it is integrated alone
            watch.rolls += _rolls(bench.ship.plant, alone_ns, end_ns, TICK_NS).tolist()
        else:
            bench.run(end_ns)
        passive = self._passive_beside(bench, (end_ns - self._fault_ns) / SECOND_NS, stopped)
        passive = passive[start_ns // SAMPLE_NS : end_ns // SAMPLE_NS]
        sound = (self._cut if stopped else self._sound)[: len(passive)]
        compared = row.limit.beside_stop if stopped else window_s < WHOLE_S
        compared = compared and not row.fault.from_start and len(sound) == len(passive)
        differs = first_difference(reference, log.frames, watched_ns) if row.fault.on_bus else None
        return Outcome(
            row.id,
            self.seed,
            **times,
            mode=bench.node.mode.name,
            code=watch.code.name,
            was_active=was_active,
            armed_again=watch.armed_again,
            **_said(log, start_ns),
            beyond_share_pa=watch.beyond_share_pa,
            refused=refused,
            steepest_pa_s=steepest_pa_s,
            variance=float(np.var(watch.rolls)),
            passive_variance=float(passive.var()),
            sound_variance=float(sound.var()) if compared else math.nan,
            window_s=window_s,
            wire=_words(*differs, start_ns) if differs else "",
            rows=self._recorded_rows(start_ns),
        )

    def _await(self, row: Row, bench: FaultyBench, watch: Watch, start_ns: int) -> None:
        """Follow on what is not found yet, until its time is over: a slow ship shows it late."""
        event, limit = TIME_OF.get(row.expect.reaction), row.limit
        most_ms = limit.found_ms or (limit.follows and 1e3 * MOST_S)
        if event not in ("found", "halved", "alarm") or not most_ms:
            return
        last_ns = start_ns + round(self.window.stopped_s * SECOND_NS) - AWAITED_NS - SECOND_NS
        known = watch.first_ns
        while event not in known and (now_ns := bench.lockstep.now_ns) < last_ns:
            begin_ns = watch.over_ns if limit.counts_from else known.get("active", start_ns)
            if begin_ns is not None and now_ns - begin_ns > 1e6 * most_ms:
                return
            bench.run(now_ns + SECOND_NS)
            if event in known:
                bench.run(now_ns + AWAITED_NS + SECOND_NS)

    def _recorded_rows(self, start_ns: int) -> FloatArray | None:
        """Rows from `RECORDED_S` before the fault on, if asked for."""
        first_s = start_ns / SECOND_NS - RECORDED_S
        kept = [each for each in self._rows if each[0] >= first_s]
        return np.array(kept) if kept else None

    def _passive_beside(self, bench: FaultyBench, seconds: float, stopped: bool) -> FloatArray:
        """Roll of the passive ship with pump and valve in the final state of a bench."""
        enabled = _pump_enabled(bench)
        valve, own = bench.ship.valve, self.setup.equipped.vessel.valve
        if stopped and valve is not None and own is not None and valve.opening != own.fail_opening:
            return self._passive_roll(seconds, enabled=enabled, opening=valve.opening)
        return self._passive[enabled]

    def _degraded_most(self, bench: FaultyBench) -> tuple[float, int]:
        """Permitted pressure in Pa while it is halved, and the time in ns to ramp down to it."""
        monitors, limits = bench.node.safety.monitors, self.setup.config.limits
        share = 1.0 if monitors is None else monitors.thresholds.degraded_share
        ramp_s = (1 - share) * limits.pressure_pa / limits.rate_pa_s
        return share * limits.pressure_pa, round(ramp_s * SECOND_NS) + COMMANDS_NS


def _stopped_at(bench: FaultyBench) -> bool:
    return not _pump_enabled(bench) and bench.node.mode is not Mode.ACTIVE


def _pump_enabled(bench: FaultyBench) -> bool:
    return bench.ship.drive is not None and bench.ship.drive.enabled


def _rolls(plant: Plant, begin_ns: int, end_ns: int, step_ns: int = SAMPLE_NS) -> FloatArray:
    """Roll of a ship that is integrated alone, from one time up to another."""
    rolls = []
    for time_ns in range(begin_ns, end_ns, step_ns):
        plant.advance(time_ns)
        rolls.append(plant.roll_rad)
    return np.array(rolls)


def times_of(row: Row, watch: Watch, log: BusLog, start_ns: int) -> dict[str, Any]:
    """Times in `Outcome` of a row whose fault began at `start_ns`; earlier counts as in time."""
    begin_ns = start_ns
    if row.fault.from_start:
        begin_ns = watch.first_ns.get("active", start_ns)
    if row.limit.counts_from:
        known = [each for each in (watch.over_ns, watch.first_ns.get("found")) if each is not None]
        begin_ns = max([begin_ns, min(known, default=begin_ns)])
    events = {name: at_ns for name, at_ns in watch.first_ns.items() if name != "active"}
    events |= {"zero": watch.pressed_ns + TICK_NS, "commanded": log.commanded_until(start_ns)}
    return {name: max((time_ns - begin_ns) / 1e6, 0.0) for name, time_ns in events.items()}


def _said(log: BusLog, start_ns: int) -> dict[str, Any]:
    """What the controller said on the bus, in the words of `Outcome`."""
    shown = [status for time_ns, status in log.shown if time_ns >= start_ns]
    status = ""
    if shown and shown[-1].mode is not None and shown[-1].fault is not None:
        status = f"{shown[-1].mode.name} {shown[-1].fault.name}"
    alarms = {fault.name for time_ns, fault in log.told if time_ns >= start_ns}
    flags = tuple(flag for flag in FLAGS if any(getattr(each, flag) for each in shown))
    return {"status": status, "alarms": tuple(sorted(alarms)), "flags": flags}


def _words(there: Heard | None, here: Heard | None, start_ns: int) -> str:

    def frame(heard: Heard | None) -> str:
        if heard is None:
            return "nothing"
        time_ns, can_id, data = heard
        return f"{can_id:08X}#{data.hex().upper()} at {(time_ns - start_ns) / 1e6:.2f} ms"

    return f"{frame(here)} instead of {frame(there)}"


def in_a_copy(work: Callable[[], T], stopped: Callable[[], bool] = lambda: False) -> T:
    """Run a function in a copy of this process and return its result.

    Raises `InterruptedError` if `stopped` became true first, `BrokenProcessPool` if the copy was
    killed, and `RuntimeError` if the function failed, with its traceback.
    """
    copies, parent_pid = multiprocessing.get_context("fork"), os.getpid()
    reading, writing = copies.Pipe(duplex=False)

    def run() -> None:
        end_with(parent_pid)
        try:
            told = pickle.dumps((True, work()))
        except Exception:  # raised again by the parent
            told = pickle.dumps((False, traceback.format_exc()))
        writing.send_bytes(told)

    copy = copies.Process(target=run)
    copy.start()
    writing.close()
    try:
        while not reading.poll(_LOOK_S):
            if stopped():
                raise InterruptedError
        done, answer = pickle.loads(reading.recv_bytes())
    except EOFError:
        raise BrokenProcessPool("a copy of the process was killed") from None
    finally:
        copy.kill()
        copy.join()
        reading.close()
    if not done:
        raise RuntimeError(answer)
    return cast(T, answer)
