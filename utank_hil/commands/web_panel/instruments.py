"""What a panel shows beside the controller's state: motion, water, pump, estimates."""

import math
from collections.abc import Sequence
from typing import Any, Final

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Catalogue,
    Frame,
    PassiveTwin,
    PumpCommand,
    Quality,
    Receiver,
    ShipEstimate,
    Verdict,
)
from utank_hil.configuration.vessel import Vessel
from utank_hil.nodes.inbox import Inbox

STALE_MS: Final = 500.0
"""Age beyond which a figure is not shown: five of the slowest cycle, and half of what an eye takes
for now."""
_ESTIMATE_MS: Final = 5000.0  #: The same of the ship's estimate, which comes once a second.
_HEEL_S: Final = 60.0  #: Time over which roll is averaged to heel, as for HEEL_LIMIT.
_SENT: Final = (PumpCommand, PassiveTwin, ShipEstimate)


class Instruments:
    """Listens to a ship's bus for a panel, and sends nothing."""

    name = "instruments"
    period_ns = 2 * TICK_NS

    def __init__(self, catalogue: Catalogue, vessel: Vessel) -> None:
        self._vessel = vessel
        self._inbox = Inbox(
            catalogue,
            vessel.version,
            pump=vessel.pump is not None,
            valve=vessel.valve is not None,
            redundancy=vessel.redundancy,
            foreign=vessel.foreign,
        )
        receivers = [catalogue.receiver(kind) for kind in _SENT]
        self._receivers: dict[int, Receiver[Any]] = {each.can_id: each for each in receivers}
        self._sent: dict[type[Any], tuple[Any, int]] = {}
        self._heel_rad = math.nan
        self._heeled_s = 0.0

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what sensors, drive, valve and controller send."""
        receiver = self._receivers.get(frame.can_id)
        if receiver is None:
            self._inbox.receive(frame, now_ns)
        elif (message := receiver.accept(frame)) is not None:
            self._sent[type(message)] = message, now_ns

    def tick(self, now_ns: int) -> Sequence[Frame]:
        """Average the roll."""
        motion = self._inbox.motions[0].sample(now_ns)
        if motion.age_ms > STALE_MS:
            self._heel_rad, self._heeled_s = math.nan, 0.0
            return ()
        step_s = self.period_ns * 1e-9
        if self._heeled_s == 0.0:
            self._heel_rad = 0.0
        self._heeled_s = min(self._heeled_s + step_s, _HEEL_S)
        self._heel_rad += (motion.roll_rad - self._heel_rad) * step_s / self._heeled_s
        return ()

    def figures(self, now_ns: int) -> dict[str, float | str | bool | None]:
        """What is measured now; NaN for what is not, or is too old."""
        measured, vessel = self._inbox.snapshot(now_ns), self._vessel
        motion = min(measured.motions, key=lambda each: each.age_ms)
        twin = self._latest(PassiveTwin, now_ns)
        usable = twin is not None and twin.quality is Quality.GOOD
        ship = self._latest(ShipEstimate, now_ns, _ESTIMATE_MS)
        known = ship is not None and ship.verdict is Verdict.GOOD
        command = self._latest(PumpCommand, now_ns)
        pump, tank_ms = vessel.pump, measured.tank_age_ms
        drive_ms = measured.drive_age_ms if pump else math.inf
        return {
            "roll_deg": math.degrees(_fresh(motion.roll_rad, motion.age_ms)),
            "heel_deg": math.degrees(self._heel_rad),
            "heeled_s": self._heeled_s,
            "roll_rms_deg": math.degrees(twin.roll_rms_rad) if twin and usable else math.nan,
            "passive_rms_deg": math.degrees(twin.twin_rms_rad) if twin and usable else math.nan,
            "port_m": _fresh(measured.port_level_m, tank_ms),
            "starboard_m": _fresh(measured.starboard_level_m, tank_ms),
            "high_level": measured.high_level,
            "asked_kpa": command.pressure_pa * 1e-3 if command and pump else math.nan,
            "given_kpa": _fresh(
                measured.pressure_pa * 1e-3, measured.pump_age_ms if pump else math.inf
            ),
            "power_kw": _fresh(measured.power_w * 1e-3, drive_ms),
            "load": _fresh(abs(measured.power_w) / pump.max_power_w, drive_ms)
            if pump
            else math.nan,
            "pump_limited": measured.drive_held_back,
            "drive": measured.drive_state.name if measured.drive_state and pump else None,
            "valve": measured.valve_opening if vessel.valve else math.nan,
            "gm_m": ship.gm_m if ship and known else math.nan,
            "roll_period_s": ship.roll_period_s if ship and known else math.nan,
        }

    def scales(self) -> dict[str, Any]:
        """Name and limits of the ship, by its file."""
        vessel = self._vessel
        limits, safety = vessel.default_limits, vessel.default_safety
        return {
            "name": vessel.name,
            "roll_deg": math.degrees(safety["roll_limit_rad"]),
            "heel_deg": math.degrees(safety["heel_limit_rad"]),
            "level_m": limits["level_m"],
            "full_m": vessel.tank.level_limit_m,
            "pressure_kpa": limits.get("pressure_pa", 0.0) * 1e-3,
            "least_gm_m": vessel.least_gm_m,
        }

    def _latest(self, kind: type[Any], now_ns: int, most_ms: float = STALE_MS) -> Any:
        message, heard_ns = self._sent.get(kind, (None, now_ns))
        return message if now_ns - heard_ns <= most_ms * 1e6 else None


def _fresh(value: float, age_ms: float) -> float:
    return value if age_ms <= STALE_MS else math.nan
