"""Mutated configurations, read as `utank-hil check` does.

    python -m tools.fuzz.configurations [--number 10000] [--seed 1] [--laws] [--json]

One of the shipped files of ships, controllers and scenarios is changed in one to three places: a
key is left out, misspelt or written twice, a value is replaced, scaled, negated or of another kind,
bytes are lost, doubled or exchanged. It is then accepted, or refused with a `ConfigError` whose
every problem names its file and says something. With `--laws` the law of each controller that is
accepted is designed too, or refused with a `ParameterError`. Anything else is a failure, which
names the seed's number and keeps the text.
"""

import copy
import json
import random
import shutil
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from firmware_sim.scenario import Scenario
from tools.evidence import ROOT
from tools.printing import command_line, show
from utank_hil.assembly import build_law
from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.configuration.files import ConfigError, ConfigProblem

KINDS: dict[str, Any] = {
    "ships": Vessel, "controllers": ControllerConfig, "scenarios": Scenario,
}  # fmt: skip
ODD: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 0.0, -0.0, 1e-300, 1e300, 10**40, float("nan"), float("inf"),
    "", "yes", "1,5", "0x10", "ja", "../ships/thesis_first.yaml", "./nothing.csv", "nothing.yaml",
    "\x00", "ü" * 300, [], [1, 2], [[]], {}, {"a": {"b": 1}}, {"kind": "gpc"}, [None] * 50,
)  # fmt: skip
FACTORS = (-1, 1e-3, 0.1, 0.5, 1.01, 2, 10, 1e3, 1e6, 57.3)


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every container and key or index within it."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(entries):
        yield tree, key
        if isinstance(value, dict | list):
            yield from places(value)


def change_tree(tree: Any, draw: random.Random) -> None:
    """Change one place of what a file holds."""
    found = list(places(tree))
    if not found:
        return
    holder, key = draw.choice(found)
    value = holder[key]
    match draw.randrange(6):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, dict):
            name = str(key)
            at = draw.randrange(len(name) + 1)
            holder[name[:at] + draw.choice("aeiou_7") + name[at + 1 :]] = holder.pop(key)
        case 2 if isinstance(value, int | float) and not isinstance(value, bool):
            holder[key] = value * draw.choice(FACTORS)
        case 3:
            other, its = draw.choice(found)
            holder[key] = json.loads(json.dumps(other[its], default=str))
        case _:
            holder[key] = copy.deepcopy(draw.choice(ODD))


def change_text(text: str, draw: random.Random) -> bytes:
    """Change some bytes of a file."""
    data = bytearray(text.encode())
    at = draw.randrange(len(data))
    length = draw.choice((1, 1, 2, 10, 100))
    match draw.randrange(4):
        case 0:
            del data[at : at + length]
        case 1:
            data[at:at] = data[at : at + length]
        case 2:
            data[at : at + length] = draw.randbytes(length)
        case _:
            data[at:at] = draw.choice((b"\t", b": ", b"- ", b"&a ", b"*a ", b"{", b"]", b"'", b"#"))
    return bytes(data)


def changed(text: str, draw: random.Random) -> bytes:
    """A file's text, changed in one to three places."""
    if draw.random() < 0.3:
        return change_text(text, draw)
    tree = yaml.safe_load(text)
    for _ in range(draw.randint(1, 3)):
        change_tree(tree, draw)
    return yaml.safe_dump(tree, allow_unicode=True).encode()


class FuzzError(AssertionError):
    """A file that was neither accepted nor refused as it should be."""


def outcome(file: Path, *, laws: bool) -> str:
    """What became of one file.

    Raises `FuzzError` if it is refused without saying where or why.
    """
    try:
        loaded = load_config(file, KINDS[file.parent.name])
    except ConfigError as error:
        if not error.problems or not all(_says(problem, file) for problem in error.problems):
            raise FuzzError(f"refused without its place or reason: {error}") from error
        return "refused"
    loaded.warnings()
    if laws and isinstance(loaded, ControllerConfig):
        try:
            build_law(loaded)
        except ParameterError as error:
            if not error.problems:
                raise FuzzError("a law was refused without a problem") from error
            return "law refused"
        return "law designed"
    return "accepted"


def _says(problem: ConfigProblem, file: Path) -> bool:
    return problem.file.is_relative_to(file.parent.parent) and bool(problem.reason.strip())


def fuzz(number: int, seed: int, *, laws: bool = False, keep: Path | None = None) -> Counter[str]:
    """Read so many mutated files; counts of what became of them.

    Raises `FuzzError` if one raised anything but the errors that it should.
    """
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        configs = Path(folder) / "configs"
        shutil.copytree(ROOT / "configs", configs)
        files = sorted(file for kind in KINDS for file in (configs / kind).glob("*.yaml"))
        texts = [file.read_text(encoding="utf-8") for file in files]
        for index in range(number):
            draw = random.Random(f"{seed}-{index}")
            place = draw.randrange(len(files))
            file = files[place]
            content = changed(texts[place], draw)
            file.write_bytes(content)
            try:
                counts[outcome(file, laws=laws)] += 1
            except Exception as error:
                if keep is not None:
                    keep.write_bytes(content)
                place_of = f"seed {seed}, number {index}, {file.name}"
                raise FuzzError(f"{place_of}: {error!r}") from error
            finally:
                file.write_text(texts[place], encoding="utf-8")
    return counts


def main() -> None:
    """Fuzz, and print the counts."""
    parser = command_line(__doc__)
    parser.add_argument("--number", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--laws", action="store_true", help="design the laws, too")
    parser.add_argument("--keep", type=Path, help="file for the text of a failure")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    counts = fuzz(arguments.number, arguments.seed, laws=arguments.laws, keep=arguments.keep)
    result = {
        "configurations": arguments.number, "seed": arguments.seed, "failures": 0,
        "seconds": round(time.perf_counter() - begin, 1), "counts": dict(sorted(counts.items())),
    }  # fmt: skip
    show(result, arguments)


if __name__ == "__main__":
    main()
