"""Devices of other makers in real time, against native nodes: the storm on vcan interfaces.

The ship of `thesis_first_devices.yaml`, whose sensor and drive are on an interface each, and the
same ship without devices, one after the other in the same waves. Frames come from candump. Latency
is from the newest frame of the motion sensor to the command; sensor and controller begin a tick
together.

Example: tools/vcan .venv/bin/python -m tools.studies.two_buses --seconds 600
"""

import subprocess
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from firmware_sim.bench import jobs_of
from firmware_sim.run import Watch, join, run_controller, run_ship
from firmware_sim.scenario import Scenario
from tools.printing import command_line, show
from tools.vcan_launcher.linux import can_is_usable, create_vcan
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Fault, Mode
from utank_hil.configuration import load_config

CONFIGS: Final = Path(__file__).resolve().parents[2] / "configs"
BUSES: Final = ("vcan0", "vcan1", "vcan2")
START_S: Final = 45.0  #: For both processes to import all, in a user-mode kernel.
ARM_S, ARMED_S = 5.0, 10.0
FRAMES: Final = {"devices": ("132", "205"), "native": ("08FF3082", "08FF1080")}
"""Identifiers of motion and command."""
AGES: Final = (
    *("motion_age_ms", "tank_degraded_age_ms", "drive_age_ms", "echo_age_ms"),
    "drive_enabled_within_ms",
)
PATIENT: Final = {"overruns_in_ten": None, "long_overrun_ms": 1000, **dict.fromkeys(AGES, 500)}
"""A user-mode kernel shares its one processor with what the machine does besides."""


@dataclass(frozen=True, slots=True)
class Start(Watch):
    """The time at which both sides begin."""

    at_ns: int

    def stopped(self, done_s: float) -> bool:  # noqa: ARG002
        """Whether to end now."""
        return False

    def begin_ns(self) -> int:
        """Time of the first tick."""
        return self.at_ns


def scenario_of(folder: Path, kind: str) -> Scenario:
    """The storm with one of the two ships."""
    ship = yaml.safe_load((CONFIGS / "ships" / "thesis_first_devices.yaml").read_text())
    devices = ship.pop("devices")
    if kind == "devices":
        devices["motion"]["bus"], devices["pump"]["bus"] = BUSES[1:]
        devices["receive_only"] = [BUSES[1]]
        devices["pump"]["heartbeat_ms"] = 100
        ship["devices"] = devices
    controller = yaml.safe_load((CONFIGS / "controllers" / "gpc.yaml").read_text())
    controller |= {"vessel": "ship.yaml", "command_timeout_ms": 100, "safety": PATIENT}
    storm = yaml.safe_load((CONFIGS / "scenarios" / "storm.yaml").read_text())
    storm |= {"vessel": "ship.yaml", "controllers": {"gpc": "controller.yaml"}}
    storm |= {"operator": [{"time_s": ARM_S, "action": "arm"}]}
    storm["sea"]["file"] = str((CONFIGS / "scenarios" / storm["sea"]["file"]).resolve())
    for name, content in (("ship", ship), ("controller", controller), ("scenario", storm)):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return load_config(folder / "scenario.yaml", Scenario)


def sail(folder: Path, kind: str, seconds: int) -> dict[str, Any]:
    """Run one of both in real time, in a process each; return what the run was like."""
    scenario = scenario_of(folder, kind)
    job = jobs_of(scenario, scenario.seed, float(seconds))[-1]
    with ExitStack() as stack:
        for name in BUSES:
            output = stack.enter_context((folder / name).open("wb"))
            dump = subprocess.Popen(["candump", "-L", "-r", "8388608", name], stdout=output)
            stack.callback(dump.wait, 30)
            stack.callback(dump.terminate)
        pool = stack.enter_context(ProcessPoolExecutor(2, get_context("spawn")))
        start = Start(time.monotonic_ns() + round(START_S * 1e9))
        ship = pool.submit(run_ship, job, BUSES[0], start)
        controller = pool.submit(run_controller, job, BUSES[0], start)
        run = join(kind, ship.result(), controller.result())
    lines = [line for name in BUSES for line in (folder / name).read_text().splitlines()]
    motion, command = (_times_s(lines, can_id) for can_id in FRAMES[kind])
    command = command[command > motion[0]]
    age_ms = 1e3 * (command - motion[np.searchsorted(motion, command) - 1])
    armed = run.between(ARMED_S, run.end_s)
    return {
        "in_charge": float(np.mean(run.column("mode")[armed] == Mode.ACTIVE)),
        "until_s": run.end_s,
        "fault": Fault(int(run.column("fault")[-1])).name,
        "roll_rms_rad": float(np.sqrt(np.mean(run.column("true_roll_rad")[armed] ** 2))),
        "latency_p10_p50_p90_ms": np.percentile(age_ms, (10, 50, 90)).tolist(),
    }


def _times_s(lines: list[str], can_id: str) -> FloatArray:
    return np.array(
        sorted(float(line[1 : line.index(")")]) for line in lines if f" {can_id}#" in line)
    )


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=int, default=600, help="of each of the two runs")
    arguments = parser.parse_args()
    for name in BUSES:
        if not can_is_usable(name):
            create_vcan(name)
    result: dict[str, Any] = {}
    for kind in FRAMES:
        with tempfile.TemporaryDirectory() as folder:
            found = sail(Path(folder), kind, arguments.seconds)
        result |= {f"{kind}_{name}": value for name, value in found.items()}
    result["roll_against_native"] = result["devices_roll_rms_rad"] / result["native_roll_rms_rad"]
    show(result, arguments)


if __name__ == "__main__":
    main()
