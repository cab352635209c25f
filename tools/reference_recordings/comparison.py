"""What the controller of today does with the kept frame logs."""

from pathlib import Path
from typing import Final

from utank_hil.configuration import ControllerConfig
from utank_hil.telemetry.frame_log import FrameLog, FrameLogError
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import ReplayHeadError, recorded_config

LOGS: Final = Path("tests/replay")


def compare(path: Path, changes: dict[str, object] | None = None) -> str:
    """The first difference of a replay and what may be its cause; empty if there is none.

    Parameters
    ----------
    path : Path
        The log.
    changes : dict, optional
        Sections of the configuration that are others than recorded.
    """
    try:
        log = FrameLog(path)
        with recorded_config(log.head) as config:
            chosen: ControllerConfig = config.model_copy(update=changes or {})
            result, why = replay_log(log, chosen, path.parent)
    except (FrameLogError, ReplayHeadError) as error:
        return str(error)
    return "; ".join([str(result.first), *why]) if result.first is not None else ""
