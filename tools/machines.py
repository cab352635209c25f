"""Recordings and shipped scenarios under other kernels, threads, Python and packages: one table.

Every reference recording is replayed, and every shipped scenario sailed passive and with each of
its controllers, by the laws and the retuner's answers that the first setting kept in a file. A run
is equal if all that the controller heard and sent, and all rows of the table, are equal bit for
bit. How far laws designed here are from the kept ones is said beside: relative, of an array's
largest element.

Example: python -m tools.machines /var/tmp/kept.json --seconds 600 --kernels
"""

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from firmware_sim.bench import jobs_of
from firmware_sim.run import RECORD_NS, RECORD_S, Job, controller_of, roll_without_tank
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from firmware_sim.truth import TRUTH, TruthRecorder
from tools.reference_recordings.cases import LOGS, SCENARIOS, compare
from utank_hil.assembly import works_of
from utank_hil.base.compiled import in_use
from utank_hil.base.provenance import machine
from utank_hil.configuration import load_config
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import SimulatedRetuner
from utank_hil.retuning.answer import Answer, answer_bytes, read_answer
from utank_hil.retuning.retuner import Request
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more
from utank_hil.telemetry.law_values import (
    decoded,
    differences,
    encoded,
    law_values,
    packed,
    restored,
    unpacked,
)
from utank_hil.telemetry.node_tap import NodeTap, Tapped

Retune = Callable[[Request], Answer]

OLD_NUMPY: Final = "X86_V3 AVX2 FMA3"  #: In the words of numpy from 2.4 on, and of those before.
NEW_NUMPY: Final = "X86_V4 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL"
NEWEST_NUMPY: Final = "AVX512_ICL AVX512_SPR"
NO_FMA: Final = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable"
NO_512: Final = f"{NEW_NUMPY} {NEWEST_NUMPY}"
KERNELS: Final = {  # OpenBLAS: what numpy leaves out, the C library, numba
    "Nehalem": (f"{OLD_NUMPY} {NO_512}", NO_FMA, "nehalem"),
    "Sandybridge": (f"{OLD_NUMPY} {NO_512}", NO_FMA, "sandybridge"),
    "Haswell": (NO_512, "", "haswell"),
    "Zen": (NO_512, "", "znver2"),
    "SkylakeX": (NEWEST_NUMPY, "", "skylake-avx512"),
}


OTHERS: Final[dict[str, dict[str, str]]] = {
    "two threads": {"OPENBLAS_NUM_THREADS": "2"},
    "plain Python": {"UTANK_HIL_COMPILED": "0"},
}


def settings() -> dict[str, dict[str, str]]:
    """Variables of each setting: a kernel alone, and all that a processor of its kind brings."""
    found: dict[str, dict[str, str]] = {"as it is": {}}
    for name, (numpy, libm, numba) in KERNELS.items():
        blas = {"OPENBLAS_CORETYPE": name}
        whole = {
            "NPY_DISABLE_CPU_FEATURES": numpy, "GLIBC_TUNABLES": libm,
            "NUMBA_CPU_NAME": numba, "NUMBA_CPU_FEATURES": "",
        }  # fmt: skip
        found |= {f"{name}, BLAS alone": blas, f"{name}, all": blas | whole}
    oldest = found["Nehalem, all"]
    for name, other in OTHERS.items():
        found |= {name: other, f"Nehalem, all, {name}": oldest | other}
    return found


class Kept:
    """A run's law and answers: taken from the run itself the first time, then given to it."""

    def __init__(self, content: dict[str, Any] | None) -> None:
        self.first = content is None
        self.content: dict[str, Any] = content or {"answers": [[], []]}
        self.deviation = 0.0

    def law(self, job: Job) -> Job:
        """The job with the kept law."""
        make = job.law.controller
        here = law_values(make())
        if self.first:
            self.content["law"] = encoded(here)
            return job
        kept = decoded(self.content["law"])
        self.deviation = max([each.deviation for each in differences(kept, here)], default=0.0)
        return replace(job, law=replace(job.law, controller=lambda: restored(make(), kept)))

    def retuner(self, number: int, retune: Retune) -> SimulatedRetuner:
        """A retuner that gives the kept answers; one after the last, too late for the run, anew."""
        answers: list[str] = self.content["answers"][number]
        known = iter([] if self.first else [*answers])

        def answer(request: Request) -> Answer:
            data = next(known, None)
            if data is not None:
                return read_answer(unpacked(data))
            answers.append(packed(answer_bytes(made := retune(request))))
            return made

        return SimulatedRetuner(answer)


def sail(job: Job, kept: Kept) -> str:
    """Digest of all that the controller of a run hears and sends, and of the rows of the table."""
    whole = hashlib.sha256()
    job = kept.law(job)
    desks = Tapped(
        *(work and kept.retuner(n, work[0]) for n, work in enumerate(works_of(job.controller))),
        wanted=True,
    )
    ship = build_ship_side(job.scenario, job.seed, job.script, job.controller)
    log, truth_log = job.log_of(SIGNALS), job.log_of(TRUTH)
    node = NodeTap(
        controller_of(job, desks, log.write), lambda data, _: whole.update(data), desks.taps
    )
    bit_rate, buses = job.controller.bit_rate, job.controller.vessel.foreign.buses
    bus = with_more(SimulatedBus(bit_rate=bit_rate), len(buses) - 1, bit_rate)
    lockstep = Lockstep([*ship.nodes, node], bus)
    lockstep.join([TruthRecorder(ship.plant, truth_log, RECORD_NS)])
    lockstep.run_until(round(job.duration_s * 1e9))
    for rows in (log.rows, truth_log.rows):
        whole.update(rows.tobytes())
    return whole.hexdigest()


def bare(scenario: Scenario, seconds: float, kept: Kept) -> str:  # noqa: ARG001 - as `sail`
    """Digest of the roll of the ship without tank."""
    roll_rad, _ = roll_without_tank(scenario, scenario.seed, round(seconds / RECORD_S))
    return hashlib.sha256(roll_rad.tobytes()).hexdigest()


def runs(seconds: float, named: str) -> Iterator[tuple[str, Callable[[Kept], str]]]:
    """Name of each run whose name holds a word, and what gives its digest."""
    for file in sorted(SCENARIOS.glob("*.yaml")):
        scenario = load_config(file, Scenario)
        if named not in f"{file.stem}/":
            continue
        duration_s = min(seconds, scenario.duration_s)
        yield f"{file.stem}/no tank", partial(bare, scenario, duration_s)
        for job in jobs_of(scenario, scenario.seed, duration_s):
            yield f"{file.stem}/{job.name}", partial(sail, job)


def row(name: str, file: Path, seconds: float, named: str) -> tuple[str, bool]:
    """Run all in this process; the table's row, and whether everything is equal."""
    known: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
    said = {path.stem: compare(path) for path in sorted(LOGS.glob("*.frames"))}
    other = [name for name, why in said.items() if why]
    count, farthest = 0, 0.0
    for run, digest_of in runs(seconds, named):
        kept = Kept(known.get(run))
        digest = digest_of(kept)
        if kept.content.setdefault("digest", digest) != digest:
            other.append(run)
        count, farthest = count + 1, max(farthest, kept.deviation)
        known[run] = kept.content
    if not file.exists():
        file.write_text(json.dumps(known))
    about = machine()
    parts = f"{about['python']}, {version('numpy')}, {version('scipy')}"
    kernels = f"{about['blas'].split()[-1]}; {about['numpy']}"
    tick = "compiled" if in_use() else "plain"
    cells = (
        name, platform.machine(), parts, kernels, tick, f"{len(said)} and {count}",
        ", ".join(other) or "none", f"{farthest:.0e}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |", not other


def main() -> int:
    """Run one setting, or all kernels in processes of their own; 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kept", type=Path, help="laws, answers and digests; made if missing")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each scenario")
    parser.add_argument("--only", default="", help="part of the names of scenarios")
    parser.add_argument(
        "--kernels", nargs="?", const="", metavar="WORD",
        help="other settings than that of here: all, or those with this in their names",
    )  # fmt: skip
    parser.add_argument("--name", default="as it is", help="of the setting, for its row")
    given = parser.parse_args()
    if given.kernels is None:
        text, equal = row(given.name, given.kept, given.seconds, given.only)
        print(text, flush=True)
        return int(not equal)
    words = [str(given.kept), "--seconds", str(given.seconds), "--only", given.only]
    failed = 0
    for name, variables in settings().items():
        if given.kernels not in name:
            continue
        done = subprocess.run(
            [sys.executable, "-m", "tools.machines", *words, "--name", name],
            env={"OPENBLAS_NUM_THREADS": "1"} | os.environ | variables, check=False,
        )  # fmt: skip
        failed += done.returncode != 0
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
