"""The campaign as a configuration: requirements, and the rows that show that they are met."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, model_validator

from firmware_sim.fault_injection.fault import FaultSpan, FaultTime
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.scenario import Scenario, missing_nodes
from utank_hil.base.parameters import Finite, Positive, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import Fault
from utank_hil.configuration import ControllerConfig, Section
from utank_hil.nodes.panel import TimedAction
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.retuning import EstimateSettings

LONG_S: Final = 300.0
"""A row that is followed for longer takes more than a minute of CPU time in one sea."""
_PHASES: Final = 100
"""Ticks in a second, the slowest cycle of a message."""
_PHASE_STRIDE: Final = 37
"""Ticks from one seed's fault to the next one's: prime to 100 and to 5."""


def _fault_name(name: str) -> str:
    if name not in Fault.__members__:
        raise ValueError("is no fault of utank_hil/safety/faults.py")
    return name


FaultName = Annotated[str, AfterValidator(_fault_name)]

CountsFrom = Literal["roll_rad", "roll_rate_rad_s", "level_m", "pressure_pa", "over_roll_rad"]
StatusFlag = Literal["degraded", "saturated"]
Reaction = Literal["stop", "ramp", "halve", "alarm", "note", "none", "refuse", "drive"]
"""What a row may ask for.

Zero pressure at once, latched; a ramp to zero, latched; half the pressure with an alarm; an alarm
while control goes on; a frame discarded or counted; nothing, as of a sound ship; no arming; a drive
or valve that stops by itself.
"""


class Requirement(Section):
    """A row of the fault table that is asked for, or a line of the trials of an earlier version."""

    id: str
    fault: str
    found_by: str = ""
    within: str = ""
    reaction: str = ""
    elsewhere: str = ""
    """What shows it, where no row of the campaign does."""


class Setup(Section):
    """A ship in a sea with one of the scenario's controllers.

    Attributes
    ----------
    actual_ship : dict of str to float
        What the ship is from the moment of the fault on, keys as in a scenario.
    redundancy : Redundancy
        What the ship has beside what the scenario's vessel has.
    displacement_n, least_gm_m : float, optional
        Of the ship, instead of the vessel's.
    sea_estimate : EstimateSettings, optional
        Instead of the controller's.
    commissioned : bool
        Whether the controller may be armed.
    """

    scenario: Scenario
    controller: str
    actual_ship: Annotated[dict[str, Finite], Field(default_factory=dict)]
    redundancy: Redundancy = NO_REDUNDANCY
    displacement_n: Positive | None = None
    least_gm_m: Positive | None = None
    sea_estimate: EstimateSettings | None = None
    commissioned: bool = True

    @property
    def equipped(self) -> Scenario:
        """The scenario with the setup's changes in it."""
        scenario, own = self.scenario, self.scenario.vessel
        weight_n = self.displacement_n or own.ship.displacement_n
        vessel = own.model_copy(
            update={
                "redundancy": self.redundancy,
                "ship": replace(own.ship, displacement_n=weight_n),
                "least_gm_m": self.least_gm_m or own.least_gm_m,
            }
        )
        controllers = {
            name: config.model_copy(
                update={"vessel": vessel, "sea_estimate": self.sea_estimate or config.sea_estimate}
            )
            for name, config in scenario.controllers.items()
        }
        return scenario.model_copy(update={"vessel": vessel, "controllers": controllers})

    @property
    def config(self) -> ControllerConfig:
        """The controller's."""
        return self.equipped.controllers[self.controller]

    def scenario_of(self, fault_s: float) -> Scenario:
        """The scenario with what the ship is from the fault on."""
        scenario = self.equipped
        if not self.actual_ship:
            return scenario
        return scenario.model_copy(
            update={"actual_ship": self.actual_ship, "actual_from_s": fault_s}
        )

    @model_validator(mode="after")
    def _known(self) -> "Setup":
        names = list(self.scenario.controllers)
        if self.controller not in names:
            refuse("", [("controller", f"must be one of {', '.join(names)}")])
        return self


class Trial(Section):
    """What is done to a ship under way.

    Attributes
    ----------
    setup : str
        One of `Campaign.setups`.
    inject : tuple
        Faults; their times count from `Campaign.fault_at_s`.
    operator : tuple of TimedAction
        What the operator does besides; times after the fault began.
    from_start : bool
        The faults are there before anybody arms. Times count from when the controller is in charge.
    followed_s : float
        How long the bus is followed after the fault.
    """

    setup: str = "pump"
    inject: tuple[AnyFault, ...] = ()
    operator: tuple[TimedAction, ...] = ()
    from_start: bool = False
    followed_s: FaultSpan = 4.0

    @property
    def on_bus(self) -> bool:
        """Whether what it does is seen on the bus at once."""
        return bool(self.inject or self.operator)

    @property
    def hardwired_stop(self) -> bool:
        """Whether the pressure can only be taken away by the hard-wired stop."""
        return any(fault.beyond_commands for fault in self.inject)


class Expectation(Section):
    """What is to come of a trial.

    Attributes
    ----------
    codes : tuple of str
        Faults that it may be called.
    also : tuple of str
        Faults that have to be alarms as well, and flags that CTRL_STATUS has to set.
    may_end : tuple of str
        Faults in which a run may end later than `Trial.followed_s`, in the minutes of the roll.
    unheard : bool
        The fault keeps the controller's frames from the bus: what they say is not judged.
    """

    reaction: Reaction
    codes: tuple[FaultName, ...] = ()
    also: tuple[FaultName | StatusFlag, ...] = ()
    may_end: tuple[FaultName, ...] = ()
    unheard: bool = False

    @property
    def latched(self) -> bool:
        """Whether the fault has to end control for good."""
        return self.reaction in ("stop", "ramp")


class Limit(Section):
    """When the expectation has to be met at the latest, and how much the ship may roll.

    Attributes
    ----------
    found_ms, halved_ms, zero_ms : float, optional
        From the fault on. `firmware_sim.fault_campaign.verdict` has what holds without the last.
    counts_from : dict of str to float
        Times count from when what the controller received of this is first so far from the truth:
        before, the fault does not show. Or from when the pump's pressure is so far from its
        set-point and stays so, or from when the ship first rolls so far (`over_roll_rad`).
    roll : float
        Variance of the roll over the passive ship's.
    roll_window_s : float, optional
        Over which the roll is compared, instead of what all rows have.
    """

    found_ms: Positive | None = None
    halved_ms: Positive | None = None
    zero_ms: Positive | None = None
    counts_from: Annotated[dict[CountsFrom, Positive], Field(default_factory=dict, max_length=1)]
    roll: Positive = 1.05
    roll_window_s: FaultSpan | None = None


class Row(Section):
    """A fault, what is to come of it, and within which limits."""

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
        """Whether it takes so long that it is run in many seas, or by its name, only."""
        return self.fault.followed_s > LONG_S


class LiveRow(Section):
    """A fault that needs processes and a CAN interface.

    Attributes
    ----------
    does : str
        Name in `firmware_sim.fault_campaign.live.ACTIONS`; empty where it is shown
        elsewhere.
    judged : str
        Whether the controller's fault or the drive's end counts.
    elsewhere : str
        What shows it, where the campaign does not run it.
    """

    id: Annotated[str, Field(pattern=r"^live-[a-z0-9-]+$")]
    meets: Annotated[tuple[str, ...], Field(min_length=1)]
    does: str = ""
    judged: Literal["found", "zero"] = "zero"
    within_ms: Positive | None = None
    elsewhere: str = ""


class Campaign(Section):
    """Requirements and rows.

    Attributes
    ----------
    fault_s : float
        When the faults begin, or up to a second later: see `fault_at_s`.
    arm_s : float
        When the operator arms.
    """

    fault_s: FaultTime
    arm_s: FaultTime
    setups: dict[str, Setup]
    requirements: tuple[Requirement, ...]
    rows: tuple[Row, ...]
    live: tuple[LiveRow, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> "Campaign":
        known = [requirement.id for requirement in self.requirements]
        every: list[tuple[str, Sequence[Row | LiveRow]]]
        every = [("rows", self.rows), ("live", self.live)]
        ids = [row.id for _, rows in every for row in rows]
        problems = [
            (f"{key}.{place}.id", "is there twice")
            for key, rows in every
            for place, row in enumerate(rows)
            if ids.count(row.id) > 1
        ]
        problems += [
            (f"requirements.{place}.id", "is there twice")
            for place, name in enumerate(known)
            if known.count(name) > 1
        ]
        problems += [
            (f"{key}.{place}.meets", f"{name} is no requirement")
            for key, rows in every
            for place, row in enumerate(rows)
            for name in row.meets
            if name not in known
        ]
        vessels = {name: setup.equipped.vessel for name, setup in self.setups.items()}
        for place, row in enumerate(self.rows):
            if row.fault.setup not in vessels:
                known_setups = ", ".join(vessels)
                problems.append((f"rows.{place}.fault.setup", f"must be one of {known_setups}"))
                continue
            key = f"rows.{place}.fault.inject"
            problems += missing_nodes(vessels[row.fault.setup], row.fault.inject, key)
        met = {name for _, rows in every for row in rows for name in row.meets}
        problems += [
            (f"requirements.{place}", "is shown by no row: add one, or say `elsewhere`")
            for place, requirement in enumerate(self.requirements)
            if requirement.id not in met and not requirement.elsewhere
        ]
        refuse("", problems)
        return self

    def fault_at_s(self, seed: int) -> float:
        """When the faults begin in the sea of a seed: in each at another phase of the messages.

        Any hundred seeds in a row have each of the hundred ticks of the slowest cycle, a second;
        any five have each tick of a cycle of 50 ms.
        """
        return self.fault_s + TICK_S * (_PHASE_STRIDE * seed % _PHASES)

    def chosen(self, names: Sequence[str]) -> tuple[list[Row], list[LiveRow]]:
        """Rows whose name, or what they meet, begins with one of the names; all without any."""

        def matches(row: Row | LiveRow) -> bool:
            return any(_begins(own, names) for own in (row.id, *row.meets))

        return [row for row in self.rows if matches(row)], [
            row for row in self.live if matches(row)
        ]

    def asked_by(self, row: Row | LiveRow) -> str:
        """What a row meets, in words."""
        texts = []
        for each in self.requirements:
            if each.id in row.meets:
                parts = [each.fault, each.found_by, each.within, each.reaction]
                texts.append(f"{each.id}: " + "; ".join(part for part in parts if part))
        return " | ".join(texts)

    def shown_elsewhere(self, names: Sequence[str]) -> list[Requirement]:
        """Requirements of these names, or all, that tests show and no row does."""
        return [each for each in self.requirements if each.elsewhere and _begins(each.id, names)]


def _begins(own: str, names: Sequence[str]) -> bool:
    return not names or own.startswith(tuple(names))
