"""Time what telemetry costs: a write and a read of the ring, and a recording of an hour.

Usage: python -m tools.benchmarks.telemetry
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry import RingReader, RingWriter, read_recording, write_recording


def ring() -> None:
    """Time single writes, and reads of all that a full ring holds."""
    row = np.zeros(len(SIGNALS))
    writes_s = []
    with RingWriter(SIGNALS) as writer, RingReader(writer.name) as reader:
        for _ in range(20_000):
            start = time.perf_counter()
            writer.write(row)
            writes_s.append(time.perf_counter() - start)
        start = time.perf_counter()
        rows = len(reader.read())
        read_s = time.perf_counter() - start
    p50, p99 = np.percentile(writes_s, (50, 99)) * 1e6
    print(
        f"ring write: p50 {p50:.2f} us, p99 {p99:.2f} us; read: {read_s / rows * 1e6:.2f} us a row"
    )


def recording() -> None:
    """Time an hour of three runs at 20 Hz, to a file and back."""
    rows = np.random.default_rng(1).standard_normal((72_000, len(SIGNALS)))
    rows[:, 0] = np.arange(len(rows)) / 20
    rows[:, SIGNALS.index("mode")] = 2
    rows[:, SIGNALS.index("fault")] = 0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "hour.rrd"
        start = time.perf_counter()
        write_recording(file, SIGNALS, {"passive": rows, "dpc": rows, "gpc": rows})
        write_s = time.perf_counter() - start
        start = time.perf_counter()
        read_recording(file)
        read_s = time.perf_counter() - start
        size = file.stat().st_size / 1e6
    print(f"an hour of three runs: write {write_s:.2f} s, read {read_s:.2f} s, {size:.1f} MB")


if __name__ == "__main__":
    ring()
    recording()
