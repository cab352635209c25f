"""What a case of a campaign costs: against duration, order, horizon, nodes and number of cases.

    python -m tools.benchmarks.campaign          # --json

Processor time of one process, the least of some turns: other work on the machine hardly counts.
What workers cost beyond their cases is in `tools.studies.campaign_kills`.
"""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import yaml

from firmware_sim.campaign.driver import batch_of
from firmware_sim.campaign.store import Store, read_results
from firmware_sim.campaign.study import Case, LoadedStudy, load_study
from firmware_sim.campaign.summary import summary
from firmware_sim.campaign.work import run_batch
from tools.printing import command_line, show

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
TURNS = 3


@dataclass(frozen=True)
class Bench:
    """Studies in a folder of their own."""

    folder: Path

    def study(self, simulation: str, controllers: list[str], **keys: Any) -> LoadedStudy:
        """A study of the storm for 60 s."""
        files = {name: str(CONFIGS / "controllers" / f"{name}.yaml") for name in controllers}
        scenario = CONFIGS / "scenarios" / f"{keys.pop('scenario', 'storm')}.yaml"
        values = {"controllers": files, "duration_s": 60.0, "settle_s": 20.0}
        grid = {"seed": {"first": 1, "count": keys.pop("cases", TURNS + 1)}}
        content = {
            "name": "cost",
            "scenario": str(scenario),
            "simulation": simulation,
            "set": {**values, **keys.pop("set", {})},
            "grid": grid,
        }
        path = self.folder / "study.yaml"
        path.write_text(yaml.safe_dump(content))
        return load_study(path)

    def case_s(self, simulation: str, controllers: list[str], **keys: Any) -> dict[str, float]:
        """Processor time of a case; of the first, which checks the scenario and designs the law."""
        loaded = self.study(simulation, controllers, **keys)
        first, *others = (_timed(loaded, case) for case in loaded.cases)
        return {"case_s": min(others), "first_case_s": first}


def _timed(loaded: LoadedStudy, case: Case) -> float:
    begin = time.process_time()
    rows = run_batch(batch_of(loaded, [case]))
    took_s = time.process_time() - begin
    wrong = [row["reason"] for row in rows if row["status"] != "ok"]
    if wrong:
        raise SystemExit(f"a case failed: {wrong[0]}")
    return took_s


def of_cases(bench: Bench, count: int) -> dict[str, float]:
    """What the driver does for so many cases: laying them out, reading their rows, summing up."""
    before = psutil.Process().memory_info().rss
    begin = time.process_time()
    loaded = bench.study("linear", ["gpc"], cases=count)
    laid_out_s = time.process_time() - begin
    (*_, row) = run_batch(batch_of(loaded, loaded.cases[:1]))
    store = Store(bench.folder / f"out-{count}")
    about = {"keys": loaded.keys, "configuration": {"stop": None}}
    store.begin(loaded, about, resume=False)
    rows = [{**row, "case": case.name, "run": run}
            for case in loaded.cases for run in ("no tank", "passive", "gpc")]  # fmt: skip
    store.write(rows)
    begin = time.process_time()
    summary(read_results(store.folder))
    read_s = time.process_time() - begin
    disk = sum(file.stat().st_size for file in store.folder.rglob("*.parquet"))
    grown = psutil.Process().memory_info().rss - before
    return {
        "laid_out_s": laid_out_s,
        "read_and_summed_s": read_s,
        "driver_bytes_a_case": grown / count,
        "disk_bytes_a_case": disk / count,
    }


def main() -> None:
    """Measure and print."""
    arguments = command_line(__doc__).parse_args()
    order, horizon = (
        "controllers.gpc.law.predictor.order",
        "controllers.constrained_gpc.law.horizon",
    )
    with tempfile.TemporaryDirectory() as temporary:
        bench = Bench(Path(temporary))
        simulations = ("linear", "nonlinear", "bus")
        found: dict[str, Any] = {
            "simulation": {
                f"{each}, {duration:g} s": bench.case_s(each, ["gpc"], set={"duration_s": duration})
                for each in simulations
                for duration in (60.0, 240.0)
            },
            "laws": {
                f"{each}, gpc, dpc and lqg": bench.case_s(each, ["gpc", "dpc", "lqg"])
                for each in simulations
            },
            "order": {
                str(each): bench.case_s("linear", ["gpc"], set={order: each})
                for each in (45, 90, 180)
            },
            "horizon": {
                str(each): bench.case_s("linear", ["constrained_gpc"], set={horizon: each})
                for each in (60, 120, 240)
            },
            "nodes": {
                "with a valve": bench.case_s("bus", ["pump_with_valve"], scenario="semi_active"),
                "without": bench.case_s("bus", ["gpc"]),
            },
            "cases": {str(count): of_cases(bench, count) for count in (1000, 10_000)},
        }
    show(found, arguments)


if __name__ == "__main__":
    main()
