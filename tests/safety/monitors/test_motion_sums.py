"""The sums of roll and integrated rate, from closed forms and by hand."""

import math
from dataclasses import replace

import pytest
from moving_ship import THRESHOLDS
from scipy.integrate import solve_ivp

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate

D = 1 / 64
"""The threshold of the drift, rad."""
DRIFTS = replace(THRESHOLDS, drift_rad=D)


class Fed:
    """A monitor that is fed with what the roll moves and what the rate says."""

    def __init__(self, step_s, thresholds=DRIFTS):
        self.monitor = RollAgainstRate(thresholds)
        self.step_s, self.roll_rad = step_s, 0.0
        assert self.monitor.update(0.0, 0.0, step_s) == 0

    def __call__(self, moved_rad, turned_rad=0.0):
        self.roll_rad += moved_rad
        return self.monitor.update(self.roll_rad, turned_rad, self.step_s)

    def to(self, unexplained_rad):
        """Jump so far that so much is left unexplained."""
        keep = 1 - self.step_s / 15
        return self(unexplained_rad / keep - self.monitor.unexplained_rad) & (
            Finding.DRIFT | Finding.DRIFT_LASTS
        )


DRIFT, LASTS = Finding.DRIFT, Finding.DRIFT | Finding.DRIFT_LASTS


@pytest.mark.parametrize("at_s", [20.0, 60.0, 260.0, 600.0])
@pytest.mark.parametrize("way", [-1, 1])
def test_of_a_constant_bias_so_much_is_left_as_has_not_been_learned(at_s, way):
    """In a leak of 15 s; it is learned as an average over 30 s and the time, at most 300 s."""
    bias_rad_s = way * 2e-4

    def slopes(t, state):
        left, learned = state
        remains = -bias_rad_s - learned
        return remains - left / 15, remains / min(30 + t, 300)

    expected_rad = solve_ivp(slopes, (0, at_s), (0.0, 0.0), rtol=1e-8, atol=1e-12).y[0, -1]
    fed = Fed(0.1)
    for _ in range(round(at_s / 0.1)):
        fed(0.0, bias_rad_s * 0.1)
    assert fed.monitor.unexplained_rad == pytest.approx(expected_rad, rel=0.02)
    fed.monitor.restart()
    assert fed.monitor.unexplained_rad == 0.0
    # what was learned is kept
    fed.monitor.update(fed.roll_rad, 0.0, 0.1)
    fed(0.0, bias_rad_s * 0.1)
    remains = 30 / (30 + at_s) if at_s < 270 else 0.1 * math.exp(-(at_s - 270) / 300)
    left_rad = -remains * bias_rad_s * 0.1 * (1 - 0.1 / 15)
    assert fed.monitor.unexplained_rad == pytest.approx(left_rad, rel=0.02)


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(("jump", "learns"), [(6.0, False), (-6.0, False), (5.75, True)])
def test_a_jump_is_learned_as_little_and_nothing_is_while_three_thresholds_are_left(
    way, jump, learns
):
    """Steps of half the leak's time: 7.5 s, of which the sum keeps half."""
    fed = Fed(7.5)
    fed(way * jump * D)
    sums = [jump / 2 * D]
    assert fed.monitor.unexplained_rad == way * sums[0]
    bias = math.copysign(D / 37.5, jump)
    for learned_s in (45, None):
        left = -7.5 * bias
        sums.append((sums[-1] + left) / 2)
        if learns and learned_s:
            bias += left / learned_s
        fed(0.0)
        assert fed.monitor.unexplained_rad == pytest.approx(way * sums[-1], rel=1e-12)


@pytest.mark.parametrize("way", [-1, 1])
def test_the_sum_stays_within_six_thresholds_and_forgets_in_fifteen_seconds(way):
    fed = Fed(7.5)
    fed(way * 100 * D)
    assert fed.monitor.unexplained_rad == way * 6 * D
    fed = Fed(15.0)
    fed(way * 100 * D)
    assert fed.monitor.unexplained_rad == 0.0
    fed = Fed(40.0)
    fed(way * 100 * D)
    assert fed.monitor.unexplained_rad == 0.0


@pytest.mark.parametrize("way", [-1, 1])
def test_one_threshold_is_a_drift_and_four_of_the_smoothed_sum_are_too_many(way):
    for sum_rad, found in ((D, 0), (1.01 * D, DRIFT), (4 * D, DRIFT), (4.01 * D, LASTS)):
        assert Fed(7.5)(way * 2 * sum_rad) & LASTS == found
    # smoothed with 0.25 s: 0.32 of the rest in a step of 80 ms
    fed = Fed(0.08)
    assert [fed.to(way * 5.9 * D) for _ in range(4)] == [DRIFT, DRIFT, LASTS, LASTS]
    share = 1 - 0.68**3
    assert 4 / share < 5.9 < 4 / (1 - 0.68**2)


@pytest.mark.parametrize(("dip", "forgets"), [(0.6, False), (0.9, False), (0.45, True)])
@pytest.mark.parametrize("way", [-1, 1])
def test_a_drift_lasts_after_thirty_seconds_that_half_of_it_ends(dip, forgets, way):
    fed = Fed(0.5)
    assert [fed.to(way * 2 * D) for _ in range(61)] == [DRIFT] * 60 + [LASTS]
    fed = Fed(0.5)
    assert [fed.to(way * 2 * D) for _ in range(50)] == [DRIFT] * 50
    assert fed.to(way * dip * D) == 0
    more = 60 if forgets else 10
    assert [fed.to(way * 2 * D) for _ in range(more + 1)] == [DRIFT] * more + [LASTS]
    fed.monitor.restart()
    fed(0.0)
    assert [fed.to(way * 2 * D) for _ in range(61)] == [DRIFT] * 60 + [LASTS]


def forgetting(fed, way):
    """Leave four thresholds unexplained until the bias is forgotten, after a minute beyond three.

    In the first step nothing is unexplained yet.
    """
    left = []
    while not left or left[-1] > 3 * D:
        fed.to(way * 4 * D)
        left.append(abs(fed.monitor.unexplained_rad))
    assert len(left) == 122


def lasting(fed):
    """For how many steps without anything new the drift is still found."""
    return next(count for count in range(200) if not fed(0.0))


@pytest.mark.parametrize("way", [-1, 1])
def test_a_bias_that_explains_nothing_for_a_minute_is_forgotten(way):
    fed = Fed(0.5)
    for _ in range(100):
        fed.to(way * 4 * D)
    fed.to(0.0)
    forgetting(fed, way)  # the first minute was not whole
    # thirty seconds of agreement, the step of the forgetting among them
    assert lasting(fed) == 59


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("agreed", [0, 20, 57])
def test_a_drift_among_the_thirty_seconds_of_agreement_begins_them_anew(way, agreed):
    fed = Fed(0.5)
    forgetting(fed, way)
    assert [fed.to(0.0) for _ in range(agreed)] == [LASTS] * agreed
    assert fed.to(way * 1.5 * D) == LASTS
    fed.to(0.0)
    assert lasting(fed) == 59


@pytest.mark.parametrize(("share", "found"), [(0.97, False), (1.03, True)])
def test_noise_of_the_roll_is_its_second_difference_over_the_square_root_of_six(share, found):
    """Of a roll that goes to and fro by a the second difference is 4 a."""
    noisy = replace(THRESHOLDS, drift_rad=100.0, roll_noise_rad=0.01)
    a, fed = share * math.sqrt(6) * 0.01 / 4, Fed(0.7, noisy)
    last = [fed(2 * a * (-1) ** k, 2 * a * (-1) ** k) for k in range(20)][-1]
    assert last & Finding.NOISE == (Finding.NOISE if found else 0)
    assert fed.monitor.noise.power == pytest.approx((4 * a) ** 2)
    # of a new roll after a gap there is none
    fed.monitor.restart()
    fed.monitor.update(1.0, 0.0, 0.7)
    fed.monitor.update(1.0, 0.0, 0.7)
    assert fed.monitor.noise.power == 0.0
