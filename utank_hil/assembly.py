"""The controller's side put together from its configuration."""

from collections.abc import Callable
from functools import partial

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.canbus import SensorTank, load_catalogue
from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.laws import build_law
from utank_hil.control import (
    CommandLimiter,
    LinearLaw,
    PredictiveDesign,
    wave_arx,
)
from utank_hil.control.level_observer import LevelObserver
from utank_hil.identification.acceptance import ModelLimits
from utank_hil.retuning import (
    AdaptiveController,
    Retuner,
    RetuningSettings,
    Work,
    make_pulses,
)
from utank_hil.retuning.redesign import LEAST_GAIN, RetuningTask, retune
from utank_hil.runtime.controller_node import (
    ControllerNode,
    ControllerSettings,
    EventSink,
    Measure,
)
from utank_hil.runtime.inbox import Inbox
from utank_hil.runtime.statistics import LoopStatistics
from utank_hil.runtime.supervisor import Supervisor
from utank_hil.tick import TICK_S

_MEASUREMENTS: dict[str, Callable[[Inbox, LevelObserver], float]] = {
    "roll_rad": lambda inbox, level: inbox.roll_rad,  # noqa: ARG005
    "roll_rate_rad_s": lambda inbox, level: inbox.roll_rate_rad_s,  # noqa: ARG005
    "level_m": lambda inbox, level: inbox.level_m,  # noqa: ARG005
    "level_rate_m_s": lambda inbox, level: level.rate_m_s,  # noqa: ARG005
}


def measure_of(names: tuple[str, ...]) -> Measure:
    """Function that picks the named signals as a measurement vector, shape (m,)."""
    pick = [_MEASUREMENTS[name] for name in names]

    def measure(inbox: Inbox, level: LevelObserver) -> FloatArray:
        return np.array([one(inbox, level) for one in pick])

    return measure


def build_controller_node(
    config: ControllerConfig,
    *,
    retuner: Retuner | None = None,
    statistics: LoopStatistics | None = None,
    sink: Callable[[FloatArray], None] | None = None,
    event_sink: EventSink | None = None,
) -> ControllerNode:
    """Design the law and build the controller node around it.

    Parameters
    ----------
    config : ControllerConfig
    retuner : Retuner, optional
        Who identifies and designs, if the configuration has the controller retune itself; without
        one it does not.
    statistics, sink, event_sink
        As `ControllerNode` takes them.
    """
    tank, catalogue = config.vessel.tank, load_catalogue()
    level_period_s = catalogue.codec(SensorTank).cycle_ns * 1e-9
    retuning = None
    built = build_law(config.law, config.vessel, config.delay_s, config.limits)
    controller = built.controller
    if (
        retuner is not None
        and config.retuning is not None
        and isinstance(config.law, PredictiveDesign)
        and built.linear is not None
    ):
        controller = retuning = _adaptive(
            config, config.law, built.linear, config.retuning, retuner
        )
    return ControllerNode(
        controller,
        measure_of(built.measured),
        LevelObserver(tank, level_period_s),
        CommandLimiter(config.limits, tank, TICK_S),
        Supervisor(config.safety),
        ControllerSettings(
            configuration_version=config.vessel.version,
            command_timeout_s=config.command_timeout_ms * 1e-3,
            bit_rate=config.bit_rate,
        ),
        catalogue,
        retuning=retuning,
        statistics=statistics,
        sink=sink,
        event_sink=event_sink,
    )


def retuner_work(config: ControllerConfig) -> tuple[Work, tuple[int, int]] | None:
    """The retuner's work for a configuration and the shape of its longest record, if it has any.

    The work may be handed to another process.
    """
    settings, design = config.retuning, config.law
    if settings is None or not isinstance(design, PredictiveDesign):
        return None
    task = RetuningTask(
        design,
        config.vessel.ship,
        config.vessel.tank,
        config.delay_s,
        config.vessel.pump.lag_s,
        settings.order,
        ModelLimits(settings.roll_period_range_s),
        config.limits.pressure_pa,
        config.limits,
        LEAST_GAIN,
    )
    rows = round(settings.identification_s / design.predictor.sample_time_s)
    return partial(retune, task=task), (rows, 1 + len(design.predictor.measured))


def _adaptive(
    config: ControllerConfig,
    design: PredictiveDesign,
    law: LinearLaw,
    settings: RetuningSettings,
    retuner: Retuner,
) -> AdaptiveController:
    """A controller that begins with `law` and retunes itself."""
    ship, tank, path = (
        config.vessel.ship,
        config.vessel.tank,
        (config.delay_s, config.vessel.pump.lag_s),
    )
    return AdaptiveController(
        law,
        wave_arx(design.predictor, ship, tank, *path),
        design.predictor.measured.index("roll_rad"),
        settings,
        make_pulses(settings, config.limits, ship, tank, law.sample_time_s, *path),
        retuner,
    )
