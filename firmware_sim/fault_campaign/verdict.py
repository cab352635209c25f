"""Verdict on a row: every seed in time, the roll no worse than the passive ship's; in print."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Final

from rich.table import Table
from rich.text import Text

from firmware_sim.fault_campaign.campaign import TIME_OF, Campaign, Row, Setup
from firmware_sim.fault_campaign.own_ship import RollBudget
from firmware_sim.fault_campaign.trial import COLUMNS, FLAGS, Outcome
from utank_hil.canbus import PumpCommand, load_catalogue
from utank_hil.console.terminal import new_table
from utank_hil.safety.faults import FAULTS, Reaction

STOP_ZERO_MS: Final = 250.0  #: Latest zero pressure in ms after a stop was triggered.
CUT_MS: Final = 100.0
"""Latest zero pressure in ms after a fault that always stops: a ramp instead would take longer."""
RAMP_ZERO_MS: Final = 1040.0
"""Latest zero pressure in ms after a ramp began: 1 s, a command cycle and a tick of the drive."""
_REACTIONS: Final = {
    row.code.name: [condition.reaction for condition in row.conditions] for row in FAULTS
}
STOPS: Final = {name for name, those in _REACTIONS.items() if Reaction.STOP in those}
HALVES: Final = {name for name, those in _REACTIONS.items() if Reaction.HALVE in those}
ONLY_STOPS: Final = {name for name, those in _REACTIONS.items() if {*those} <= {Reaction.STOP}}
RATE_SHARE: Final = 1.001
"""Share of the rate limit that commands may reach, with the limiter's rounding."""
STATUS_MS: Final = 200.0
"""Two cycles of CTRL_STATUS in ms: a shorter state need not appear in one."""
ALARM_MS: Final = 100.0  #: Period in ms at which the list of alarms is updated and checked.
COMMAND: Final = load_catalogue().codec(PumpCommand).name
_GO_ON: Final = ("halve", "alarm", "note", "none")  # Reactions after which control continues.


Verdict = dict[str, Any]
"""A row of the campaign as ``--json`` has it: None where a time does not apply."""


def judged(campaign: Campaign, row: Row, outcomes: Sequence[Outcome]) -> Verdict:
    """Judge a row by its outcomes, one per seed; times are the worst of them.

    ``found_ms`` is the start of the required reaction, ``zero_ms`` the final zero of the drive's
    set-point, ``wire`` the first frame that the fault changed, in the first seed, ``roll_ratio``
    the roll variance over that of the passive ship, or, if larger, of the ship without fault.
    """
    setup = campaign.setups[row.fault.setup]
    sound = [each for each in outcomes if not each.error]
    found = [_reaction_ms(row, each) for each in sound]
    ends = row.expect.latched or row.expect.reaction == "drive"
    zero = [each.zero for each in sound] if ends and not row.fault.hardwired_stop else []
    known = [each for one in sound if (each := _found_limit_ms(row, setup, one)) is not None]
    limit_ms = min(known, default=row.limit.found_ms)
    limits = (_zero_limit_ms(row, each) for each in sound if zero and row.expect.latched)
    zero_limit_ms = max(filter(None, limits), default=row.limit.zero_ms)
    problems = [f"seed {each.seed}: {each.error}" for each in outcomes if each.error]
    problems += [
        f"seed {each.seed}: {why}" for each in sound for why in _problems(row, setup, each)
    ]
    passive = sum(each.passive_variance for each in sound)
    without_fault = sum(each.sound_variance for each in sound)
    least, whose = max((passive, "passive"), (without_fault, "sound"))  # NaN is not larger
    ratio = sum(each.variance for each in sound) / least if least else math.nan
    if row.limit.roll is not None and not ratio <= row.limit.roll:
        problems.append(f"rolls {ratio:.2f} times the {whose} ship's variance")
    window_s = max((each.window_s for each in sound), default=math.nan)
    return {
        "id": row.id,
        "meets": list(row.meets),
        "requirement": campaign.asked_by(row),
        "reaction": row.expect.reaction,
        "found_ms": _worst(found),
        "zero_ms": _worst(zero),
        "limit_ms": limit_ms,
        "counted_from": row.limit.counts_from or None,
        "zero_limit_ms": zero_limit_ms,
        "verdict": "fail" if problems else "pass",
        "problems": problems,
        "codes": sorted({each.code for each in sound if each.code != "NONE"}),
        "wire": next((each.wire for each in sound), ""),
        "roll_ratio": None if math.isnan(ratio) else round(ratio, 6),
        "roll_limit": row.limit.roll,
        "roll_window_s": None if math.isnan(window_s) else window_s,
        "seeds": len(outcomes),
    }


def _worst(times_ms: Sequence[float | None]) -> float | None:
    known = [each for each in times_ms if each is not None]
    return round(max(known), 3) if known and len(known) == len(times_ms) else None


def _reaction_ms(row: Row, outcome: Outcome) -> float | None:
    """Start of the required reaction in ms; zero where arming was refused."""
    if row.fault.from_start and row.expect.latched and not outcome.was_active:
        return 0.0 if outcome.code != "NONE" else None
    time = TIME_OF.get(row.expect.reaction)
    return None if time is None else getattr(outcome, time)


def _instead(outcome: Outcome) -> str:
    """What came in the place of the required reaction."""
    times_ms = {
        f"latched {outcome.code}": outcome.found,
        "halved the pressure": outcome.halved,
        "gave an alarm of the row": outcome.alarm,
        "passed over a frame": outcome.noted,
    }
    done = [f"{what} after {ms:.0f} ms" for what, ms in times_ms.items() if ms is not None]
    done += [f"alarms {' '.join(outcome.alarms)}"] if outcome.alarms else []
    return ", ".join(done) or f"nothing, and ended in {outcome.mode}"


def _found_limit_ms(row: Row, setup: Setup, outcome: Outcome) -> float | None:
    """Deadline in ms for the reaction; of an own ship by her roll budget, where it follows that."""
    if row.limit.found_ms is not None or row.limit.follows is None:
        return row.limit.found_ms
    return 1e3 * RollBudget.of(setup.config).found_s(1e-3 * (outcome.full or 0.0))


def _zero_limit_ms(row: Row, outcome: Outcome) -> float | None:
    """Deadline in ms for zero pressure of a latching row; None where nothing was found.

    A stop after another fault's ramp has the ramp's deadline.
    """
    found_ms = _reaction_ms(row, outcome)
    if row.limit.zero_ms is not None or found_ms is None:
        return row.limit.zero_ms
    if row.expect.reaction != "stop":
        return found_ms + RAMP_ZERO_MS
    if outcome.code in ONLY_STOPS:
        return found_ms + CUT_MS
    if outcome.code not in STOPS:
        found_ms = max(found_ms, row.limit.found_ms or 0.0)
    return found_ms + STOP_ZERO_MS


def _problems(row: Row, setup: Setup, outcome: Outcome) -> Iterator[str]:
    yield from _late(row, setup, outcome)
    yield from _unsaid(row, outcome)
    yield from _ended_wrongly(row, outcome)
    reaction = row.expect.reaction
    if reaction != "stop" and outcome.steepest_pa_s > RATE_SHARE * setup.config.limits.rate_pa_s:
        yield f"commands changed at {outcome.steepest_pa_s:.3g} Pa/s"
    spoiled = [fault.spoiled_message for fault in row.fault.inject]
    if outcome.refused and COMMAND not in spoiled:
        yield f"the drive refused {outcome.refused} commands"
    if outcome.beyond_share_pa > 0:
        yield f"commanded {outcome.beyond_share_pa:.0f} Pa more than it may while degraded"
    if not outcome.wire and row.fault.inject:
        yield "the fault did not reach the bus"


def _late(row: Row, setup: Setup, outcome: Outcome) -> Iterator[str]:
    limit, allowed_ms = row.limit, _found_limit_ms(row, setup, outcome)
    found_ms = _reaction_ms(row, outcome)
    if row.expect.reaction not in ("none", "refuse"):
        if found_ms is None:
            yield f"was not found; instead: {_instead(outcome)}"
        elif allowed_ms is not None and found_ms > allowed_ms:
            yield f"found after {found_ms:.0f} ms, {allowed_ms:.0f} allowed"
    if limit.halved_ms is not None:
        halved = [each for each in (outcome.halved, outcome.found) if each is not None]
        if min(halved, default=math.inf) > limit.halved_ms:
            yield f"pressure not halved within {limit.halved_ms:.0f} ms"
    limit_ms = _zero_limit_ms(row, outcome) if row.expect.latched else None
    if limit_ms is not None:
        zero_ms = math.inf if outcome.zero is None else outcome.zero
        if not row.fault.hardwired_stop and zero_ms > limit_ms:
            yield f"pressure at zero after {zero_ms:.0f} ms, {limit_ms:.0f} allowed"
        if not row.expect.unheard and outcome.commanded > limit_ms:
            yield f"pressure commanded until {outcome.commanded:.0f} ms, {limit_ms:.0f} allowed"


def _ended_wrongly(row: Row, outcome: Outcome) -> Iterator[str]:
    """Yield wrong final modes, actions and fault codes of the controller."""
    expect = row.expect
    if expect.latched and outcome.found is not None and outcome.mode != "FAULT":
        yield f"not latched: ended in {outcome.mode}"
    ended_late = outcome.found is None and outcome.code in expect.may_end
    if expect.reaction in _GO_ON and outcome.mode != "ACTIVE" and not ended_late:
        yield f"ended in {outcome.mode}, {outcome.code}"
    # what may end it may halve the pressure first
    may_halve = expect.reaction == "halve" or not HALVES.isdisjoint(expect.may_end)
    if expect.reaction in _GO_ON and not may_halve and outcome.halved is not None:
        yield "halved the pressure"
    if expect.reaction == "refuse" and outcome.was_active:
        yield "was armed"
    if expect.reaction != "refuse" and not outcome.was_active and not row.fault.from_start:
        yield "was not in charge before"
    if outcome.armed_again:
        yield "armed again by itself"
    named = outcome.code in expect.codes or (not expect.latched and _named_in_time(row, outcome))
    if expect.codes and not named:
        yield f"called {outcome.code}"


def _named_in_time(row: Row, outcome: Outcome) -> bool:
    if outcome.alarm is None or row.expect.reaction == "refuse":
        return outcome.alarm is not None
    found_ms = max(row.limit.found_ms or 0.0, _reaction_ms(row, outcome) or 0.0)
    return outcome.alarm <= found_ms + ALARM_MS


def _unsaid(row: Row, outcome: Outcome) -> Iterator[str]:
    expect = row.expect
    if expect.unheard:
        return
    if expect.latched and outcome.found is not None:
        if outcome.status != f"FAULT {outcome.code}":
            yield f"CTRL_STATUS shows {outcome.status or 'nothing'} in the end"
        if outcome.code not in outcome.alarms:
            yield f"no alarm {outcome.code} was sent"
    named = {*expect.codes, *expect.also} & set(outcome.alarms)
    if expect.reaction in ("alarm", "halve") and expect.codes and not named:
        yield "no alarm with its name was sent"
    halved = row.limit.halved_ms is not None and outcome.halved is not None
    if halved and outcome.found is not None:  # long enough before the latch to appear in a status
        halved = outcome.found - (outcome.halved or 0.0) > STATUS_MS
    degraded = ["degraded"] if halved or expect.reaction == "halve" else []
    for name in (*expect.also, *degraded):
        if name in FLAGS and name not in outcome.flags:
            yield f"CTRL_STATUS never said {name}"
        elif name not in FLAGS and name not in outcome.alarms:
            yield f"no alarm {name} was sent"


def write_recordings(
    folder: Path, outcomes: Mapping[str, Sequence[Outcome]], about: Mapping[str, Any]
) -> dict[str, Path]:
    """Write the recordings of the rows that have one; return the files by row."""
    from utank_hil.telemetry.recording import write_recording

    files = {}
    for name, each in outcomes.items():
        kept = {f"seed {one.seed}": one.rows for one in each if one.rows is not None}
        if kept:
            files[name] = folder / f"{name}.rrd"
            write_recording(files[name], COLUMNS, kept, about=about)
    return files


def as_json(
    rows: Sequence[Verdict], not_run: Mapping[str, str], about: Mapping[str, Any]
) -> dict[str, Any]:
    """All rows, and why others were not run, for `json.dumps`."""
    failed = sum(row["verdict"] == "fail" for row in rows)
    return {
        "rows": rows,
        "not_run": [{"id": name, "why": why} for name, why in not_run.items()],
        "passed": len(rows) - failed,
        "failed": failed,
        "about": dict(about),
    }


def table(rows: Sequence[Verdict], seeds: int) -> Table:
    """Table with two lines a row, found above asked; a row tells where it lacks seeds."""
    caption = (
        "worst of the seeds; times after the fault, ≤ their limits; zero: of the drive's "
        "set-point, or the end of the valve's following; variance of the roll over that of the "
        "passive ship, or, in charge, of the sound one if that is more, ≤ 1.05"
    )
    figures = ("found\nms", "zero\nms", "roll\nvar.", "")
    drawn = new_table("Faults", *figures, names=["row\n  reaction, alarms"], caption=caption)
    for row in rows:
        verdict = Text(row["verdict"], "green" if row["verdict"] == "pass" else "red")
        if row["seeds"] < seeds:
            verdict.append(f"\n{row['seeds']} of {seeds}", "default")
        drawn.add_row(
            "\n  ".join([row["id"], *wrap(" ".join((row["reaction"], *row["codes"])), 40)]),
            _over(row["found_ms"], row["limit_ms"]),
            _over(row["zero_ms"], row["zero_limit_ms"]),
            "" if row["roll_ratio"] is None else f"{row['roll_ratio']:.2f}",
            verdict,
        )
    return drawn


def _over(time_ms: float | None, limit_ms: float | None) -> str:
    found = "" if time_ms is None else f"{time_ms:.0f}"
    return found if limit_ms is None else f"{found}\n≤{limit_ms:.0f}"
