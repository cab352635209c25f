"""What a renewal of the self-tuned law costs: each step in the loop, design time, memory.

    python -m tools.benchmarks.renewal [--repeats 5] [--json]

The loop is a plain one, in turns with a real retuner's process that designs for the storm's hour.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np

from tools.printing import command_line, show
from tools.studies.trial_setup import shipped
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.assembly import build_law, retuner_work
from utank_hil.canbus import RetuningOrder, RetuningState, Verdict
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.retuning import (
    MotionEstimate,
    RenewingController,
    RetunerProcess,
    ShipFigures,
)
from utank_hil.retuning.renewing import TRIAL
from utank_hil.sea import SlopeSpectrum

OMEGA_RAD_S = np.arange(0.12, 2.4, 0.018)
BEFORE_S = 240.0
SECOND_NS = 1_000_000_000
WAIT_S = 120.0


def storm_estimate(ship: ShipFigures) -> MotionEstimate:
    """The storm's hour, as if it had been estimated."""
    law = shipped("self_tuned").law
    assert isinstance(law, SelfTunedDesign)
    assert law.sea is not None
    density = law.sea.slope_density(OMEGA_RAD_S)
    waves = SlopeSpectrum(OMEGA_RAD_S, density, 0.1 * density)
    return MotionEstimate(Verdict.GOOD, Verdict.GOOD, ship, waves, 0.05, 4.7, 10.0, 1200.0)


def resident_mb(group: int) -> float:
    """Greatest memory of the processes of a group, so far."""
    most = 0.0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(stat.read_text().rpartition(")")[2].split()[2]) != group:
                continue
            status = (stat.parent / "status").read_text()
        except (FileNotFoundError, ProcessLookupError):  # it has just ended
            continue
        peak = next(line for line in status.splitlines() if line.startswith("VmHWM"))
        most = max(most, int(peak.split()[1]) / 1024)
    return most


def renew_once(law: ConstrainedLaw, times: dict[str, list[float]]) -> tuple[float, float]:
    """Renew, add the time of each step under its name, and return the process's memory in MB."""
    config = shipped("self_tuning")
    ship = ShipFigures.of(config.vessel.ship)
    work = retuner_work(config)
    assert work is not None
    rng = np.random.default_rng(1)
    with RetunerProcess(work) as process:
        controller = RenewingController(
            law, law.controller(), ship, 0, config.limits, process.desks[0]
        )
        idle_mb = resident_mb(process.pid)
        step_s = law.sample_time_s
        noted = round(BEFORE_S / step_s)
        samples = noted + round(TRIAL.trial_s / step_s) + 30
        asked_s = 0.0
        k = 0
        while k < samples:
            if k == noted and controller.state is RetuningState.IDLE:
                controller.note(storm_estimate(ship))
            before, renewed = controller.state, controller.renewed
            y = np.array([0.03, 0.02, 0.8]) * np.sin(0.12 * k + np.arange(3))
            y += 1e-3 * rng.standard_normal(3)
            start = time.perf_counter()
            controller.update(
                round(k * step_s * SECOND_NS), RetuningOrder(), engaged=True, fresh=True
            )
            middle = time.perf_counter()
            command = controller.step(y)
            end = time.perf_counter()
            controller.applied(command)
            k += 1
            designing = controller.state is RetuningState.DESIGN
            waiting = designing and controller.renewed is None
            if before is RetuningState.IDLE and waiting:
                times.setdefault("handing the estimate over", []).append(middle - start)
                asked_s = end
            elif controller.renewed is not renewed:
                times.setdefault("taking the law in", []).append(middle - start)
                times.setdefault("design, there and back", []).append(end - asked_s)
            elif designing and not waiting:
                times.setdefault("step, filling the law's memory", []).append(end - middle)
            elif waiting:
                if end - asked_s > WAIT_S:
                    raise RuntimeError("the retuner's process does not answer")
                times.setdefault("looking for the law", []).append(middle - start)
                time.sleep(0.05)
                k -= 1
            else:
                times.setdefault(f"step, {controller.state.name}", []).append(end - middle)
        assert controller.state in (RetuningState.RETUNED, RetuningState.REFUSED), controller.events
        return idle_mb, resident_mb(process.pid)


def main() -> None:
    """Renew some times and print the medians."""
    parser = command_line(__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    built = build_law(shipped("self_tuning"))
    assert isinstance(built.linear, ConstrainedLaw)
    times: dict[str, list[float]] = {}
    memory = [renew_once(built.linear, times) for _ in range(arguments.repeats)]
    found: dict[str, Any] = {
        f"{name}, us": 1e6 * float(np.median(values)) for name, values in times.items()
    }
    idle_mb, busy_mb = np.median(memory, axis=0).tolist()
    found |= {"retuner's process at rest, MB": idle_mb, "after a design, MB": busy_mb}
    show(found, arguments)


if __name__ == "__main__":
    main()
