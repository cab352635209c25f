"""What retuning did for a run, in figures."""

from typing import Any, Final

from firmware_sim.run import Run
from utank_hil.analysis.metrics import roll_statistics
from utank_hil.canbus import RetuningState

SETTLING_S: Final = 60.0
"""Left out after a new law came into service."""


def retuning_figures(run: Run, settle_s: float) -> dict[str, Any] | None:
    """Events of a run, and its roll before the first identification and after the last trial began.

    Parameters
    ----------
    run : Run
    settle_s : float
        Left out at the start.

    Returns
    -------
    dict or None
        Ready for `json.dumps`; None if nothing was retuned. The rolls are None where there is no
        such time.
    """
    if not run.retuning:
        return None
    time_s, state = run.column("time_s"), run.column("retuning")
    times = {kind: time_s[state == kind] for kind in (RetuningState.IDENTIFY, RetuningState.TRIAL)}
    before = after = None
    if len(times[RetuningState.IDENTIFY]):
        shown = (time_s >= settle_s) & (time_s < times[RetuningState.IDENTIFY][0])
        before = _rms(run, shown)
    if len(times[RetuningState.TRIAL]):
        began = times[RetuningState.TRIAL]
        # of several trials the last: where one sample follows another by more than its step
        breaks = (began[1:] - began[:-1]) > 2 * (time_s[1] - time_s[0])
        start_s = began[1:][breaks][-1] if breaks.any() else began[0]
        after = _rms(run, time_s >= start_s + SETTLING_S)
    first_ns = run.retuning[0].time_ns
    return {
        "roll_before_rad": before,
        "roll_after_rad": after,
        "roll_after_below_before": None if not before or after is None else 1 - after / before,
        "events": [
            {
                "after_first_s": (event.time_ns - first_ns) * 1e-9,
                "state": event.state.name,
                "reasons": list(event.reasons),
            }
            for event in run.retuning
        ],
    }


def _rms(run: Run, shown: Any) -> float | None:
    roll_rad = run.column("true_roll_rad")[shown]
    return roll_statistics(roll_rad).rms_rad if len(roll_rad) else None
