"""Preview station: it forecasts the waves that are to come, with an error of a stated size."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sections import Forecasts
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Address, Catalogue, ForecastPoints, Frame, Quality
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.nodes.forecast_heard import SPACING_S
from utank_hil.nodes.housekeeping import Housekeeping

_OTHER_SEA: Final = 1 << 33  # Beyond the seeds that other draws count up from a scenario's.


class PreviewStation:
    """Node that knows the waves of a scenario and sends them, two points a frame, lead by lead.

    Its error is the moment of another sea of the same spectrum, and it says how large that is.
    """

    name = "preview"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(self, scenario: Scenario, seed: int, catalogue: Catalogue) -> None:
        vessel, wanted = scenario.vessel, scenario.preview or Forecasts()
        assert vessel.foreign.preview is not None
        self._tag = vessel.foreign.preview << BUS_SHIFT
        self._waves = scenario.wave_moment(seed)
        self._others = scenario.wave_moment(seed + _OTHER_SEA)
        self._stiffness_nm_rad = vessel.ship.stiffness_nm_rad
        rms_rad = np.sqrt(self._waves.variance) / self._stiffness_nm_rad
        self._error, self._deviation_rad = wanted.error, float(wanted.error * rms_rad)
        self._leads_s = np.arange(0.0, wanted.horizon_s + 1e-9, 2 * SPACING_S).tolist()
        self._transmitter = catalogue.transmitter(ForecastPoints)
        self._cycle_ticks = self._transmitter.cycle_ns // self.period_ns
        self._housekeeping = Housekeeping(Address.PREVIEW, catalogue, vessel.version)
        self._begin_ns: int | None = None
        self._ticks = 0

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send the points of the next lead when they are due."""
        if self._begin_ns is None:
            self._begin_ns = now_ns
        frames = self._housekeeping.frames(now_ns)
        sent, late = divmod(self._ticks, self._cycle_ticks)
        if not late:
            lead_s = self._leads_s[sent % len(self._leads_s)]
            frames.append(self._transmitter.frame(self._points(now_ns, lead_s)))
        self._ticks += 1
        return [Frame(self._tag | each.can_id, each.data) for each in frames]

    def _points(self, now_ns: int, lead_s: float) -> ForecastPoints:
        assert self._begin_ns is not None
        begin_s = (now_ns - self._begin_ns) * 1e-9 + lead_s
        at_s = np.array([begin_s, begin_s + SPACING_S])
        moment_nm = self._waves.at(at_s)
        if self._error:
            moment_nm += self._error * self._others.at(at_s)
        first, second = (moment_nm / self._stiffness_nm_rad).tolist()
        return ForecastPoints(lead_s, first, second, self._deviation_rad, Quality.GOOD)
