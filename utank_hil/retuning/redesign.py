"""Design of a law for the present ship from a record, or the reasons why there is none.

The first part of the record identifies the model; the rest and physical limits validate it. The
law designed then has its margins checked on the identified ship, its robustness to deviations, and
its performance in the recorded waves.

There, the pump's part of the outputs is computed with the ship's model and subtracted; the rest is
due to the waves. The loop is then closed on model and waves, with the limiter between law and pump,
which in a storm has more influence than the law. The limiter's level is always computed from the
roll, with the tank's equation of motion.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from utank_hil.analysis.loop.margins import Robustness, robustness
from utank_hil.base.arrays import FloatArray
from utank_hil.control import (
    CommandLimiter,
    DesignPlant,
    LinearLaw,
    PredictiveDesign,
    PredictiveLaw,
    WashoutLaw,
)
from utank_hil.dynamics import STATES, LinearModel, RollShip, Tank, coupled_matrices
from utank_hil.identification import (
    IdentificationError,
    OkidResult,
    Validation,
    find_disturbance_frequencies,
    okid,
    validate,
)
from utank_hil.identification.lag_regression import segment_bounds
from utank_hil.identification.ship_fit import ModelLimits, ShipFit, fit_ship, model_objections
from utank_hil.retuning import Candidate, ModelSummary, Refusal
from utank_hil.retuning.settings import (
    LAGS,
    LEAST_PREDICTIONS,
    estimation_samples,
    record_problems,
)

MOST_MISSING = 0.2  #: Largest share of missing samples. Chosen; no study.
LEAST_MOTION = (10.0, 1e-6)
"""Smallest peak-to-peak value of the command in Pa, and of each output in its unit."""
OFFSET = 0  #: Degree of the polynomial disturbance: it models a steady heel and a sensor's bias.
LARGEST = 1e9  #: Largest command and output in SI units; larger values mean a wrong unit.
LEAST_GAIN = 0.05
"""Smallest relative reduction of the roll against the configured law; less is within the error of
the simulation in the recorded waves.
"""
ROLL_PART = 1.02  #: Largest roll in the recorded waves, relative to the passive tank's.
EFFORT_PART = 0.9
"""Largest pressure RMS in the recorded waves, relative to the pump's greatest pressure."""
SUBSTEPS: Final = 10
"""Limiter steps in a sample time of the law: the level barrier acts between samples as well."""
_WATER: Final = [STATES.index("level_m"), STATES.index("level_rate_m_s")]
_SETTLING_S: Final = 60.0  # The transient of the start at rest is left out of the RMS.
_HIGHEST_RAD_S: Final = 2.5  # Above this there are no waves, and differentiation amplifies noise.


class RmsResponse(NamedTuple):
    """Root mean squares of passive roll, roll with the law, and the law's limited pressure."""

    passive_roll_rad: float
    roll_rad: float
    pressure_pa: float


class RecordedWaves:
    """The wave-induced part of a record, as a disturbance to simulate laws with.

    `record`, shape (N, 1 + m), has command and outputs; gaps are NaN. `plant` is ship, tank, loop
    and limits at the time of the record; `measured` names the outputs, ``roll_rad`` among them.
    """

    def __init__(
        self,
        record: FloatArray,
        plant: DesignPlant,
        measured: tuple[str, ...],
        sample_time_s: float,
    ) -> None:
        self._limits, self._tank = plant.limits, plant.tank
        self._measured = [STATES.index(name) for name in measured]
        self._roll = measured.index("roll_rad")
        self._plant = plant.sampled(STATES, sample_time_s / SUBSTEPS)
        slow = plant.sampled(STATES, sample_time_s)
        pump_response = _response(slow, np.nan_to_num(record[:, 0]))[:, self._measured]
        waves = record[:, 1:] - pump_response
        # Gaps hold the last value.
        here = np.isfinite(waves).all(axis=1)
        last = np.maximum.accumulate(np.where(here, np.arange(len(waves)), 0))
        waves = np.nan_to_num(waves[last])
        self._waves = waves - waves.mean(axis=0)
        roll_rad = self._waves[:, self._roll]
        self._levels = tank_motion(plant.ship, plant.tank, roll_rad, sample_time_s, SUBSTEPS)
        self._first = min(round(_SETTLING_S / sample_time_s), len(record) // 2)

    def simulate(self, law: LinearLaw) -> RmsResponse:
        """Simulate the closed loop of a law for the record's outputs and sample time."""
        plant, controller = self._plant, law.controller()
        limiter = CommandLimiter(self._limits, self._tank, plant.dt)
        state = np.zeros(len(plant.A))
        sums = np.zeros(2)
        for k, (waves, levels) in enumerate(
            zip(self._waves, self._levels.reshape(len(self._waves), SUBSTEPS, 2), strict=True)
        ):
            applied = np.full(1, limiter.mean_since_last_call())
            y = (plant.C @ state + plant.D[:, 0] * limiter.command_pa)[self._measured] + waves
            controller.applied(applied)
            desired_pa = float(controller.step(y)[0])
            for level_m, rate_m_s in levels.tolist():
                command_pa = limiter.command_pa
                water = plant.C[_WATER] @ state + plant.D[_WATER, 0] * command_pa
                state = plant.A @ state + plant.B[:, 0] * command_pa
                limiter.limit(desired_pa, level_m + float(water[0]), rate_m_s + float(water[1]))
            if k >= self._first:
                sums += y[self._roll] ** 2, applied[0] ** 2
        samples = max(1, len(self._waves) - self._first)
        roll_square, pressure_square = (sums / samples).tolist()
        return RmsResponse(
            float(np.sqrt(np.mean(self._waves[self._first :, self._roll] ** 2))),
            math.sqrt(roll_square),
            math.sqrt(pressure_square),
        )


@dataclass(frozen=True, slots=True)
class RetuningTask:
    """Inputs of the retuner besides the record."""

    design: PredictiveDesign  #: Design method of the laws.
    plant: DesignPlant  #: The configured plant, where the fit starts.
    order: int  #: Order of the ARX model.
    limits: ModelLimits
    #: Smallest relative reduction of the roll against the configured law; None: not compared.
    least_gain: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Result of an identification."""

    okid: OkidResult
    #: Frequencies of regular waves; empty in an irregular sea.
    wave_frequencies_rad_s: tuple[float, ...]
    validation: Validation  #: Validation on the second part of the record.
    fit: ShipFit

    def plant(self, task: RetuningTask) -> DesignPlant:
        """The configured plant with the identified ship and tank."""
        return dataclasses.replace(task.plant, ship=self.fit.ship, tank=self.fit.tank)


def retune(record: FloatArray, task: RetuningTask) -> Candidate | Refusal:
    """Identify the ship, design a law and check it.

    `record`, shape (N, 1 + m), has the mean command since the previous sample and the measured
    outputs of `task.design`, at its sample time. Outputs that are not finite are gaps. A record
    that determines no model gives a refusal, not an exception.
    """
    record = np.where(np.isfinite(record), record, np.nan)
    try:
        found = identify(record, task)
    except (IdentificationError, np.linalg.LinAlgError) as error:
        return Refusal((str(error),))
    return judge(record, found, task)


def judge(record: FloatArray, found: Identification, task: RetuningTask) -> Candidate | Refusal:
    """Judge the result of `identify`, design a law and check it: the second half of `retune`."""
    objections = model_objections(found.validation, found.fit, task.limits)
    if objections:
        return Refusal(objections)
    try:
        return _design_and_check(record, found, task)
    except ValueError as error:  # The design fails for this ship; LinAlgError is a ValueError too.
        return Refusal((str(error),))


def identify(record: FloatArray, task: RetuningTask) -> Identification:
    """Identify ship and tank on the first part of a record and validate on the second.

    Raises `ValueError` if the number of columns does not match the task's signals. Raises
    `IdentificationError` if it does not determine a model.
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
    split = estimation_samples(len(record))
    _refuse_unusable(record[:split])
    _refuse_unusable(record[split:])
    stretches = [stop - start for start, stop in segment_bounds(record[split:])]
    skipped = max(task.order, LAGS)  # no prediction at the start and after gaps
    predictions = sum(max(0, length - skipped) for length in stretches)
    if predictions < LEAST_PREDICTIONS:
        raise IdentificationError(
            f"gaps leave {predictions} predictions on held-out data, {LEAST_PREDICTIONS} are "
            "needed: record longer, or with fewer gaps"
        )
    u, y = record[:split, :1], record[:split, 1:]
    waves = find_disturbance_frequencies(u, y, predictor.sample_time_s, most=1)
    result = okid(
        u,
        y,
        task.order,
        sample_time_s=predictor.sample_time_s,
        disturbance_frequencies_rad_s=waves,
        disturbance_polynomial_degree=OFFSET,
    )
    validation = validate(result.arx, record[split:, :1], record[split:, 1:], waves, LAGS, OFFSET)
    fit = fit_ship(result, u, task.plant, predictor.measured)
    return Identification(result, waves, validation, fit)


def _refuse_unusable(part: FloatArray) -> None:
    """Refuse a part of a record with too many gaps, wrong units, or signals that do not move."""
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


def _design_and_check(
    record: FloatArray, found: Identification, task: RetuningTask
) -> Candidate | Refusal:
    """Return a law for the identified ship, if it passes every check."""
    plant = found.plant(task)
    design, measured = task.design, task.design.predictor.measured
    law = design.law(plant)
    report = robustness(law, plant, measured, with_delay_margin=False)
    waves = RecordedWaves(record, plant, measured, law.sample_time_s)
    trial = waves.simulate(law)
    before = None
    if task.least_gain is not None:
        before = waves.simulate(design.law(task.plant))
    objections = (*report.failures(), *_performance_objections(trial, before, task))
    if objections:
        return Refusal(objections)
    return Candidate(
        *_split_washout(law),
        _summary(found, report, trial),
    )


def _performance_objections(
    trial: RmsResponse, before: RmsResponse | None, task: RetuningTask
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
    if not trial.roll_rad <= ROLL_PART * trial.passive_roll_rad:
        found.append(
            f"in the recorded waves the law rolls {math.degrees(trial.roll_rad):.2f} degrees RMS, "
            f"the passive tank {math.degrees(trial.passive_roll_rad):.2f}"
        )
    if not trial.pressure_pa <= EFFORT_PART * task.plant.limits.pressure_pa:
        found.append(
            f"in the recorded waves the law takes {trial.pressure_pa / 1e3:.0f} kPa RMS of "
            f"{task.plant.limits.pressure_pa / 1e3:.0f}"
        )
    return tuple(found)


def _split_washout(law: LinearLaw) -> tuple[PredictiveLaw, float]:
    """Return the predictive law and the corner frequency of its washout, 0 for none."""
    if isinstance(law, WashoutLaw) and isinstance(law.law, PredictiveLaw):
        return law.law, law.corner_rad_s
    assert isinstance(law, PredictiveLaw)
    return law, 0.0


def _summary(found: Identification, report: Robustness, trial: RmsResponse) -> ModelSummary:
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
        roll_below_passive=1 - trial.roll_rad / trial.passive_roll_rad
        if trial.passive_roll_rad
        else 0.0,
    )


def tank_motion(
    ship: RollShip, tank: Tank, roll_rad: FloatArray, sample_time_s: float, substeps: int = 1
) -> FloatArray:
    """Level (m) and level rate (m/s) of the passive tank for a given roll, shape (N substeps, 2).

    The linear model's level equation is solved in the frequency domain: the steady-state response,
    without transient, band-limited between samples.
    """
    mass, damping, stiffness = coupled_matrices(ship, tank)
    s = 2j * np.pi * np.fft.rfftfreq(len(roll_rad), sample_time_s)
    coupling, level_dynamics = (
        mass[1, column] * s**2 + damping[1, column] * s + stiffness[1, column] for column in (0, 1)
    )
    level = np.where(
        np.abs(s) < _HIGHEST_RAD_S, -coupling / level_dynamics * np.fft.rfft(roll_rad), 0.0
    )
    samples = substeps * len(roll_rad)
    return np.column_stack([substeps * np.fft.irfft(part, samples) for part in (level, s * level)])


def _response(plant: LinearModel, command: FloatArray) -> FloatArray:
    state = np.zeros(len(plant.A))
    outputs = np.empty((len(command), len(plant.C)))
    for k, value in enumerate(command):
        outputs[k] = plant.C @ state + plant.D[:, 0] * value
        state = plant.A @ state + plant.B[:, 0] * value
    return outputs
