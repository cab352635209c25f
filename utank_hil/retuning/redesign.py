"""From a record to a law for the ship as she is now, or to the reasons why there is none.

This is the whole of the retuner's work: identify on the first part of the record, judge the model
on the rest and against physics, design, and judge the law on the ship that was found, around her,
and in the recorded waves.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from utank_hil.analysis.loop.robustness import Robustness, robustness
from utank_hil.arrays import FloatArray
from utank_hil.control import (
    DesignPlant,
    LinearLaw,
    PredictiveDesign,
    PredictiveLaw,
    wave_arx,
)
from utank_hil.control.washout import WashoutLaw
from utank_hil.identification import (
    IdentificationError,
    OkidResult,
    Validation,
    find_disturbance_frequencies,
    okid,
    validate,
)
from utank_hil.identification.acceptance import ModelLimits, model_objections
from utank_hil.identification.lag_regression import unbroken
from utank_hil.identification.ship_fit import ShipFit, fit_ship
from utank_hil.retuning import Answer, Candidate, ModelSummary, Refusal
from utank_hil.retuning.record_length import (
    LAGS,
    LEAST_PREDICTIONS,
    first_part,
    record_problems,
)
from utank_hil.retuning.rehearsal import RecordedWaves, Rehearsal

MOST_MISSING = 0.2
"""Part of the samples that may be missing."""
LEAST_MOTION = (10.0, 1e-6)
"""Spread of the command in Pa, and of each output in its unit, below which nothing happened."""
OFFSET = 0
"""Degree of the polynomial beside the model: a steady heel, or a sensor's bias, is no motion."""
LARGEST = 1e9
"""No command or output of a ship is as large in SI units."""
LEAST_GAIN = 0.05
"""Part by which a new law rolls less than the configured one in the recorded waves: what a
rehearsal hardly tells apart is not worth a swap."""
ROLL_PART = 1.02
"""Of the passive tank's roll, in the recorded waves: no law may be worse."""
EFFORT_PART = 0.9
"""Of the pump's greatest pressure, root mean square in the recorded waves."""


@dataclass(frozen=True, slots=True)
class RetuningTask:
    """What the retuner is told once, before any record.

    Attributes
    ----------
    design : PredictiveDesign
        How laws are made.
    plant : DesignPlant
        As configured: where the search begins.
    order : int
        Of the ARX model.
    limits : ModelLimits
    least_gain : float or None
        Part by which a law must roll less than the configured one; None: they are not compared.
    """

    design: PredictiveDesign
    plant: DesignPlant
    order: int
    limits: ModelLimits
    least_gain: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What was found in a record.

    Attributes
    ----------
    okid : OkidResult
    wave_frequencies_rad_s : tuple of float
        Of regular waves; empty in an irregular sea.
    validation : Validation
        On held-out data.
    fit : ShipFit
    """

    okid: OkidResult
    wave_frequencies_rad_s: tuple[float, ...]
    validation: Validation
    fit: ShipFit

    def plant(self, task: RetuningTask) -> DesignPlant:
        """The configured plant with the ship and tank that were found."""
        return dataclasses.replace(task.plant, ship=self.fit.ship, tank=self.fit.tank)


def retune(record: FloatArray, task: RetuningTask) -> Answer:
    """Identify, design, judge.

    Parameters
    ----------
    record : ndarray, shape (N, 1 + m)
        Mean command since the sample before, and the outputs that `task.design` names, at its
        sample time. Outputs that are not finite are gaps.
    task : RetuningTask

    Returns
    -------
    Candidate or Refusal
        Never an exception for what the record holds.
    """
    record = np.where(np.isfinite(record), record, np.nan)
    try:
        found = identify(record, task)
    except (IdentificationError, np.linalg.LinAlgError) as error:
        return Refusal((str(error),))
    return judge(record, found, task)


def judge(record: FloatArray, found: Identification, task: RetuningTask) -> Answer:
    """Design for what `identify` found in a record, and judge: the rest of `retune`."""
    objections = model_objections(found.validation, found.fit, task.limits)
    if objections:
        return Refusal(objections)
    try:
        return _designed(record, found, task)
    except ValueError as error:  # a design's demands on the ship, or an equation's (LinAlgError)
        return Refusal((str(error),))


def identify(record: FloatArray, task: RetuningTask) -> Identification:
    """Identify ship and tank on the first part of a record and validate on the rest.

    Raises
    ------
    ValueError
        If the record has another number of columns than the task's signals.
    IdentificationError
        If it does not determine a model.
    """
    predictor = task.design.predictor
    record = np.asarray(record, dtype=np.float64)
    if record.ndim != 2 or record.shape[1] != 1 + len(predictor.measured):
        raise ValueError(
            f"a record has the columns command, {', '.join(predictor.measured)}; this one has "
            f"shape {record.shape}"
        )
    problems = record_problems(
        task.order,
        len(record),
        len(predictor.measured),
        predictor.sample_time_s,
        task.limits.roll_period_range_s[0],
    )
    if problems:
        names = {"order": "order", "identification_s": "the record"}
        reasons = (f"{names[name]} {reason}" for name, reason in problems)
        raise IdentificationError("; ".join(reasons))
    split = first_part(len(record))
    _refuse_empty(record[:split])
    _refuse_empty(record[split:])
    stretches = [stop - start for start, stop in unbroken(record[split:])]
    lost = max(task.order, LAGS)  # predictions, at the start and after every gap
    predictions = sum(max(0, length - lost) for length in stretches)
    if predictions < LEAST_PREDICTIONS:
        raise IdentificationError(
            f"gaps leave {predictions} predictions on held-out data, {LEAST_PREDICTIONS} are "
            "needed: record longer, or with fewer gaps"
        )
    u, y = record[:split, :1], record[:split, 1:]
    waves = find_disturbance_frequencies(u, y, predictor.sample_time_s)
    result = okid(
        u,
        y,
        task.order,
        predictor.sample_time_s,
        disturbance_frequencies_rad_s=waves,
        disturbance_polynomial_degree=OFFSET,
    )
    validation = validate(result.arx, record[split:, :1], record[split:, 1:], waves, LAGS, OFFSET)
    fit = fit_ship(result, u, task.plant, predictor.measured)
    return Identification(result, waves, validation, fit)


def _refuse_empty(part: FloatArray) -> None:
    """Refuse a part of a record in which nothing is to be seen."""
    here = np.asarray(np.isfinite(part).all(axis=1))
    if len(part) == 0 or np.mean(~here) > MOST_MISSING:
        raise IdentificationError("too much of the record is missing: are the sensors alive?")
    present = part[here]
    if np.abs(present).max() > LARGEST:
        raise IdentificationError("the record holds numbers that no ship makes: is a unit wrong?")
    spread = np.ptp(present, axis=0)
    if spread[0] < LEAST_MOTION[0]:
        raise IdentificationError(
            "the pump was hardly used in a part of the record: give pulses throughout"
        )
    if spread[1:].min() < LEAST_MOTION[1]:
        raise IdentificationError(
            "an output hardly moves in a part of the record: is its sensor stuck?"
        )


def _designed(record: FloatArray, found: Identification, task: RetuningTask) -> Answer:
    """A law for the ship that was found, if it passes."""
    plant = found.plant(task)
    design, measured = task.design, task.design.predictor.measured
    law = design.law(plant)
    report = robustness(law, plant, measured, with_delay_margin=False)
    waves = RecordedWaves(record, plant, measured, law.sample_time_s)
    trial = waves.rehearse(law)
    before = None
    if task.least_gain is not None:
        before = waves.rehearse(design.law(task.plant))
    objections = (*report.failures(), *_rehearsal_objections(trial, before, task))
    if objections:
        return Refusal(objections)
    return Candidate(
        *_parts(law),
        wave_arx(design.predictor, plant),
        _summary(found, report, trial),
    )


def _rehearsal_objections(
    trial: Rehearsal, before: Rehearsal | None, task: RetuningTask
) -> tuple[str, ...]:
    found = []
    if (
        before is not None
        and task.least_gain is not None
        and not trial.roll_rad <= (1 - task.least_gain) * before.roll_rad
    ):
        found.append(
            f"in the recorded waves the law rolls {math.degrees(trial.roll_rad):.2f} degrees RMS, "
            f"the configured one {math.degrees(before.roll_rad):.2f}: less than "
            f"{task.least_gain:.0%} to gain"
        )
    if not trial.roll_rad <= ROLL_PART * trial.passive_rad:
        found.append(
            f"in the recorded waves the law rolls {math.degrees(trial.roll_rad):.2f} degrees RMS, "
            f"the passive tank {math.degrees(trial.passive_rad):.2f}"
        )
    if not trial.pressure_pa <= EFFORT_PART * task.plant.limits.pressure_pa:
        found.append(
            f"in the recorded waves the law takes {trial.pressure_pa / 1e3:.0f} kPa RMS of "
            f"{task.plant.limits.pressure_pa / 1e3:.0f}"
        )
    return tuple(found)


def _parts(law: LinearLaw) -> tuple[PredictiveLaw, float]:
    """The predictive law within, and its washout."""
    if isinstance(law, WashoutLaw) and isinstance(law.law, PredictiveLaw):
        return law.law, law.corner_rad_s
    assert isinstance(law, PredictiveLaw)
    return law, 0.0


def _summary(found: Identification, report: Robustness, trial: Rehearsal) -> ModelSummary:
    ship = found.fit.ship
    return ModelSummary(
        roll_period_s=2 * math.pi / ship.natural_frequency_rad_s,
        period_deviation=found.fit.period_deviation,
        inertia_kg_m2=ship.inertia_kg_m2,
        stiffness_nm_rad=ship.stiffness_nm_rad,
        damping_nms_rad=ship.damping_nms_rad,
        tank_damping_ratio=found.fit.tank.damping_ratio,
        held_out_fit=float(np.min(found.validation.one_step_fit)),
        peak_sensitivity=report.nominal.peak_sensitivity,
        roll_below_passive=1 - trial.roll_rad / trial.passive_rad if trial.passive_rad else 0.0,
    )
