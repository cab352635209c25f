"""Configuration of the fault campaign: requirements, and the rows that verify them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from firmware_sim.fault_campaign.own_ship import (
    GAP_S,
    Ratios,
    ratios,
    renumbered,
    resized,
    stretched,
    thresholds,
)
from firmware_sim.fault_injection.fault import FaultSpan, FaultTime, one_of
from firmware_sim.fault_injection.frames import Lost
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fault_injection.nodes import Law
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_problems import foreign_role, missing_nodes
from utank_hil.base.parameters import Finite, Positive, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import Fault
from utank_hil.canbus.profiles.drive_plan import DrivePlan
from utank_hil.configuration import ControllerConfig, Section, Vessel
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.panel import TimedAction
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.retuning import EstimateSettings
from utank_hil.safety.monitoring import GAP_PERIODS

COMMON: Final = "pump"  #: Setup of rows that name none.
LONG_S: Final = 300.0
"""Follow-up time in s above which a row takes more than a minute of CPU time per sea."""
TIME_OF: Final[dict["Reaction", str]] = {
    "stop": "found",
    "ramp": "found",
    "halve": "halved",
    "alarm": "alarm",
    "note": "noted",
    "drive": "zero",
}  #: Field of `Outcome` with the start of each reaction.
_AT_A_SAMPLE: Final = ("raises", "answers_nan")  #: Failures of a law that show at its next sample.
_LATE_MS: Final = 20.0  #: Beyond that sample, as on the first ship.
_PHASES: Final = 100  # Number of ticks in a second, the slowest message cycle.
_PHASE_STRIDE: Final = 37  # Ticks from one seed's fault to the next one's: coprime to 100 and to 5.


FaultName = Annotated[
    str, one_of("fault of utank_hil/safety/faults.py", lambda: list(Fault.__members__))
]
CountsFrom = Literal["roll_rad", "roll_rate_rad_s", "level_m", "pressure_pa", "over_roll_rad"]
StatusFlag = Literal["degraded", "saturated"]
Reaction = Literal["stop", "ramp", "halve", "alarm", "note", "none", "refuse", "drive"]
"""Required reaction of a row.

In order: zero pressure at once, latched; ramp to zero, latched; half pressure with an alarm; alarm
while control continues; frame discarded or counted; none, as for a sound ship; arming refused;
drive or valve that stops by itself."""


class Requirement(Section):
    """Required row of the fault table, or a line of the trials of an earlier version."""

    id: str
    fault: str
    found_by: str = ""
    within: str = ""
    reaction: str = ""
    elsewhere: str = ""  #: Test or document that verifies it, where no row of the campaign does.

    @property
    def text(self) -> str:
        """What is required, in one line."""
        parts = (self.fault, self.found_by, self.within, self.reaction)
        return f"{self.id}: " + "; ".join(filter(None, parts))


class Setup(Section):
    """Ship in a sea with one of the scenario's controllers."""

    scenario: Scenario
    controller: str
    #: Parameters of the ship from the fault on, with the keys of a scenario.
    actual_ship: Annotated[dict[str, Finite], Field(default_factory=dict)]
    #: Redundancy of the ship in addition to that of the scenario's vessel.
    redundancy: Redundancy = NO_REDUNDANCY
    #: displacement_n, least_gm_m: values that replace the vessel's.
    displacement_n: Positive | None = None
    least_gm_m: Positive | None = None
    sea_estimate: EstimateSettings | None = None  #: Settings that replace the controller's.
    devices: DevicesSection | None = None  #: Devices that replace the vessel's.
    delay_s: Positive | None = None  #: Delay that the law is made for, instead of its own.
    commissioned: bool = True  #: Whether the controller may be armed.

    @property
    def equipped(self) -> Scenario:
        """Scenario with the setup's changes applied."""
        scenario, own = self.scenario, self.scenario.vessel
        weight_n = self.displacement_n or own.ship.displacement_n
        changed = {
            "redundancy": self.redundancy,
            "ship": replace(own.ship, displacement_n=weight_n),
            **self._given("least_gm_m", "devices"),
        }
        vessel = own.model_copy(update=changed)
        changed = {"vessel": vessel, **self._given("sea_estimate", "delay_s")}
        controllers = {
            name: config.model_copy(update=changed) for name, config in scenario.controllers.items()
        }
        return scenario.model_copy(update={"vessel": vessel, "controllers": controllers})

    def _given(self, *names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def config(self) -> ControllerConfig:
        """Configuration of the controller."""
        return self.equipped.controllers[self.controller]

    def scenario_of(self, fault_s: float) -> Scenario:
        """Scenario with the ship's parameters that apply from the fault on."""
        later = {"actual_ship": self.actual_ship, "actual_from_s": fault_s}
        return self.equipped.model_copy(update=later if self.actual_ship else None)

    @model_validator(mode="after")
    def _known(self) -> "Setup":
        names = list(self.scenario.controllers)
        if self.controller not in names:
            refuse("", [("controller", f"must be one of {', '.join(names)}")])
        refuse("", self.config.late_problems())
        return self


class Trial(Section):
    """Stimulus for a ship under way."""

    setup: str = COMMON  #: Name of a setup in `Campaign.setups`.
    inject: tuple[AnyFault, ...] = ()  #: Faults; their times count from `Campaign.fault_at_s`.
    #: Additional actions of the operator; their times count from the fault.
    operator: tuple[TimedAction, ...] = ()
    #: Whether the faults exist before arming; times then count from the controller's being in
    #: charge.
    from_start: bool = False
    followed_s: FaultSpan = 4.0  #: Time for which the bus is followed after the fault.

    @property
    def on_bus(self) -> bool:
        """Whether the stimulus is visible on the bus at once."""
        return bool(self.inject or self.operator)

    @property
    def hardwired_stop(self) -> bool:
        """Whether only the hard-wired stop can remove the pressure."""
        return any(fault.beyond_commands for fault in self.inject)


class Expectation(Section):
    """Expected outcome of a trial."""

    reaction: Reaction
    codes: tuple[FaultName, ...] = ()  #: Accepted fault codes.
    elsewhere: tuple[FaultName, ...] = ()  #: Those that another ship may have besides.
    #: Faults that must also be alarms, and flags that CTRL_STATUS must set.
    also: tuple[FaultName | StatusFlag, ...] = ()
    #: Faults that may end a run after `Trial.followed_s`, while the roll is compared.
    may_end: tuple[FaultName, ...] = ()
    #: Whether the fault keeps the controller's frames off the bus, so that they are not judged.
    unheard: bool = False

    @property
    def latched(self) -> bool:
        """Whether the fault must end control for good."""
        return self.reaction in ("stop", "ramp")


class Limit(Section):
    """Deadlines of an expectation, and the largest permitted roll."""

    #: found_ms, halved_ms, zero_ms: deadlines from the fault on; without `zero_ms`,
    #: `firmware_sim.fault_campaign.verdict` has the limit.
    found_ms: Positive | None = None
    halved_ms: Positive | None = None
    zero_ms: Positive | None = None
    #: What `found_ms` follows from: another ship has her own. The times of such a row's faults go
    #: with the tank's period, too.
    follows: Literal["roll_budget", "tank_period"] | None = None
    #: Deviation from which times count, because the fault is invisible before it: the first
    #: deviation of a received value from the truth; a lasting deviation of the pump's pressure from
    #: its set-point; or the first roll of this size (`over_roll_rad`).
    counts_from: Annotated[dict[CountsFrom, Positive], Field(default_factory=dict, max_length=1)]
    #: Largest ratio of the roll variance to that of the passive ship; None where it is not judged.
    roll: Positive | None = 1.05
    #: Whether a ship whose pump went off at the fault's moment may stand for the passive one.
    beside_stop: bool = False
    #: Time over which the roll is compared, instead of the one for all rows.
    roll_window_s: FaultSpan | None = None


class Row(Section):
    """Fault with its expected outcome and its limits."""

    id: Annotated[str, Field(pattern=r"^[a-z0-9-]+$")]
    meets: Annotated[tuple[str, ...], Field(min_length=1)]
    fault: Annotated[Trial, Field(default_factory=Trial)]
    expect: Expectation
    limit: Annotated[Limit, Field(default_factory=lambda: Limit(counts_from={}))]

    @model_validator(mode="after")
    def _judged_by_something(self) -> "Row":
        followed_s = self.fault.followed_s
        problems = [
            (f"fault.inject.{place}.at_s", f"must be below followed_s, {followed_s:g}")
            for place, fault in enumerate(self.fault.inject)
            if fault.at_s >= followed_s
        ]
        if self.expect.reaction == "alarm" and not self.expect.codes:
            problems.append(("expect.codes", "are needed: which alarm is it?"))
        refuse("", problems)
        return self

    @property
    def long(self) -> bool:
        """Whether the row is so slow that it is run only in many seas, or by its name."""
        return self.fault.followed_s > LONG_S


def _each_setup(rows: Any) -> Any:
    """Append a copy of a row for each further setup of a list; names begin with the setup's."""
    further: list[Any] = []
    first: list[Any] = []
    for row in rows if isinstance(rows, list) else ():
        fault = row.get("fault") if isinstance(row, dict) else None
        names = fault.get("setup") if isinstance(fault, dict) else None
        if fault and isinstance(names, list) and names:
            row, *others = (
                row | {"id": f"{name}-{row.get('id')}", "fault": fault | {"setup": name}}
                for name in names
            )
            further += others
        first.append(row)
    return first + further if first else rows


class Campaign(Section):
    """Requirements and rows."""

    noun: ClassVar = "fault campaign"
    #: Earliest start of the faults; they begin up to a second later, see `fault_at_s`.
    fault_s: FaultTime
    arm_s: FaultTime  #: Time at which the operator arms.
    setups: dict[str, Setup]
    requirements: tuple[Requirement, ...]
    #: `setup` of a fault may be a list: a row for each, named by it (`sbg-silent`).
    rows: Annotated[tuple[Row, ...], BeforeValidator(_each_setup)]

    @model_validator(mode="after")
    def _consistent(self) -> "Campaign":
        known = [requirement.id for requirement in self.requirements]
        problems = [
            (f"{section}.{place}.id", "is there twice")
            for section, ids in (("rows", [row.id for row in self.rows]), ("requirements", known))
            for place, name in enumerate(ids)
            if ids.count(name) > 1
        ]
        problems += [
            (f"rows.{place}.meets", f"{name} is no requirement")
            for place, row in enumerate(self.rows)
            for name in row.meets
            if name not in known
        ]
        vessels = {name: setup.equipped.vessel for name, setup in self.setups.items()}
        for place, row in enumerate(self.rows):
            key, vessel = f"rows.{place}.fault", vessels.get(row.fault.setup)
            if vessel is None:
                problems.append((f"{key}.setup", f"must be one of {', '.join(vessels)}"))
            else:
                problems += missing_nodes(vessel, row.fault.inject, f"{key}.inject")
        met = {name for row in self.rows for name in row.meets}
        problems += [
            (f"requirements.{place}", "is shown by no row: add one, or say `elsewhere`")
            for place, requirement in enumerate(self.requirements)
            if requirement.id not in met and not requirement.elsewhere
        ]
        refuse("", problems)
        return self

    def fault_at_s(self, seed: int) -> float:
        """Start of the faults in the sea of a seed, at a different phase of the messages in each.

        Any hundred consecutive seeds cover each of the hundred ticks of the slowest cycle (1 s);
        any five cover each tick of a 50 ms cycle.
        """
        return self.fault_s + TICK_S * (_PHASE_STRIDE * seed % _PHASES)

    def chosen(self, names: Sequence[str]) -> list[Row]:
        """Rows whose name, or requirement, begins with one of the names; all rows without names."""
        return [row for row in self.rows if _begin((row.id, *row.meets), names)]

    def on(self, scenario: Scenario, controller: str) -> "Campaign":
        """Campaign with another ship in the place of that of the setup `COMMON`.

        Left are the rows of setups that change neither its parameters nor its devices, and of those
        with a CANopen drive where it has one, with faults that its nodes can have, as large for it
        as for the first (`own_ship`). Of a device without counters no single frame is missed.
        """
        common = self.setups[COMMON]
        bare = {"redundancy": common.redundancy, "commissioned": common.commissioned}
        drive = scenario.vessel.foreign.pump
        theirs = {
            name: setup.equipped.vessel.foreign.pump
            for name, setup in self.setups.items()
            if drive is not None and setup.model_copy(update={"devices": None}) == common
        }
        changed = {"scenario": scenario, "controller": controller, "devices": None}
        setups = {
            name: setup.model_copy(update=changed)
            for name, setup in self.setups.items()
            if setup.model_copy(update=bare) == common or theirs.get(name) is not None
        }
        vessels = {name: setup.equipped.vessel for name, setup in setups.items()}
        own = setups[COMMON]
        by = ratios((common.scenario, common.config), (own.scenario, own.config))
        # gaps that keep the water of so large a ship from being judged are silence
        gapless = GAP_PERIODS * thresholds(own.config).tank_period_s >= GAP_S
        rows = tuple(
            _resized(row, by, theirs.get(row.fault.setup), drive)
            for row in self.rows
            if (vessel := vessels.get(row.fault.setup)) is not None
            and not missing_nodes(vessel, row.fault.inject)
            and not (row.expect.reaction == "note" and _uncounted(vessel, row.fault.inject))
            and not (gapless and _gaps(row))
        )
        return self.model_copy(update={"setups": setups, "rows": rows})

    def asked_by(self, row: Row) -> str:
        """Text of the requirement that a row meets."""
        return " | ".join(each.text for each in self.requirements if each.id in row.meets)

    def shown_elsewhere(self, names: Sequence[str]) -> list[Requirement]:
        """Requirements with these names, or all, that tests verify and no row does."""
        return [each for each in self.requirements if each.elsewhere and _begin((each.id,), names)]


def _resized(row: Row, by: Ratios, first: DrivePlan | None, own: DrivePlan | None) -> Row:
    """A row for another ship; by a pressure that no command takes away it rolls as it may."""
    inject = tuple(resized(each, by) for each in row.fault.inject)
    if first is not None and own is not None:
        inject = tuple(renumbered(each, first, own) for each in inject)
    fault, expect, limit = row.fault, row.expect, row.limit
    found_ms = None if limit.follows == "roll_budget" else limit.found_ms
    times: dict[str, Any] = {"inject": inject}
    if limit.follows == "tank_period":
        found_ms = found_ms and by.period * found_ms
        inject = tuple(stretched(each, by) for each in inject)
        times = {"inject": inject, "followed_s": by.period * fault.followed_s}
    counts_from = {key: value * by.range.get(key, 1.0) for key, value in limit.counts_from.items()}
    roll = None if fault.hardwired_stop else limit.roll
    changed: dict[str, Any] = {
        "found_ms": found_ms, "counts_from": counts_from, "beside_stop": True, "roll": roll
    }  # fmt: skip
    if any(isinstance(each, Law) and each.fails in _AT_A_SAMPLE for each in inject):
        changed["found_ms"] = max(found_ms or 0.0, 1e3 * by.sample_s + _LATE_MS)
    parts = {
        "fault": fault.model_copy(update=times),
        "expect": expect.model_copy(update={"codes": expect.codes + expect.elsewhere}),
        "limit": limit.model_copy(update=changed),
    }
    return row.model_copy(update=parts)


def _gaps(row: Row) -> bool:
    return row.limit.follows == "tank_period" and any(
        isinstance(each, Lost) for each in row.fault.inject
    )


def _uncounted(vessel: Vessel, faults: Sequence[AnyFault]) -> bool:
    roles = filter(None, (foreign_role(vessel, fault) for fault in faults))
    return any(not getattr(vessel.devices, role).protection.counters for role in roles)


def _begin(own: Sequence[str], names: Sequence[str]) -> bool:
    return not names or any(each.startswith(tuple(names)) for each in own)
