"""A ship loaded otherwise than her file, identified in closed loop, and by methods of others."""

import numpy as np
import pytest

from tools.studies.identified_ships import (
    LOADS,
    RATE,
    SAMPLE_TIME_S,
    ShipRecord,
    by_motion,
    by_okid,
    motion_estimate,
    record_of,
    response_error,
    shipped,
    table,
)
from tools.studies.published_identification import published

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def record():
    """Waves of 3 m and 8 s."""
    return record_of(1)


def test_pulses_roll_the_ship_five_per_cent_more_at_most(record):
    assert record.sea == "3 m 8 s"
    assert 1.0 < record.added_roll < 1.05


def test_motion_and_pulses_find_the_same_ship(record):
    seen = motion_estimate(record, slice(len(record.motion) - record.first, None))
    rows = {
        "motion": by_motion(record, seen),
        "OKID": by_okid(record, ("roll_rad", "level_m"), 200),
    }
    for row in rows.values():
        assert abs(row["ratios"][0] - 1) < 0.03
        assert abs(row["in_deviations"][0]) < 3
    rows["OKID"]["counts"] = False  # as where the motion says otherwise
    made = {row["method"]: row for row in table([rows])}
    assert (made["motion"]["counts"], made["OKID"]["counts"]) == (1, 0)
    assert made["OKID"]["accepted"] == 1


def _still(plant, u):
    """Roll and level in still water."""
    model = plant.sampled(("roll_rad", "level_m"), SAMPLE_TIME_S)
    state, y = np.zeros(len(model.A)), np.empty((len(u), 2))
    for k, value in enumerate(u):
        y[k] = model.C @ state + model.D[:, 0] * value
        state = model.A @ state + model.B[:, 0] * value
    return y


def test_published_methods_are_right_where_there_are_no_waves():
    plant, draw = shipped().plant, np.random.default_rng(3)
    u = 1e4 * np.repeat(draw.choice([-1.0, 1.0], 400), 5)
    y = _still(plant, u)
    y += 1e-3 * y.std(axis=0) * draw.standard_normal(y.shape)
    motion = np.zeros((len(u), len(RATE)))
    calm = ShipRecord(plant, "still", u, motion, 0, 1.0)
    found = published()
    assert len(found) >= 3
    for name, identify in found.items():
        assert response_error(calm, identify(u, y, SAMPLE_TIME_S)) < 0.1, name
    assert LOADS == (0.85, 1.3)
