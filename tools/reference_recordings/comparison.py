"""What the controller of today does with the kept frame logs."""

from pathlib import Path
from typing import Final

from utank_hil.configuration import ControllerConfig
from utank_hil.telemetry.frame_log import FrameLog, FrameLogError
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import ReplayHeadError, recorded_config

LOGS: Final = Path("tests/replay")
DESIGN_BOUND: Final = 1e-6
"""Relative to the largest element of an array: how far today's design may be from a recorded one.

Kernels that are chosen by processor differ in the sixteenth digit; Riccati equations and
factorizations of these plants lose five digits of it (4e-12 between machines with AVX-512, AVX2 and
SSE), five more are room. A weight that is changed by a thousandth moves a gain by 1e-4.
"""


def compare(path: Path, changes: dict[str, object] | None = None) -> str:
    """The first difference of a replay and what may be its cause; empty if there is none.

    The law that was recorded answers, so that frames are equal bit for bit on any processor. A
    design that is farther from it than `DESIGN_BOUND` is a difference of its own.

    Parameters
    ----------
    path : Path
        The log.
    changes : dict, optional
        Sections of the configuration that are others than recorded; its own law answers then.
    """
    try:
        log = FrameLog(path)
        with recorded_config(log.head) as config:
            chosen: ControllerConfig = config.model_copy(update=changes or {})
            result, why, law = replay_log(log, chosen, path.parent, as_recorded=not changes)
    except (FrameLogError, ReplayHeadError) as error:
        return str(error)
    designs = [f"law, {each}" for each in law.differences if each.deviation > DESIGN_BOUND]
    if result.first is not None:
        return "; ".join([str(result.first), *why, *designs])
    if not changes and law.why_not_recorded:
        designs.insert(0, law.why_not_recorded)
    return "; ".join(designs)
