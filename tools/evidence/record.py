"""Results of parts: made, written, read, and whether they are of the code as it is."""

import importlib.metadata
import json
import os
import platform
import re
import shlex
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from tools.evidence.parts import PEERS, Part
from tools.evidence.sources import ROOT, digest_of, imported
from tools.mutation.targets import TARGETS

FOLDER = ROOT / "docs" / "evidence"
PRINTED = ROOT / ".cache" / "evidence"
"""What parts printed that failed: it may be hours of work, and says why."""
State = Literal["not run yet", "other command", "other code", "current"]
Record = dict[str, Any]


class PartError(Exception):
    """A part that gave no result."""


def file_of(part: Part) -> Path:
    """Where the result of a part is kept."""
    return FOLDER / f"{part.name}.json"


def read(part: Part) -> Record | None:
    """The kept result, None if there is none."""
    try:
        return dict(json.loads(file_of(part).read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None


def state(part: Part) -> State:
    """Whether there is a result, of this command and of the code as it is."""
    kept = read(part)
    if kept is None:
        return "not run yet"
    if kept["command"] != part.command:
        return "other command"
    return "current" if kept["sources"] == sources(part) else "other code"


def sources(part: Part) -> str:
    """Digest of what a part is made from: configurations and the code it imports.

    Tests run the installed commands: all of both packages counts.
    """
    module = re.search(r"-m ((?:tools|firmware_sim)\.\S+)", part.command)
    assert module, part.command
    start = {ROOT / (module[1].replace(".", "/") + ".py")}
    if module[1] == "tools.evidence.pytest_part":
        for package in ("utank_hil", "firmware_sim"):
            start |= set((ROOT / package).rglob("*.py"))
        for file in (ROOT / "tests").rglob("*.py"):
            if b"mark.evidence" in file.read_bytes():
                start.add(file)
    if module[1].startswith("tools.mutation."):
        for target in TARGETS:
            start |= {ROOT / name for name in (target.file, *target.tests, *target.behind)}
    configs = {file for file in (ROOT / "configs").rglob("*") if file.is_file()}
    return digest_of(imported(start) | configs)


def run(part: Part) -> Record:
    """Run a part and keep its result.

    Raises
    ------
    PartError
        If its command fails or prints anything but one JSON object; what was kept stays.
    """
    if PEERS in part.command and not (ROOT / PEERS).exists():
        raise PartError("the packages it compares with are missing: run `make peers` first")
    words = [sys.executable if word == "python" else word for word in shlex.split(part.command)]
    digest, load, begin = sources(part), os.getloadavg()[0], time.monotonic()
    commit, changed = _commit()
    made: Record = {
        "part": part.name,
        "shows": part.shows,
        "command": part.command,
        "date": datetime.now(UTC).date().isoformat(),
        "commit": commit,
        "uncommitted_changes": changed,
        "sources": digest,
        "machine": machine() | {"load_at_begin": round(load, 2)},
        "versions": versions(),
    }
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    made["seconds"] = round(time.monotonic() - begin, 1)
    wrong = f"exit code {done.returncode}" if done.returncode else ""
    try:
        made["result"] = json.loads(done.stdout)
    except ValueError as error:
        wrong = wrong or f"printed no JSON object ({error})"
    if wrong:
        PRINTED.mkdir(parents=True, exist_ok=True)
        printed = PRINTED / f"{part.name}.out"
        printed.write_text(done.stdout, encoding="utf-8")
        raise PartError(f"{wrong}: {part.command}; what it printed is in {printed}")
    _write(file_of(part), made)
    return made


def _write(file: Path, content: Record) -> None:
    """Write a file whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_suffix(".part")
    temporary.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    temporary.replace(file)


def machine() -> Record:
    """Processor, cores and kernel; nothing that names the machine."""
    names = re.findall(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    return {
        "processor": names[0] if names else platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": f"{platform.system()} {platform.release()}",
    }


def versions() -> dict[str, str]:
    """Python and the packages that the project names."""
    named = (
        re.split(r"[^\w.-]", each)[0]
        for each in importlib.metadata.requires("utank-hil") or []
        if "extra ==" not in each
    )
    return {"python": platform.python_version()} | {
        name: importlib.metadata.version(name) for name in sorted(named)
    }


def _commit() -> tuple[str | None, bool]:
    """Commit that is checked out, and whether files differ from it; None outside a repository."""
    head, changes = (
        subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
        ).stdout.strip()
        for words in (["rev-parse", "--short=10", "HEAD"], ["status", "--porcelain"])
    )
    changed = [line for line in changes.splitlines() if "docs/evidence" not in line]
    return head or None, bool(changed)
