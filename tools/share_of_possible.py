"""How far from the possible: roll in the storm hour beside the clairvoyant bound, over many seeds.

    python tools/share_of_possible.py [--seeds 8] [--seconds 3600] [--power-w W] [--json]

The first ship, linear, in the storm hour; sensors, delay, lag and limiter as on the bus. Share is
the part of the way from the passive tank to the best pressure history known in advance, within the
same limits on pressure, rate, level (4 m) and power; with it the 95 % confidence interval of its
mean. Constrained laws differ in the sea they expect: the hour's own spectrum, one of hours before,
a JONSWAP spectrum of the hour's height and period, or none (white wave slope). Times are those of
one step on this machine. Takes half a minute for an hour of one seed.
"""

import argparse
import dataclasses
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from scipy.stats import t as student

from firmware_sim.sensors import SensorErrors
from utank_hil.analysis.bare_ship import roll_without_tank
from utank_hil.analysis.clairvoyant import clairvoyant_bound
from utank_hil.analysis.loop_simulation import (
    TICK_S,
    LoopRun,
    SensorNoise,
    passive_motion,
    simulate_loop,
)
from utank_hil.analysis.robustness import robustness
from utank_hil.arrays import FloatArray
from utank_hil.control import DPC_ROLL_LEVEL, GPC_ROLL, Controller, LinearLaw, PumpLimits
from utank_hil.control.constrained_design import ConstrainedDesign
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics import RollShip, Tank
from utank_hil.sea import EffectiveSlope, Sea, Spectrum, jonswap, load_ndbc

SHIP = RollShip(1.9275e9, 4.81875e8, 4.81875e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
SEAS = Path(__file__).parent.parent / "configs" / "seas"
HOUR, BEFORE, LONG_BEFORE = "2019-02-10T05:40", "2019-02-10T04:40", "2019-02-10T02:40"
LEVEL_M = 4.0
# a constrained law plans for the level itself; the barrier behind it only has to catch the rest
CATCHING = PumpLimits(level_m=LEVEL_M, brake_share=1.0, sharpness=4.0)
ERRORS = SensorErrors()
NOISE = SensorNoise(
    ERRORS.roll_noise_rad,
    ERRORS.roll_rate_noise_rad_s,
    ERRORS.level_noise_m / math.sqrt(2),  # mean of two gauges
    ERRORS.pressure_noise_pa,
)
SAMPLE_TICKS = 20


@dataclasses.dataclass(frozen=True)
class Entry:
    """A law of the comparison."""

    name: str
    law: LinearLaw
    measured: tuple[str, ...]
    limits: PumpLimits


class Timed:
    """A controller whose steps are timed."""

    def __init__(self, controller: Controller, times_s: list[float]) -> None:
        self.sample_time_s = controller.sample_time_s
        self._controller = controller
        self._times_s = times_s

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Step, and note how long it took."""
        began = time.perf_counter()
        u = self._controller.step(y, reference)
        self._times_s.append(time.perf_counter() - began)
        return u

    def applied(self, u: FloatArray) -> None:
        """Pass on."""
        self._controller.applied(u)

    def reset(self) -> None:
        """Pass on."""
        self._controller.reset()


def expecting(spectrum: Spectrum) -> SeaModel:
    """Model of a sea with this spectrum."""
    return SeaModel(tuple(spectrum.frequency_hz.tolist()), tuple(spectrum.density.tolist()))


def entries(power_w: float) -> list[Entry]:
    """All laws, each with the limits that stand behind it."""
    spectra = load_ndbc(SEAS / "ndbc_41010_2019-02_spectral_density.txt")
    hour = spectra.at(HOUR)
    standard = dataclasses.replace(PumpLimits(), power_w=power_w)
    catching = dataclasses.replace(CATCHING, power_w=power_w)
    found = [
        Entry(name, design.law(SHIP, TANK), design.predictor.measured, standard)
        for name, design in (("GPC, roll", GPC_ROLL), ("DPC, roll and level", DPC_ROLL_LEVEL))
    ]
    for name, sea in (
        ("constrained, white slope", dataclasses.replace(expecting(hour), floor=100.0)),
        ("constrained, JONSWAP", expecting(jonswap(hour.hs_m, hour.tp_s))),
        ("constrained, 3 h before", expecting(spectra.at(LONG_BEFORE))),
        ("constrained, 1 h before", expecting(spectra.at(BEFORE))),
        ("constrained, the hour", expecting(hour)),
    ):
        design = ConstrainedDesign("constrained_gpc", sea)
        law = design.law(SHIP, TANK, limits=catching)
        found.append(Entry(name, law, design.measured, catching))
    unaware = dataclasses.replace(law, limits=PumpLimits(1e12, 1e12, 1e6))
    return [*found, Entry("the same, limits not planned", unaware, design.measured, standard)]


def degrees(roll_rad: FloatArray) -> float:
    """RMS in degrees."""
    return float(np.rad2deg(np.sqrt(np.mean(np.square(roll_rad)))))


def half_width(values: FloatArray) -> float:
    """Half the 95 % confidence interval of the mean."""
    return float(student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values)))


def summary(run: LoopRun) -> dict[str, float]:
    """What is kept of a run."""
    level, power = run.motion[:, 2], run.pressure_pa * TANK.reservoir_area_m2 * run.motion[:, 3]
    return {
        "roll_rms_deg": degrees(run.motion[:, 0]),
        "level_peak_m": float(np.abs(level).max()),
        "pressure_rms_pa": float(run.pressure_pa.std()),
        "power_peak_w": float(power.max()),
    }


def main() -> None:
    """Run all seeds and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=8, help="how many, 2 or more")
    parser.add_argument("--seconds", type=float, default=3600.0, help="length of each run")
    parser.add_argument("--power-w", type=float, default=math.inf, help="limit on the water power")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    laws = entries(arguments.power_w)
    spectrum = load_ndbc(SEAS / "ndbc_41010_2019-02_spectral_density.txt").at(HOUR)
    runs: dict[str, list[dict[str, float]]] = {entry.name: [] for entry in laws}
    times: dict[str, list[float]] = {entry.name: [] for entry in laws}
    ends: dict[str, list[float]] = {"no tank": [], "passive": [], "clairvoyant": []}
    count = round(arguments.seconds / TICK_S) + 1
    console = Console(file=sys.stderr if arguments.json else sys.stdout, width=110)
    with Progress(console=console) as progress:
        task = progress.add_task("seeds", total=arguments.seeds * (len(laws) + 1))
        for seed in range(1, arguments.seeds + 1):
            moment = Sea.irregular(spectrum, seed).roll_moment(
                SHIP.stiffness_nm_rad, EffectiveSlope(0.5)
            )
            waves = passive_motion(SHIP, TANK, moment, TICK_S, count)
            limits = PumpLimits(level_m=LEVEL_M, power_w=arguments.power_w)
            bound = clairvoyant_bound(SHIP, TANK, waves[::SAMPLE_TICKS], limits)
            ends["no tank"].append(degrees(roll_without_tank(SHIP, moment, TICK_S, count)))
            ends["passive"].append(degrees(waves[:, 0]))
            ends["clairvoyant"].append(math.degrees(bound.roll_rms_rad))
            progress.advance(task)
            for entry in laws:
                controller = Timed(entry.law.controller(), times[entry.name])
                run = simulate_loop(
                    SHIP,
                    TANK,
                    waves,
                    controller,
                    entry.measured,
                    entry.limits,
                    noise=NOISE,
                    seed=seed,
                )
                runs[entry.name].append(summary(run))
                progress.advance(task)

    passive, best = np.array(ends["passive"]), np.array(ends["clairvoyant"])
    rows: dict[str, dict[str, float]] = {
        name: {"roll_rms_deg": float(np.mean(values))} for name, values in ends.items()
    }
    for entry in laws:
        kept = runs[entry.name]
        roll = np.array([one["roll_rms_deg"] for one in kept])
        share = (passive - roll) / (passive - best)
        report = robustness(entry.law, SHIP, TANK, entry.measured)
        microseconds = 1e6 * np.array(times[entry.name])
        rows[entry.name] = {
            "roll_rms_deg": float(roll.mean()),
            "share": float(share.mean()),
            "share_half_width": half_width(share),
            "level_peak_m": max(one["level_peak_m"] for one in kept),
            "pressure_rms_pa": float(np.mean([one["pressure_rms_pa"] for one in kept])),
            "power_peak_w": max(one["power_peak_w"] for one in kept),
            "peak_sensitivity": report.nominal.peak_sensitivity,
            "worst_radius": report.worst_radius,
            "step_mean_us": float(microseconds.mean()),
            "step_p99_us": float(np.quantile(microseconds, 0.99)),
        }
    if arguments.json:
        print(json.dumps({"seeds": arguments.seeds, "seconds": arguments.seconds, "rows": rows}))
        return
    table = Table("", "roll, deg", "share", "±", "level, m", "kPa", "peak MW", "Ms", "mean/p99 us")
    for name, row in rows.items():
        cells = [name, f"{row['roll_rms_deg']:.3f}"]
        if "share" in row:
            cells += [
                f"{row['share']:.1%}",
                f"{row['share_half_width']:.1%}",
                f"{row['level_peak_m']:.2f}",
                f"{row['pressure_rms_pa'] / 1e3:.1f}",
                f"{row['power_peak_w'] / 1e6:.2f}",
                f"{row['peak_sensitivity']:.2f}",
                f"{row['step_mean_us']:.0f}/{row['step_p99_us']:.0f}",
            ]
        table.add_row(*cells)
    console.print(table)


if __name__ == "__main__":
    main()
