from pathlib import Path

import numpy as np
import pytest

from utank_hil.control import DesignPlant, PumpLimits, pump_model
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.sampling import sample
from utank_hil.retuning import RetuningSettings, make_pulses
from utank_hil.retuning.settings import Excitation

CONFIGS = Path(__file__).parents[2] / "configs"

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.8e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
LIMITS = PumpLimits()


def _largest_response(pulses: np.ndarray) -> tuple[float, float]:
    plant = sample(pump_model(SHIP, TANK, ("roll_rad", "level_m")), 0.2, 0.05, 0.1)
    state, largest = np.zeros(len(plant.A)), np.zeros(2)
    for pressure in pulses:
        largest = np.maximum(largest, np.abs(plant.C @ state + plant.D[:, 0] * pressure))
        state = plant.A @ state + plant.B[:, 0] * pressure
    return float(largest[0]), float(largest[1])


@pytest.mark.parametrize(
    ("kind", "added_roll_rad"),
    [("random_pulses", 0.005), ("random_pulses", 0.02), ("random_pulses", 0.5), ("prbs", 0.02),
     ("multisine", 0.02), ("chirp", 0.02)],
)  # fmt: skip
def test_pulses_keep_within_pressure_rate_roll_and_level(kind, added_roll_rad: float) -> None:
    settings = RetuningSettings(
        (6.0, 20.0), added_roll_rad=added_roll_rad, excitation=Excitation(kind)
    )
    made = make_pulses(settings, DesignPlant(SHIP, TANK, limits=LIMITS), 0.2)
    pulses = made.pressure_pa
    assert len(pulses) == 2500
    assert np.abs(pulses).max() <= settings.pulse_pa
    assert np.abs(np.diff(pulses)).max() <= LIMITS.rate_pa_s * 0.2 * (1 + 1e-12)
    roll_rad, level_m = _largest_response(pulses)
    assert roll_rad <= added_roll_rad * (1 + 1e-9)
    assert level_m <= LIMITS.level_m * (1 + 1e-9)
    # nothing is given away: one of the limits is reached
    assert (
        max(roll_rad / added_roll_rad, level_m / LIMITS.level_m, np.abs(pulses).max() / 30e3) > 0.9
    )


def test_a_band_is_for_multisine_and_chirp_and_rises() -> None:
    assert Excitation("chirp", (0.3, 0.9)).band == (0.3, 0.9)
    with pytest.raises(ValueError, match="band_rad_s"):
        Excitation("prbs", (0.3, 0.9))
    with pytest.raises(ValueError, match="must rise"):
        Excitation("chirp", (0.9, 0.3))


def test_pumps_own_limit_counts_too() -> None:
    settings = RetuningSettings((6.0, 20.0), pulse_pa=40e3, added_roll_rad=1.0)
    limits = PumpLimits(pressure_pa=10e3)
    pulses = make_pulses(settings, DesignPlant(SHIP, TANK, limits=limits), 0.2).pressure_pa
    assert np.abs(pulses).max() <= 10e3


@pytest.mark.parametrize(
    "wrong",
    [
        {"roll_period_range_s": (20.0, 6.0)},
        {"order": 1},
        {"identification_s": 0.0},
        {"pulse_pa": float("nan")},
        {"every_s": -1.0},
        {"change_factor": 1.0},
        {"trial_s": float("inf")},
        {"trial_s": 29.0},  # before the earliest verdict
        {"answer_within_s": 601.0},
        {"roll_limit_rad": 0.71},
        {"seed": -1},
        {"identification_s": 5.0, "excitation": Excitation("multisine")},
    ],
)
def test_settings_out_of_range_are_refused_by_name(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        RetuningSettings(**{"roll_period_range_s": (6.0, 20.0), **wrong})  # type: ignore[arg-type]
