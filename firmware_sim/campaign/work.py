"""Work of a campaign's worker: a few cases in turn, each failing alone."""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from pydantic import ValidationError

from firmware_sim.campaign.case_name import as_text, code_digest
from firmware_sim.campaign.overrides import Content, changed
from firmware_sim.campaign.simulations import Row, rows_of
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig
from utank_hil.configuration.files import ALLOW_CODE, problems_in_words
from utank_hil.control import BuiltLaw

OK: Final = "ok"
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
    """Return the rows of all cases; a failed case gives one row with the reason.

    Raises `OtherCodeError` if the code is not that of the campaign any more.
    """
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
