"""A shorter week with tighter bounds: thirteen minutes, retuned and disturbed all the while."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from firmware_sim.scenario import Scenario
from tools.studies.week import SCENARIO, Sample, sail, verdict
from utank_hil.assembly import retuning_task
from utank_hil.configuration import load_config
from utank_hil.control.predictive.design import WashoutLaw
from utank_hil.retuning import Candidate, ModelSummary, RetuningSettings

SETTINGS = RetuningSettings((6.0, 20.0), identification_s=10.0, trial_s=30.0, pulse_pa=10e3)


def configured_law():
    """An answer that costs nothing: the configured law, for the configured ship."""
    config = load_config(SCENARIO, Scenario).controllers["gpc"]
    task = retuning_task(config, 200, (6.0, 20.0))
    law = task.design.law(task.plant)
    assert isinstance(law, WashoutLaw)
    ship = task.plant.ship
    found = ModelSummary(
        12.6, 0.01, ship.inertia_kg_m2, ship.stiffness_nm_rad, ship.damping_nms_rad,
        task.plant.tank.damping_ratio, 0.99, 1.2, 0.3,
    )  # fmt: skip
    return Candidate(law.law, law.corner_rad_s, found)


def sailed():
    candidate = configured_law()

    def retune(record):
        return candidate

    return sail(800, 40, retune, 3, settings=SETTINGS, episode_s=55.0, cargo_s=110.0)


@pytest.mark.evidence
def test_faults_and_retunings_leave_nothing_behind():
    """In a process of its own: what other tests have left free in this one grows at random."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        samples, counts = pool.submit(sailed).result()
    print(counts, verdict(samples))
    assert counts["last 50 events: RETUNED"] > 0
    assert min(counts[name] for name in ("silence", "lost_link", "strange_frames")) > 0
    found = verdict(samples)
    assert found["objects_ratio"] <= 1.002
    assert found["resident_growth_mb"] <= 2.0
    assert found["more_descriptors"] <= 0


def test_what_grows_is_found():
    flat = [Sample(hour, 100.0, 10_000, 9, 50.0) for hour in range(16)]
    assert verdict(flat)["flat"]
    for name, slope in (("resident_mb", 1.0), ("objects", 50), ("descriptors", 1), ("tick_us", 1)):
        grown = [
            Sample(**{**vars(each), name: vars(each)[name] + slope * i})
            for i, each in enumerate(flat)
        ]
        assert not verdict(grown)["flat"]
