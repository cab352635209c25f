"""Measurements for a release, one file each in docs/evidence.

    python -m tools.evidence                      # all that this release has not; `make evidence`
    python -m tools.evidence --list
    python -m tools.evidence cost_slice week         # these, even if this release has them

A part is a command. Its record holds what it printed, with command, version, commit, date, machine
and duration. A part that fails leaves the record that was there. After Ctrl-C the same command goes
on where it was. Pages quote numbers of these records by hand, with command and date.
"""

import argparse
import json
import os
import platform
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[1]
FOLDER: Final = ROOT / "docs" / "evidence"
LAST_LINES: Final = 400  #: Lines that are kept of a command that prints no JSON object.


class Part(NamedTuple):
    """A command as typed at the root of a checkout, and about how long it takes on two cores."""

    command: str
    minutes: float


def _study(name: str) -> str:
    out = f".cache/campaigns/{name}"
    return f"utank-hil campaign configs/studies/{name}.yaml --out {out} --resume --json"


PARTS: Final = {
    # what the laws are worth
    "share_of_possible": Part("python -m tools.studies.share_of_possible --seeds 8 --json", 6),
    "preview_worth": Part("python -m tools.studies.preview_worth --seeds 12 --json", 10),
    "renewed_seas": Part("python -m tools.studies.renewed_seas --seeds 3 --json", 30),
    "unseen_seeds": Part("python -m tools.studies.unseen_seeds --json", 60),
    "ten_hulls": Part("python -m tools.studies.ten_hulls --json", 15),
    "turning": Part("python -m tools.studies.turning --json", 1),
    "less_pressure": Part("python -m tools.studies.less_pressure --json", 12),
    "other_loads": Part("python -m tools.studies.other_loads --json", 15),
    "identified_ships": Part("python -m tools.studies.identified_ships --json", 15),
    "february_hours": Part(_study("february_hours"), 80),
    "storm_seeds": Part(_study("storm_seeds"), 30),
    "shipped_scenarios": Part(_study("shipped_scenarios"), 10),
    "year_of_seas": Part(_study("year_of_seas"), 30),
    # what the safety code is worth
    "half_pressure": Part("python -m tools.studies.half_pressure --json", 5),
    "fault_campaign": Part("utank-hil faults --seeds 100 --json", 20),
    "fault_campaign_roll": Part("utank-hil faults --seeds 10 --full --json", 20),
    "false_alarms": Part("python -m tools.studies.false_alarms --hours 50 --json", 1200),
    "monitor_margins": Part(
        "python -m tools.studies.monitor_margins configs/scenarios/storm_all.yaml"
        " --minutes 60 --json",
        10,
    ),
    "week": Part("python -m tools.studies.week --days 7 --json", 120),
    "search": Part("make search", 60),
    "mutants": Part("make mutants", 90),
    "coverage": Part("make coverage", 5),
    "tests": Part("pytest -n auto -rA -m 'evidence and not socketcan'", 150),
    "tests_on_vcan": Part(
        "tools/vcan pytest -m evidence tests/socketcan --ignore=tests/socketcan/test_service.py", 60
    ),
    "two_buses": Part("tools/vcan python -m tools.studies.two_buses --json", 25),
    "service": Part("tools/vcan --uml pytest -rA -m evidence tests/socketcan/test_service.py", 4),
    # what it costs
    **{
        f"cost_{name}": Part(f"python -m tools.benchmarks.{name} {options}--json", minutes)
        for name, options, minutes in (
            ("realtime", "--seconds 200 ", 20),
            ("campaign", "", 1),
            ("slice", "", 1),
        )
    },
    # the source
    "thesis_figures": Part("python -m tools.thesis --json", 4),
    "thesis_derivation": Part("python -m tools.thesis.derive_tank_forces --json", 1),
}


class PartError(Exception):
    """A part ended with another exit code than 0; what it printed is in `.cache/evidence`."""


def read(name: str) -> dict[str, Any]:
    """The record of a part; empty where there is none."""
    file = FOLDER / f"{name}.json"
    found: dict[str, Any] = json.loads(file.read_text("utf-8")) if file.exists() else {}
    return found


def is_of_this_release(name: str) -> bool:
    """Whether a part was run with the version that is installed."""
    return read(name).get("version") == version("utank-hil")


def commit() -> str:
    """The commit that is checked out, with a plus where files differ from it."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
        return done.stdout

    changed = [
        line for line in git("status", "--porcelain").splitlines() if "evidence/" not in line
    ]
    return git("rev-parse", "--short=10", "HEAD").strip() + "+" * bool(changed)


def run(name: str, part: Part) -> float:
    """Run a part, write its record, and return how many seconds it took.

    Raises `PartError` if the command fails.
    """
    programs = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    load, begin, at = os.getloadavg()[0], time.monotonic(), commit()
    done = subprocess.run(
        shlex.split(part.command),
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    seconds = round(time.monotonic() - begin, 1)
    if done.returncode:
        printed = ROOT / ".cache" / "evidence" / f"{name}.out"
        printed.parent.mkdir(parents=True, exist_ok=True)
        printed.write_text(done.stdout, encoding="utf-8")
        raise PartError(f"exit code {done.returncode}: {part.command}; it printed {printed}")
    try:
        result = json.loads(done.stdout)
    except ValueError:
        result = done.stdout.splitlines()[-LAST_LINES:]
    processor = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    record = {
        "part": name,
        "command": part.command,
        "version": version("utank-hil"),
        "commit": at,
        "date": datetime.now(UTC).date().isoformat(),
        "machine": {
            "processor": processor[1] if processor else platform.machine(),
            "cores": len(os.sched_getaffinity(0)),
            "kernel": f"{platform.system()} {platform.release()}",
            "python": platform.python_version(),
            "load_at_begin": round(load, 2),
        },
        "seconds": seconds,
        "result": result,
    }
    unfinished = (FOLDER / f"{name}.json").with_suffix(".part")
    unfinished.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    unfinished.replace(FOLDER / f"{name}.json")
    return seconds


def main(arguments: Sequence[str] | None = None) -> int:
    """List the parts, or run those that are wanted."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.evidence",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("parts", nargs="*", help="names of parts", metavar="PART")
    parser.add_argument("--list", action="store_true", help="print the parts, run nothing")
    options = parser.parse_args(arguments)
    if unknown := set(options.parts) - PARTS.keys():
        parser.error(f"no part {', '.join(sorted(unknown))}; --list prints all")
    if options.list:
        for name, part in PARTS.items():
            kept = read(name)
            of = f"{kept.get('version', '')} {kept['date']}" if kept else "not run"
            print(f"{name:20} {of:17} about {part.minutes:4g} min  {part.command}")
        return 0
    failed = 0
    for name in options.parts or [name for name in PARTS if not is_of_this_release(name)]:
        print(f"{name}, about {PARTS[name].minutes:g} min", flush=True)
        try:
            print(f"  {run(name, PARTS[name]):.0f} s")
        except PartError as error:
            print(f"  {error}", file=sys.stderr)
            failed += 1
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
