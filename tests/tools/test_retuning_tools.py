"""What the tools around identification and retuning compute beside what they run."""

import numpy as np
import pytest

from firmware_sim.run import COLUMNS, Run
from tools.benchmarks.retuning import interval
from tools.peers.identification_records import response, sampled_plant
from tools.studies import identification_bound
from tools.studies.retuned_voyages import voyages
from utank_hil.canbus import RetuningState
from utank_hil.retuning import RetuningEvent


def test_interval_of_a_count_is_that_of_the_tables() -> None:
    # exact Poisson limits, as in any table of them
    assert interval(0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert interval(10) == pytest.approx((4.795, 18.390), abs=1e-3)


def _run(name: str, roll_rad: float, *events: RetuningEvent) -> Run:
    rows = np.zeros((2000, len(COLUMNS)))
    rows[:, COLUMNS.index("time_s")] = 0.05 * np.arange(2000)
    rows[:, COLUMNS.index("true_roll_rad")] = roll_rad
    rows[:1300, COLUMNS.index("true_roll_rad")] = 9.0  # before 65 s
    return Run(name, rows, 0.0, 0, 0.0, retuning=events)


def test_voyages_are_judged_over_the_same_time_after_the_swap() -> None:
    found = (
        RetuningEvent(1_000_000_000, RetuningState.IDENTIFY, ("ordered",)),
        RetuningEvent(5_000_000_000, RetuningState.TRIAL, ("roll period 7.51 s; less roll",)),
        RetuningEvent(9_000_000_000, RetuningState.RETUNED, ()),
    )
    refused = (found[0], RetuningEvent(5_000_000_000, RetuningState.REFUSED, ("no fit",)))
    runs = [
        _run("passive", 3.0),
        *(_run("a", 1.0, *found), _run("a", 2.0)),
        *(_run("b", 2.5, *refused), _run("b", 2.5)),
    ]
    first, second = voyages(7, runs, settle_s=10.0)
    assert (first.seed, first.controller, first.ended, first.period_s) == (7, "a", "RETUNED", 7.51)
    assert (first.begun_s, first.from_s) == (1.0, 65.0)
    rolls = first.passive_rad, first.as_it_was_rad, first.retuned_rad
    assert rolls == pytest.approx((3.0, 2.0, 1.0))
    assert (second.ended, second.period_s, second.reasons) == ("REFUSED", None, ("no fit",))


def test_bound_of_a_gain_in_white_noise_is_noise_over_signal() -> None:
    rng = np.random.default_rng(1)
    u, deviation = rng.standard_normal(4000), np.array([0.5, 2.0])
    noise = np.zeros((identification_bound.NOISE_ORDER, 2, 2)), np.diag(1 / deviation)

    def gains(theta):
        zero = np.zeros((1, 1))
        return (
            zero,
            np.ones((1, 1)),
            np.array([[3.0], [5.0]]) * (1 + theta[:, None]),
            0 * theta[:, None],
        )

    right = response(*gains(np.zeros(2)))
    found = identification_bound.bound(gains, 2, u, noise, right)
    power = np.sum(u[identification_bound.NOISE_ORDER - 1 : -1] ** 2)
    np.testing.assert_allclose(found, deviation / [3.0, 5.0] / np.sqrt(power), rtol=1e-6)


def test_both_forms_of_the_true_model_are_the_ship_of_the_records() -> None:
    plant = sampled_plant()
    right = response(*(np.asarray(m) for m in (plant.A, plant.B, plant.C, plant.D)))
    for model, size in (
        (identification_bound.of_physics, 4),
        (identification_bound.of_four_states, 28),
    ):
        np.testing.assert_allclose(response(*model(np.zeros(size))), right, rtol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("studies.retuned_voyages", "nowhere.yaml"), "nowhere.yaml: can't be read"),
        (("studies.identification_bound", "--records", "0"), "--records must be 1 or more"),
        (("benchmarks.retuning", "--turns", "0"), "--turns must be 2 or more"),
    ],
)
def test_wrong_arguments_are_refused_with_the_remedy(tool, arguments, message) -> None:
    done = tool(*arguments)
    assert done.code == 2
    assert message in done.errors
