"""Scenarios: what the ship's side needs to know, ``configs/scenarios``."""

import math
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from firmware_sim.drive import DriveLimits
from firmware_sim.place import Place
from firmware_sim.scenario_sea import ScenarioSea
from firmware_sim.sensors import SensorErrors
from utank_hil.configuration import ControllerConfig, Section, Vessel
from utank_hil.configuration.vessel import tank_problems
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.parameters import ParameterError, Problem, refuse
from utank_hil.runtime.panel import TimedAction
from utank_hil.sea import Harmonics

MOST_CONTROLLERS = 7
"""More runs than these and the passive one can't be distinguished in a picture."""

PASSIVE = "passive"
"""Name of the run with the tank alone."""

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

LONGEST_S: Final = 86_400.0
"""Longest run: its rows are kept in memory."""

# where the user sets none, drive and high-level switch are as the first ship's to its pump and tank
_DRIVE_RATE_PER_PRESSURE: Final = 5.0
_HIGH_LEVEL_SHARE: Final = 4.6 / 4.88


class Scenario(Section):
    """A ship in a sea, with the controllers to try there."""

    name: str
    vessel: Vessel
    sea: ScenarioSea
    sensors: Annotated[SensorErrors, Field(default_factory=dict, validate_default=True)]
    drive: Annotated[DriveLimits, Field(default_factory=dict, validate_default=True)]
    """Limits not given follow from the vessel's pump."""
    controllers: Annotated[
        dict[str, ControllerConfig], Field(default_factory=dict, max_length=MOST_CONTROLLERS)
    ]
    """One or more; none are needed where the vessel has no pump."""
    operator: tuple[TimedAction, ...] = ()
    """What the operator does in the runs with a controller; in the passive run nobody arms."""
    duration_s: Annotated[float, Field(gt=0, le=LONGEST_S)]
    settle_s: Annotated[float, Field(ge=0)]
    """Left out of the statistics at the start."""
    seed: Annotated[int, Field(ge=0)] = 1
    place: Place | None = None
    """Where people are judged; over the starboard reservoir if not given."""
    plant: Literal["nonlinear", "linear"] = "nonlinear"
    """Equations of the emulated ship; the linear ones are their limit for small motions."""
    actual_ship: dict[str, float] = Field(default_factory=dict)
    """Keys of the ship that differ from the vessel's, which is what the controller believes.

    Those of `SAILED` only.
    """
    actual_from_s: Annotated[float, Field(ge=0)] = 0.0
    """When the difference comes about: cargo moved, fuel burnt."""
    retuner_latency_s: Annotated[float, Field(ge=0)] = 5.0
    """Time that identification and design take in simulated time."""

    @field_validator("sensors", mode="before")
    @classmethod
    def _switch_below_the_roof(cls, sensors: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        if vessel is None or not isinstance(sensors, dict):
            return sensors
        return {"high_level_m": vessel.tank.level_limit_m * _HIGH_LEVEL_SHARE, **sensors}

    @field_validator("drive", mode="before")
    @classmethod
    def _as_the_pump_can(cls, drive: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        if vessel is None or not isinstance(drive, dict):
            return drive
        pump = vessel.pump
        if pump is None:
            return drive
        pressure_pa = pump.max_pressure_pa
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
                problems.append(("controllers", "must name at least 1 for the vessel's pump"))
            if "operator" not in self.model_fields_set:
                problems.append(("operator", "is required but missing: who arms the controllers"))
        if PASSIVE in self.controllers:
            reason = (
                "names one 'passive', the run without a controller that is always made: rename it"
            )
            problems.append(("controllers", reason))
        for name, controller in self.controllers.items():
            problems += self._controller_problems(name, controller)
        refuse("", [*problems, *self._ship_problems(), *self._sea_problems()])
        return self

    @property
    def place_on_board(self) -> Place:
        """Where people are judged."""
        return self.place or Place.over_reservoir(self.vessel.tank)

    @property
    def sailing_ship(self) -> RollShip:
        """The ship from `actual_from_s` on."""
        return replace(self.vessel.ship, **self.actual_ship)  # type: ignore[arg-type]  # floats only

    def ship_at(self, time_s: float) -> RollShip:
        """The ship at a time since the start."""
        return self.sailing_ship if time_s >= self.actual_from_s else self.vessel.ship

    def _controller_problems(self, name: str, controller: ControllerConfig) -> list[Problem]:
        """Why a controller would never arm, or the drive would refuse what it may send."""
        problems = []
        if controller.vessel.version != self.vessel.version:
            problems.append(
                (
                    f"controllers.{name}",
                    f"is for another ship, {controller.vessel.name}: it would never arm on "
                    f"{self.vessel.name}; name the same ship file in both",
                )
            )
        limits, drive = controller.limits, self.drive
        for key, taken, sender, sent in (
            ("pressure_pa", drive.pressure_pa, "limits.pressure_pa", limits.pressure_pa),
            ("pressure_rate_pa_s", drive.pressure_rate_pa_s, "limits.rate_pa_s", limits.rate_pa_s),
            (
                "longest_timeout_ms",
                drive.longest_timeout_ms,
                "command_timeout_ms",
                controller.command_timeout_ms,
            ),
        ):
            if sent > taken:
                problems.append(
                    (
                        f"drive.{key}",
                        f"takes {taken:g} at most, but controllers.{name}.{sender} is {sent:g}: "
                        "lower that, or raise this",
                    )
                )
        return problems

    def _ship_problems(self) -> list[Problem]:
        wrong = [key for key in self.actual_ship if key not in SAILED]
        if wrong:
            reason = f"can't differ from the vessel's; it takes {', '.join(SAILED)}"
            return [(f"actual_ship.{key}", reason) for key in wrong]
        try:
            unstable = tank_problems(self.sailing_ship, self.vessel.tank)
        except ParameterError as error:
            return [(f"actual_ship.{name}", reason) for name, reason in error.problems]
        if unstable:
            return [("actual_ship", f"with it, the tank {reason}") for _, reason in unstable]
        ships = {"vessel": self.vessel.ship}
        if self.actual_ship:
            ships["actual_ship"] = self.sailing_ship
        return [(key, why) for key, ship in ships.items() for why in self._heel_problems(ship)]

    def _heel_problems(self, ship: RollShip) -> list[str]:
        """Why a ship's steady heel is refused: the water would be at the tank's roof."""
        tank = self.vessel.tank
        _, _, stiffness = coupled_matrices(ship, tank)
        roll_rad, level_m = np.linalg.solve(stiffness, [ship.heeling_moment_nm, 0.0]).tolist()
        if abs(level_m) <= tank.level_limit_m:
            return []
        return [
            f"heels steadily by {math.degrees(roll_rad):.0f} degrees, at which the tank is full or "
            f"empty at one side: lower {' or '.join(SAILED[-2:])}"
        ]

    def _sea_problems(self) -> list[Problem]:
        try:
            with np.errstate(all="ignore"):
                amplitudes = self.wave_moment(self.seed).amplitude
        except (ValueError, ArithmeticError, MemoryError) as error:
            return [("sea", f"can't be made: {error}")]
        if not np.isfinite(amplitudes).all():
            return [("sea", "has waves beyond all scale: check height, period and slope")]
        return []

    def wave_moment(self, seed: int) -> Harmonics:
        """Roll moment of the sea on the ship."""
        return self.sea.sea(seed).roll_moment(
            self.vessel.ship.stiffness_nm_rad, self.sea.effective_slope
        )
