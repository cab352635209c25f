"""Content of a scenario: ship, sea, controllers, and what follows from them."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.fmu_file import FmuFile
from firmware_sim.scenario_sea import ScenarioSea
from firmware_sim.scenario_sections import DriveLimits, Forecasts, RightingInWaves, SensorErrors
from firmware_sim.voyage import Waypoint, ship_on_the_way, spectra_on_the_way, track, turning
from firmware_sim.waves import (
    PassingWaves,
    Response,
    SteadyWaves,
    Waves,
    beside,
    responses_of,
)
from firmware_sim.wind import Gusts
from utank_hil.base.parameters import Finite, NotNegative, Range
from utank_hil.configuration import ControllerConfig, Section, Vessel
from utank_hil.configuration.hull_files.reader import HullFile
from utank_hil.dynamics.hull.lateral import LateralHull
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.nodes.panel import TimedAction
from utank_hil.sea import Harmonics
from utank_hil.sea.sea import slope_per_m

MOST_CONTROLLERS = 7
"""Most controllers: more runs with the passive one cannot be distinguished in a picture."""

PASSIVE = "passive"  #: Name of the run with the passive tank.

HEELED: Final = ("offset_moment_nm", "wind_moment_nm")  #: Moments that heel a ship steadily.
SAILED: Final = (
    "inertia_kg_m2",
    "stiffness_nm_rad",
    "damping_nms_rad",
    "quadratic_damping_nms2_rad2",
    "displacement_n",
    *HEELED,
)  #: Parameters of the ship that may differ from the vessel's.

SWAY: Final = "sway_of_slope"  #: Another one, which does not change under way.

OF_HULL: Final = ("sway_roll_yaw", "six_degrees")  # plants whose ship is `hull`

REALISATIONS: Final = 16  #: In one sum: a lightly damped ship needs a fine spectrum. Chosen.
LONGEST_S: Final = 86_400.0  #: Longest run in s, a day: its rows are kept in memory.

_GUSTS: Final = 1 << 32  # Beyond the seeds that other draws count up from a scenario's.
_TINY: Final = 1e-30  # Term that keeps a quotient finite on still water.

# default limits of drive and high-level switch relative to pump and tank are the first ship's
_DRIVE_RATE_PER_PRESSURE: Final = 5.0
_HIGH_LEVEL_SHARE: Final = 4.6 / 4.88


class ScenarioContent(Section):
    """Sections of a scenario, and what they mean together; `Scenario` judges them."""

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
    preview: Forecasts | None = None
    """What the vessel's preview station knows; by default 5 s, with an error of half the waves."""
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
    """Change of the righting moment as waves pass along the hull; not for plant: fmu."""
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
        sways = info.data.get("plant") in OF_HULL
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

    @property
    def lateral_hull(self) -> LateralHull | None:
        """Hull of a plant that sways and yaws."""
        return None if self.hull is None else self.hull.hull

    @property
    def six(self) -> bool:
        """Whether the plant surges, heaves and pitches, too."""
        return self.plant == "six_degrees"

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
        of_gusts = 0 if self.hull is None else 1
        if not self.voyage and len(spectra) <= 1:
            forces = [*self._forces(seed), *self._righting_change(seed)]
            return SteadyWaves(*(forces if gusts is None else beside(forces, gusts, of_gusts)))
        responses = self._responses()
        if self.righting_in_waves is not None:
            responses.append(self.righting_in_waves.change_per_m)
        return PassingWaves(
            self.sea.passing_sea(spectra, seed), self.turn_rad, self._speed_m_s, *responses,
            gusts=gusts, of_gusts=of_gusts,
        )  # fmt: skip

    @property
    def _sway_of_slope(self) -> float | None:
        """Sway of a ship without hull data; 0 for a row that turns, or what follows it, need."""
        sway = self.sailing_ship.sway_of_slope
        needed = self.righting_in_waves is not None or self.turning_lever_m is not None
        return 0.0 if sway is None and needed else sway

    def _forces(self, seed: int) -> list[Harmonics]:
        """Forces of the initial sea on a ship that keeps its course."""
        if self.hull is not None:
            return self._hull_forces(seed)
        forces, sway = [self.wave_moment(seed)], self._sway_of_slope
        if sway is not None:
            slope = self.sea.sea(seed).slope
            forces.append(replace(slope, amplitude=sway * slope.amplitude))
        return forces

    def _responses(self) -> list[Response]:
        """Responses of the forces to a wave."""
        if (hull := self.lateral_hull) is not None:
            return responses_of(partial(hull.forces, six=self.six), 6 if self.six else 3)
        moment, sway = self.sea.moment(self.vessel.ship.stiffness_nm_rad), self._sway_of_slope
        if sway is None:
            return [moment]
        return [moment, lambda omega, heading: sway * slope_per_m(omega, heading)]

    def wave_moment(self, seed: int) -> Harmonics:
        """Roll moment of the initial sea on a ship that keeps its course."""
        if self.hull is not None:
            return self._hull_forces(seed)[1]
        return self.sea.roll_moment(self.sea.sea(seed), self.vessel.ship.stiffness_nm_rad)

    def pooled_wave_moment(self) -> Harmonics:
        """Wave moment for linear predictions: many realisations, each with an equal share."""
        seas = [self.wave_moment(seed) for seed in range(REALISATIONS)]
        return Harmonics(
            np.concatenate([sea.amplitude for sea in seas]) / math.sqrt(REALISATIONS),
            np.concatenate([sea.frequency_rad_s for sea in seas]),
            np.concatenate([sea.phase_rad for sea in seas]),
        )

    def _righting_change(self, seed: int) -> list[Harmonics]:
        """Change of the righting moment in the initial sea, if it has one."""
        if self.righting_in_waves is None:
            return []
        sea = self.sea.sea(seed)
        share = self.righting_in_waves.change_per_m(sea.omega_rad_s, sea.heading_rad)
        return [sea.harmonics(sea.amplitude_m * share)]

    def _hull_forces(self, seed: int) -> list[Harmonics]:
        """Forces of the initial sea in the order of `LateralHull.forces`."""
        sea, hull = self.sea.sea(seed), self.lateral_hull
        assert hull is not None
        forces = hull.forces(sea.omega_rad_s, sea.heading_rad, six=self.six)
        return [sea.harmonics(sea.amplitude_m * force) for force in forces]
