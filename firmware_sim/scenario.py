"""Scenarios: what the ship's side needs to know, ``configs/scenarios``."""

import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from firmware_sim.drive import DriveLimits
from firmware_sim.sensors import SensorErrors
from utank_hil.config import ControllerConfig, Vessel
from utank_hil.config_files import Section
from utank_hil.dynamics.ship import RollShip
from utank_hil.runtime.panel import TimedAction
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap, load_ndbc

MOST_CONTROLLERS = 7
"""More runs than these and the passive one can't be told apart in a picture."""

PASSIVE = "passive"
"""Name of the run with the tank alone."""


class MeasuredSea(Section):
    """One hour of a buoy's record."""

    kind: Literal["measured"]
    file: Path
    time: datetime
    """Start of the record's hour, UTC, as written in the file."""
    heading_deg: float = 90.0
    effective_slope: EffectiveSlope = EffectiveSlope()

    @model_validator(mode="after")
    def _hour_is_there(self) -> "MeasuredSea":
        try:
            self.sea(0)
        except OSError as error:  # pydantic lists ValueErrors with their place, and nothing else
            raise ValueError(f"file {self.file} can't be read: {error.strerror}") from error
        return self

    def sea(self, seed: int) -> Sea:
        """A realisation of the hour's spectrum."""
        spectrum = load_ndbc(self.file).at(self.time.isoformat())
        return Sea.irregular(spectrum, seed, heading_rad=math.radians(self.heading_deg))


class JonswapSea(Section):
    """A model spectrum of a growing sea."""

    kind: Literal["jonswap"]
    hs_m: Annotated[float, Field(gt=0)]
    tp_s: Annotated[float, Field(gt=0)]
    gamma: Annotated[float, Field(ge=1, le=7)] = 3.3
    heading_deg: float = 90.0
    speed_m_s: Annotated[float, Field(ge=0)] = 0.0
    effective_slope: EffectiveSlope = EffectiveSlope()

    def sea(self, seed: int) -> Sea:
        """A realisation of the spectrum."""
        return Sea.irregular(
            jonswap(self.hs_m, self.tp_s, self.gamma),
            seed,
            heading_rad=math.radians(self.heading_deg),
            speed_m_s=self.speed_m_s,
        )


class RegularSea(Section):
    """One wave."""

    kind: Literal["regular"]
    amplitude_m: Annotated[float, Field(ge=0)]
    period_s: Annotated[float, Field(gt=0)]
    heading_deg: float = 90.0
    effective_slope: EffectiveSlope = EffectiveSlope()

    def sea(self, seed: int) -> Sea:  # noqa: ARG002, a regular sea has nothing to draw
        """The wave."""
        return Sea.regular(
            self.amplitude_m,
            2 * math.pi / self.period_s,
            heading_rad=math.radians(self.heading_deg),
        )


class Scenario(Section):
    """A ship in a sea, with the controllers to try there."""

    name: str
    vessel: Vessel
    sea: Annotated[MeasuredSea | JonswapSea | RegularSea, Field(discriminator="kind")]
    sensors: SensorErrors = SensorErrors()
    drive: DriveLimits = DriveLimits()
    controllers: Annotated[
        dict[str, ControllerConfig], Field(min_length=1, max_length=MOST_CONTROLLERS)
    ]
    operator: tuple[TimedAction, ...]
    """What the operator does in the runs with a controller; in the passive run nobody arms."""
    duration_s: Annotated[float, Field(gt=0)]
    settle_s: Annotated[float, Field(ge=0)]
    """Left out of the statistics at the start."""
    seed: Annotated[int, Field(ge=0)] = 1
    actual_ship: dict[str, float] = Field(default_factory=dict)
    """Keys of the ship that differ from the vessel's, which is what the controller believes."""
    actual_from_s: Annotated[float, Field(ge=0)] = 0.0
    """When the difference comes about: cargo moved, fuel burnt."""
    retuner_latency_s: Annotated[float, Field(ge=0)] = 5.0
    """Time that identification and design take in simulated time."""

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        if self.settle_s >= self.duration_s:
            raise ValueError("settle_s must be less than duration_s, else nothing is left to judge")
        if PASSIVE in self.controllers:
            raise ValueError("controllers must not name one 'passive': that run is always made")
        for name, controller in self.controllers.items():
            self._check_drive_takes(name, controller)
        try:
            _ = self.sailing_ship
        except TypeError as error:  # an unknown key; a wrong value is a ValueError already
            raise ValueError(f"actual_ship: {error}") from error
        return self

    @property
    def sailing_ship(self) -> RollShip:
        """The ship as she is from `actual_from_s` on."""
        return replace(self.vessel.ship, **self.actual_ship)  # type: ignore[arg-type]  # floats only

    def _check_drive_takes(self, name: str, controller: ControllerConfig) -> None:
        """Raise if the drive would refuse what a controller may send."""
        limits, drive = controller.limits, self.drive
        for key, sent, taken in (
            ("limits.pressure_pa", limits.pressure_pa, drive.pressure_pa),
            ("limits.rate_pa_s", limits.rate_pa_s, drive.pressure_rate_pa_s),
            ("command_timeout_ms", controller.command_timeout_ms, drive.longest_timeout_ms),
        ):
            if sent > taken:
                raise ValueError(
                    f"controllers.{name}.{key} is {sent:g}, but the drive takes {taken:g} at most"
                )

    def wave_moment(self, seed: int) -> Harmonics:
        """Roll moment of the sea on the ship."""
        return self.sea.sea(seed).roll_moment(
            self.vessel.ship.stiffness_nm_rad, self.sea.effective_slope
        )
