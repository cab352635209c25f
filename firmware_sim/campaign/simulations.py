"""Simulation of cases, each failing alone: bare ship, passive tank and every controller."""

import errno
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from pydantic import ValidationError

from firmware_sim.bench import run_in_turn
from firmware_sim.campaign.study import METRICS, Content, as_text, changed, code_digest
from firmware_sim.figures import LEAST_ROLL_RAD, NO_TANK, bare_figures, run_figures
from firmware_sim.prediction import active_run, noise_of
from firmware_sim.run import RECORD_S, roll_without_tank
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_content import PASSIVE
from utank_hil.analysis.loop import sea_response
from utank_hil.analysis.loop.loop_simulation import between, passive_motion, simulate_loop
from utank_hil.analysis.motion import statistics
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig
from utank_hil.configuration.files import ALLOW_CODE, problems_in_words
from utank_hil.control import BuiltLaw, DesignPlant
from utank_hil.control.gain import PassiveDesign
from utank_hil.control.interface import PRESSURE
from utank_hil.dynamics.linear import STATES
from utank_hil.nodes.signals import ROW_TICKS

Row = dict[str, str | float]
Laws = Mapping[str, BuiltLaw]
CAPSIZED: Final = "capsized"
_NO_FIGURE: Final = math.nan
_LEVEL, _LEVEL_RATE = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True, eq=False)
class _Record:
    """Record of a fast simulation, every `RECORD_S`; arrays have shape (n,)."""

    name: str
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray
    power_w: FloatArray
    strikes: int = 0
    capsized_s: float = math.inf


def rows_of(simulation: str, scenario: Scenario, seed: int, laws: Laws) -> list[Row]:
    """Compute a case.

    `simulation` is "bus", "linear" or "nonlinear"; `seed` replaces the scenario's. There is one row
    for the bare ship and for each run: ``run``, ``mark`` (why it does not count, or empty) and the
    figures of `METRICS`. Raises `ValueError` if this kind of simulation cannot compute the
    scenario.
    """
    if simulation == "bus":
        return _on_the_bus(scenario, seed, laws)
    if scenario.faults:
        raise ValueError("faults befall bus and nodes, which simulation: bus alone has: take that")
    if scenario.vessel.valve:
        raise ValueError("vessel.valve is moved by simulation: bus alone: take that")
    for name, law in laws.items():
        if law.commands != (PRESSURE,):
            raise ValueError(f"controllers.{name} moves a valve: take simulation: bus")
    records = {"linear": _linear, "nonlinear": _nonlinear}[simulation](scenario, seed, laws)
    return _judged(scenario, list(records))


def _on_the_bus(scenario: Scenario, seed: int, laws: Laws) -> list[Row]:
    result = run_in_turn(scenario, seed, laws)
    sunk = result.without_tank_capsized_s < result.end_s
    rows = [_row(NO_TANK, CAPSIZED if sunk else "", bare_figures(result))]
    for run in run_figures(result):
        if run.roll is None:
            continue
        mark = "" if run.mark is None else run.mark.word
        row = _row(run.name, mark, run.roll, run.pump, run.strikes)
        shares = ("roll_below_no_tank", "roll_below_passive", "active_share")
        rows.append(row | {key: _number(getattr(run, key)) for key in shares})
    return rows


def _judged(scenario: Scenario, records: list[_Record]) -> list[Row]:
    window = slice(round(scenario.settle_s / RECORD_S), None)
    rows: list[Row] = []
    rolls: dict[str, float] = {}
    references = {"roll_below_no_tank": NO_TANK, "roll_below_passive": PASSIVE}
    for record in records:
        roll = statistics.roll_statistics(record.roll_rad[window])
        sunk = record.capsized_s < scenario.duration_s
        if record.name == NO_TANK:
            row = _row(NO_TANK, CAPSIZED if sunk else "", roll)
        else:
            pump = statistics.pump_statistics(
                record.pressure_pa[window], record.power_w[window], record.level_m[window]
            )
            row = _row(record.name, CAPSIZED if sunk else "", roll, pump, record.strikes)
            row["active_share"] = float(record.name != PASSIVE)
        if not sunk:
            rolls[record.name] = roll.rms_rad
            for key, reference in references.items():
                if record.name != NO_TANK and rolls.get(reference, 0.0) >= LEAST_ROLL_RAD:
                    row[key] = 1.0 - roll.rms_rad / rolls[reference]
        rows.append(row)
    return rows


def _row(
    name: str,
    mark: str,
    roll: statistics.RollStatistics,
    pump: statistics.PumpStatistics | None = None,
    strikes: float = _NO_FIGURE,
) -> Row:
    row: Row = {"run": name, "mark": mark, **dict.fromkeys(METRICS, _NO_FIGURE)}
    row |= {
        "roll_rms_rad": roll.rms_rad,
        "roll_significant_rad": _number(roll.significant_rad),
        "roll_max_rad": roll.maximum_rad,
        "strikes": float(strikes),
    }
    pumped = {} if pump is None else asdict(pump)
    return row | {key: value for key, value in pumped.items() if key in METRICS}


def _number(value: float | None) -> float:
    return _NO_FIGURE if value is None else value


def _linear(scenario: Scenario, seed: int, laws: Laws) -> Iterator[_Record]:
    """Simulate linear ship and tank with law, limiter, level observer and sensor noise."""
    ship, tank = scenario.ship_at(0.0), scenario.vessel.tank
    later = scenario.actual_ship and scenario.actual_from_s > 0
    changes = later or scenario.voyage or len(scenario.sea.spectra) > 1
    for wrong, why in (
        (changes, "keeps ship, course and sea"),
        (ship.heeling_moment_nm, "knows no steady heel"),
        (ship.sway_of_slope or scenario.hull, "knows no sway"),
        (scenario.righting_in_waves, "has one righting moment"),
        (scenario.fmu, "knows no ship of an FMU"),
    ):
        if wrong:
            raise ValueError(f"simulation: linear {why}: take nonlinear or bus")
    moment = scenario.wave_moment(seed)
    count = round(scenario.duration_s / RECORD_S)
    at_rest = np.zeros(count)
    bare = sea_response.roll_without_tank(ship, moment, RECORD_S, count)
    yield _Record(NO_TANK, bare, at_rest, at_rest, at_rest)
    passive = passive_motion(ship, tank, moment, RECORD_S, count + 1)
    in_ticks = between(passive, RECORD_S, ROW_TICKS)
    yield _Record(PASSIVE, passive[:-1, 0], passive[:-1, _LEVEL], at_rest, at_rest)
    for name, controller in scenario.controllers.items():
        law, plant = laws[name], controller.plant
        run = simulate_loop(
            DesignPlant(ship, tank, plant.delay_s, plant.lag_s, plant.limits),
            in_ticks,
            law.controller(),
            law.measured,
            noise=noise_of(scenario),
            seed=seed,
            every=ROW_TICKS,
        )
        motion, pressure_pa = run.motion, run.pressure_pa
        power_w = pressure_pa * tank.reservoir_area_m2 * motion[:, _LEVEL_RATE]
        yield _Record(name, motion[:, 0], motion[:, _LEVEL], pressure_pa, power_w)


def _nonlinear(scenario: Scenario, seed: int, laws: Laws) -> Iterator[_Record]:
    """Simulate the bench's plant with law, limiter, level observer and sensor noise."""
    count = round(scenario.duration_s / RECORD_S)
    at_rest, own = np.zeros(count), DesignPlant(scenario.vessel.ship, scenario.vessel.tank)
    roll_rad, capsized_s = roll_without_tank(scenario, seed, count)
    yield _Record(NO_TANK, roll_rad, at_rest, at_rest, at_rest, capsized_s=capsized_s)
    plants = {name: each.plant for name, each in scenario.controllers.items()}
    passive = next(iter(plants.values()), own)
    for name, plant in {PASSIVE: passive, **plants}.items():
        law = laws[name] if name in laws else PassiveDesign().build(plant)
        kept, ship = active_run(scenario, plant, law, seed, count)
        roll, level, pressure, power = (
            kept[key] for key in ("roll_rad", "level_m", "pressure_pa", "power_w")
        )
        yield _Record(name, roll, level, pressure, power, ship.strikes, ship.capsized_s)


OK: Final = "ok"
_OF_THE_MACHINE: Final = (errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC)
FAILED: Final = "failed"  #: Status of a case that cannot be computed; it would fail again.
LOST: Final = "lost"  #: Status of a case that was ended from outside; `--resume` tries it again.


class OtherCodeError(Exception):
    """Error for code that changed while the campaign ran."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Cases sent to a worker together."""

    simulation: str
    scenario: str  #: Content of the study's scenario as text.
    code: str
    allow_code: bool  #: Whether laws may be code that the files name.
    cases: tuple[tuple[str, int, str], ...]  #: Name, seed, and overrides of the scenario as text.


def run_batch(batch: Batch) -> list[Row]:
    """Rows of all cases, one with the reason for a failed one; `OtherCodeError` for other code."""
    if code_digest() != batch.code:
        raise OtherCodeError(
            "the code has changed since the campaign began: begin it anew in another folder"
        )
    return [row for name, seed, values in batch.cases for row in _case(batch, name, seed, values)]


def failed_row(name: str, status: str, reason: str) -> Row:
    """Row stored for a case without a result."""
    return {"case": name, "run": "", "status": status, "reason": reason, "mark": "", "wall_s": 0.0}


def _case(batch: Batch, name: str, seed: int, values: str) -> Sequence[Row]:
    started = time.perf_counter()
    try:
        content = changed(_content(batch.scenario), json.loads(values))
        # the seed is passed separately, so that one validation serves all seeds
        content = {key: value for key, value in content.items() if key != "seed"}
        scenario = _scenario(as_text(content), batch.allow_code)
        laws = {
            each: _law(as_text(content["controllers"][each]), each, batch.allow_code)
            for each in scenario.controllers
        }
        rows = rows_of(batch.simulation, scenario, seed, laws)
    except MemoryError:
        return [failed_row(name, LOST, "the worker's memory did not suffice")]
    except OSError as error:
        status = LOST if error.errno in _OF_THE_MACHINE else FAILED
        return [failed_row(name, status, f"{type(error).__name__}: {error}")]
    except ValidationError as error:
        found = problems_in_words(error, content, Scenario)
        reason = "; ".join(f"{'.'.join(map(str, key))}: {why}" for key, why in found)
        return [failed_row(name, FAILED, reason)]
    except ParameterError as error:
        reason = "; ".join(f"{key}: {why}" for key, why in error.problems)
        return [failed_row(name, FAILED, reason)]
    except Exception as error:  # a law may be foreign code, and no case may end the campaign
        return [failed_row(name, FAILED, f"{type(error).__name__}: {error}")]
    wall_s = time.perf_counter() - started
    ended: Row = {"case": name, "status": OK, "reason": "", "wall_s": wall_s}
    return [{**ended, **row} for row in rows]


@lru_cache(maxsize=2)
def _content(text: str) -> Content:
    content: Content = json.loads(text)
    return content


@lru_cache(maxsize=16)
def _scenario(text: str, allow_code: bool) -> Scenario:
    return Scenario.model_validate(json.loads(text), context={ALLOW_CODE: allow_code})


@lru_cache(maxsize=64)
def _law(text: str, name: str, allow_code: bool) -> BuiltLaw:
    """Law of a controller; its controllers are created anew for every run."""
    try:
        content = json.loads(text)
        return build_law(ControllerConfig.model_validate(content, context={ALLOW_CODE: allow_code}))
    except ParameterError as error:
        problems = [(f"controllers.{name}.{key}", why) for key, why in error.problems]
        raise ParameterError("", problems) from error
