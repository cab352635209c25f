"""Two motion sensors side by side, to the update."""

import math
from dataclasses import replace

import pytest
from moving_ship import SHIP, TANK, THRESHOLDS, MovingShip

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion_pair import MotionPair, SensorEvidence
from utank_hil.safety.monitors.motion_watch import MotionWatch
from utank_hil.safety.monitors.tank_equation import TankEquation

PERIOD_S = 10.0
MOUNTED_RAD = math.radians(0.5)
# the noise of a sample takes as much of each limit as the mounting
BOUNDS = replace(
    THRESHOLDS,
    tank_period_s=PERIOD_S,
    roll_noise_rad=5 * MOUNTED_RAD / 3,
    rate_noise_rad_s=5 * 2 * (2 * math.pi / PERIOD_S) * MOUNTED_RAD / 3,
)
ROLL_LIMIT_RAD = 2 * MOUNTED_RAD
RATE_LIMIT_RAD_S = 4 * (2 * math.pi / PERIOD_S) * MOUNTED_RAD
APART_RAD = 2 * ROLL_LIMIT_RAD
DISAGREE = Finding.SENSORS_DISAGREE
UNCLEAR = Finding.SENSORS_DISAGREE | Finding.SENSORS_UNCLEAR


class Pair:
    """Two sensors of which nothing is found, and their comparison every `step_s`."""

    def __init__(self, step_s: float = 0.25) -> None:
        self.pair = MotionPair(BOUNDS, step_s)
        assert self.pair.unclear is False
        self.used, self.spare = (
            SensorEvidence(MotionWatch(BOUNDS), TankEquation(SHIP, TANK, BOUNDS, 0.1))
            for _ in range(2)
        )

    def __call__(self, apart_rad: float = 0.0, rate_apart_rad_s: float = 0.0) -> int:
        return self.pair.update(apart_rad, rate_apart_rad_s, self.used, self.spare)

    def found(self, times: int, apart_rad: float = 0.0) -> list[int]:
        return [self(apart_rad) for _ in range(times)]


@pytest.mark.parametrize("way", [-1, 1])
def test_roll_or_rate_apart_by_more_than_mounting_and_noise_disagree(way: int) -> None:
    for roll, rate, found in ((0.98, 0.98, 0), (1.02, 0.0, DISAGREE), (0.0, 1.02, DISAGREE)):
        pair = Pair()
        for _ in range(4):
            last = pair(way * roll * ROLL_LIMIT_RAD, -way * rate * RATE_LIMIT_RAD_S)
        assert last == found
        assert pair.pair.unclear is bool(found)


@pytest.mark.parametrize("which", [0, 1])
def test_differences_are_smoothed_with_a_quarter_of_a_second(which: int) -> None:
    """In steps of 50 ms each takes a fifth of the rest; three tenths of a second are apart."""
    for share, late in ((0.9999, None), (1.0001, 5)):
        pair = Pair(0.05)
        # over its limit in the fourth step, and then for just so many
        apart = [0.0, 0.0]
        apart[which] = share * (ROLL_LIMIT_RAD, RATE_LIMIT_RAD_S)[which] / (1 - 0.8**4)
        found = [pair(*apart) for _ in range(4)]
        apart[which] = (ROLL_LIMIT_RAD, RATE_LIMIT_RAD_S)[which] * share
        found += [pair(*apart) for _ in range(10)]
        first = found.index(DISAGREE) if DISAGREE in found else None
        assert first == (None if late is None else 3 + late)


@pytest.mark.parametrize(("step_s", "updates"), [(0.15, 2), (0.1, 3), (0.3, 1)])
def test_a_difference_counts_after_three_tenths_of_a_second(step_s: float, updates: int) -> None:
    far_rad = 100 * ROLL_LIMIT_RAD
    pair = Pair(step_s)
    assert pair.found(updates, far_rad) == [0] * (updates - 1) + [DISAGREE]


def test_what_disagreed_is_remembered_for_a_roll_period() -> None:
    pair = Pair()
    assert pair.found(2, APART_RAD) == [0, DISAGREE]
    assert pair.found(41) == [DISAGREE] * 39 + [0, 0]
    assert pair.pair.unclear is False
    # and from the last time on
    assert pair.found(2, APART_RAD) == [0, DISAGREE]
    pair.found(10)
    assert pair.found(2, APART_RAD) == [DISAGREE] * 2
    assert pair.found(41) == [DISAGREE] * 39 + [0, 0]
    # once is too short a time, and is forgotten
    assert [pair(APART_RAD * (k % 2)) for k in range(20)] == [0] * 20


def test_it_is_unclear_after_one_and_a_half_periods_without_evidence() -> None:
    pair = Pair()
    assert pair(APART_RAD) == 0
    assert pair.found(61, APART_RAD) == [DISAGREE] * 60 + [UNCLEAR]
    pair.used.water = Finding.WATER_SIGN
    assert pair(APART_RAD) == DISAGREE
    assert pair.pair.unclear is False
    pair.spare.water = Finding.MOTION_LATE  # of both: as if there were one
    assert pair.found(61, APART_RAD) == [DISAGREE] * 60 + [UNCLEAR]
    assert pair.pair.unclear is True


@pytest.mark.parametrize("which", ["used", "spare"])
def test_evidence_counts_until_both_agree_again(which: str) -> None:
    pair = Pair()
    sensor = getattr(pair, which)
    other = pair.spare if sensor is pair.used else pair.used
    assert (sensor.accused, sensor.found, sensor.water) == (False, 0, 0)
    # beside a difference it is kept when it has gone
    pair.found(2, APART_RAD)
    sensor.watch.found = int(Finding.SPIKES)
    assert pair(APART_RAD) == DISAGREE
    sensor.watch.found = 0
    assert pair.found(80, APART_RAD) == [DISAGREE] * 80
    assert (sensor.accused, other.accused) == (True, False)
    assert pair.pair.unclear is False
    assert pair.found(40) == [DISAGREE] * 39 + [0]
    assert (sensor.accused, other.accused) == (False, False)
    # without a difference it is not
    sensor.watch.found = int(Finding.SPIKES)
    assert pair.found(3) == [DISAGREE] * 3
    assert (sensor.accused, other.accused) == (True, False)
    sensor.watch.found = 0
    assert pair.found(5) == [DISAGREE] * 4 + [0]
    assert sensor.accused is False


@pytest.mark.parametrize("which", ["used", "spare"])
def test_what_was_known_is_kept_while_one_is_silent(which: str) -> None:
    pair = Pair()
    sensor = getattr(pair, which)
    pair.found(2, APART_RAD)
    sensor.watch.found = int(Finding.SPIKES)
    pair(APART_RAD)
    sensor.watch.found = 0
    assert pair.found(400, math.nan) == [DISAGREE] * 400
    assert sensor.accused is True
    # nor is it forgotten where they never were apart, as with a drift
    pair = Pair()
    sensor = getattr(pair, which)
    sensor.watch.found = int(Finding.DRIFT)
    pair(0.0)
    sensor.watch.found = 0
    assert pair.found(400, math.nan) == [DISAGREE] * 400
    assert sensor.accused is True
    # of two that agree nothing is found, whichever is silent
    pair = Pair()
    assert pair.found(400, math.nan) == [0] * 400
    # of two that disagreed nobody knows which was right: half the pressure, and no end that could
    # not be reset while one is silent
    pair = Pair()
    assert pair(APART_RAD) == 0
    assert pair.found(10, APART_RAD) == [DISAGREE] * 10
    assert pair.found(400, math.nan) == [DISAGREE] * 400
    assert pair.pair.unclear is False
    assert pair.found(40, 0.0) == [DISAGREE] * 39 + [0]
    # the time is kept over short silences
    pair = Pair()
    assert pair(APART_RAD) == 0
    found = [pair(math.nan if k % 4 == 3 else APART_RAD) for k in range(90)]
    assert found.index(UNCLEAR) == 80
    assert [pair(APART_RAD), pair(math.nan)] == [UNCLEAR, DISAGREE]


@pytest.mark.parametrize("finding", Finding)
def test_what_is_evidence_against_a_motion_sensor(finding: Finding) -> None:
    pair = Pair()
    speaks = finding.name in {
        "MOTION_SIGN", "ROLL_STUCK", "RATE_STUCK", "DRIFT", "DRIFT_LASTS", "NOISE", "SPIKES",
        "WATER_SIGN", "MOTION_LATE", "MOTION_REPEATS",
    }  # fmt: skip
    for said in ((int(finding), 0), (0, int(finding))):
        pair.used.watch.found, pair.used.water = said
        assert pair.used.found == (finding if speaks else 0)
    pair.used.watch.found, pair.used.water = int(Finding.NOISE), int(finding)
    assert pair.used.found == (Finding.NOISE | finding if speaks else Finding.NOISE)


def test_a_gap_of_the_water_forgets_what_it_said() -> None:
    sensor = Pair().used
    ship = MovingShip()
    for t in (0.1 * k for k in range(600)):
        said = -ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t)
        sensor.water = sensor.equation.update(*said)
    assert sensor.water
    assert not math.isnan(sensor.equation.roll_gain)
    sensor.restart_water()
    assert sensor.water == 0
    assert math.isnan(sensor.equation.roll_gain)
