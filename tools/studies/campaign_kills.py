"""A campaign whose workers and driver are killed: what is done twice, whether a bit differs.

    python -m tools.studies.campaign_kills          # --fast 10000 --bus 200 --kills 20

The storm with GPC, `--fast` cases of 60 s in the linear simulation and `--bus` in lockstep, on two
workers. At random places a random worker is killed (SIGKILL), and twice the driver, which is then
started anew with what is there. Afterwards: are rows unique and all there, how many cases were
begun more than once, and do 200 of each kind equal a serial run bit for bit? Then the same on one
worker and on two, undisturbed: what a case costs beyond its own work.
"""

import argparse
import dataclasses
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import psutil
import yaml

from firmware_sim.campaign.cluster import workers
from firmware_sim.campaign.driver import Driver, batch_of
from firmware_sim.campaign.simulations import Row
from firmware_sim.campaign.store import Store
from firmware_sim.campaign.study import LoadedStudy, load_study
from firmware_sim.campaign.work import Batch, run_batch
from tools.printing import command_line, show

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
TALLY = "CAMPAIGN_TALLY"
COMPARED = 200
RESTARTS = 2
POLL_S = 0.02
SCALED = {"linear": 400, "bus": 16}


def tallied(batch: Batch) -> list[Row]:
    """`run_batch`, with a line in a file for each case that is begun."""
    rows = []
    for case in batch.cases:
        with Path(os.environ[TALLY]).open("a") as tally:
            tally.write(case[0] + "\n")
        rows += run_batch(dataclasses.replace(batch, cases=(case,)))
    return rows


def study_of(folder: Path, simulation: str, count: int) -> Path:
    """A study of so many seeds."""
    content = {
        "name": "killed",
        "scenario": str(CONFIGS / "scenarios" / "storm.yaml"),
        "simulation": simulation,
        "set": {
            "controllers": {"gpc": str(CONFIGS / "controllers" / "gpc.yaml")},
            "duration_s": 60.0,
            "settle_s": 20.0,
        },
        "grid": {"seed": {"first": 1, "count": count}},
    }
    path = folder / f"{simulation}.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def drive(study: Path, out: Path, count: int) -> None:
    """Compute what is missing, in this process and its workers."""
    loaded, store = load_study(study), Store(out)
    store.begin(loaded, {"keys": loaded.keys}, resume=True)
    driver = Driver(loaded, store, lambda _: None, tallied)
    with workers(None, count) as client:
        driver.run(client)


def begun(tally: Path) -> list[str]:
    """Names of the cases that were begun, as often as they were."""
    return tally.read_text().split() if tally.exists() else []


def disturbed(study: Path, out: Path, kills: int, restarts: int) -> dict[str, Any]:
    """Run a study to its end while its workers and drivers are killed."""
    loaded = load_study(study)
    tally = out.with_suffix(".tally")
    os.environ[TALLY] = str(tally)
    rng = random.Random(4)
    places = sorted(
        [(rng.uniform(0.02, 0.98), "worker") for _ in range(kills)]
        + [(rng.uniform(0.2, 0.8), "driver") for _ in range(restarts)]
    )
    command = [
        sys.executable,
        "-m",
        "tools.studies.campaign_kills",
        "--drive",
        str(study),
        str(out),
    ]
    started, drivers, killed = time.monotonic(), 1, 0
    driver = subprocess.Popen(command)
    while driver.poll() is None or driver.returncode == -signal.SIGKILL:
        time.sleep(POLL_S)
        if places and len(begun(tally)) >= places[0][0] * len(loaded.cases):
            _, what = places.pop(0)
            if what == "driver":
                driver.kill()
                driver.wait()
                drivers += 1
                driver = subprocess.Popen(command)
            else:
                killed += kill_worker(driver.pid, rng)
    if driver.returncode:
        raise SystemExit(f"the driver ended with {driver.returncode}")
    return {
        "cases": len(loaded.cases),
        "drivers": drivers,
        "workers_killed": killed,
        "wall_s": time.monotonic() - started,
        **checked(loaded, Store(out), begun(tally)),
    }


def kill_worker(driver: int, rng: random.Random) -> int:
    """Kill one of a driver's workers; none may be there yet."""
    try:
        names = [
            child
            for child in psutil.Process(driver).children()
            if any("spawn_main" in word for word in child.cmdline())
        ]
        rng.choice(names).kill()
    except (psutil.Error, IndexError):  # it has just ended, or none has begun
        return 0
    return 1


def checked(loaded: LoadedStudy, store: Store, names: list[str]) -> dict[str, Any]:
    """Whether all is there once, and what equals a serial run."""
    rows = store.rows().to_pylist()
    keys = Counter((row["case"], row["run"]) for row in rows)
    by_case: dict[str, list[Row]] = {}
    for row in rows:
        by_case.setdefault(row["case"], []).append(row)
    step = max(1, len(loaded.cases) // COMPARED)
    cases = loaded.cases[::step][:COMPARED]
    different = sum(
        in_bits(run_batch(batch_of(loaded, [case]))) != in_bits(by_case[case.name])
        for case in cases
    )
    return {
        "rows": len(rows),
        "rows_not_unique": sum(count > 1 for count in keys.values()),
        "cases_missing": len(loaded.cases) - len(by_case),
        "cases_failed": sum(row["run"] == "" for row in rows),
        "computed_twice": (len(names) - len(set(names))) / len(set(names)),
        "compared": len(cases),
        "different": different,
    }


def in_bits(rows: list[Row]) -> list[dict[str, str]]:
    """Rows as text that is exact; without the time they took."""
    return [
        {key: value.hex() if isinstance(value, float) else value for key, value in row.items()
         if key != "wall_s"}
        for row in rows
    ]  # fmt: skip


def scaled(folder: Path, simulation: str) -> list[dict[str, float]]:
    """The same cases on one worker and on two, undisturbed."""
    found = []
    for count in (1, 2):
        out = folder / f"{simulation}-{count}"
        os.environ[TALLY] = str(out) + ".tally"
        loaded = load_study(study_of(folder, simulation, SCALED[simulation]))
        store = Store(out)
        store.begin(loaded, {"keys": loaded.keys}, resume=False)
        driver = Driver(loaded, store, lambda _: None, tallied)
        with workers(None, count) as client:
            client.run(warm, batch_of(loaded, loaded.cases[:1]))
            begin = time.monotonic()
            used_s = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
            driver.run(client)
            wall_s = time.monotonic() - begin
            own_s = sum(resource.getrusage(resource.RUSAGE_SELF)[:2]) - used_s
            memory = client.run(lambda: psutil.Process().memory_info().rss)
        rows = store.rows().to_pylist()
        work_s = sum({row["case"]: row["wall_s"] for row in rows}.values())
        cases = len(loaded.cases)
        found.append(
            {
                "workers": count,
                "cases": cases,
                "wall_s": wall_s,
                "case_s": work_s / cases,
                "cases_a_second": cases / wall_s,
                "overhead_a_case_s": (wall_s * count - work_s) / cases,
                "driver_a_case_s": own_s / cases,
                "worker_bytes": max(memory.values()),
                "driver_bytes": psutil.Process().memory_info().rss,
            }
        )
    return found


def warm(batch: Batch) -> None:
    """Have a worker import and build what the first case needs."""
    run_batch(batch)


def main() -> None:
    """Run the study, or be a driver of it."""
    parser = command_line(__doc__)
    parser.add_argument("--fast", type=int, default=10_000, help="cases, %(default)s")
    parser.add_argument("--bus", type=int, default=200, help="cases, %(default)s")
    parser.add_argument("--kills", type=int, default=20, help="of workers, %(default)s")
    parser.add_argument("--drive", nargs=2, type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.drive:
        study, out = arguments.drive
        drive(study, out, 2)
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        bus_kills = arguments.kills // 4
        kinds = {
            "linear": (arguments.fast, arguments.kills - bus_kills, 1),
            "bus": (arguments.bus, bus_kills, RESTARTS - 1),
        }
        found: dict[str, Any] = {"killed": {}, "scaling": {}}
        for simulation, (count, kills, restarts) in kinds.items():
            out = folder / f"{simulation}-killed"
            study = study_of(folder, simulation, count)
            found["killed"][simulation] = disturbed(study, out, kills, restarts)
            found["scaling"][simulation] = scaled(folder, simulation)
            sys.stderr.write(json.dumps(found) + "\n")  # should the rest fail
    show(found, arguments)


if __name__ == "__main__":
    main()
