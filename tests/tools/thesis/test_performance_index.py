"""The index of Fig. 3.10 against its integral; what a small gain does to it."""

import numpy as np
import pytest

from tools.thesis.linear_contest import (
    DPC_BOTH,
    FREQUENCY_RATIOS,
    PRINTED,
    SAMPLE_TIME_S,
    designed_laws,
    performance_index,
)
from utank_hil.analysis.loop.margins import closed_loop_response
from utank_hil.control import DesignPlant, PredictiveLaw
from utank_hil.dynamics import RollShip, Tank

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 5.8e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.08)


def test_index_is_the_integral_of_amplitude_taken_away_per_pressure():
    law, measured = designed_laws(SHIP, TANK)[DPC_BOTH], PRINTED[DPC_BOTH].measured
    plant, roll_rad_s = DesignPlant(SHIP, TANK, SAMPLE_TIME_S, 0.0), 0.496
    total, step = 0.0, FREQUENCY_RATIOS[1] - FREQUENCY_RATIOS[0]
    for q in FREQUENCY_RATIOS[::20]:
        w = np.array([q * roll_rad_s])
        passive = closed_loop_response(None, plant, measured, w)[0][0, 0]
        active, pressure = closed_loop_response(law, plant, measured, w)
        total += 20 * step * abs(abs(passive) - abs(active[0, 0])) / abs(pressure[0])
    found = performance_index(law, plant, measured)
    assert found == pytest.approx(total, rel=0.02)


def test_gain_of_a_law_counts_for_nothing_where_it_is_small():
    # amplitude taken away and pressure both grow with a small gain
    quiet, quieter = (
        performance_index(
            PredictiveLaw(
                np.zeros((1, 1, 1)), np.full((1, 1, 1), gain), np.zeros((1, 1, 1)), SAMPLE_TIME_S
            ),
            DesignPlant(SHIP, TANK, SAMPLE_TIME_S, 0.0),
            ("roll_rad",),
        )
        for gain in (1e-3, 1e-4)
    )
    assert quiet == pytest.approx(quieter, rel=1e-3)
