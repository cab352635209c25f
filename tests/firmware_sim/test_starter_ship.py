"""The ship of a starter project: where its roll damping comes from."""

import dataclasses

import pytest

from firmware_sim.starter import StarterShip

SHIP = StarterShip("patrol", 63, 9.5, 1000, 0.9, 9.5, 3.2)


def test_damping_is_as_given_or_estimated_or_assumed() -> None:
    ratio, words = SHIP.damping
    # a 63 m vessel's regression with keels elsewhere: 0.015 at 3 degrees, 0.030 at 10
    assert 0.010 < ratio < 0.030
    assert "1.5 either way" in words
    given = dataclasses.replace(SHIP, roll_damping_ratio=0.07)
    assert given.damping == (0.07, "as given")
    unknown = dataclasses.replace(SHIP, draught_m=None)
    assert unknown.damping == (0.05, "assumed, --draught estimates it")


def test_radiation_of_a_hull_takes_the_place_of_the_estimate_s_waves() -> None:
    estimate, _ = SHIP.damping
    still, _ = dataclasses.replace(SHIP, radiated_ratio=0.0).damping
    assert still < estimate
    assert dataclasses.replace(SHIP, radiated_ratio=0.01).damping[0] == pytest.approx(still + 0.01)


@pytest.mark.parametrize(("draught_m", "named"), [(2.0, "beam per draught"), (9.0, "block")])
def test_a_form_beyond_the_regression_is_named_with_a_wider_factor(draught_m, named) -> None:
    words = dataclasses.replace(SHIP, draught_m=draught_m).damping[1]
    assert "2 either way" in words
    assert named in words
