"""Whether a row was passed: every seed in time, and the roll no worse than the passive ship's."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from firmware_sim.fault_campaign.campaign import Row, Setup
from firmware_sim.fault_campaign.trial import Outcome
from utank_hil.safety.faults import FAULTS, Reaction

STOP_ZERO_MS: Final = 250.0
"""Zero pressure after a stop was found, at the latest."""
CUT_MS: Final = 100.0
"""The same of a fault that only ever stops: a ramp that began in its place would take longer."""
RAMP_ZERO_MS: Final = 1040.0
"""And after a ramp began: a second, a cycle of the command and a tick of the drive."""
STOPS: Final = {
    row.code.name
    for row in FAULTS
    if any(condition.reaction is Reaction.STOP for condition in row.conditions)
}
ONLY_STOPS: Final = {
    row.code.name
    for row in FAULTS
    if all(condition.reaction is Reaction.STOP for condition in row.conditions)
}
RATE_SHARE: Final = 1.001
STATUS_MS: Final = 200.0
"""Two cycles of CTRL_STATUS: what is so for less need not be in one."""
ALARM_MS: Final = 100.0
"""The list of alarms is renewed, and looked at, ten times a second."""


@dataclass(frozen=True, slots=True)
class Result:
    """A row over all seeds; times are the worst of them, None where there is none.

    Attributes
    ----------
    requirement : str
        Its text.
    found_ms, zero_ms : float or None
        When the reaction asked for began, and when the drive's set-point was zero for good.
    codes : tuple of str
        What the fault was called, over the seeds.
    wire : str
        The first frame that the fault changed, in the first seed.
    roll_ratio : float
        Variance of the roll over that of the passive ship.
    window_s : float
        Over which it was taken.
    problems : tuple of str
        Why the row is not passed; empty if it is.
    outcomes : tuple of Outcome
        By seed.
    recording : str
        File, if any.
    """

    row: Row
    requirement: str
    found_ms: float | None
    zero_ms: float | None
    zero_limit_ms: float | None
    codes: tuple[str, ...]
    wire: str
    roll_ratio: float
    window_s: float
    problems: tuple[str, ...]
    outcomes: tuple[Outcome, ...] = field(repr=False)
    recording: str = ""

    @property
    def passed(self) -> bool:
        """Whether it is."""
        return not self.problems

    def as_json(self) -> dict[str, Any]:
        """For `json.dumps`: None where a time does not apply."""
        return {
            "id": self.row.id,
            "meets": list(self.row.meets),
            "requirement": self.requirement,
            "reaction": self.row.reaction,
            "found_ms": self.found_ms,
            "zero_ms": self.zero_ms,
            "limit_ms": self.row.within_ms,
            "counted_from": self.row.counts_from or None,
            "zero_limit_ms": self.zero_limit_ms,
            "verdict": "pass" if self.passed else "fail",
            "problems": list(self.problems),
            "codes": list(self.codes),
            "wire": self.wire,
            "roll_ratio": None if math.isnan(self.roll_ratio) else round(self.roll_ratio, 6),
            "roll_limit": self.row.roll_limit,
            "roll_window_s": None if math.isnan(self.window_s) else self.window_s,
            "seeds": len(self.outcomes),
            "recording": self.recording or None,
        }


def judged(row: Row, setup: Setup, requirement: str, outcomes: Sequence[Outcome]) -> Result:
    """Judge a row by its outcomes, one a seed."""
    sound = [each for each in outcomes if not each.error]
    found = [_reaction_ms(row, each) for each in sound]
    ends = row.reaction in ("stop", "ramp", "drive") and not row.hardwired_stop
    zero = [each.zero_ms for each in sound] if ends else []
    zero_limit_ms = row.zero_within_ms
    if zero_limit_ms is None and ends and row.reaction != "drive":
        limits = (_zero_limit_ms(row, each) for each in sound)
        zero_limit_ms = max((limit for limit in limits if limit is not None), default=None)
    roll = sum(each.roll_variance for each in sound)
    passive = sum(each.passive_variance for each in sound)
    problems = [f"seed {each.seed}: {each.error}" for each in outcomes if each.error]
    for each in sound:
        problems += [f"seed {each.seed}: {why}" for why in _problems(row, setup, each)]
    ratio = roll / passive if sound and passive else math.nan
    if not ratio <= row.roll_limit:
        problems.append(f"rolls {ratio:.2f} times the passive ship's variance")
    return Result(
        row,
        requirement,
        _worst(found),
        _worst(zero),
        zero_limit_ms,
        tuple(sorted({each.code for each in sound if each.code != "NONE"})),
        next((each.wire for each in sound), ""),
        ratio,
        max((each.window_s for each in sound), default=math.nan),
        tuple(problems),
        tuple(outcomes),
    )


def _worst(times_ms: Sequence[float | None]) -> float | None:
    known = [each for each in times_ms if each is not None]
    return round(max(known), 3) if known and len(known) == len(times_ms) else None


def _reaction_ms(row: Row, outcome: Outcome) -> float | None:
    """When the reaction began that the row asks for; at once where nobody could arm."""
    if row.from_start and row.reaction in ("stop", "ramp") and not outcome.was_active:
        return 0.0 if outcome.code != "NONE" else None
    return {
        "stop": outcome.found_ms,
        "ramp": outcome.found_ms,
        "halve": outcome.halved_ms,
        "alarm": outcome.alarm_ms,
        "note": outcome.noted_ms,
        "drive": outcome.zero_ms,
        "none": None,
        "refuse": None,
    }[row.reaction]


def _zero_limit_ms(row: Row, outcome: Outcome) -> float | None:
    """When the pressure is to be zero, of a row that latches; None where nothing was found.

    A stop that another fault's ramp comes before has the time that it would have had.
    """
    found_ms = _reaction_ms(row, outcome)
    if row.zero_within_ms is not None or found_ms is None:
        return row.zero_within_ms
    if row.reaction != "stop":
        return found_ms + RAMP_ZERO_MS
    if outcome.code in ONLY_STOPS:
        return found_ms + CUT_MS
    if outcome.code not in STOPS:
        found_ms = max(found_ms, row.within_ms or 0.0)
    return found_ms + STOP_ZERO_MS


def _named_in_time(row: Row, outcome: Outcome) -> bool:
    """Whether an alarm had one of the row's names by the time that it was, or had to be, found."""
    if outcome.alarm_ms is None:
        return False
    latest_ms = max(row.within_ms or 0.0, _reaction_ms(row, outcome) or 0.0) + ALARM_MS
    return row.reaction == "refuse" or outcome.alarm_ms <= latest_ms


def _problems(row: Row, setup: Setup, outcome: Outcome) -> Iterator[str]:
    """What was not as it should be in one sea."""
    found_ms = _reaction_ms(row, outcome)
    latched = row.reaction in ("stop", "ramp")
    if row.reaction not in ("none", "refuse"):
        if found_ms is None:
            yield "was not found"
        elif row.within_ms is not None and found_ms > row.within_ms:
            yield f"found after {found_ms:.0f} ms, {row.within_ms:.0f} allowed"
    if row.halved_within_ms is not None:
        halved = [each for each in (outcome.halved_ms, outcome.found_ms) if each is not None]
        if not halved or min(halved) > row.halved_within_ms:
            yield f"pressure not halved within {row.halved_within_ms:.0f} ms"
    if latched and outcome.found_ms is not None and outcome.mode != "FAULT":
        yield f"not latched: ended in {outcome.mode}"
    yield from _unsaid(row, outcome)
    limit_ms = _zero_limit_ms(row, outcome) if latched else None
    if limit_ms is not None:
        zero_ms = math.inf if outcome.zero_ms is None else outcome.zero_ms
        if not row.hardwired_stop and zero_ms > limit_ms:
            yield f"pressure at zero after {zero_ms:.0f} ms, {limit_ms:.0f} allowed"
        if not row.unheard and outcome.commanded_ms > limit_ms:
            yield f"pressure commanded until {outcome.commanded_ms:.0f} ms, {limit_ms:.0f} allowed"
    ended_late = outcome.found_ms is None and outcome.code in row.may_end
    in_charge = outcome.mode == "ACTIVE" or ended_late
    if row.reaction in ("halve", "alarm", "note", "none") and not in_charge:
        yield f"ended in {outcome.mode}, {outcome.code}"
    if row.reaction in ("alarm", "note", "none") and outcome.halved_ms is not None:
        yield "halved the pressure"
    if row.reaction == "refuse" and outcome.was_active:
        yield "was armed"
    if row.reaction != "refuse" and not outcome.was_active and not row.from_start:
        yield "was not in charge before"
    if outcome.armed_again:
        yield "armed again by itself"
    beside = not latched and _named_in_time(row, outcome)
    if row.codes and outcome.code not in row.codes and not beside:
        yield f"called {outcome.code}"
    limits = setup.config.limits
    if row.reaction != "stop" and outcome.steepest_pa_s > RATE_SHARE * limits.rate_pa_s:
        yield f"commands changed at {outcome.steepest_pa_s:.3g} Pa/s"
    if outcome.refused and "PUMP_CMD" not in str(row.faults):
        yield f"the drive refused {outcome.refused} commands"
    if not outcome.wire and row.faults:
        yield "the fault did not reach the bus"


def _unsaid(row: Row, outcome: Outcome) -> Iterator[str]:
    """What the bus was not told, or told wrongly."""
    latched = row.reaction in ("stop", "ramp")
    if outcome.beyond_share_pa > 0:
        yield f"commanded {outcome.beyond_share_pa:.0f} Pa more than it may while degraded"
    if row.unheard:
        return
    if latched and outcome.found_ms is not None:
        if outcome.shown != f"FAULT {outcome.code}":
            yield f"CTRL_STATUS shows {outcome.shown or 'nothing'} in the end"
        if outcome.code not in outcome.told:
            yield f"no alarm {outcome.code} was sent"
    named = {*row.codes, *row.alarms} & set(outcome.told)
    if row.reaction in ("alarm", "halve") and row.codes and not named:
        yield "no alarm with its name was sent"
    for name in row.alarms:
        if name not in outcome.told:
            yield f"no alarm {name} was sent"
    halves = row.reaction == "halve" or (row.halved_within_ms is not None and _halved_long(outcome))
    for flag in (*row.flags, *(["degraded"] if halves else [])):
        if flag not in outcome.flags:
            yield f"CTRL_STATUS never said {flag}"


def _halved_long(outcome: Outcome) -> bool:
    """Whether the pressure was halved for long enough, before the fault was latched, to be said."""
    if outcome.halved_ms is None:
        return False
    return outcome.found_ms is None or outcome.found_ms - outcome.halved_ms > STATUS_MS
