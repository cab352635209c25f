"""Problems of a scenario: what its sections and the ship's make impossible together."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

import numpy as np

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.scenario_content import HEELED, OF_HULL, SAILED, SWAY, ScenarioContent
from firmware_sim.voyage import moment_problems, waypoint_problems
from utank_hil.base.parameters import ParameterError, Problem
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.configuration.plausibility import tank_problems
from utank_hil.dynamics.hull.lateral import LateralModel
from utank_hil.dynamics.nonlinear import RollModel, steady_heel
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea.sea import wavenumber_rad_m

_NO_MOMENT: Final = 1e-9  # Share of the waves' slope below which they do not act on the ship.


def missing_nodes(vessel: Vessel, faults: Sequence[AnyFault], key: str = "faults") -> list[Problem]:
    """Problems of faults, listed at a key, of nodes that the ship does not have."""
    missing = {
        "drive": vessel.pump is None,
        "valve": vessel.valve is None,
        "sensors_2": not vessel.redundancy.second_motion_sensor,
        "hardwired": not vessel.redundancy.hardwired_inputs,
        "preview": vessel.preview is None,
    }
    problems = [
        (f"{key}.{place}", f"can't be: the vessel has no {name}")
        for place, fault in enumerate(faults)
        for name in fault.node_names()
        if missing.get(name)
    ]
    for place, fault in enumerate(faults):
        role = foreign_role(vessel, fault)
        if role and (getattr(fault, "of_catalogue", False) or role == "pump"):
            problems.append(
                (f"{key}.{place}", f"can't be: devices.{role} sends no {fault.spoiled_message}; "
                 "take kind lost, frozen or value of what is measured, or lost_identifier")
            )  # fmt: skip
    return problems


_ROLE_OF: Final = {
    "SENSOR_MOTION": "motion", "SENSOR_MOTION_2": "motion_2", "SENSOR_TANK": "levels",
    "SENSOR_PUMP": "pump_sensor", "VALVE_STATUS": "valve", "OPERATOR_CMD": "panel",
    **dict.fromkeys(("DRIVE_STATUS_1", "DRIVE_STATUS_2", "PUMP_CMD"), "pump"),
}  # fmt: skip


def foreign_role(vessel: Vessel, fault: AnyFault) -> str:
    """The ship's device of another maker whose message a fault spoils; empty if it is none."""
    role = _ROLE_OF.get(fault.spoiled_message or "", "")
    there = role and vessel.devices is not None and not getattr(vessel.devices, role).native
    return role if there else ""


def part_problems(scenario: ScenarioContent) -> list[Problem]:
    """Problems of the sections by themselves."""
    return [
        *_weather_problems(scenario),
        *_hull_problems(scenario),
        *_fmu_problems(scenario),
        *_preview_problems(scenario),
    ]


def whole_problems(scenario: ScenarioContent) -> list[Problem]:
    """Problems of ship, sea, voyage and faults together, of a scenario whose sections are right."""
    return [
        *_ship_problems(scenario),
        *_device_problems(scenario),
        *_sea_problems(scenario),
        *_voyage_problems(scenario),
        *_fault_problems(scenario),
    ]


def controller_problems(
    scenario: ScenarioContent, name: str, controller: ControllerConfig
) -> list[Problem]:
    """Reasons why a controller would never arm, or the drive would refuse its commands."""
    problems = []
    if controller.vessel.version != scenario.vessel.version:
        reason = (
            f"is for another ship, {controller.vessel.name}: it would never arm on "
            f"{scenario.vessel.name}; name the same ship file in both"
        )
        problems.append((f"controllers.{name}", reason))
    limits, drive = controller.limits, scenario.drive
    timeout_ms = controller.command_timeout_ms
    for key, taken, sender, sent in (
        ("pressure_pa", drive.pressure_pa, "limits.pressure_pa", limits.pressure_pa),
        ("pressure_rate_pa_s", drive.pressure_rate_pa_s, "limits.rate_pa_s", limits.rate_pa_s),
        ("longest_timeout_ms", drive.longest_timeout_ms, "command_timeout_ms", timeout_ms),
    ):
        if sent > taken:
            reason = (
                f"takes {taken:g} at most, but controllers.{name}.{sender} is {sent:g}: "
                "lower that, or raise this"
            )
            problems.append((f"drive.{key}", reason))
    return problems


def _of_plant(scenario: ScenarioContent, key: str, *plants: str) -> list[Problem]:
    """Reasons why a section and the only plants that have it do not go together."""
    if scenario.plant in plants:
        return [(key, f"is required with plant: {scenario.plant} but missing")]
    return [(key, f"needs plant: {' or '.join(plants)}")] if getattr(scenario, key) else []


def _hull_problems(scenario: ScenarioContent) -> list[Problem]:
    if scenario.hull is None or scenario.plant not in OF_HULL:
        return _of_plant(scenario, "hull", *OF_HULL)
    problems = []
    for index, point in enumerate(scenario.voyage):
        reason = f"can't change: the hull data are of one loading; it takes {', '.join(HEELED)}"
        problems += [
            (f"voyage.{index}.ship.{key}", reason) for key in point.ship if key not in HEELED
        ]
    given = {"effective_slope", "roll_moment_table"} & scenario.sea.model_fields_set
    problems += [(f"sea.{key}", "remove it: the hull data of the ship say so") for key in given]
    try:
        hull = scenario.hull.hull
        LateralModel(hull, scenario.sailing_ship, scenario.vessel.tank, scenario.six)
    except (OSError, ValueError) as error:
        return [*problems, ("hull", f"does not fit: {error}")]
    if scenario.voyage:
        around = np.radians(np.arange(0.0, 360.0, 5.0))
        try:
            hull.forces(np.full(around.shape, hull.about_g.wave_frequency_rad_s[0]), around)
        except ValueError as error:
            problems.append(("voyage", f"needs hull data at all headings: {error}"))
    return problems


def _weather_problems(scenario: ScenarioContent) -> list[Problem]:
    problems, ship = [], {**asdict(scenario.vessel.ship), **scenario.actual_ship}
    if scenario.gusts is not None and ship["wind_moment_nm"] == 0:
        reason = "needs a steady wind: give actual_ship.wind_moment_nm, the moment of its mean"
        problems.append(("gusts", reason))
    if scenario.righting_in_waves is not None and scenario.plant == "fmu":
        problems.append(("righting_in_waves", "does not act on the ship of an FMU: remove it"))
    if scenario.turning_lever_m is None:
        return problems
    if not scenario.voyage:
        problems.append(("turning_lever_m", "is for a voyage with turns: leave it out"))
    if ship["displacement_n"] <= 0:
        reason = "needs the ship's mass: give actual_ship.displacement_n, its weight"
        problems.append(("turning_lever_m", reason))
    return problems


def _fmu_problems(scenario: ScenarioContent) -> list[Problem]:
    if scenario.fmu is None or scenario.plant != "fmu":
        return _of_plant(scenario, "fmu", "fmu")
    problems = [
        (key, "does not act on the ship of an FMU: remove it; fmu.parameters change that")
        for key in ("actual_ship", "voyage", "gusts")
        if getattr(scenario, key)
    ]
    variables = scenario.fmu.variables
    for key, part, ours in (
        ("pressure_pa", "pump", scenario.vessel.pump),
        ("valve_loss_pa_s2_m2", "valve", scenario.vessel.valve),
    ):
        if (getattr(variables, key) is None) != (ours is None):
            verb = "is required" if ours is not None else "must be left out"
            has = "has a" if ours is not None else "has no"
            problems.append((f"fmu.variables.{key}", f"{verb}: the vessel {has} {part}"))
    return problems


def _preview_problems(scenario: ScenarioContent) -> list[Problem]:
    """Reasons why the waves can't be forecast."""
    if scenario.vessel.preview is None:
        wrong = [("preview", "needs a station: give the ship preview: {}")]
        return [] if scenario.preview is None else wrong
    if scenario.voyage or len(scenario.sea.spectra) > 1 or scenario.hull is not None:
        reason = "is emulated on a ship that keeps course, speed and sea, and does not sway"
        return [("vessel.preview", f"{reason}: leave it out, or remove voyage, sea.until and hull")]
    return []


def _ship_problems(scenario: ScenarioContent) -> list[Problem]:
    known = (*SAILED, SWAY)
    wrong = [key for key in scenario.actual_ship if key not in known]
    if wrong:
        reason = f"can't differ from the vessel's; it takes {', '.join(known)}"
        return [(f"actual_ship.{key}", reason) for key in wrong]
    try:
        unstable = tank_problems(scenario.sailing_ship, scenario.vessel.tank)
    except ParameterError as error:
        return [(f"actual_ship.{name}", reason) for name, reason in error.problems]
    if unstable:
        keys = ", ".join(scenario.actual_ship) or "it"
        return [("actual_ship", f"with {keys}, the tank {reason}") for _, reason in unstable]
    ships = {"vessel": scenario.vessel.ship}
    if scenario.actual_ship:
        ships["actual_ship"] = scenario.sailing_ship
    return [(key, why) for key, ship in ships.items() for why in _heel_problems(scenario, ship)]


def _device_problems(scenario: ScenarioContent) -> list[Problem]:
    foreign = scenario.vessel.foreign
    reason = "must be 10 or more in a scenario: no emulated device sends twice in a tick"
    plans = (*foreign.motions, foreign.levels, foreign.pump_sensor, foreign.valve, foreign.panel)
    return [
        (f"vessel.devices.{plan.name}.cycle_ms", f"{reason}; on board it may be less")
        for plan in plans
        if plan is not None and any(each.cycle_ns < TICK_NS for each in plan.messages)
    ]


def _heel_problems(scenario: ScenarioContent, ship: RollShip) -> list[str]:
    """Reasons why a steady heel is refused: no equilibrium, or water at the tank's roof."""
    if ship.heeling_moment_nm == 0:
        return []
    heel = steady_heel(RollModel(ship, scenario.vessel.tank))
    if heel is not None and not heel.at_the_end:
        return []
    remedy = f"lower {' or '.join(HEELED)}"
    if heel is None:
        return [f"capsizes the ship without a wave, as no righting moment holds it: {remedy}"]
    return [
        f"heels steadily by {math.degrees(abs(heel.roll_rad)):.0f} degrees, at which the "
        f"tank is full or empty at one side: {remedy}"
    ]


def _sea_problems(scenario: ScenarioContent) -> list[Problem]:
    try:
        with np.errstate(all="ignore"):
            amplitudes = scenario.wave_moment(scenario.seed).amplitude
    except (ValueError, ArithmeticError, MemoryError) as error:
        return [("sea", f"can't be made: {error}")]
    if not np.isfinite(amplitudes).all():
        return [("sea", "has waves too large to compute: check height, period and slope")]
    if problems := moment_problems(scenario.sea, scenario.vessel.ship):
        return problems
    waves = scenario.sea.sea(scenario.seed)
    steep = (wavenumber_rad_m(waves.omega_rad_s) * waves.amplitude_m).sum()
    if np.abs(amplitudes).max() > _NO_MOMENT * scenario.vessel.ship.stiffness_nm_rad * steep:
        return []
    # still water is a valid sea, and a ship that turns meets these waves from the side
    turns = any(point.heading_deg is not None or point.course_deg is not None
                for point in scenario.voyage)  # fmt: skip
    return scenario.sea.without_moment() if steep > 0 and not turns else []


def _voyage_problems(scenario: ScenarioContent) -> list[Problem]:
    problems = waypoint_problems(scenario.voyage, scenario.duration_s)
    wrong = "heading_deg" if scenario.sea.turn_deg[1] else "course_deg"
    right = "course_deg" if scenario.sea.turn_deg[1] else "heading_deg"
    for index, point in enumerate(scenario.voyage):
        at = f"voyage.{index}"
        if getattr(point, wrong) is not None:
            reason = f"does not go with this scenario's sea: give {right}"
            problems.append((f"{at}.{wrong}", reason))
        if point.sea is not None and len(scenario.sea.spectra) != 1:
            own = "given by its own records (until)"
            why = own if scenario.sea.spectra else "given wave by wave"
            problems.append((f"{at}.sea", f"can't follow: the scenario's sea is {why}"))
        elif point.sea is not None and scenario.sea.turn_deg[1]:
            why = "the scenario's sea has measured directions, a spectrum alone has none"
            problems.append((f"{at}.sea", f"can't follow: {why}"))
        problems += [
            (f"{at}.ship.{key}", f"can't change; it takes {', '.join(SAILED)}")
            for key in point.ship
            if key not in SAILED
        ]
    if problems:
        return problems
    for index, point in enumerate(scenario.voyage):
        try:
            unstable = tank_problems(scenario.ship_at(point.time_s), scenario.vessel.tank)
        except ParameterError as error:
            return [(f"voyage.{index}.ship.{name}", why) for name, why in error.problems]
        if unstable:
            keys = ", ".join(point.ship) or "it"
            return [(f"voyage.{index}.ship", f"with {keys}, the tank {unstable[0][1]}")]
        if point.ship:
            heels = _heel_problems(scenario, scenario.ship_at(point.time_s))
            problems += [(f"voyage.{index}.ship", why) for why in heels]
    return problems


def _fault_problems(scenario: ScenarioContent) -> list[Problem]:
    problems = missing_nodes(scenario.vessel, scenario.faults)
    if any(controller.retuning is not None for controller in scenario.controllers.values()):
        problems += [
            (f"faults.{place}", "can't be: a controller here retunes itself, its law changes")
            for place, fault in enumerate(scenario.faults)
            if fault.kind == "law"
        ]
    return problems
