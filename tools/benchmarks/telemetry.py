"""Time what telemetry costs: a write and a read of the ring, a recording of an hour, the loop.

python -m tools.benchmarks.telemetry [--json]

Of the loop: a controller's tick with ring, recorder, frame log and viewer, and one of the same
controller with none of them, in turns of a second of the same storm in one process. So too while
the viewer is stopped, after the recorder was killed, and when the disk is full.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from tools.timed_node import TimedNode
from utank_hil.assembly import build_controller_node
from utank_hil.base.provenance import describe
from utank_hil.commands.recording import RunRecording
from utank_hil.configuration import load_config
from utank_hil.nodes.signals import ROW_TICKS, SIGNALS
from utank_hil.runners import Lockstep
from utank_hil.telemetry.node_tap import NodeTap
from utank_hil.telemetry.recording import read_recording, write_recording
from utank_hil.telemetry.rows import RowReader, RowWriter
from utank_hil.telemetry.viewer import rerun_binary, rerun_environment

STORM: Final = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "storm.yaml"
_TICKS_OF_A_ROUND: Final = 20
"""In 0.2 s everything is done at least once: the law, status frames, what goes to the recorder."""
_STREAM: Final = """
import sys, time
from utank_hil.telemetry.live import LiveStream, live_runs
(run,) = (each for each in live_runs() if each.pid == int(sys.argv[1]))
with LiveStream(run) as stream:
    print(stream.url, flush=True)
    while stream.send():
        time.sleep(0.25)
"""


def ring() -> dict[str, float]:
    """Time single writes, and reads of all that a full ring holds."""
    row = np.zeros(len(SIGNALS))
    writes_s = []
    with RowWriter(SIGNALS) as writer, RowReader(writer.name) as reader:
        for _ in range(20_000):
            start = time.perf_counter()
            writer.write(row)
            writes_s.append(time.perf_counter() - start)
        start = time.perf_counter()
        rows = len(reader.read_rows())
        read_s = time.perf_counter() - start
    p50, p99 = np.percentile(writes_s, (50, 99)) * 1e6
    return {"write_p50_us": p50, "write_p99_us": p99, "read_us_a_row": read_s / rows * 1e6}


def recording() -> dict[str, float]:
    """Time an hour of three runs at 20 Hz, to a file and back."""
    rows = np.random.default_rng(1).standard_normal((72_000, len(SIGNALS)))
    rows[:, 0] = np.arange(len(rows)) / 20
    rows[:, SIGNALS.index("mode")] = 2
    rows[:, SIGNALS.index("fault")] = rows[:, SIGNALS.index("retuning")] = 0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "hour.rrd"
        start = time.perf_counter()
        write_recording(file, SIGNALS, {"passive": rows, "dpc": rows, "gpc": rows})
        write_s = time.perf_counter() - start
        start = time.perf_counter()
        read_recording(file)
        read_s = time.perf_counter() - start
        size = file.stat().st_size / 1e6
    return {"write_s": write_s, "read_s": read_s, "size_mb": size}


def _slice(recording: RunRecording | None) -> tuple[Lockstep, TimedNode]:
    """The storm with the scenario's last law; with its telemetry taken, or without."""
    scenario = load_config(STORM, Scenario)
    config = list(scenario.controllers.values())[-1]
    ship = build_ship_side(scenario, scenario.seed, scenario.operator)
    sink = None if recording is None else recording.write
    node = build_controller_node(config, sink=sink, sink_every=ROW_TICKS, commissioned=True)
    timed = TimedNode(
        node if recording is None else NodeTap(node, recording.write_records, every=ROW_TICKS),
        time.thread_time_ns,
    )
    return Lockstep([*ship.nodes, timed]), timed


def loop(seconds: int) -> dict[str, dict[str, float]]:
    """Processor time of a tick without telemetry, and what it takes more with it, by situation."""
    config = list(load_config(STORM, Scenario).controllers.values())[-1]
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as place, ExitStack() as stack:
        folder = Path(place)
        about = describe("run", config, folder, options={})
        recording = RunRecording(folder, about=about, head={"about": about})
        stack.callback(recording.stop)
        stream = subprocess.Popen(
            [sys.executable, "-c", _STREAM, str(os.getpid())], stdout=subprocess.PIPE, text=True
        )
        stack.callback(stream.kill)
        assert stream.stdout is not None
        url, saved = stream.stdout.readline().strip(), str(folder / "seen.rrd")
        viewer = subprocess.Popen([rerun_binary(), url, "--save", saved], env=rerun_environment())
        stack.callback(viewer.kill)
        pairs = _slice(None), _slice(recording)
        recorder = recording.recorder_pid
        assert recorder is not None
        for situation, change in (
            ("on", None),
            ("viewer stopped", lambda: viewer.send_signal(signal.SIGSTOP)),
            ("disk full", lambda: subprocess.run(
                ["prlimit", f"--pid={recorder}", "--fsize=100000"], check=True)),
            ("recorder killed", lambda: os.kill(recorder, signal.SIGKILL)),
        ):  # fmt: skip
            if change is not None:
                change()
            costs = _in_turns(pairs, seconds)
            found[situation] = {}
            for name, percent in (("p50", 50), ("p99", 99)):
                off, on = (float(np.percentile(each, percent)) for each in costs)
                found[situation] |= {f"{name}_off_us": off, f"{name}_more_us": on - off}
            # tick by tick: they do the same work in the same order, and repeat it after as many
            off_us, on_us = (np.reshape(each, (-1, _TICKS_OF_A_ROUND)) for each in costs)
            mean_us = float(np.median(on_us - off_us, axis=0).mean())
            found[situation]["mean_more_us"] = mean_us
    return found


def _in_turns(pairs: Sequence[tuple[Lockstep, TimedNode]], seconds: int) -> list[list[float]]:
    """Costs of the ticks of each, in microseconds; the first of all warm up."""
    for turn in range(seconds + 1):
        for lockstep, timed in pairs:
            lockstep.run_until(lockstep.now_ns + 1_000_000_000)
            if turn == 0:
                timed.ticks_ns.clear()
    return [[cost_ns / 1e3 for cost_ns in timed.ticks_ns] for _, timed in pairs]


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=60, help="of the storm, in each situation")
    arguments = parser.parse_args()
    found = {
        "ring": ring(),
        "an hour of three runs": recording(),
        "the loop's tick": loop(arguments.seconds),
    }
    show(found, arguments)


if __name__ == "__main__":
    main()
