"""Scenarios (``configs/scenarios``): configuration of the ship's side."""

from pydantic import model_validator

from firmware_sim.scenario_content import PASSIVE, ScenarioContent
from firmware_sim.scenario_problems import controller_problems, part_problems, whole_problems
from firmware_sim.voyage import unusual_loadings, unusual_sea, unusual_waypoints
from utank_hil.base.parameters import Problem, refuse
from utank_hil.canbus.profiles.guarded import guard_parts
from utank_hil.configuration import Vessel
from utank_hil.dynamics.hull.radiation import GOOD_FIT


def guard_problem(vessel: Vessel) -> str:
    """Why a ship can have no guard; empty if it can."""
    if vessel.pump is None:
        return "is for a ship with a pump: leave it out"
    try:
        guard_parts(vessel.foreign)
    except ValueError as error:
        return f"must be left out: {error}"
    return ""


class Scenario(ScenarioContent):
    """Ship in a sea, with the controllers to be tested there."""

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        problems = []
        if self.settle_s >= self.duration_s:
            reason = (
                f"is {self.settle_s:g}, must be less than duration_s, {self.duration_s:g}, else "
                "nothing is left to judge: both are in seconds"
            )
            problems.append(("settle_s", reason))
        if self.vessel.pump is not None:
            if not self.controllers:
                problems.append(
                    ("controllers", "must have 1 or more, got 0, as the vessel has a pump")
                )
            if "operator" not in self.model_fields_set:
                problems.append(("operator", "is required but missing: who arms the controllers"))
        if self.guard and (reason := guard_problem(self.vessel)):
            problems.append(("guard", reason))
        if self.plant == "linear" and self.vessel.valve is not None:
            reason = (
                "is linear, but the loss of the vessel's valve is quadratic and would change "
                "nothing: leave it out, or take a vessel without a valve"
            )
            problems.append(("plant", reason))
        if PASSIVE in self.controllers:
            reason = (
                "names one 'passive', the run without a controller that is always made: rename it"
            )
            problems.append(("controllers", reason))
        for name, controller in self.controllers.items():
            if "/" in name:
                reason = f"names one {name!r}: files are named by it, so it can't be a path"
                problems.append(("controllers", reason))
            problems += controller_problems(self, name, controller)
        refuse("", [*problems, *part_problems(self)])
        refuse("", whole_problems(self))
        return self

    def warnings(self) -> list[Problem]:
        """Warnings of unusual values in vessel and sea, and of what they imply together."""
        parts = {"vessel": self.vessel, "sea": self.sea} | {
            f"voyage.{index}.sea": point.sea
            for index, point in enumerate(self.voyage)
            if point.sea is not None
        }
        found = [
            (f"{name}.{key}", reason)
            for name, part in parts.items()
            for key, reason in part.warnings()
        ]
        figures = self.figures()
        hs_m, roll_rad = figures["hs_m"], figures["static_roll_rms_rad"]
        found += unusual_sea(self.sea, self.vessel.ship, hs_m, roll_rad)
        found += unusual_waypoints(self.voyage, hs_m)
        late = {f"operator.{i}.time_s": each.time_s for i, each in enumerate(self.operator)}
        late |= {f"faults.{i}.at_s": each.at_s for i, each in enumerate(self.faults)}
        found += [
            (key, f"is {time_s:g}, after duration_s")
            for key, time_s in late.items()
            if time_s > self.duration_s
        ]
        if (hull := self.lateral_hull) is not None:
            found += [
                ("hull", f"has radiation of {motions} that the memory fitted to it misses by "
                 f"{error:.1%}, more than {GOOD_FIT:.0%}: is it smooth over the frequency?")
                for motions, error in hull.memory_errors(six=self.six).items()
                if error > GOOD_FIT
            ]  # fmt: skip
        loadings = {f"voyage.{index}.ship": point.ship for index, point in enumerate(self.voyage)}
        loadings = {"actual_ship": self.actual_ship, **loadings}
        if self.fmu is not None:
            reason = (
                "has no ship without its tank: 'no tank' is the vessel by the bench's equations"
            )
            found.append(("fmu.file", reason))
        return [*found, *unusual_loadings(self.vessel, loadings)]
