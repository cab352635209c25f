"""The list of parts of a deployed controller, CycloneDX JSON, from the lock.

    python -m tools.sbom [--extra viewer] > out/sbom.json
    python -m tools.sbom [--extra viewer] --lock > dist/requirements.txt

The second is what pip installs these parts by, and none else. The parts are what the package
requires without its extras, and what those require in turn, in the versions and with the hashes of
requirements.lock. `cyclonedx-py` writes them; who requires whom is added from the packages' own
metadata.
"""

import argparse
import json
import re
import subprocess
import sys
import warnings
from importlib.metadata import requires
from pathlib import Path
from typing import Any, Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT: Final = Path(__file__).resolve().parents[1]
LOCK: Final = ROOT / "requirements.lock"
PROJECT: Final = "utank-hil"


def required_by(name: str, extras: frozenset[str]) -> dict[str, frozenset[str]]:
    """What an installed package requires on this machine: names, with the extras asked of them."""
    found: dict[str, frozenset[str]] = {}
    for line in requires(name) or ():
        wanted = Requirement(line)
        marker = wanted.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in {"", *extras}):
            other = canonicalize_name(wanted.name)
            found[other] = found.get(other, frozenset()) | frozenset(wanted.extras)
    return found


def closure(extras: frozenset[str]) -> dict[str, set[str]]:
    """Every part, with what it requires itself; the project among them."""
    parts: dict[str, set[str]] = {}
    waiting = [(PROJECT, extras)]
    done = set()
    while waiting:
        name, asked = waiting.pop()
        if (name, asked) in done:
            continue
        done.add((name, asked))
        needs = required_by(name, asked)
        parts.setdefault(name, set()).update(needs.keys() - {name})
        waiting += needs.items()
    return parts


def locked(names: set[str]) -> str:
    """Return the entries of the lock for these packages that hold on this machine.

    An extra that only other packages ask for goes: its own packages are not among these.
    """
    text = LOCK.read_text(encoding="utf-8")
    kept = {}
    for entry in re.split(r"\n(?=\S)", text.strip()):
        wanted = Requirement(entry.partition("\\\n")[0].strip())
        if canonicalize_name(wanted.name) in names and (
            wanted.marker is None or wanted.marker.evaluate({"extra": ""})
        ):
            kept[canonicalize_name(wanted.name)] = wanted, entry
    missing = sorted(names - kept.keys())
    if missing:
        raise SystemExit(f"{LOCK.name} lacks {', '.join(missing)}: run `make lock`")
    asked = {
        (other, extra)
        for name in (*names, PROJECT)
        for other, extras in required_by(name, frozenset()).items()
        for extra in extras
    }
    lines = []
    for name, (wanted, entry) in kept.items():
        extras = sorted(extra for extra in wanted.extras if (name, extra) in asked)
        pinned = f"{wanted.name}[{','.join(extras)}]" if extras else wanted.name
        lines.append(re.sub(r"^[^=\s]+(?===)", pinned, entry))
    return "\n".join(lines) + "\n"


def sbom(extras: frozenset[str] = frozenset()) -> dict[str, Any]:
    """The list of parts."""
    parts = closure(extras)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "cyclonedx_py", "requirements", "-",
         "--pyproject", "pyproject.toml", "--output-reproducible"],
        cwd=ROOT, input=locked(parts.keys() - {PROJECT}), stdout=subprocess.PIPE, text=True,
        check=True,
    )  # fmt: skip
    made: dict[str, Any] = json.loads(done.stdout)
    refs: dict[str, str] = {
        canonicalize_name(part["name"]): part["bom-ref"] for part in made["components"]
    }
    refs[PROJECT] = made["metadata"]["component"]["bom-ref"]
    made["dependencies"] = [
        {"ref": refs[name], "dependsOn": sorted(refs[other] for other in needs)}
        for name, needs in sorted(parts.items())
    ]
    return made


def main() -> None:
    """Print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--extra", action="append", default=[], help="an extra that is installed")
    parser.add_argument("--lock", action="store_true", help="as requirements of pip, with hashes")
    arguments = parser.parse_args()
    extras = frozenset(arguments.extra)
    if arguments.lock:
        sys.stdout.write(locked(closure(extras).keys() - {PROJECT}))
        return
    warnings.simplefilter("error")
    json.dump(sbom(extras), sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
