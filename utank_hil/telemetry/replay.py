"""Replay: recorded inputs are given to the controller again, and its answers are compared.

The controller gets each record in the order of the log and at its recorded time, so the result does
not depend on machine or present. Every frame that it returns is compared byte by byte.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple

from utank_hil.assembly import build_controller_node, build_law
from utank_hil.canbus import Frame
from utank_hil.configuration import ControllerConfig
from utank_hil.control.interface import PRESSURE, BuiltLaw
from utank_hil.control.python_law import PythonDesign
from utank_hil.nodes.controller import ControllerNode
from utank_hil.runners import LoopStatistics
from utank_hil.telemetry.explained_tick import ExplainedTick
from utank_hil.telemetry.frame_comparison import FrameComparison, RecordedRetuner, ReplayResult
from utank_hil.telemetry.frame_log import LAYOUT, FrameLog, Kind, Records
from utank_hil.telemetry.law_values import ValueDifference
from utank_hil.telemetry.replay_head import causes, law_differences, recorded_law, refuse_foreign


class LoopFigures(NamedTuple):
    """What a law does to its ship, by its impulse responses at rest."""

    #: Predicted roll RMS in a broad sea, relative to that with the passive tank; no limits.
    roll_part: float
    peak_sensitivity: float
    gain_margin: float  #: Greatest factor of the gain that leaves the loop stable; inf if any does.
    phase_margin_rad: float


@dataclass(frozen=True)
class LawVerdict:
    """The law that answered recorded frames, and its distance from the one designed today."""

    why_not_recorded: str  #: Why the law designed here answered; empty if the recorded one did.
    #: Differences between the recorded law and the one designed here; they fail no replay.
    differences: list[ValueDifference]
    laws: tuple[BuiltLaw, BuiltLaw]  #: The one that answered, and the one designed here.
    config: ControllerConfig

    @property
    def deviation(self) -> float:
        """Largest relative deviation in any array of the design; 0 if the designs are equal."""
        return max((each.deviation for each in self.differences), default=0.0)

    @cached_property
    def loops(self) -> tuple[LoopFigures, LoopFigures] | None:
        """Loops of the recorded law and the designed one, None if equal or not to be judged."""
        if not self.differences or self.why_not_recorded:
            return None
        recorded, here = (loop_figures(law, self.config) for law in self.laws)
        return None if recorded is None or here is None else (recorded, here)


def loop_figures(law: BuiltLaw, config: ControllerConfig) -> LoopFigures | None:
    """Return what the loop of a law of the pump does; None if it has none or can't be judged."""
    # here: a replay with equal laws needs none of it
    from utank_hil.analysis.loop.impulse_response import NoImpulseResponse, impulse_response_law
    from utank_hil.analysis.loop.margins import margins
    from utank_hil.analysis.loop.sea_response import moment_of, motion_in_sea
    from utank_hil.analysis.loop.self_tuning import unknown_sea
    from utank_hil.dynamics.linear import pump_model

    if law.commands != (PRESSURE,) or not law.closes_loop:
        return None
    plant = config.design_plant
    try:
        linear = impulse_response_law(law.controller, law.measured)
    except NoImpulseResponse:
        return None
    system = pump_model(plant.ship, plant.tank, law.measured)
    found = margins(linear, system, plant.delay_s, plant.lag_s, with_delay_margin=False)
    waves = moment_of(unknown_sea(plant.ship), plant.ship)
    roll, passive = (
        motion_in_sea(each, plant, law.measured, waves).roll_rms_rad for each in (linear, None)
    )
    return LoopFigures(
        roll / passive, found.peak_sensitivity, found.gain_high, found.phase_margin_rad
    )


_MOST_SENT: Final = 1 << 16  #: Frames of one recorded tick at most; it sends some 20.


class Entry(NamedTuple):
    """One record, its fields in the order of `LAYOUT`."""

    number: int
    data: bytes
    kind: int
    time_ns: int


class ReplayedLog(NamedTuple):
    """A replayed log: the result, other differences from the recording, and the law."""

    result: ReplayResult
    causes: list[str]
    law: LawVerdict


def entries_of(blocks: Iterable[Records]) -> Iterator[Entry]:
    """Yield the records one by one."""
    for block in blocks:
        yield from map(Entry._make, LAYOUT.iter_unpack(block.tobytes()))


def replay_log(
    log: FrameLog,
    config: ControllerConfig,
    folder: Path,
    *,
    as_recorded: bool = True,
    explained: ExplainedTick | None = None,
) -> ReplayedLog:
    """Run `replay` with a controller as the log's head describes it.

    If `config` is the recorded one (`as_recorded`), the recorded law runs if possible, else that of
    `config`. ReplayHeadError is raised for a head that is not as `replay_head` writes it.
    """
    refuse_foreign(log.head)
    law = designed = build_law(config)
    why_not = "another configuration was named"
    if as_recorded or isinstance(config.law, PythonDesign):
        law, why_not = recorded_law(log.head, config, designed)
    result = replay(
        entries_of(log.blocks()),
        config,
        law,
        retuner=log.head["retuner"],
        estimating=log.head.get("estimating", False),
        commissioned=log.head.get("commissioned", True),
        explained=explained,
    )
    apart = law_differences(log.head, designed)
    verdict = LawVerdict(why_not, apart, (law, designed), config)
    return ReplayedLog(result, causes(log.head, config, folder), verdict)


def replay(
    entries: Iterable[Entry],
    config: ControllerConfig,
    law: BuiltLaw,
    *,
    retuner: bool = False,
    estimating: bool = False,
    commissioned: bool = True,
    open_end: bool = False,
    explained: ExplainedTick | None = None,
) -> ReplayResult:
    """Give recorded entries of a whole run to a new controller and compare what it sends.

    `law` is that of the configuration. `retuner`, `estimating` and `commissioned` say what the
    controller had and whether it could be armed. With `open_end` the log may end before what the
    controller sent in its last tick. `explained` takes the numbers of its tick.
    """
    answers, estimates = RecordedRetuner(), RecordedRetuner()
    statistics = LoopStatistics()
    node = build_controller_node(
        config,
        law,
        retuner=answers if retuner else None,
        estimating=estimates if estimating else None,
        statistics=statistics,
        commissioned=commissioned,
    )
    run = _Replay(node, explained or ExplainedTick(-2))  # that of no tick
    for entry in entries:
        kind = entry.kind
        if kind in (Kind.ALIVE, Kind.ANSWER):
            answers.take(entry.data, alive=kind == Kind.ALIVE)
        elif kind in (Kind.ESTIMATOR_ALIVE, Kind.ESTIMATE):
            estimates.take(entry.data, alive=kind == Kind.ESTIMATOR_ALIVE)
        elif kind == Kind.STARTED:
            statistics.real_time = any(entry.data)
        else:
            run.take(entry)
        if kind == Kind.TICK:
            run.comparison.retuner("retuner", answers)
            run.comparison.retuner("estimator", estimates)
    run.end(open_end=open_end)
    return run.result


class _Replay:
    """A controller that is given the records of a run, one by one."""

    def __init__(self, node: ControllerNode, explained: ExplainedTick) -> None:
        self._node = node
        self.result = ReplayResult()
        self.comparison = FrameComparison(self.result)
        self._explained = explained
        self._sent: list[Frame] = []
        self._recorded: list[Frame] = []
        self._waiting = False  # for the recorded frames of a tick
        panel = node.inbox.panel
        self._challenge = None if panel is None else panel.plan.authentication

    def take(self, entry: Entry) -> None:
        """Give the controller a record."""
        number, data, kind, time_ns = entry
        if kind == Kind.SENT:
            self._recorded.append(Frame(number, data))
            if len(self._recorded) > _MOST_SENT:
                tick = self.result.ticks
                raise ValueError(f"tick {tick} sent more than {_MOST_SENT} frames")
            return
        self.end(open_end=False)
        node = self._node
        if kind == Kind.RECEIVED:
            self.comparison.received(number, data)
            if self.result.ticks == self._explained.tick:
                self._explained.received(Frame(number, data))
            node.receive(Frame(number, data), time_ns)
        elif kind == Kind.TICK:
            self._tick(time_ns)
        elif kind == Kind.STOP:
            self._sent, self._waiting = list(node.stop(time_ns)), True
        elif kind == Kind.OTHERS:
            node.other_frames(number)
        elif kind == Kind.LINK_ERROR:
            node.link_error(time_ns, "")
        elif kind == Kind.LOST:
            self.result.lost_rows += number

    def _tick(self, time_ns: int) -> None:
        node, result = self._node, self.result
        if result.ticks == self._explained.tick:
            self._explained.begin(node)
        self._sent, self._waiting = list(node.tick(time_ns)), True
        self.comparison.tick = result.ticks
        self.comparison.time_s = (time_ns - node.start_ns) * 1e-9
        result.ticks += 1

    def end(self, *, open_end: bool) -> None:
        """Compare the frames of the last tick, which in a log with an `open_end` may be missing."""
        if not self._waiting or (open_end and not self._recorded):
            return
        recorded, sent = self._recorded, self._sent
        self._waiting, self._recorded = False, []
        if self._challenge is not None:
            self._take_challenge(recorded, sent)
        self.comparison.compare(recorded, sent)
        explained = self._explained
        if self.result.ticks == explained.tick + 1 and not explained.ended:
            explained.end(self._node, recorded, sent)

    def _take_challenge(self, recorded: list[Frame], sent: list[Frame]) -> None:
        """Go on from the recorded challenge: the first one was drawn by lot."""
        panel, plan = self._node.inbox.panel, self._challenge
        assert panel is not None
        assert plan is not None
        for place, frame in enumerate(sent):
            first = [each for each in recorded if each.can_id == frame.can_id]
            if frame.can_id == plan.challenge_id and first:
                sent[place], panel.nonce, self._challenge = first[0], first[0].data, None
                return
