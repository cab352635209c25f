"""A forecast of the waves as the controller hears it: points, each with the time that it came.

A forecast is advice: whatever becomes of it, the law goes on without it. So it is not watched as
other messages are, and nothing of it stops the pump.
"""

import math
from typing import Final

import numpy as np

from utank_hil.canbus import Address, Catalogue, Fault, ForecastPoints, Heartbeat
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.canbus.measurements import Measurements
from utank_hil.control.interface import WaveForecast
from utank_hil.nodes.plausibility import MILLISECOND_NS, NEVER_HEARD_NS, USABLE
from utank_hil.nodes.routing import Routing

SPACING_S: Final = 0.25
"""Time from a frame's first point to its second."""
BEAT_NS: Final = 1_000_000_000
"""Silence of its heartbeat, or of a station of the right versions, after which none counts."""
REPLAY_NS: Final = 20_000_000_000
AGAIN: Final = 3
LEAST_RAD: Final = 0.01
"""A forecast of at least so much that comes again so often within 20 s, to the last digit, is
replayed: of live waves it does once in 30 years (digits of 1e-4 rad, 5 frames of a lead a second).
"""


class ForecastHeard:
    """The newest points of a preview station on the bus of a number, by their lead.

    `versions` of catalogue and ship are the controller's: what a moment is over depends on them.
    `received` takes in words why the station's forecasts do not count.
    """

    def __init__(
        self,
        routing: Routing,
        catalogue: Catalogue,
        bus: int,
        versions: tuple[int, int],
        received: dict[Fault, str],
    ) -> None:
        self._versions, self._received = versions, received
        self._points: dict[float, tuple[int, ForecastPoints]] = {}
        self._matched_ns = self._sought_ns = NEVER_HEARD_NS
        self._sought: ForecastPoints | None = None
        self._again, self._replayed = 0, False
        self.heard_ns = NEVER_HEARD_NS  #: When points that count came last.
        self.points: tuple[tuple[int, ForecastPoints], ...] = ()
        forecast = catalogue.receiver(ForecastPoints)
        beat = catalogue.receiver(Heartbeat, Address.PREVIEW)
        tag = bus << BUS_SHIFT
        routing.accept(tag | forecast.can_id, forecast.accept, self._take)
        routing.accept(tag | beat.can_id, beat.accept, self._beat)

    def _beat(self, beat: Heartbeat, now_ns: int) -> None:
        versions = (beat.catalogue_version, beat.configuration_version)
        if versions == self._versions:
            self._matched_ns = now_ns
            self._received.pop(Fault.FORECAST_IGNORED, None)
            return
        self._matched_ns = NEVER_HEARD_NS
        self._received[Fault.FORECAST_IGNORED] = (
            f"preview: catalogue {versions[0]} and ship {versions[1]}, here {self._versions[0]} "
            f"and {self._versions[1]}"
        )

    def _take(self, points: ForecastPoints, now_ns: int) -> None:
        if points.quality not in USABLE or now_ns - self._matched_ns > BEAT_NS:
            return
        if math.isfinite(sum(points[:4])) and not self._is_replayed(points, now_ns):
            self._points[points.lead_s] = now_ns, points
            self.points = tuple(self._points.values())
            self.heard_ns = now_ns

    def _is_replayed(self, points: ForecastPoints, now_ns: int) -> bool:
        """Whether one frame in 20 s, which is sought, comes again and again."""
        if points == self._sought:
            self._again += 1
            self._replayed = self._replayed or self._again >= AGAIN
        elif now_ns - self._sought_ns > REPLAY_NS and abs(points.moment_rad) > LEAST_RAD:
            self._replayed = self._again >= AGAIN
            self._sought, self._sought_ns, self._again = points, now_ns, 0
        return self._replayed


def forecast_of(measured: Measurements, most_age_ms: float) -> WaveForecast | None:
    """Return what was forecast within an age, from now on; None if nothing was."""
    now_ns, rows = measured.now_ns, list[tuple[float, float, float]]()
    for heard_ns, points in measured.forecast:
        age_ns = now_ns - heard_ns
        if age_ns <= most_age_ms * MILLISECOND_NS:
            ahead_s = points.lead_s - age_ns * 1e-9
            rows.append((ahead_s, points.moment_rad, points.deviation_rad))
            rows.append((ahead_s + SPACING_S, points.next_moment_rad, points.deviation_rad))
    if not rows:
        return None
    columns = np.array(sorted(rows)).T
    return WaveForecast(*np.ascontiguousarray(columns))
