"""What the supervisor looks at: windows, time constants and thresholds to the tick."""

import math

import pytest
from controller_bench import CATALOGUE, MS, VERSION

from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.observer import HEEL_TIME_CONSTANT_S, Observer


class Table:
    """An observer of an inbox that hears nothing."""

    def __init__(self) -> None:
        self.inbox = Inbox(CATALOGUE, VERSION)
        self.observer = Observer(self.inbox, 250_000, 20 * MS)
        self.seen = self.observer.seen
        self.now_ns = 0

    def tick(self, late_ticks: int = 0) -> None:
        self.now_ns += (1 + late_ticks) * TICK_NS
        self.observer.observe(self.now_ns, 0)

    def measure(self, roll_rad: float, seconds: float = TICK_S) -> None:
        self.inbox.roll_rad = roll_rad
        for _ in range(round(seconds / TICK_S)):
            self.inbox.motion_ns = self.now_ns
            self.tick()


@pytest.mark.parametrize("begins", range(0, 100, 7))
def test_load_of_the_bus_is_that_of_the_last_second_whenever_a_flood_begins(begins: int) -> None:
    table = Table()
    for _ in range(300 + begins):
        table.tick()
    assert table.seen.bus_load == 0.0
    for tick in range(1, 201):
        table.inbox.frames += 15  # 15 x 143 bits in 10 ms at 250 kbit/s: 0.858
        table.tick()
        assert table.seen.bus_load <= 0.858 * min(tick + 1, 100) / 100 + 1e-9
        assert table.seen.bus_load >= 0.858 * min(tick - 9, 100) / 100 - 1e-9


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_heel_is_the_low_pass_of_the_roll_over_a_minute_with_its_sign(sign: float) -> None:
    table = Table()
    table.measure(0.0, 60.0)
    table.measure(sign * 0.1, 60.0)
    assert HEEL_TIME_CONSTANT_S == 60.0
    assert table.seen.heel_rad == pytest.approx(sign * 0.1 * (1 - math.exp(-1)), rel=1e-3)


def test_in_the_first_minute_heel_is_the_mean_of_what_was_measured_and_of_ten_seconds_of_zeros():
    table = Table()
    table.inbox.roll_rad = 0.3  # nobody measured it
    table.tick()
    assert table.seen.heel_rad == 0.0
    rolls = [0.3 + 0.2 * math.sin(0.005 * k) for k in range(round(50.0 / TICK_S) + 1)]
    for count, roll_rad in enumerate(rolls, 1):
        table.measure(roll_rad)
        mean_rad = sum(rolls[:count]) / (count + 10.0 / TICK_S - 1)
        assert table.seen.heel_rad == pytest.approx(mean_rad, rel=1e-9)
    # and from then on each sample has the same share
    table.measure(table.seen.heel_rad + 1.0)
    assert table.inbox.roll_rad - table.seen.heel_rad == pytest.approx(1.0 - TICK_S / 60.0)


def test_a_roll_that_is_not_measured_any_more_is_no_heel() -> None:
    table = Table()
    table.measure(0.0, 60.0)
    table.measure(0.2)
    for _ in range(9):
        table.tick()
    counted_rad = table.seen.heel_rad
    assert table.seen.motion_age_ms == 100.0
    for _ in range(12_000):
        table.tick()
    assert table.seen.heel_rad == counted_rad
    table.measure(0.0)
    assert table.seen.heel_rad < counted_rad


def test_link_is_lost_for_a_command_cycle_after_an_error() -> None:
    table = Table()
    table.tick()
    assert not table.seen.link_lost
    table.observer.link_error(table.now_ns)
    for lost in (True, True, False, False):
        table.tick()
        assert table.seen.link_lost == lost


def test_a_late_tick_counts_for_ten_ticks() -> None:
    table = Table()
    table.tick()
    table.tick(late_ticks=1)
    for _ in range(9):
        assert table.seen.overruns_in_ten == 1
        table.tick()
    assert table.seen.overruns_in_ten == 1
    table.tick()
    assert table.seen.overruns_in_ten == 0


def test_a_second_sender_is_gone_after_ten_seconds() -> None:
    table = Table()
    table.tick()
    assert not table.seen.address_conflict
    table.inbox.conflict_ns = table.now_ns
    for _ in range(1000):
        table.tick()
        assert table.seen.address_conflict
    table.tick()
    assert not table.seen.address_conflict
