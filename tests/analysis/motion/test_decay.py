"""Decay tests: measured ones against values found elsewhere, simulated ones against their truth."""

import csv
import json

import numpy as np
import pytest
from others import others_file

from tools.thesis.capsize import without_tank
from tools.thesis.simulate import simulate
from utank_hil.analysis.motion.decay import roll_decay
from utank_hil.dynamics import RollModel, RollShip, Tank

TANK = Tank(17.1, 4.88, 17.11, 6.22)


def simulated(zeta, b2, start_rad=0.2):
    ship = RollShip(2e9, 2e9 * 0.25, 2 * zeta * 0.5 * 2e9, b2 * 2e9)
    run = simulate(without_tank(RollModel(ship, TANK)), 200.0, (start_rad, 0, 0, 0))
    part = slice(0, None, 10)
    return run.time_s[part], run.state[part, 0]


def measured(name):
    (record,) = (
        each
        for each in json.loads(others_file("decay/records.json").read_text())
        if each["file"] == name
    )
    with others_file(f"decay/{name}").open() as lines:
        rows = [(float(row["time_s"]), float(row["roll_rad"])) for row in csv.DictReader(lines)]
    time, roll = np.array(rows).T
    part = (time >= record["start_s"]) & (time <= record["end_s"])
    return time[part], roll[part]


@pytest.mark.parametrize(
    ("name", "period", "zeta", "b2", "equivalent"),
    [
        ("kvlcc2_21337", 2.5532, (0.00096, 0.00147), (0.094, 0.106), (0.00492, 0.00639, 0.00787)),
        ("kvlcc2_21340", 2.5497, (0.0110, 0.0119), (0.038, 0.061), (0.01331, 0.01405, 0.01479)),
        ("kvlcc2_hybrid_15.5kn", 2.5788, (0.0103, 0.0117), (0.033, 0.064),
         (0.01280, 0.01352, 0.01424)),
        ("kvlcc2_potential_flow_0kn", 2.5567, (-0.0002, 0.0004), (0.019, 0.028),
         (None, 0.00132, 0.00167)),
        ("kvlcc2_potential_flow_15.5kn", 2.5553, (-0.0023, -0.0001), (0.073, 0.112),
         (None, 0.00359, 0.00496)),
    ],
)  # fmt: skip
def test_records_of_others_give_the_damping_found_elsewhere(name, period, zeta, b2, equivalent):
    found = roll_decay(*measured(f"{name}.csv"))
    assert found.period_s == pytest.approx(period, rel=1e-3)
    assert zeta[0] <= found.damping_ratio <= zeta[1]
    assert b2[0] <= found.quadratic_per_rad <= b2[1]
    for amplitude_deg, ratio in zip((5, 7, 9), equivalent, strict=True):
        if ratio is not None:
            work = 4 / (3 * np.pi) * np.radians(amplitude_deg) * found.quadratic_per_rad
            assert found.damping_ratio + work == pytest.approx(ratio, rel=0.015)
    assert found.residual_share < 0.008


@pytest.mark.parametrize(("zeta", "b2"), [(0.02, 0.0), (0.01, 0.2), (0.003, 0.05)])
def test_a_simulated_decay_gives_back_its_damping(zeta, b2):
    found = roll_decay(*simulated(zeta, b2))
    assert found.period_s == pytest.approx(2 * np.pi / 0.5, rel=1e-5)
    assert found.damping_ratio == pytest.approx(zeta, abs=2e-5)
    assert found.quadratic_per_rad == pytest.approx(b2, abs=1e-3)


@pytest.mark.parametrize("heel_deg", [0.1, 1.0, -3.0])
def test_heel_and_drift_are_no_damping(heel_deg):
    time, roll = measured("kvlcc2_21337.csv")
    straight = roll_decay(time, roll)
    heeled = roll_decay(time, roll + np.radians(heel_deg) + 1e-4 * (time - time[0]))
    assert heeled.damping_ratio == pytest.approx(straight.damping_ratio, abs=1e-5)
    assert heeled.heel_rad - straight.heel_rad == pytest.approx(np.radians(heel_deg), abs=1e-5)
    assert any("heel" in each for each in heeled.warnings) == (abs(heel_deg) > 2.4)


def test_a_gap_and_uneven_times_cost_nothing():
    time, roll = measured("kvlcc2_21337.csv")
    keep = (time < 40) | (time > 43.8)
    keep &= np.arange(len(time)) % 7 != 3
    found, whole = roll_decay(time[keep], roll[keep]), roll_decay(time, roll)
    assert found.damping_ratio == pytest.approx(whole.damping_ratio, abs=1.5e-4)
    assert found.quadratic_per_rad == pytest.approx(whole.quadratic_per_rad, rel=0.03)


def test_intervals_hold_the_truth_in_most_records():
    """Noise that is correlated over a swing, as that of a residual swell; nominal 95 %."""
    time, roll = simulated(0.004, 0.1)
    held = np.zeros(2)
    for seed in range(40):
        white = np.random.default_rng(seed).normal(size=len(time))
        noise = np.convolve(white, np.exp(-np.arange(60) / 15), "same")
        found = roll_decay(time, roll + 1e-3 * noise / np.std(noise))
        for n, (truth, (low, high)) in enumerate(
            [(0.004, found.ratio_interval), (0.1, found.quadratic_interval_per_rad)]
        ):
            held[n] += low <= truth <= high
    assert np.all(held >= 34)


def test_the_answer_says_for_which_amplitudes_it_holds():
    found = roll_decay(*measured("kvlcc2_21337.csv"))
    assert np.degrees(found.amplitude_rad) == pytest.approx([3.9, 6.5, 9.2], abs=0.1)
    assert np.all(found.equivalent_interval[:, 0] < found.equivalent_ratio)
    assert found.halves_ratio is not None
    assert min(found.halves_ratio) < found.equivalent_ratio[1] < 1.05 * max(found.halves_ratio)


def whole_file():
    with others_file("decay/kvlcc2_21337.csv").open() as lines:
        rows = [(float(row["time_s"]), float(row["roll_rad"])) for row in csv.DictReader(lines)]
    time, roll = np.array(rows).T
    return time, roll


SWING = np.arange(0, 120, 0.1)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (lambda: (SWING[:200], 0.1 * np.exp(-SWING[:200] / 80) * np.cos(0.5 * SWING[:200])),
         "two swings or more"),
        (lambda: (SWING[:280], 0.1 * np.exp(-SWING[:280] / 80) * np.cos(0.5 * SWING[:280])),
         r"needs 2\.5 swings, .* has 2\.2"),
        (lambda: (SWING[::40], 0.1 * np.exp(-SWING[::40] / 80) * np.cos(0.5 * SWING[::40])),
         "20 samples a swing|at least 20 samples"),
        (lambda: (SWING, 0.1 * np.cos(0.5 * SWING + 0.4) + 1e-3 * np.cos(0.37 * SWING)),
         "does not decay"),
        (lambda: (SWING, 0.01 * np.exp(SWING / 60) * np.cos(0.5 * SWING)), "does not decay"),
        (lambda: (SWING, 0.1 * np.cos(0.5 * SWING) + 0.08 * np.cos(0.61 * SWING)), "leaves"),
        (lambda: (SWING, 0.3 + 0.1 * np.exp(-SWING / 80) * np.cos(0.5 * SWING)), "heel of 17"),
        (whole_file, "leave them out|does not decay"),
        (lambda: (np.repeat(SWING, 2), 0.1 * np.cos(np.repeat(SWING, 2))), "rising times"),
    ],
)  # fmt: skip
def test_what_is_no_free_decay_is_refused(record, words):
    with pytest.raises(ValueError, match=words):
        roll_decay(*record())
