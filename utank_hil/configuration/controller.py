"""Content of a controller's configuration.

Sections that stand for a model or a node are the dataclasses of the code itself, so a key in a file
is the parameter of the same name.
"""

import math
from typing import Annotated, Any, ClassVar, Final

from pydantic import Field, ValidationInfo, field_validator, model_validator

from utank_hil.analysis.loop.margins import EXTRA_DELAY_S
from utank_hil.analysis.loop.sea_response import at_work, moment_of
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign, unknown_sea
from utank_hil.base.parameters import ParameterError, Problem, Range, refuse
from utank_hil.base.tick import TICK_S, is_whole_ticks
from utank_hil.canbus.profiles.device_plan import SLOPE_S
from utank_hil.configuration.files import Section
from utank_hil.configuration.laws import AnyDesign, sample_time
from utank_hil.configuration.plausibility.controller import controller_warnings
from utank_hil.configuration.vessel import Vessel
from utank_hil.control import DesignPlant, PassiveDesign, PredictiveDesign, PumpLimits
from utank_hil.control.predictive.design import MOST_ORDER, WASHOUT_SHARE
from utank_hil.control.semi_active import ClippedValveDesign, OnOffValveDesign
from utank_hil.retuning.estimator import SHIP_PERIODS, EstimateSettings
from utank_hil.retuning.settings import RetuningSettings, record_problems
from utank_hil.runners.bus_model import SimulatedBus
from utank_hil.safety.monitors.thresholds import SensorFigures
from utank_hil.safety.safety_limits import SafetyLimits

_WITHOUT_PUMP: Final = (PassiveDesign, OnOffValveDesign, ClippedValveDesign)
_OF_ANY_OPENING: Final = (
    "valve_clipped",
    "pump_with_valve",
    "heel_removal",
)  #: Laws that throttle.

MOST_PRESSURE_PA: Final = 250e3
"""Largest pressure of PUMP_CMD: the codec cuts larger ones without the controller's knowledge."""
MOST_ROLL_RATE_RAD_S: Final = 1.0  #: Of SENSOR_MOTION; a faster roll is told as not available.
LEAST_PAUSE_S: Final = 600.0  #: Shortest time between two scheduled retunings.
COMMAND_S: Final = 0.02  #: Share of the delay that the cycle of the pump's commands takes.
MOST_PULSES_S: Final = 3600.0
"""Longest identification, because pulses and record are kept in memory."""


class ControllerConfig(Section):
    """A controller's configuration, ``configs/controllers``: the argument of ``utank-hil run``."""

    noun: ClassVar = "controller"

    name: str
    vessel: Vessel
    law: AnyDesign
    delay_s: Annotated[float, Range(least=0, most=1)] = 0.05
    """Time from the sampling of a measurement to the drive's answer to its command."""
    accept_low_margins: bool = False
    """Whether the law is used even if it misses the required margins."""
    limits: Annotated[PumpLimits, Field(default_factory=dict, validate_default=True)]
    """Limits of the pump's command; missing ones are the vessel's (`Vessel.default_limits`)."""
    safety: Annotated[SafetyLimits, Field(default_factory=dict, validate_default=True)]
    """Thresholds of the fault table; missing ones of roll and heel are from
    `Vessel.default_safety`."""
    sensors: SensorFigures = SensorFigures()
    """Noise of the sensors, from which the monitors' thresholds follow."""
    command_timeout_ms: Annotated[float, Range(least=20, most=100)] = 50.0
    bit_rate: Annotated[int, Range(least=10_000, most=1_000_000)] = 250_000
    retuning: RetuningSettings | None = None
    """Settings of retuning; without them the controller does not retune itself."""
    sea_estimate: EstimateSettings | None = None
    """Settings of the estimate of waves and ship from the motion; without them nothing is
    estimated."""

    @field_validator("limits", "safety", mode="before")
    @classmethod
    def _as_the_vessel_allows(cls, given: Any, info: ValidationInfo) -> Any:
        vessel = info.data.get("vessel")
        if vessel is None or not isinstance(given, dict):
            return given
        return {**getattr(vessel, f"default_{info.field_name}"), **given}

    @field_validator("bit_rate")
    @classmethod
    def _bits_of_whole_nanoseconds(cls, bit_rate: int) -> int:
        try:
            SimulatedBus(bit_rate)
        except ValueError as error:
            raise ValueError(str(error).partition(": ")[2]) from error
        return bit_rate

    @model_validator(mode="after")
    def _consistent(self) -> "ControllerConfig":
        problems = [*self._limit_problems(), *self._retuning_problems(), *self._law_problems()]
        problems += self._roll_problems()
        problems += self.late_problems()
        if self.renews and not isinstance(self.law, SelfTunedDesign):
            reason = f"is for a law of kind self_tuned, not {self.law.kind}: leave it out"
            problems.append(("sea_estimate.renew", reason))
        problems += self._record_problems()
        refuse("", problems)
        return self

    def warnings(self) -> list[Problem]:
        """Return what is unusual in the vessel, and limits without a monitor."""
        found = [(f"vessel.{key}", reason) for key, reason in self.vessel.warnings()]
        if self.vessel.least_gm_m is not None and self.sea_estimate is None:
            reason = "is not watched without the section sea_estimate: add `sea_estimate: {}`"
            found.append(("vessel.least_gm_m", reason))
        if self.retuning and self.retuning.roll_limit_rad >= self.safety.roll_limit_rad:
            reason = (
                f"is {self.retuning.roll_limit_rad:g} rad, but control ends at "
                f"{self.safety.roll_limit_rad:g}, safety.roll_limit_rad: set it lower"
            )
            found.append(("retuning.roll_limit_rad", reason))
        rate_rad_s = self.safety.roll_limit_rad * self.vessel.ship.natural_frequency_rad_s
        devices = self.vessel.devices
        native = devices is None or devices.motion.native
        if native and rate_rad_s > MOST_ROLL_RATE_RAD_S:
            seen_rad = MOST_ROLL_RATE_RAD_S / self.vessel.ship.natural_frequency_rad_s
            reason = (
                f"is passed at {rate_rad_s:.2g} rad/s in a roll of the ship's period, and "
                f"SENSOR_MOTION tells {MOST_ROLL_RATE_RAD_S:g} at most: control ends from "
                f"{seen_rad:.2g} rad on, as the motion is unknown"
            )
            found.append(("safety.roll_limit_rad", reason))
        return [*found, *controller_warnings(self), *self.held_pressure_problems()]

    def held_pressure_problems(self) -> list[Problem]:
        """Return what is wrong with a pump that could capsize the ship: no monitor stops a drive.

        A bench warns of it. Check refuses it, and so does run to be armed on hardware.
        """
        most_pa, roll_rad = self.limits.pressure_pa, self.safety.roll_limit_rad
        reason = self.vessel.why_not_held(most_pa, roll_rad)
        return [("limits.pressure_pa", reason)] if reason else []

    @property
    def renews(self) -> bool:
        """Whether the law is renewed under way."""
        return self.sea_estimate is not None and self.sea_estimate.renew

    @property
    def sensor_figures(self) -> SensorFigures:
        """Noise of the sensors, no less than what a device of another maker brings."""
        devices = self.vessel.devices
        if devices is None:
            return self.sensors
        roles = ("motion", "motion_2")
        values = {
            "roll_noise_rad": [devices.noise(role, "roll_rad") for role in roles],
            "roll_rate_noise_rad_s": [devices.noise(role, "roll_rate_rad_s") for role in roles],
            "level_noise_m": [
                devices.noise("levels", f"{side}_level_m") for side in ("port", "starboard")
            ],
        }
        most = {name: max(getattr(self.sensors, name), *found) for name, found in values.items()}
        if devices.motion.derived or devices.motion_2.derived:
            slope_rad_s = math.sqrt(2) * most["roll_noise_rad"] / SLOPE_S
            most["roll_rate_noise_rad_s"] = max(most["roll_rate_noise_rad_s"], slope_rad_s)
        return SensorFigures(**most)

    def late_problems(self) -> list[Problem]:
        """Problems of a motion sensor that is too slow for the delay that the law is made for."""
        devices = self.vessel.devices
        problems: list[Problem] = []
        try:
            _ = self.sensor_figures
        except ParameterError as error:
            problems += [(f"vessel.devices: noise or step: {n}", why) for n, why in error.problems]
        for role in ("motion", "motion_2"):
            device = None if devices is None else devices.sensors()[role]
            if device is None or device.native or device.cycle_ms is None:
                continue
            late_ms = device.late_ms
            borne_ms = 1e3 * (self.delay_s + EXTRA_DELAY_S - COMMAND_S)
            if late_ms > borne_ms:
                brings = "a derived rate" if device.derived else "roll"
                left_ms = borne_ms - late_ms + device.cycle_ms
                faster = f"use a sensor of {1e3 / left_ms:.3g} Hz or more, or " * (left_ms > 5)
                reason = (
                    f"brings {brings} {late_ms:g} ms late, cycle and latency, but the law is made "
                    f"for a delay of {1e3 * self.delay_s:g} ms and bears {borne_ms:g}: {faster}set "
                    "delay_s of the controller's file to "
                    f"{late_ms * 1e-3 + COMMAND_S - EXTRA_DELAY_S:.3g} or more"
                )
                problems.append((f"vessel.devices.{role}.cycle_ms", reason))
        return problems

    def _limit_problems(self) -> list[Problem]:
        pump, level_m = self.vessel.pump, self.vessel.tank.level_limit_m
        pressure_pa = math.inf if pump is None else pump.max_pressure_pa
        said_pa = math.inf if pump is None else MOST_PRESSURE_PA
        asked_pa = self.limits.pressure_pa
        gives = f"the vessel's pump gives {pressure_pa:g} at most"
        says = f"PUMP_CMD can ask for {said_pa:g} at most"
        full = f"the vessel's tank is full or empty at {level_m:g}"
        return [
            (name, f"is {value:g}, but {why}: set it to {most:g} or less, or leave it out")
            for name, value, most, why in (
                ("limits.pressure_pa", asked_pa, pressure_pa, gives),
                ("limits.pressure_pa", min(asked_pa, pressure_pa), said_pa, says),
                ("limits.level_m", self.limits.level_m, level_m, full),
            )
            if value > most
        ]

    def _roll_problems(self) -> list[Problem]:
        """Return problems of roll limits beyond the range in which the ship rights itself."""
        limit_rad, righting = self.safety.roll_limit_rad, self.vessel.righting
        if limit_rad < righting.vanishing_rad:
            return []
        reason = (
            f"is {limit_rad:g}, but with the tank's water the stability vanishes at "
            f"{righting.vanishing_rad:.2f} rad: leave it out, or set it to "
            f"{righting.greatest_rad:.2f} or less, where the righting moment is greatest"
        )
        return [("safety.roll_limit_rad", reason)]

    def _retuning_problems(self) -> list[Problem]:
        settings, law = self.retuning, self.law
        if settings is None:
            return []
        if not isinstance(law, PredictiveDesign) or "roll_rad" not in law.predictor.measured:
            return [("retuning", "is for predictive laws (gpc, dpc) that measure roll_rad")]
        period_s, length_s = law.predictor.sample_time_s, settings.identification_s
        shortest_s, longest_s = settings.pulse_hold_s
        every_s = math.inf if settings.every_s is None else settings.every_s
        most_rad_s = WASHOUT_SHARE * 2 * math.pi / settings.roll_period_range_s[1]
        checks = (
            (settings.change_factor is not None and self.sea_estimate is None, "change_factor",
             "needs the section sea_estimate, which tells the ship: add `sea_estimate: {}`"),
            (settings.order > MOST_ORDER, "order",
             f"must be {MOST_ORDER} at most, got {settings.order}"),
            (not period_s / 2 < shortest_s <= longest_s <= length_s, "pulse_hold_s",
             f"must rise from the law's sample time, {period_s:g} s, to identification_s at most, "
             f"got {shortest_s:g} and {longest_s:g}"),
            (every_s < LEAST_PAUSE_S, "every_s",
             f"must be {LEAST_PAUSE_S:g} or more, got {every_s:g}: during the pulses, and for "
             "eight roll periods after, no law is compared with the passive ship"),
            (settings.excitation.banded and settings.excitation.band[1] >= math.pi / period_s,
             "excitation.band_rad_s",
             f"must stay below {math.pi / period_s:.3g}, half of the law's sampling"),
            (length_s > MOST_PULSES_S, "identification_s",
             f"must be {MOST_PULSES_S:g} at most, got {length_s:g}"),
            (law.washout_rad_s > most_rad_s, "roll_period_range_s",
             f"must leave {most_rad_s:.4g} or more for the law's washout_rad_s, "
             f"{law.washout_rad_s:g}: lower one of the two"),
        )  # fmt: skip
        problems = [(name, reason) for wrong, name, reason in checks if wrong]
        problems += record_problems(
            settings.order,
            round(length_s / period_s),
            len(law.predictor.measured),
            period_s,
            settings.roll_period_range_s[0],
        )
        return [(f"retuning.{name}", reason) for name, reason in problems]

    def _record_problems(self) -> list[Problem]:
        least_s = SHIP_PERIODS * 2 * math.pi / self.vessel.ship.natural_frequency_rad_s
        if self.sea_estimate is None or self.sea_estimate.record_s >= least_s:
            return []
        reason = (
            f"must be {SHIP_PERIODS:g} of the ship's roll periods, {math.ceil(least_s)}, or more: "
            f"{self.sea_estimate.record_s:g} never tell sea and ship"
        )
        return [("sea_estimate.record_s", reason)]

    def _law_problems(self) -> list[Problem]:
        if self.vessel.pump is None and not isinstance(self.law, _WITHOUT_PUMP):
            reason = (
                f"is {self.law.kind}, which drives a pump, but {self.vessel.name} has none: give "
                "the vessel a pump, or take kind: passive"
            )
            return [("law.kind", reason)]
        devices = self.vessel.devices
        if self.law.kind in _OF_ANY_OPENING and devices is not None and devices.valve.of_one_bit:
            reason = (
                f"is {self.law.kind}, which asks for any opening, but devices.valve has one bit: "
                "it would chatter. Take kind: valve_on_off, or a valve with a position"
            )
            return [("law.kind", reason)]
        found = sample_time(self.law)
        if found is None or is_whole_ticks(found[1]):
            return []
        name, period_s = found
        reason = f"must be a whole number of ticks of {TICK_S:g} s, got {period_s:g}"
        return [(f"law.{name}", reason)]

    @property
    def plant(self) -> DesignPlant:
        """Ship, tank, pump and limits."""
        vessel = self.vessel
        lag_s = 0.0 if vessel.pump is None else vessel.pump.lag_s
        valve = None if vessel.valve is None else vessel.valve.range(vessel.tank)
        return DesignPlant(vessel.ship, vessel.tank, self.delay_s, lag_s, self.limits, valve)

    @property
    def design_plant(self) -> DesignPlant:
        """The plant with the tank's loss in the sea that the law expects (`at_work`)."""
        plant = self.plant
        sea = getattr(self.law, "sea", None) or unknown_sea(plant.ship)
        return at_work(plant, moment_of(sea, plant.ship))
