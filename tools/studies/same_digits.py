"""Frames of the shipped scenarios under the kernels of several processors, one and two threads.

Each setting runs in a process of its own, in lockstep, with the laws that the first one designed;
a digest of every frame on the bus is compared with the first's.

Example: python -m tools.studies.same_digits --seconds 120
"""

import argparse
import hashlib
import os
import pickle
import subprocess
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.configuration import load_config
from utank_hil.control import BuiltLaw
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.telemetry.law_values import law_values, restored

SCENARIOS: Final = Path("configs/scenarios")
_NO_FMA: Final = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable"
SETTINGS: Final[dict[str, dict[str, str]]] = {
    "as it is": {},
    "Nehalem": {"NPY_DISABLE_CPU_FEATURES": "X86_V3", "OPENBLAS_CORETYPE": "Nehalem"},
    **{
        name: {"OPENBLAS_CORETYPE": name} for name in ("Sandybridge", "Haswell", "Zen")
    },
    "two threads": {"OPENBLAS_NUM_THREADS": "2"},
    "C library without fused products": {"GLIBC_TUNABLES": _NO_FMA},
    "numba for Nehalem": {"NUMBA_CPU_NAME": "nehalem", "NUMBA_CPU_FEATURES": ""},
    "plain Python": {"UTANK_HIL_COMPILED": "0"},
}  # fmt: skip


def digests(seconds: float, laws: Path) -> dict[str, str]:
    """Digest of the frames of each scenario and controller; designs are kept in a file."""
    known: dict[str, Any] = pickle.loads(laws.read_bytes()) if laws.exists() else {}
    found, designed = {}, {}
    for file in sorted(SCENARIOS.glob("*.yaml")):
        scenario = load_config(str(file), Scenario)
        for name, config in scenario.controllers.items():
            key = f"{file.stem}/{name}"
            law = build_law(config)
            designed[key] = law_values(law.controller())
            if key in known:
                law = _with(law, known[key])
            ship = build_ship_side(scenario, scenario.seed, scenario.operator)
            node = build_controller_node(config, law, commissioned=True)
            whole = hashlib.sha256()
            bus = SimulatedBus(bit_rate=config.bit_rate)
            run = Lockstep([*ship.nodes, node], bus, trace=partial(_note, whole))
            run.run_until(round(seconds * 1e9))
            found[key] = whole.hexdigest()[:16]
    if not known:
        laws.write_bytes(pickle.dumps(designed))
    return found


def _note(whole: Any, *seen: object) -> None:
    whole.update(repr(seen).encode())


def _with(law: BuiltLaw, values: Any) -> BuiltLaw:
    make = law.controller
    return replace(law, controller=lambda: restored(make(), values))


def main() -> int:
    """Compare all settings; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--laws", type=Path, help="run one setting only, with the laws kept here")
    arguments = parser.parse_args()
    if arguments.laws:
        for key, digest in digests(arguments.seconds, arguments.laws).items():
            sys.stdout.write(f"{key} {digest}\n")
        return 0
    first, different = "", 0
    with tempfile.TemporaryDirectory() as folder:
        words = ["--seconds", str(arguments.seconds), "--laws", f"{folder}/laws"]
        for name, setting in SETTINGS.items():
            said = subprocess.run(
                [sys.executable, "-m", "tools.studies.same_digits", *words],
                env={"OPENBLAS_NUM_THREADS": "1"} | os.environ | setting,
                stdout=subprocess.PIPE, text=True, check=True,
            ).stdout  # fmt: skip
            first = first or said
            others = sorted({*said.splitlines()} - {*first.splitlines()})
            different += len(others)
            equal = len(said.splitlines()) - len(others)
            sys.stdout.write(f"{name}: {equal} runs equal; different: {others or 'none'}\n")
            sys.stdout.flush()
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
