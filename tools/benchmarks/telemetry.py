"""Time what telemetry costs: a write and a read of the ring, and a recording of an hour.

python -m tools.benchmarks.telemetry [--json]
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from tools.printing import command_line, show
from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry import RingReader, RingWriter, read_recording, write_recording


def ring() -> dict[str, float]:
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
    return {"write_p50_us": p50, "write_p99_us": p99, "read_us_a_row": read_s / rows * 1e6}


def recording() -> dict[str, float]:
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
    return {"write_s": write_s, "read_s": read_s, "size_mb": size}


def main() -> None:
    """Measure and print."""
    arguments = command_line(__doc__).parse_args()
    found = {"ring": ring(), "an hour of three runs": recording()}
    show(found, arguments)


if __name__ == "__main__":
    main()
