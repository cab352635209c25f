"""The share of a command that pays, on rolls whose best share is known in closed form."""

import math

import numpy as np
import pytest

from utank_hil.retuning.renewing import FIRST_EFFORT, LEAST_EFFORT, LIMITED_EFFORT, Effort

SAMPLES = 60


def ended(made_with_all: complex, periods: int = 60, *, plans: bool = False) -> float:
    """Share in the end, where the whole command adds this phasor to a passive roll of one."""
    effort = Effort(SAMPLES)
    for n in range(periods * SAMPLES):
        turn = np.exp(2j * np.pi * n / SAMPLES)
        passive_rad = float(turn.real)
        made_rad = effort.share * float((made_with_all * turn).real)
        effort.update(passive_rad + made_rad, passive_rad, limited=False, plans=plans)
    return effort.share


@pytest.mark.parametrize(
    ("made", "best"),
    [
        (-0.8 + 0.0j, 1.0),  # the best share is 1.25
        (-2.0 + 0.0j, 0.5),  # with all of it the roll would be turned round
        (-0.5 + 1.0j, 0.4),  # Re(-made) / |made|^2
        (0.3 + 0.0j, LEAST_EFFORT),  # it only adds roll
        (0.0 + 1.0j, LEAST_EFFORT),
    ],
)
def test_it_ends_at_the_share_of_the_least_roll(made: complex, best: float) -> None:
    assert ended(made) == pytest.approx(best, rel=0.04)


@pytest.mark.parametrize(
    ("made", "share"),
    [
        (-0.5 + 0.7j, 1.0),  # |1 + made|^2 is 0.74; the least would be at 0.68
        (-0.5 + 1.2j, 2 * 0.5 / 1.69),  # |1 + made|^2 is 1.69: where |1 + s made| is one again
        (0.3 + 0.0j, LEAST_EFFORT),
    ],
)
def test_a_law_that_plans_has_all_while_the_ship_rolls_less(made: complex, share: float) -> None:
    assert ended(made, 120, plans=True) == pytest.approx(share, rel=0.08)


def test_a_law_that_helps_again_comes_back() -> None:
    effort = Effort(SAMPLES)
    for made in (0.5, -0.8):
        for n in range(80 * SAMPLES):
            passive_rad = math.sin(2 * math.pi * n / SAMPLES)
            effort.update(passive_rad * (1 + effort.share * made), passive_rad, limited=False)
        assert (effort.share > 0.95) == (made < 0)


def test_an_unknown_passive_roll_gives_the_whole_command_and_clearing_forgets() -> None:
    effort = Effort(SAMPLES)
    for _ in range(40 * SAMPLES):
        effort.update(0.1, math.nan, limited=False)
    assert effort.share == pytest.approx(1.0, abs=0.01)
    effort.clear()
    assert effort.share == FIRST_EFFORT


def test_what_limits_make_of_the_roll_does_not_shrink_the_share_for_good() -> None:
    """At each crest a limit adds roll, whatever the share; without it all of the command pays."""
    effort = Effort(SAMPLES)
    for n in range(160 * SAMPLES):
        passive_rad = math.sin(2 * math.pi * n / SAMPLES)
        at_limit = n < 60 * SAMPLES and n % SAMPLES == SAMPLES // 4
        made_rad = -0.8 * effort.share * passive_rad + (6.0 if at_limit else 0.0)
        effort.update(passive_rad + made_rad, passive_rad, limited=at_limit)
        if n == 59 * SAMPLES:  # between two crests the memory of eight periods decays
            held = 8 * (1 - math.exp(-1 / 8))
            expected = LEAST_EFFORT + held * (LIMITED_EFFORT - LEAST_EFFORT)
            assert effort.share == pytest.approx(expected, rel=0.01)
    assert effort.share > 0.95
