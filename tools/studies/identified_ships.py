"""Identification in closed loop: errors, coverage of the stated intervals, and published methods.

    python -m tools.studies.identified_ships --json     # --records, --workers

Each record is of the first ship, linear, loaded to 0.85 to 1.3 times the roll period of its file,
in one of five seas. The shipped GPC in a storm, made for the file's ship, is in charge: for twenty
minutes alone, then with its configuration's pulses added to the command. Limits, rate, lag, delay
and sensor noise are the bench's. The motion's own estimate is made of the first part and the last
twenty minutes of all; the other methods get the part with pulses: pressure, roll and level, or
pressure and roll. `tools.studies.published_identification` has the methods of others.

Error of a response: relative 2-norm of pressure to roll over 0.2 to 1.2 rad/s. Coverage: share of
the records whose true value is within 1.96 stated deviations.
"""

import math
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from tools.printing import command_line, show
from tools.studies.published_identification import Model, published
from tools.studies.share_of_possible import STORM_HOUR, measured_hour
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.loop.margins import of_period
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import Verdict
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import Controller, DesignPlant, PredictiveDesign
from utank_hil.identification import IdentificationError
from utank_hil.identification.ship_fit import ModelLimits, model_objections
from utank_hil.retuning.adaptive import AGREES, bearable, make_pulses
from utank_hil.retuning.estimate import (
    SIGNIFICANT,
    EstimateRequest,
    MotionEstimate,
    ShipFigures,
)
from utank_hil.retuning.redesign import RetuningTask, identify
from utank_hil.retuning.renewal import EstimateTask, estimate
from utank_hil.sea import EffectiveSlope, Sea, Spectrum, ittc

CONTROLLER: Final = Path("configs/controllers/adaptive_gpc_storm.yaml")
SLOPE: Final = 0.5  #: Ratio of effective to true wave slope.
ALONE_S: Final = 1200.0  #: Time without pulses, from which the motion's estimate is made.
SAMPLE_TIME_S: Final = 0.2  #: Of law and estimate.
LOADS: Final = (0.85, 1.3)
RATE: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
BAND_RAD_S: Final = np.linspace(0.2, 1.2, 101)
SETS: Final = {
    "roll, order 200": (("roll_rad",), 200),
    "roll and level, order 120": (("roll_rad", "level_m"), 120),
    "roll and level, order 200": (("roll_rad", "level_m"), 200),
}
"""Outputs and order of OKID; the first two as shipped controllers have them."""
FIGURES: Final = ("period", "inertia", "stiffness", "damping", "tank damping")
WITHIN: Final = 1.96


@cache
def seas() -> dict[str, Spectrum]:
    """The five seas, by name."""
    found = {"storm hour": measured_hour(STORM_HOUR)}
    for hs_m, tp_s in ((3.0, 8.0), (4.0, 10.0), (6.0, 12.0), (1.5, 9.0)):
        found[f"{hs_m:g} m {tp_s:g} s"] = ittc(hs_m, tp_s)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class ShipRecord:
    """A ship's record, one row per sample: all of it, and where the pulses begin."""

    ship: DesignPlant  #: The ship that made it.
    sea: str
    command_pa: FloatArray
    motion: FloatArray  #: shape (N, 3): `RATE`, with the sensors' noise.
    first: int
    added_roll: float  #: RMS with pulses over that of the same law without them, same waves.


class _Recording:
    """The law with pulses from `first` on, and what it was given and gave."""

    def __init__(self, law: Controller, pulses_pa: FloatArray, first: int) -> None:
        self.sample_time_s = law.sample_time_s
        self._law, self._pulses_pa, self._first = law, pulses_pa, first
        self.rows: list[FloatArray] = []
        self._applied_pa = 0.0

    def reset(self) -> None:
        """Reset the law."""
        self._law.reset()

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take a measurement and return the command."""
        at = len(self.rows) - self._first
        self.rows.append(np.array([self._applied_pa, *y]))
        pulse_pa = self._pulses_pa[at] if 0 <= at < len(self._pulses_pa) else 0.0
        return np.asarray(self._law.step(y[:1], reference) + pulse_pa)

    def applied(self, u: FloatArray) -> None:
        """Take the mean of the commands since the last step."""
        self._applied_pa = float(u[0])
        self._law.applied(u)


@cache
def shipped() -> ControllerConfig:
    """The shipped controller that retunes itself in a storm."""
    return load_config(CONTROLLER, ControllerConfig)


def record_of(number: int) -> ShipRecord:
    """Record of a number; load, waves, pulses and noise follow from it."""
    config = shipped()
    assert isinstance(config.law, PredictiveDesign)
    assert config.retuning is not None
    plant = config.plant
    low, high = np.log(LOADS)
    load = math.exp(np.random.default_rng(number).uniform(low, high))
    loaded = replace(plant, ship=of_period(plant.ship, load))
    name, spectrum = list(seas().items())[number % len(seas())]
    law = config.law.law(plant)
    pulses = make_pulses(replace(config.retuning, seed=number), plant, SAMPLE_TIME_S)
    first = round(ALONE_S / SAMPLE_TIME_S)
    ticks = round((first + len(pulses.pressure_pa)) * SAMPLE_TIME_S / TICK_S)
    waves = Sea.irregular(spectrum, 7000 + number)
    moment = waves.roll_moment(plant.ship.stiffness_nm_rad, EffectiveSlope(SLOPE))
    passive = passive_motion(loaded.ship, loaded.tank, moment, TICK_S, ticks)
    since = round(ALONE_S / TICK_S)

    def run(given_pa: FloatArray) -> tuple[FloatArray, FloatArray]:
        controller = _Recording(law.controller(), given_pa, first)
        roll_rad = simulate_loop(loaded, passive, controller, RATE, seed=number).motion[:, 0]
        return roll_rad, np.array(controller.rows)

    quiet, _ = run(np.zeros(0))
    before = quiet[since - round(config.retuning.trial_s / TICK_S) : since]
    part = bearable(pulses, float(np.std(before)))
    pulsed, rows = run(part * pulses.pressure_pa)
    added = float(np.std(pulsed[since:]) / np.std(quiet[since:]))
    return ShipRecord(loaded, name, rows[:, 0], rows[:, 1:], first, added)


def response(model: Model) -> ComplexArray:
    """Frequency response of the first output over `BAND_RAD_S`."""
    a, b, c, d = model
    turns = np.exp(1j * BAND_RAD_S * SAMPLE_TIME_S)
    eye = np.eye(len(a))
    return np.array([(c[:1] @ np.linalg.solve(z * eye - a, b) + d[:1])[0, 0] for z in turns])


def task_of(outputs: tuple[str, ...], order: int) -> RetuningTask:
    """The configured retuning for other outputs."""
    config = shipped()
    assert isinstance(config.law, PredictiveDesign)
    assert config.retuning is not None
    predictor = replace(
        config.law.predictor, measured=outputs, measurement_std=(2e-3,) * len(outputs)
    )
    weights = (1.0,) * len(outputs)  # no law is designed
    design = replace(config.law, predictor=predictor, output_weight=weights)
    limits = ModelLimits(config.retuning.roll_period_range_s)
    return RetuningTask(design, config.plant, order, limits)


def figures_of(plant: DesignPlant) -> FloatArray:
    """Figures of a ship, in the order of `FIGURES`."""
    ship = plant.ship
    return np.array(
        [
            2 * math.pi / ship.natural_frequency_rad_s,
            ship.inertia_kg_m2,
            ship.stiffness_nm_rad,
            ship.damping_nms_rad,
            plant.tank.damping_ratio,
        ]
    )


def motion_estimate(record: ShipRecord, part: slice) -> MotionEstimate:
    """The controller's estimate from a part of a record."""
    config = shipped()
    task = EstimateTask(config.plant, SAMPLE_TIME_S, SLOPE)
    request = EstimateRequest(ShipFigures.of(config.plant.ship), record.motion[part])
    return estimate(request, task)


def by_okid(record: ShipRecord, outputs: tuple[str, ...], order: int) -> dict[str, Any]:
    """Errors of OKID with the ship fitted, in deviations too, and the model's verdict."""
    task = task_of(outputs, order)
    columns = [RATE.index(name) for name in outputs]
    rows = np.column_stack([record.command_pa, record.motion[:, columns]])[record.first :]
    begin = time.process_time()
    try:
        found = identify(rows, task)
    except IdentificationError as error:
        return {"failed": str(error)}
    seconds = time.process_time() - begin
    plant = found.plant(task)
    ratios = figures_of(plant) / figures_of(record.ship)
    deviations = [found.fit.period_deviation, *found.fit.deviation]
    return {
        "ratios": ratios,
        "in_deviations": np.log(ratios) / deviations,
        "period_s": figures_of(plant)[0],
        "accepted": not model_objections(found.validation, found.fit, task.limits),
        "response": response_error(record, plant.sampled(outputs, SAMPLE_TIME_S)[:4]),
        "seconds": seconds,
    }


def by_motion(record: ShipRecord, seen: MotionEstimate) -> dict[str, Any]:
    """Errors of the motion's estimate of period and stiffness, in deviations too."""
    ship = seen.ship
    if seen.of_ship is not Verdict.GOOD or ship is None:
        return {"failed": seen.of_ship.name}
    true = figures_of(record.ship)
    ratios = np.array([ship.roll_period_s / true[0], ship.stiffness_nm_rad / true[2]])
    deviations = [ship.period_deviation, ship.stiffness_deviation]
    return {"ratios": ratios, "in_deviations": np.log(ratios) / deviations, "accepted": True}


def response_error(record: ShipRecord, model: Model) -> float:
    """Relative error of the response from pressure to roll."""
    true = response(record.ship.sampled(("roll_rad",), SAMPLE_TIME_S)[:4])
    return float(np.linalg.norm(response(model) - true) / np.linalg.norm(true))


def case(number: int, with_published: bool) -> dict[str, dict[str, Any]]:
    """What each method finds in a record."""
    record = record_of(number)
    seen = motion_estimate(record, slice(len(record.motion) - record.first, None))
    found = {
        "motion, before the pulses": by_motion(
            record, motion_estimate(record, slice(record.first))
        ),
        "motion, with the pulses": by_motion(record, seen),
    }
    for name, (outputs, order) in SETS.items():
        row = by_okid(record, outputs, order)
        if "failed" not in row and seen.of_ship is Verdict.GOOD and seen.ship is not None:
            apart = abs(math.log(row["period_s"] / seen.ship.roll_period_s))
            least = max(math.log(AGREES), SIGNIFICANT * seen.ship.period_deviation)
            row["counts"] = row["accepted"] and apart <= least
        found[f"OKID and ship, {name}"] = row
    if with_published:
        u, y = record.command_pa[record.first :], record.motion[record.first :, [0, 2]]
        for name, identify_model in published().items():
            begin = time.process_time()
            try:
                model = identify_model(u, y, SAMPLE_TIME_S)
            except (ArithmeticError, ValueError) as error:  # LinAlgError is a ValueError
                found[name] = {"failed": str(error)}
                continue
            seconds = time.process_time() - begin
            found[name] = {"response": response_error(record, model), "seconds": seconds}
    found["pulses"] = {"added": record.added_roll}
    return found


def table(found: Sequence[dict[str, dict[str, Any]]]) -> list[dict[str, Any]]:
    """A row for each method."""
    rows = []
    for name in dict.fromkeys(name for each in found for name in each if name != "pulses"):
        results = [each[name] for each in found if name in each]
        good = [each for each in results if "failed" not in each]
        row: dict[str, Any] = {"method": name, "records": len(results), "found": len(good)}
        if good and "ratios" in good[0]:
            off = np.abs(np.array([each["ratios"] for each in good]) - 1)
            inside = np.abs(np.array([each["in_deviations"] for each in good])) < WITHIN
            names = FIGURES if off.shape[1] == len(FIGURES) else ("period", "stiffness")
            row |= {f"{name} off": float(np.median(off[:, k])) for k, name in enumerate(names)}
            row |= {f"{name} covered": float(inside[:, k].mean()) for k, name in enumerate(names)}
            accepted = np.array([each["accepted"] for each in good])
            counts = np.array([each.get("counts", each["accepted"]) for each in good])
            wrong = off[:, 0] > ModelLimits((6.0, 20.0)).period_deviation
            row |= {"accepted": int(accepted.sum()), "wrong": int((accepted & wrong).sum())}
            row |= {"counts": int(counts.sum()), "counts, wrong": int((counts & wrong).sum())}
            row["worst that counts"] = float(off[counts, 0].max(initial=0.0))
        if good and "response" in good[0]:
            row["response off"] = float(np.median([each["response"] for each in good]))
            row["CPU s"] = float(np.median([each["seconds"] for each in good]))
        rows.append(row)
    return rows


def main(words: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = command_line(__doc__)
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument(
        "--published", type=int, default=20, help="records of the published methods"
    )
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args(words)
    with (
        one_thread_each(),
        ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool,
    ):
        started = [
            pool.submit(case, number, number < arguments.published)
            for number in range(arguments.records)
        ]
        found = []
        for number, future in enumerate(started):
            found.append(future.result())
            print(number, file=sys.stderr, flush=True)
    added = np.array([each["pulses"]["added"] for each in found])
    pulses = {"median": float(np.median(added)), "greatest": float(added.max())}
    show({"roll with pulses over without": pulses, "methods": table(found)}, arguments)


if __name__ == "__main__":
    main()
