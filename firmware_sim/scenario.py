"""Scenarios (``configs/scenarios``): configuration of the ship's side."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fmu_file import FmuFile
from firmware_sim.scenario_sea import ScenarioSea
from firmware_sim.scenario_sections import DriveLimits, RightingInWaves, SensorErrors
from firmware_sim.voyage import (
    Waypoint,
    moment_problems,
    ship_on_the_way,
    spectra_on_the_way,
    track,
    turning,
    unusual_loadings,
    unusual_sea,
    unusual_waypoints,
    waypoint_problems,
)
from firmware_sim.waves import PassingWaves, Response, SteadyWaves, Waves, beside
from firmware_sim.wind import Gusts
from utank_hil.base.parameters import (
    Finite,
    NotNegative,
    ParameterError,
    Problem,
    Range,
    refuse,
)
from utank_hil.configuration import ControllerConfig, Section, Vessel
from utank_hil.configuration.devices import UNGUARDED
from utank_hil.configuration.hull_files.reader import HullFile
from utank_hil.configuration.plausibility import tank_problems
from utank_hil.dynamics.hull.lateral import LateralHull, LateralModel
from utank_hil.dynamics.nonlinear import RollModel, steady_heel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.nodes.panel import TimedAction
from utank_hil.sea import Harmonics
from utank_hil.sea.sea import slope_per_m, wavenumber_rad_m

MOST_CONTROLLERS = 7
"""Most controllers: more runs with the passive one cannot be distinguished in a picture."""

PASSIVE = "passive"  #: Name of the run with the passive tank.

SAILED: Final = (
    "inertia_kg_m2",
    "stiffness_nm_rad",
    "damping_nms_rad",
    "quadratic_damping_nms2_rad2",
    "displacement_n",
    "offset_moment_nm",
    "wind_moment_nm",
)
"""Parameters of the ship that may differ from the vessel's; the last two heel it."""

SWAY: Final = "sway_of_slope"  #: Another one, which does not change under way.

LONGEST_S: Final = 86_400.0  #: Longest run in s, a day: its rows are kept in memory.

_OF_HULL: Final = ("sway_roll_yaw", "six_degrees")  # plants whose ship is `hull`
_GUSTS: Final = 1 << 32  # Beyond the seeds that other draws count up from a scenario's.
_TINY: Final = 1e-30  # Term that keeps a quotient finite on still water.
_NO_MOMENT: Final = 1e-9  # Share of the waves' slope below which they do not act on the ship.

# default limits of drive and high-level switch relative to pump and tank are the first ship's
_DRIVE_RATE_PER_PRESSURE: Final = 5.0
_HIGH_LEVEL_SHARE: Final = 4.6 / 4.88


def missing_nodes(vessel: Vessel, faults: Sequence[AnyFault], key: str = "faults") -> list[Problem]:
    """Problems of faults, listed at a key, of nodes that the ship does not have."""
    missing = {
        "drive": vessel.pump is None,
        "valve": vessel.valve is None,
        "sensors_2": not vessel.redundancy.second_motion_sensor,
        "hardwired": not vessel.redundancy.hardwired_inputs,
    }
    return [
        (f"{key}.{place}", f"can't be: the vessel has no {name}")
        for place, fault in enumerate(faults)
        for name in fault.node_names()
        if missing.get(name)
    ]


class Scenario(Section):
    """Ship in a sea, with the controllers to be tested there."""

    noun: ClassVar = "scenario"

    name: str
    vessel: Vessel
    sea: ScenarioSea
    sensors: Annotated[SensorErrors, Field(default_factory=dict, validate_default=True)]
    drive: Annotated[DriveLimits, Field(default_factory=dict, validate_default=True)]
    """Limits of the drive; those not given follow from the vessel's pump."""
    controllers: Annotated[
        dict[str, ControllerConfig], Field(default_factory=dict, max_length=MOST_CONTROLLERS)
    ]
    """Controllers to be run, at least one; optional where the vessel has no pump."""
    guard: bool = False
    """Whether a guard hears the frames and may cut the drive's power (docs/safety.md)."""
    operator: tuple[TimedAction, ...] = ()
    """Actions of the operator in the runs with a controller; the passive run is never armed."""
    duration_s: Annotated[float, Range(above=0, most=LONGEST_S)]
    settle_s: NotNegative  #: Time at the start that is left out of the statistics.
    seed: Annotated[int, Range(least=0)] = 1
    plant: Literal["roll", "linear", "sway_roll_yaw", "six_degrees", "fmu"] = "roll"
    """Equations of the emulated ship: roll, its small-motion limit, three or six degrees of `hull`,
    or those of another program in `fmu`."""
    hull: Annotated[HullFile | None, Field(validate_default=True)] = None
    """Hull data of the ship at rest, for the plants that sway; by default the vessel's."""
    fmu: FmuFile | None = None  #: Ship and tank of another program, for plant: fmu.
    actual_ship: dict[str, Finite] = Field(default_factory=dict)
    """Parameters of the actual ship that differ from the vessel's, on which the controller relies.

    Allowed keys are those of `SAILED`, and ``sway_of_slope``, which holds from the start."""
    actual_from_s: NotNegative = 0.0
    """Time at which the difference arises, as by shifted cargo or burnt fuel."""
    voyage: tuple[Waypoint, ...] = ()  #: Changes of course, speed, loading and sea under way.
    turning_lever_m: Annotated[float, Range(least=-20, most=20)] | None = None
    """Height of the centre of gravity above the force on the hull in a turn, some KG less half the
    draught: the ship heels outward in the turns of the voyage. Without it they do not heel it."""
    gusts: Gusts | None = None  #: Gusts about the steady wind of ``wind_moment_nm``.
    righting_in_waves: RightingInWaves | None = None
    """Change of the righting moment as waves pass along the hull, for plant: roll."""
    faults: tuple[AnyFault, ...] = ()
    """Faults in simulated runs with a controller; the passive run has none."""

    @field_validator("sensors", mode="before")
    @classmethod
    def _switch_below_the_roof(cls, sensors: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        if vessel is None or not isinstance(sensors, dict):
            return sensors
        return {"high_level_m": vessel.tank.level_limit_m * _HIGH_LEVEL_SHARE, **sensors}

    @field_validator("hull", mode="before")
    @classmethod
    def _of_the_vessel(cls, hull: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        sways = info.data.get("plant") in _OF_HULL
        return vessel.hull if hull is None and sways and vessel is not None else hull

    @field_validator("drive", mode="before")
    @classmethod
    def _as_the_pump_can(cls, drive: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        if vessel is None or vessel.pump is None or not isinstance(drive, dict):
            return drive
        pump, pressure_pa = vessel.pump, vessel.pump.max_pressure_pa
        rate_pa_s = min(_DRIVE_RATE_PER_PRESSURE * pressure_pa, pump.max_pressure_rate_pa_s)
        return {"pressure_pa": pressure_pa, "pressure_rate_pa_s": rate_pa_s, **drive}

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        problems = []
        if self.settle_s >= self.duration_s:
            reason = "must be less than duration_s, else nothing is left to judge"
            problems.append(("settle_s", reason))
        if self.vessel.pump is not None:
            if not self.controllers:
                problems.append(
                    ("controllers", "must have 1 or more, got 0, as the vessel has a pump")
                )
            if "operator" not in self.model_fields_set:
                problems.append(("operator", "is required but missing: who arms the controllers"))
        if self.guard and self.vessel.foreign.any:
            problems.append(("guard", f"can't be with devices: leave it out. {UNGUARDED}"))
        elif self.guard and self.vessel.pump is None:
            problems.append(("guard", "is for a ship with a pump: leave it out"))
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
            problems += self._controller_problems(name, controller)
        problems += self._weather_problems()
        refuse("", [*problems, *self._hull_problems(), *self._fmu_problems()])
        problems = [*self._ship_problems(), *self._sea_problems(), *self._voyage_problems()]
        refuse("", [*problems, *self._fault_problems()])
        return self

    @property
    def lateral_hull(self) -> LateralHull | None:
        """Hull of a plant that sways and yaws."""
        return None if self.hull is None else self.hull.hull

    @property
    def six(self) -> bool:
        """Whether the plant surges, heaves and pitches, too."""
        return self.plant == "six_degrees"

    def _of_plant(self, key: str, *plants: str) -> list[Problem]:
        """Reasons why a section and the only plants that have it do not go together."""
        if self.plant in plants:
            return [(key, f"is required with plant: {self.plant} but missing")]
        return [(key, f"needs plant: {' or '.join(plants)}")] if getattr(self, key) else []

    def _hull_problems(self) -> list[Problem]:
        """Reasons why the plant can't be that of the hull."""
        if self.hull is None or self.plant not in _OF_HULL:
            return self._of_plant("hull", *_OF_HULL)
        problems = []
        if self.voyage or len(self.sea.spectra) > 1:
            reason = "keeps course, speed and sea: remove voyage and sea.until, or take plant: roll"
            problems.append(("plant", f"is {self.plant}, which {reason}"))
        given = {"effective_slope", "roll_moment_table"} & self.sea.model_fields_set
        problems += [(f"sea.{key}", "and hull exclude each other: remove one") for key in given]
        try:
            LateralModel(self.hull.hull, self.sailing_ship, self.vessel.tank, self.six)
        except (OSError, ValueError) as error:
            problems.append(("hull", f"does not fit: {error}"))
        return problems

    def _weather_problems(self) -> list[Problem]:
        """Reasons why gusts, or turns, can't act on the ship."""
        problems, ship = [], {**asdict(self.vessel.ship), **self.actual_ship}
        if self.gusts is not None and ship["wind_moment_nm"] == 0:
            reason = "needs a steady wind: give actual_ship.wind_moment_nm, the moment of its mean"
            problems.append(("gusts", reason))
        if self.righting_in_waves is not None and self.plant != "roll":
            problems.append(("righting_in_waves", "needs plant: roll"))
        if self.turning_lever_m is None:
            return problems
        if not self.voyage:
            problems.append(("turning_lever_m", "is for a voyage with turns: leave it out"))
        if ship["displacement_n"] <= 0:
            reason = "needs the ship's mass: give actual_ship.displacement_n, its weight"
            problems.append(("turning_lever_m", reason))
        return problems

    def _fmu_problems(self) -> list[Problem]:
        """Reasons why the plant can't be that of the FMU."""
        if self.fmu is None or self.plant != "fmu":
            return self._of_plant("fmu", "fmu")
        problems = [
            (key, "does not act on the ship of an FMU: remove it; fmu.parameters change that")
            for key in ("actual_ship", "voyage", "gusts")
            if getattr(self, key)
        ]
        variables = self.fmu.variables
        for key, part, ours in (
            ("pressure_pa", "pump", self.vessel.pump),
            ("valve_loss_pa_s2_m2", "valve", self.vessel.valve),
        ):
            if (getattr(variables, key) is None) != (ours is None):
                verb = "is required" if ours is not None else "must be left out"
                has = "has a" if ours is not None else "has no"
                problems.append((f"fmu.variables.{key}", f"{verb}: the vessel {has} {part}"))
        return problems

    def figures(self) -> dict[str, float]:
        """Effect of the sea on the ship, in figures."""
        elevation, moment = self.sea.sea(self.seed).elevation, self.wave_moment(self.seed)
        moment_nm = math.sqrt(moment.variance)
        energy = elevation.amplitude * elevation.amplitude + _TINY  # still water has one, too
        return {
            "hs_m": 4 * math.sqrt(elevation.variance),
            "encounter_rad_s": float(np.average(elevation.frequency_rad_s, weights=energy)),
            "speed_kn": self.sea.speed_m_s * 3600 / 1852,
            "wave_moment_rms_nm": moment_nm,
            "static_roll_rms_rad": moment_nm / self.vessel.ship.stiffness_nm_rad,
        }

    def meaning(self) -> list[str]:
        """Description of `figures` in words."""
        figures = self.figures()
        changes = self.voyage or len(self.sea.spectra) > 1
        waves = "At the start, waves" if changes else "Waves"
        return [
            f"{waves} of {figures['hs_m']:.2f} m significant height, met at "
            f"{figures['encounter_rad_s']:.3g} rad/s and {figures['speed_kn']:.3g} knots; standing "
            f"still they would heel it {math.degrees(figures['static_roll_rms_rad']):.2g}° RMS."
        ]

    @property
    def sailing_ship(self) -> RollShip:
        """Ship from `actual_from_s` on."""
        return replace(self.vessel.ship, **self.actual_ship)  # type: ignore[arg-type]  # floats only

    def ship_at(self, time_s: float) -> RollShip:
        """Ship at a time since the start, under way."""
        ship = self.sailing_ship if time_s >= self.actual_from_s else self.vessel.ship
        ship = ship_on_the_way(self.voyage, ship, time_s)
        return ship.at_speed(self._speed_m_s(time_s))

    @property
    def _speed_m_s(self) -> Callable[[float], float]:
        return track(self.voyage, self.sea.speed_m_s, lambda point: point.speed_m_s)

    @property
    def turn_rad(self) -> Callable[[float], float]:
        """Turn of the ship to starboard since the start."""
        start_deg, is_course = self.sea.turn_deg
        name, sign = ("course_deg", 1.0) if is_course else ("heading_deg", -1.0)
        angle = track(self.voyage, start_deg, lambda point: getattr(point, name), angle=True)
        return lambda time_s: sign * math.radians(angle(time_s) - start_deg)

    @property
    def turning(self) -> Callable[[float], tuple[float, float]] | None:
        """Roll moment in N m and lateral acceleration over g of the ship's turns."""
        if self.turning_lever_m is None:
            return None
        mass_kg = self.sailing_ship.displacement_n / GRAVITY_M_S2
        return turning(self.turn_rad, self._speed_m_s, mass_kg, self.turning_lever_m)

    def waves(self, seed: int) -> Waves:
        """Waves that the ship meets."""
        spectra = spectra_on_the_way(self.voyage, self.sea.spectra)
        gusts = None
        if self.gusts is not None:  # drawn apart from waves and noise
            gusts = self.gusts.moment(self.sailing_ship.wind_moment_nm, seed + _GUSTS)
        if self.hull is not None:
            forces = self._hull_forces(seed)
            return SteadyWaves(*(forces if gusts is None else beside(forces, gusts, 1)))
        sway, changing = self.sailing_ship.sway_of_slope, self.righting_in_waves
        if sway is None and (changing is not None or self.turning_lever_m is not None):
            sway = 0.0  # a row for the lateral acceleration of turns
        if not self.voyage and len(spectra) <= 1:
            forces = [self.wave_moment(seed)]
            sea = self.sea.sea(seed)
            if sway is not None:
                forces.append(replace(sea.slope, amplitude=sway * sea.slope.amplitude))
            if changing is not None:
                change = changing.change_per_m(sea.omega_rad_s, sea.heading_rad)
                forces.append(sea.harmonics(sea.amplitude_m * change))
            return SteadyWaves(*(forces if gusts is None else beside(forces, gusts, 0)))
        responses: list[Response] = [self.sea.moment(self.vessel.ship.stiffness_nm_rad)]
        if sway is not None:
            responses.append(lambda omega, heading: sway * slope_per_m(omega, heading))
        if changing is not None:
            responses.append(changing.change_per_m)
        return PassingWaves(
            self.sea.passing_sea(spectra, seed), self.turn_rad, self._speed_m_s, *responses,
            gusts=gusts,
        )  # fmt: skip

    def _controller_problems(self, name: str, controller: ControllerConfig) -> list[Problem]:
        """Reasons why a controller would never arm, or the drive would refuse its commands."""
        problems = []
        if controller.vessel.version != self.vessel.version:
            reason = (
                f"is for another ship, {controller.vessel.name}: it would never arm on "
                f"{self.vessel.name}; name the same ship file in both"
            )
            problems.append((f"controllers.{name}", reason))
        limits, drive = controller.limits, self.drive
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

    def _fault_problems(self) -> list[Problem]:
        problems = missing_nodes(self.vessel, self.faults)
        if any(controller.retuning is not None for controller in self.controllers.values()):
            problems += [
                (f"faults.{place}", "can't be: a controller here retunes itself, its law changes")
                for place, fault in enumerate(self.faults)
                if fault.kind == "law"
            ]
        return problems

    def _ship_problems(self) -> list[Problem]:
        known = (*SAILED, SWAY)
        wrong = [key for key in self.actual_ship if key not in known]
        if wrong:
            reason = f"can't differ from the vessel's; it takes {', '.join(known)}"
            return [(f"actual_ship.{key}", reason) for key in wrong]
        try:
            unstable = tank_problems(self.sailing_ship, self.vessel.tank)
        except ParameterError as error:
            return [(f"actual_ship.{name}", reason) for name, reason in error.problems]
        if unstable:
            keys = ", ".join(self.actual_ship) or "it"
            return [("actual_ship", f"with {keys}, the tank {reason}") for _, reason in unstable]
        ships = {"vessel": self.vessel.ship}
        if self.actual_ship:
            ships["actual_ship"] = self.sailing_ship
        return [(key, why) for key, ship in ships.items() for why in self._heel_problems(ship)]

    def _heel_problems(self, ship: RollShip) -> list[str]:
        """Reasons why a steady heel is refused: no equilibrium, or water at the tank's roof."""
        if ship.heeling_moment_nm == 0:
            return []
        heel = steady_heel(RollModel(ship, self.vessel.tank))
        if heel is not None and not heel.at_the_end:
            return []
        remedy = f"lower {' or '.join(SAILED[-2:])}"
        if heel is None:
            return [f"capsizes the ship without a wave, as no righting moment holds it: {remedy}"]
        return [
            f"heels steadily by {math.degrees(abs(heel.roll_rad)):.0f} degrees, at which the "
            f"tank is full or empty at one side: {remedy}"
        ]

    def _sea_problems(self) -> list[Problem]:
        try:
            with np.errstate(all="ignore"):
                amplitudes = self.wave_moment(self.seed).amplitude
        except (ValueError, ArithmeticError, MemoryError) as error:
            return [("sea", f"can't be made: {error}")]
        if not np.isfinite(amplitudes).all():
            return [("sea", "has waves too large to compute: check height, period and slope")]
        if problems := moment_problems(self.sea, self.vessel.ship):
            return problems
        waves = self.sea.sea(self.seed)
        steep = (wavenumber_rad_m(waves.omega_rad_s) * waves.amplitude_m).sum()
        if np.abs(amplitudes).max() > _NO_MOMENT * self.vessel.ship.stiffness_nm_rad * steep:
            return []
        # still water is a valid sea, and a ship that turns meets these waves from the side
        turns = any(point.heading_deg is not None or point.course_deg is not None
                    for point in self.voyage)  # fmt: skip
        return self.sea.without_moment() if steep > 0 and not turns else []

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
        loadings = {f"voyage.{index}.ship": point.ship for index, point in enumerate(self.voyage)}
        loadings = {"actual_ship": self.actual_ship, **loadings}
        if self.fmu is not None:
            reason = (
                "has no ship without its tank: 'no tank' is the vessel by the bench's equations"
            )
            found.append(("fmu.file", reason))
        return [*found, *unusual_loadings(self.vessel, loadings)]

    def _voyage_problems(self) -> list[Problem]:
        problems = waypoint_problems(self.voyage, self.duration_s)
        wrong = "heading_deg" if self.sea.turn_deg[1] else "course_deg"
        right = "course_deg" if self.sea.turn_deg[1] else "heading_deg"
        for index, point in enumerate(self.voyage):
            at = f"voyage.{index}"
            if getattr(point, wrong) is not None:
                reason = f"does not go with this scenario's sea: give {right}"
                problems.append((f"{at}.{wrong}", reason))
            if point.sea is not None and len(self.sea.spectra) != 1:
                why = "regular" if not self.sea.spectra else "given by its own records (until)"
                problems.append((f"{at}.sea", f"can't follow: the scenario's sea is {why}"))
            elif point.sea is not None and self.sea.turn_deg[1]:
                why = "the scenario's sea has measured directions, a spectrum alone has none"
                problems.append((f"{at}.sea", f"can't follow: {why}"))
            problems += [
                (f"{at}.ship.{key}", f"can't change; it takes {', '.join(SAILED)}")
                for key in point.ship
                if key not in SAILED
            ]
        if problems:
            return problems
        for index, point in enumerate(self.voyage):
            try:
                unstable = tank_problems(self.ship_at(point.time_s), self.vessel.tank)
            except ParameterError as error:
                return [(f"voyage.{index}.ship.{name}", why) for name, why in error.problems]
            if unstable:
                keys = ", ".join(point.ship) or "it"
                return [(f"voyage.{index}.ship", f"with {keys}, the tank {unstable[0][1]}")]
            if point.ship:
                heels = self._heel_problems(self.ship_at(point.time_s))
                problems += [(f"voyage.{index}.ship", why) for why in heels]
        return problems

    def wave_moment(self, seed: int) -> Harmonics:
        """Roll moment of the initial sea on a ship that keeps its course."""
        if self.hull is not None:
            return self._hull_forces(seed)[1]
        return self.sea.roll_moment(self.sea.sea(seed), self.vessel.ship.stiffness_nm_rad)

    def _hull_forces(self, seed: int) -> list[Harmonics]:
        """Forces of the initial sea in the order of `LateralHull.forces`."""
        sea, hull = self.sea.sea(seed), self.lateral_hull
        assert hull is not None
        forces = hull.forces(sea.omega_rad_s, sea.heading_rad, six=self.six)
        return [sea.harmonics(sea.amplitude_m * force) for force in forces]
