"""From a configuration to a controller on the bus: the one place where a law is built."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.analysis.loop.linear_tuning import AutoDesign
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign, sample_time_of
from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import ParameterError
from utank_hil.base.tick import TICK_S, is_whole_ticks
from utank_hil.canbus import Catalogue, load_catalogue
from utank_hil.canbus.cmac import read_key
from utank_hil.canbus.measurements import MEASURED, Measurements, MotionSample
from utank_hil.canbus.profiles.device_plan import ForeignDevices
from utank_hil.canbus.profiles.drive_plan import COMMAND_MS
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw, CommandLimiter, PredictiveDesign
from utank_hil.control.constrained.design import previewed
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.heel_removal import HeelingTank, HeelRemovalDesign
from utank_hil.control.interface import PRESSURE, VALVE
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.pressure_loop import PressureLoop
from utank_hil.nodes.actuators import Actuators, ValveCommander
from utank_hil.nodes.canopen_drive import CanopenDrive
from utank_hil.nodes.commissioning.node import CommissioningNode
from utank_hil.nodes.commissioning.pulses import PulseLaw, plan_pulses, plan_stroke
from utank_hil.nodes.controller import ControllerNode, ControllerSettings
from utank_hil.nodes.running_law import Measure, RunningLaw
from utank_hil.nodes.signals import EventSink, Telemetry
from utank_hil.retuning import (
    AdaptiveController,
    Desk,
    Estimator,
    LawExchange,
    RenewingController,
    Retuner,
    RetunerProcess,
    ShipFigures,
    Work,
    make_pulses,
)
from utank_hil.retuning.estimate import MOST_BANDS, EstimateRequest, MotionEstimate
from utank_hil.retuning.estimator import COLUMNS
from utank_hil.retuning.estimator import SAMPLE_TIME_S as ESTIMATE_SAMPLE_TIME_S
from utank_hil.runners.statistics import LoopStatistics
from utank_hil.safety.judge import Safety
from utank_hil.safety.monitoring import LONG_S, Monitors
from utank_hil.safety.monitors.harbour import HarbourWatch
from utank_hil.safety.monitors.thresholds import thresholds_of
from utank_hil.safety.situation import THROTTLED_OFF, VALVE_OFF

if TYPE_CHECKING:
    from utank_hil.retuning.redesign import RetuningTask

_STEPPING_S = 20.0
"""For all steps of a law whose impulse response is to be found."""

_Get = Callable[[Measurements, MotionSample, LevelObserver], float]


def _received(name: str) -> _Get:
    """Getter of a signal as it was received, of the motion sensor in use if it is one of its."""
    get: Callable[[object], float] = attrgetter(name)
    if hasattr(MotionSample(), name):
        return lambda _, motion, __: get(motion)
    return lambda measured, _, __: get(measured)


_GETTERS: Final[dict[str, _Get]] = {
    **{name: _received(name) for name in MEASURED},
    # the last one measured, held over a gap, looks like water that stands still
    "level_m": lambda measured, _, level: level.level_m if level.alone else measured.level_m,
    "level_rate_m_s": lambda _, __, level: level.rate_m_s,
}


def measure_of(names: tuple[str, ...]) -> Measure:
    """Picks the named signals as a vector, shape (m,); `ValueError` if no law can measure one."""
    for name in names:
        if name not in _GETTERS:
            raise ValueError(f"no measurement {name!r}; there are {', '.join(_GETTERS)}")
    getters = [_GETTERS[name] for name in names]

    def measure(measured: Measurements, motion: MotionSample, level: LevelObserver) -> FloatArray:
        return np.array([get(measured, motion, level) for get in getters])

    return measure


def build_law(config: ControllerConfig) -> BuiltLaw:
    """Design the law of a configuration for its vessel.

    The law is to be handed on to whatever needs it: judging it, running it. Raises `ParameterError`
    if it can't be designed; the problems are named by their keys in the configuration.
    """
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # an equation that was solved for another matrix than the one given
            warnings.simplefilter("error", RuntimeWarning)
            law = (
                config.law.build(config.design_plant, first=True)
                if config.renews and isinstance(config.law, SelfTunedDesign)
                else config.law.build(config.design_plant)
            )
            if law.linear is None and law.closes_loop and not law.dissipates:
                law = _by_impulse_response(law)
            if config.vessel.preview is not None:
                law = previewed(law, config.vessel.ship)
            finite = law.linear is None or all(
                np.isfinite(matrix).all() for matrix in law.linear.matrices()[:4]
            )
        period_s = law.controller().sample_time_s
    except ParameterError as error:
        problems = [(f"law.{name}".rstrip("."), reason) for name, reason in error.problems]
        raise ParameterError("", problems) from error
    except (ValueError, ArithmeticError, RuntimeWarning) as error:
        reason = f"can't be designed for this vessel: {error}"
        raise ParameterError("", [("law", reason)]) from error
    if not finite:
        reason = "gives no finite law: a weight or a noise is too large or too small by far"
        raise ParameterError("", [("law", reason)])
    if not is_whole_ticks(period_s):
        reason = f"has a sample time of {period_s:g} s, which is not a whole number of {TICK_S:g} s"
        raise ParameterError("", [("law", reason)])
    return law


def _by_impulse_response(law: BuiltLaw) -> BuiltLaw:
    """The law with the linear law that it is at rest, or with the reason why there is none."""
    # here: laws that bring their own linear law do not need it
    from utank_hil.analysis.loop.impulse_response import NoImpulseResponse, impulse_response_law

    try:
        linear = impulse_response_law(law.controller, law.measured, budget_s=_STEPPING_S)
    except NoImpulseResponse as error:
        return replace(law, unjudged=f"its loop can't be judged: {error}")
    if not linear.impulse.any():
        reason = "it answers a small impulse with nothing: a dead zone, or a late answer"
        return replace(law, unjudged=f"its loop can't be judged: {reason}")
    return replace(law, linear=linear, at_rest=not linear.linear)


def build_controller_node(
    config: ControllerConfig,
    law: BuiltLaw | None = None,
    *,
    retuner: Retuner | None = None,
    estimating: Retuner | None = None,
    statistics: LoopStatistics | None = None,
    sink: Callable[[FloatArray], None] | None = None,
    sink_every: int = 1,
    event_sink: EventSink | None = None,
    commissioned: bool = False,
    monitored: bool = True,
) -> ControllerNode:
    """Build the controller node of a configuration.

    A `law` of this configuration that was built before is not designed again. `retuner` identifies
    and designs, if the configuration has the controller retune itself; `estimating` tells waves and
    ship from the motion, if it asks for that. `statistics`, `sink`, `sink_every` and `event_sink`
    are those of `Telemetry`. A controller may be armed if it is `commissioned`: a commissioning was
    passed, or it is on a bench, whose ship is made of the same files. One that is not `monitored`
    has no monitors. KeyFileError is raised where the key of the ship's panel is not there.
    """
    law = law or build_law(config)
    vessel, safety, catalogue = config.vessel, config.safety, load_catalogue()
    exchange = None if retuner is None else _exchange(config, law, retuner)
    estimator = None
    if estimating is not None and config.sea_estimate is not None:
        estimator = Estimator(
            config.sea_estimate, estimating, vessel.ship, vessel.tank, vessel.least_gm_m
        )
    monitors = _monitors(config, compares=law.closes_loop) if monitored else None
    running = RunningLaw(
        law.controller() if exchange is None else exchange,
        measure_of(law.measured),
        law.commands,
        limits=safety,
        thresholds=None if monitors is None else monitors.thresholds,
    )
    return ControllerNode(
        running,
        Safety(
            safety,
            config.bit_rate,
            monitors,
            pump=vessel.pump is not None,
            motion_cycles_s=vessel.motion_cycles_s,
            unprotected=vessel.devices is not None and vessel.devices.unprotected,
        ),
        _actuators(config, catalogue),
        Telemetry(statistics, sink, sink_every, event_sink),
        ControllerSettings(
            vessel.version,
            commissioned,
            vessel.tank,
            vessel.redundancy,
            vessel.foreign,
            key_of(vessel.foreign),
        ),
        catalogue,
        estimator,
    )


def _monitors(config: ControllerConfig, *, compares: bool) -> Monitors:
    vessel = config.vessel
    return Monitors(
        config.plant,
        config.safety.roll_limit_rad,
        config.sensor_figures,
        config.bit_rate,
        compares=compares,
        second_motion=vessel.redundancy.second_motion_sensor,
        motion_cycles_s=vessel.motion_cycles_s,
        of_hull=vessel.hull is not None,
        harbour=_harbour_watch(config),
    )


def _actuators(config: ControllerConfig, catalogue: Catalogue) -> Actuators:
    vessel, tank, foreign = config.vessel, config.vessel.tank, config.vessel.foreign
    timeout_s = config.command_timeout_ms * 1e-3
    valve = drive = None
    if vessel.valve is not None:
        most_off = THROTTLED_OFF if isinstance(config.law, HeelRemovalDesign) else VALVE_OFF
        valve = ValveCommander(vessel.valve, tank, catalogue, timeout_s, foreign.valve, most_off)
    if foreign.pump is not None and vessel.pump is not None:
        of = foreign.pump
        loop = PressureLoop(vessel.pump, COMMAND_MS * 1e-3, of.delay_s, torque=of.mode.torque)
        drive = CanopenDrive(of, loop, tank.reservoir_area_m2)
    limiter = CommandLimiter(config.limits, tank, TICK_S)
    pump = vessel.pump is not None
    return Actuators(limiter, catalogue, timeout_s, pump=pump, valve=valve, drive=drive)


def _harbour_watch(config: ControllerConfig) -> HarbourWatch | None:
    valve, tank = config.vessel.valve, config.vessel.tank
    if not isinstance(config.law, HeelRemovalDesign) or valve is None:
        return None
    loss = partial(valve.loss, tank)
    return HarbourWatch(HeelingTank.of(config.plant), config.law, loss, LONG_S)


def key_of(foreign: ForeignDevices) -> bytes:
    """The key of a ship's panel; empty where it needs none (`read_key`)."""
    panel = foreign.panel
    if panel is None or panel.authentication is None:
        return b""
    return read_key(Path(panel.authentication.key))


def build_commissioning_node(
    config: ControllerConfig,
    *,
    statistics: LoopStatistics | None = None,
    event_sink: EventSink | None = None,
) -> CommissioningNode:
    """Build the node that leads through the commissioning of a configuration.

    The law of the configuration has no part in it. `statistics` and `event_sink` are those of
    `Telemetry`. Raises `ValueError` if the vessel has neither pump nor valve.
    """
    vessel, plant = config.vessel, config.plant
    commands = tuple(
        name for name, part in ((PRESSURE, vessel.pump), (VALVE, vessel.valve)) if part is not None
    )
    if not commands:
        raise ValueError(f"{vessel.name} has neither pump nor valve: nothing can be armed")
    law = PulseLaw(commands)
    built = BuiltLaw(lambda: law, ("roll_rad",), closes_loop=False, commands=commands)
    # a monitor would end the pulses at what they are there to show, before they can say which it is
    node = build_controller_node(
        config, built, statistics=statistics, event_sink=event_sink, monitored=False
    )
    return CommissioningNode(
        node,
        law,
        plant,
        plan=None if vessel.pump is None else plan_pulses(plant),
        stroke=None if vessel.valve is None else plan_stroke(vessel.valve, vessel.tank),
        pump=vessel.pump,
        stop_within_ms=vessel.stop_within_ms,
        volume_m=thresholds_of(plant, config.safety.roll_limit_rad, config.sensor_figures).volume_m,
    )


def retuning_task(
    config: ControllerConfig, order: int, roll_period_range_s: tuple[float, float]
) -> "RetuningTask":
    """What is to be identified and designed anew: the part of a configuration that matters to it.

    `order` is that of the ARX model, `roll_period_range_s` that of the ships that the stability
    booklet covers. Raises `ValueError` if the law is not one that can be designed anew.
    """
    from utank_hil.identification.ship_fit import ModelLimits  # here: scipy.optimize
    from utank_hil.retuning.redesign import RetuningTask

    design = config.law
    if isinstance(design, AutoDesign):
        design = design.tuned(config.design_plant)
    if not isinstance(design, PredictiveDesign) or "roll_rad" not in design.predictor.measured:
        raise ValueError(
            f"law.kind: {design.kind} can't be designed anew for a ship that is found: it must be "
            "predictive and measure roll_rad; take {kind: gpc, tuning: auto} in its place, in a "
            "copy of the file"
        )
    return RetuningTask(design, config.plant, order, ModelLimits(roll_period_range_s))


def retuner_work(config: ControllerConfig) -> Work | None:
    """The retuner's work for a configuration and the shape of its longest record, if it has any.

    The work may be handed to another process.
    """
    settings, design = config.retuning, config.law
    if config.renews:
        from utank_hil.retuning.renewal import RenewalTask, renew  # here: scipy.optimize

        assert isinstance(design, SelfTunedDesign)
        renewal = RenewalTask(config.plant, sample_time_of(config.plant), design.mean_power_w)
        return Work(partial(renew, task=renewal), MotionEstimate, 2 * MOST_BANDS)
    if settings is None:
        return None
    from utank_hil.retuning.redesign import LEAST_GAIN, retune

    task = retuning_task(config, settings.order, settings.roll_period_range_s)
    task = replace(task, least_gain=LEAST_GAIN)
    predictor = task.design.predictor
    rows = round(settings.identification_s / predictor.sample_time_s)
    columns = 1 + len(predictor.measured)
    return Work(partial(retune, task=task), FloatArray, rows * columns)


def estimator_work(config: ControllerConfig) -> Work | None:
    """The estimator's work for a configuration and its longest request, if it has any."""
    settings = config.sea_estimate
    if settings is None:
        return None
    from utank_hil.retuning.renewal import EstimateTask, estimate  # here: scipy.optimize

    task = EstimateTask(config.plant, ESTIMATE_SAMPLE_TIME_S, settings.effective_slope)
    numbers = settings.samples * len(COLUMNS)
    return Work(partial(estimate, task=task), EstimateRequest, numbers)


def works_of(config: ControllerConfig) -> tuple[Work | None, Work | None]:
    """What the retuner's process does for a configuration: `retuner_work`, `estimator_work`."""
    return retuner_work(config), estimator_work(config)


@contextmanager
def retuner_process(config: ControllerConfig) -> Iterator[tuple[Desk | None, Desk | None]]:
    """The process that retunes and estimates, while it is wanted: a desk for each of `works_of`."""
    works = works_of(config)
    wanted = [work for work in works if work is not None]
    if not wanted:
        yield None, None
        return
    with RetunerProcess(*wanted) as process:
        desks = iter(process.desks)
        retuner, estimating = (None if work is None else next(desks) for work in works)
        yield retuner, estimating


def _exchange(config: ControllerConfig, law: BuiltLaw, retuner: Retuner) -> LawExchange | None:
    """A controller that begins with `law` and has it retuned or renewed, as configured."""
    settings = config.retuning
    if settings is None and not config.renews:
        return None
    ship, roll = ShipFigures.of(config.vessel.ship), law.measured.index("roll_rad")
    if settings is not None:
        assert law.linear is not None
        pulses = make_pulses(settings, config.plant, law.linear.sample_time_s)
        return AdaptiveController(
            law.linear, law.controller(), ship, roll, settings, pulses, retuner
        )
    assert isinstance(law.linear, ConstrainedLaw)
    return RenewingController(law.linear, law.controller(), ship, roll, config.limits, retuner)
