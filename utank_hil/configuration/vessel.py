"""A ship with its tank and pump, and the checks that they fit together."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import asdict, fields
from typing import Annotated, Any, ClassVar, Final

from pydantic import ValidationInfo, field_validator, model_validator

from utank_hil.base.parameters import Problem, Range, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.canbus.frame import MOST_BUSES
from utank_hil.canbus.profiles.device_plan import NO_FOREIGN_DEVICES, ForeignDevices
from utank_hil.configuration.device_sections import NATIVE_DRIVE
from utank_hil.configuration.devices import DevicesSection
from utank_hil.configuration.files import Section
from utank_hil.configuration.hull_files.reader import HullFile
from utank_hil.configuration.plausibility import vessel_problems, vessel_warnings
from utank_hil.configuration.ship_keys import ShipFromFile, hull_words, in_written_key
from utank_hil.dynamics import RollModel, Tank
from utank_hil.dynamics.nonlinear import RightingRange, greatest_held_pa, righting_range
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.valves import Valve, valve_problems
from utank_hil.nodes.redundancy import NO_REDUNDANCY, Redundancy
from utank_hil.safety.safety_limits import SafetyLimits

NOT_AVAILABLE = 0xFFF  #: Hash that means none: twelve bits carry it on the bus, and all are ones.

# Default limits keep the first ship's ratios to its pump and tank,
# because the laws were tuned within these.
_RATE_PER_PRESSURE: Final = 2.0
_LEVEL_SHARE: Final = 3.85 / 4.88


class PreviewSection(Section):
    """Section ``preview``: a station that forecasts the waves, by WAVE_FORECAST."""

    bus: str = ""  #: Interface that it is on; empty for the controller's own.


class Vessel(Section):
    """A ship with its tank and pump: ``configs/ships``."""

    noun: ClassVar = "ship"

    name: str
    ship: ShipFromFile
    tank: Tank
    pump: Pump | None = None
    valve: Valve | None = None
    """Valve of a semi-active tank; without pump and valve the tank is passive."""
    least_gm_m: Annotated[float, Range(above=0, most=1e3)] | None = None
    """Limit of the stability booklet on the metacentric height, tank water free to move."""
    redundancy: Redundancy = NO_REDUNDANCY
    """Equipment that the ship has twice, or with separate wires."""
    emulated: bool = False
    """Whether every node is an emulated one, for which no commissioning is asked; never on board.

    The nodes prove it by their version, which differs from that of the same ship on board."""
    devices: DevicesSection | None = None  #: What is on the bus in the place of the native nodes.
    preview: PreviewSection | None = None
    """Station that forecasts the waves; without it its frames are strangers'."""
    _hull: HullFile | None = None
    _written: frozenset[str] = frozenset()  # These are the keys of the ship in its file.

    @property
    def version(self) -> int:
        """Hash of everything but name and preview, compared by the nodes before arming."""
        parts = (self.ship, self.tank, self.pump)
        content = [None if part is None else not_by_default(part) for part in parts]
        if self.valve is not None:
            content.append(not_by_default(self.valve))
        if self.redundancy != NO_REDUNDANCY:
            content.append({"redundancy": asdict(self.redundancy)})
        if not self.emulated:
            content.append({"emulated": False})
        if self.devices is not None:
            later = ("pump", "valve", "panel")  # so a ship without these has the version it had
            native = {each for each in later if getattr(self.devices, each).native}
            content.append({"devices": self.devices.model_dump(mode="json", exclude=native)})
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).digest()
        return int.from_bytes(digest[:4], "big") % NOT_AVAILABLE

    @property
    def stop_within_ms(self) -> float:
        """Longest time from a stop to a fifth of the pump's pressure."""
        return (NATIVE_DRIVE if self.devices is None else self.devices.pump).stop_within_ms

    @property
    def default_limits(self) -> dict[str, float]:
        """Limits of the pump's command for keys that the user does not set."""
        limits = {"level_m": self.tank.level_limit_m * _LEVEL_SHARE}
        if self.pump is not None:
            pressure_pa, rate_pa_s = self.pump.max_pressure_pa, self.pump.max_pressure_rate_pa_s
            limits["pressure_pa"] = pressure_pa
            limits["rate_pa_s"] = min(_RATE_PER_PRESSURE * pressure_pa, rate_pa_s)
        return limits

    @field_validator("pump", mode="before")
    @classmethod
    def _by_similarity(cls, pump: Any, info: ValidationInfo) -> Any:
        """Complete the pump's parameters by scaling the first ship's pump."""
        if not isinstance(pump, dict):
            return pump
        tank = info.data.get("tank")
        area_m2 = pump.get("duct_area_m2", 1.0 if tank is None else tank.duct_area_m2)
        try:
            similar = Pump.for_duct(float(area_m2), float(pump["max_pressure_pa"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            similar = Pump.for_duct(1.0)  # Problems of these two are found at their keys.
        others = {name: of for name, of in asdict(similar).items() if name != "max_pressure_pa"}
        return others | pump

    @property
    def righting(self) -> RightingRange:
        """Righting range of the ship with the tank's water."""
        return righting_range(RollModel(self.ship, self.tank))

    @property
    def default_safety(self) -> dict[str, float]:
        """Limits of roll and heel for a ship with a short righting range (`SafetyLimits`)."""
        greatest_rad = math.floor(100 * self.righting.greatest_rad) / 100
        most = SafetyLimits()
        ages = {} if self.devices is None else self.devices.default_ages()
        return {
            "roll_limit_rad": min(most.roll_limit_rad, greatest_rad),
            "heel_limit_rad": min(most.heel_limit_rad, greatest_rad / 2),
            **ages,
        }

    def why_not_held(self, most_pa: float, roll_rad: float) -> str:
        """Return why a pump's pressure may not be held at its limit; empty if it may.

        It may if it heels the ship no further than to `roll_rad`, or if the pump has a cut by wires
        of its own.
        """
        if self.pump is None or self.redundancy.hardwired_inputs:
            return ""
        held_pa = greatest_held_pa(RollModel(self.ship, self.tank), most_pa, roll_rad)
        if held_pa == most_pa:
            return ""
        return (
            f"is {most_pa / 1e3:.4g} kPa, and over {math.floor(held_pa / 10) / 100:g} kPa takes "
            f"the ship beyond {roll_rad:g} rad, safety.roll_limit_rad, if it is held, as by a "
            "drive that hangs: lower it here and in the drive, or have a hard-wired stop cut its "
            "power and declare it in the ship's file, redundancy: {hardwired_inputs: true}"
        )

    def held_pressure_problems(self) -> list[Problem]:
        """Return what is wrong with the pump at its own limit; see `why_not_held`."""
        if self.pump is None:
            return []
        most_pa = self.pump.max_pressure_pa
        reason = self.why_not_held(most_pa, self.default_safety["roll_limit_rad"])
        return [("pump.max_pressure_pa", reason)] if reason else []

    @model_validator(mode="wrap")
    @classmethod
    def _plausible(cls, content: Any, validated: Callable[[Any], "Vessel"]) -> "Vessel":
        vessel = validated(content)
        written = content.get("ship") if isinstance(content, dict) else None
        if isinstance(written, dict):
            vessel._written = frozenset(written)
            if written.get("hull") is not None:
                vessel._hull = HullFile.model_validate(written["hull"])
        problems = vessel_problems(vessel.ship, vessel.tank, vessel.pump, vessel.valve)
        if vessel.valve is not None:
            wrong = valve_problems(vessel.tank, vessel.valve)
            problems += [(f"valve.{name}", reason) for name, reason in wrong]
        if vessel.least_gm_m is not None and not vessel.ship.displacement_n > 0:
            problems.append(("least_gm_m", "needs ship.displacement_t, to which GM refers: add it"))
        if vessel.hull is not None and not vessel.emulated:
            keys = ", ".join(f"{name}: {of:.6g}" for name, of in not_by_default(vessel.ship).items()
                             if isinstance(of, float))  # fmt: skip
            reason = f"is for a bench, and the ship is not emulated: write instead {keys}"
            problems.append(("ship.hull", reason))
        if vessel.devices is not None:
            lacking = vessel.devices.redundancy_problems(vessel.redundancy)
            problems += [(f"devices.{name}", reason) for name, reason in lacking]
            problems += vessel.devices.pump.pump_problems(vessel.pump)
            problems += vessel.devices.valve.valve_problems(vessel.valve)
        buses = vessel.foreign.buses
        if vessel.preview is not None and len(buses) > MOST_BUSES:
            problems.append(("preview.bus", f"is the {len(buses)}th interface: there are no more"))
        refuse("", [in_written_key(each, vessel._written) for each in problems])
        return vessel

    @property
    def foreign(self) -> ForeignDevices:
        """Devices that are not nodes of the catalogue, and on which bus the preview station is."""
        found = NO_FOREIGN_DEVICES
        if self.devices is not None:
            found = self.devices.foreign(self.pump)
        return found if self.preview is None else found.with_preview(self.preview.bus)

    @property
    def motion_cycles_s(self) -> tuple[float, float]:
        """Time between two samples of each motion sensor."""
        if self.devices is None:
            return TICK_S, TICK_S
        first, second = self.devices.motion.cycle_ms, self.devices.motion_2.cycle_ms
        return 1e-3 * first if first else TICK_S, 1e-3 * second if second else TICK_S

    @property
    def hull(self) -> HullFile | None:
        """Hull data that the ship's figures come from, if any."""
        return self._hull

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Return the assumptions in place of keys that the file does not have."""
        if self._hull is not None:
            return tuple(hull_words(self._hull, self._written))
        if not self._written or self._written & {"roll_period_s", "inertia_kg_m2"}:
            return ()
        period_s = 2 * math.pi / self.ship.natural_frequency_rad_s
        return (
            f"ship: roll period {period_s:.1f} s by the weather criterion's formula (IS Code 2008, "
            "part A, 2.3.4); give roll_period_s if it is known",
        )

    def warnings(self) -> list[Problem]:
        """Return what is unusual in the vessel."""
        found = vessel_warnings(self.ship, self.tank, self.pump, self.valve)
        if self.devices is not None and self.pump is not None:
            found += self.devices.pump.unusual(self.pump)
        if self.devices is not None:
            level_m = self.tank.height_m
            sizes = {"roll_rad": 0.35, "roll_rate_rad_s": 0.2, "port_level_m": level_m,
                     "starboard_level_m": level_m}  # fmt: skip
            for role, device in self.devices.devices().items():
                found += ((f"devices.{role}.{key}", why) for key, why in device.unusual(sizes))
        if self.least_gm_m is not None:
            gm_m = self.ship.stiffness_nm_rad / self.ship.displacement_n
            if not 0.05 * gm_m <= self.least_gm_m <= gm_m:  # 0.15 m of 3 m to all of it
                why = f"is {self.least_gm_m:g} m, and the ship's GM {gm_m:.3g} m: both in metres"
                found.append(("least_gm_m", why))
        return [in_written_key(each, self._written) for each in found]


def not_by_default(part: Any) -> dict[str, Any]:
    """Return parameters that differ from their default, so that a new one changes no version."""
    defaults = {field.name: field.default for field in fields(part)}
    return {name: value for name, value in asdict(part).items() if value != defaults[name]}
