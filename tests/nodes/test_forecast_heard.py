"""Forecasts that come again are those of a station that replays them."""

import numpy as np
import pytest

from utank_hil.canbus import Address, ForecastPoints, Heartbeat, Quality, load_catalogue
from utank_hil.nodes.forecast_heard import ForecastHeard

CYCLE_NS = 20_000_000
LEADS = 11


class Station:
    """A station that sends forecasts to what hears them, at a frame each 20 ms."""

    def __init__(self, size_rad):
        catalogue, self.handlers = load_catalogue(), {}
        self.heard = ForecastHeard(self, catalogue, 0, (1, 2), {})
        self.forecast_id = catalogue.receiver(ForecastPoints).can_id
        self.beat_id = catalogue.receiver(Heartbeat, Address.PREVIEW).can_id
        self.size_rad, self.now_ns = size_rad, 0
        self.random = np.random.default_rng(1)

    def accept(self, can_id, _, handler):
        self.handlers[can_id] = handler

    def live(self, count):
        """Send forecasts of random waves; return how many of them counted."""
        moments = np.round(self.random.normal(0, self.size_rad, (count, 2)), 4).tolist()
        return self.send(
            [
                ForecastPoints(0.5 * (k % LEADS), *moment, 0.02, Quality.GOOD)
                for k, moment in enumerate(moments)
            ]
        )

    def send(self, frames):
        counted = 0
        for points in frames:
            self.now_ns += CYCLE_NS
            self.handlers[self.beat_id](Heartbeat(None, None, 0.0, 1, 2, 0.0, 0.0), self.now_ns)
            self.handlers[self.forecast_id](points, self.now_ns)
            counted += self.heard.heard_ns == self.now_ns
        return counted


@pytest.mark.parametrize("cycle", [33, 80, 250])
def test_what_is_replayed_counts_no_longer_until_it_lives_again(cycle):
    station = Station(0.03)
    assert station.live(3000) == 3000
    moments = station.random.normal(0, 0.03, (cycle, 2)).tolist()
    frames = [ForecastPoints(0.5, *each, 0.02, Quality.GOOD) for each in moments]
    again = [frames[k % cycle] for k in range(3000)]
    assert station.send(again) <= (20 + 3 * cycle * 0.02) / 0.02 + cycle
    assert station.send(again) == 0
    assert station.live(3000) >= 3000 - 2 * 20 / 0.02
    assert station.live(3000) == 3000


def test_forecasts_of_a_calm_sea_that_come_again_by_chance_are_none():
    station = Station(2e-4)
    assert station.live(10_000) == 10_000
