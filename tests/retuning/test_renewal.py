"""The retuner's work for a renewal: from an estimate to a law with all margins."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from utank_hil.analysis.loop.margins import robustness
from utank_hil.analysis.loop.self_tuning import passive_roll_rad, sample_time_of
from utank_hil.assembly import works_of
from utank_hil.canbus import Verdict
from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.retuning import Desk, MotionEstimate, Refusal, RenewedLaw, ShipFigures
from utank_hil.retuning.estimate import MOST_BANDS
from utank_hil.retuning.renewal import RenewalTask, TailedSpectrum, renew
from utank_hil.sea import SlopeSpectrum, ittc

CONTROLLERS = Path("configs/controllers")
CONFIG = load_config(CONTROLLERS / "self_tuning.yaml", ControllerConfig)
PLANT = CONFIG.plant
SHIP = ShipFigures.of(PLANT.ship)
G = 9.81
OMEGA = np.arange(0.12, 2.4, 0.02)
STORM = ittc(4.0, 10.0)


def slope(omega: np.ndarray) -> np.ndarray:
    """Of the storm, with an effective slope of a half."""
    density = np.interp(omega / (2 * np.pi), STORM.frequency_hz, STORM.density) / (2 * np.pi)
    return density * (0.5 * omega**2 / G) ** 2


def estimated(ship: ShipFigures = SHIP, factor: float = 1.0) -> MotionEstimate:
    density = factor * slope(OMEGA)
    waves = SlopeSpectrum(OMEGA, density)
    return MotionEstimate(Verdict.GOOD, Verdict.GOOD, ship, waves, 0.05, 4.0, 10.0, 1200.0)


@pytest.mark.evidence("1.1455847255369929-0.7352")
@pytest.mark.parametrize(("period", "begun_with"), [(1.0, 0.5548), (14.4 / 12.57, 0.7352)])
def test_the_law_is_for_the_estimated_ship_at_the_sample_time_of_the_one_in_charge(
    period: float, begun_with: float
) -> None:
    """It rolls less than the law that the observer's search begins with.

    That law comes from Riccati equations: its share of the passive roll, `begun_with`, is the same
    to eleven digits on any processor. How far a search of ten steps comes from there is not.
    """
    ship = replace(SHIP, stiffness_nm_rad=SHIP.stiffness_nm_rad / period**2)
    step_s = sample_time_of(PLANT)
    task = RenewalTask(PLANT, step_s)
    answer = renew(estimated(ship), task)
    assert isinstance(answer, RenewedLaw)
    assert answer.law.sample_time_s == step_s
    plant = replace(PLANT, ship=ship.ship(PLANT.ship))
    measured = ("roll_rad", "roll_rate_rad_s", "level_m")
    assert not robustness(answer.law, plant, measured, with_delay_margin=False).failures()
    waves = estimated(ship).waves
    assert waves is not None
    passive = passive_roll_rad(plant, TailedSpectrum(waves))
    assert answer.passive_roll_rad == pytest.approx(passive, rel=1e-9)
    assert answer.roll_rad < begun_with * passive


def test_beyond_the_bands_the_slope_falls_as_that_of_wind_waves() -> None:
    waves = estimated().waves
    tailed = TailedSpectrum(waves)
    inside = OMEGA[:-1] + 0.01
    assert tailed.slope_density(inside) == pytest.approx(waves.slope_density(inside))
    beyond = np.array([2.5, 5.0, 12.0])
    assert tailed.slope_density(beyond) == pytest.approx(
        tailed.slope_density(np.array([3.0])) * 3.0 / beyond
    )
    # the tail of this sea by its formula, 5/16 Hs^2 wp^4 / w^5, its exponential near one
    true = (0.5 / G) ** 2 * 5 / 16 * 4.0**2 * (2 * math.pi / 10.0) ** 4 / beyond
    assert tailed.slope_density(beyond) == pytest.approx(true, rel=0.15)


def test_waves_that_do_not_roll_her_are_refused_with_the_reason() -> None:
    task = RenewalTask(PLANT, sample_time_of(PLANT))
    answer = renew(estimated(factor=0.0), task)
    assert isinstance(answer, Refusal)
    assert "does not roll the ship" in answer.reasons[0]
    nothing = MotionEstimate(Verdict.RECORD_SHORT, Verdict.RECORD_SHORT)
    answer = renew(nothing, task)
    assert isinstance(answer, Refusal)
    assert "no estimate" in answer.reasons[0]


def test_the_works_of_a_configuration_hold_the_renewal_and_its_power_budget() -> None:
    law = replace(CONFIG.law, mean_power_w=2e5)  # type: ignore[type-var]  # it is a dataclass
    work, estimating = works_of(CONFIG.model_copy(update={"law": law}))
    assert estimating is not None
    assert work.compute.keywords["task"].mean_power_w == 2e5  # type: ignore[attr-defined]  # partial
    waves = SlopeSpectrum(*(np.arange(1.0, 1 + MOST_BANDS),) * 2)
    Desk(work).submit(1, replace(estimated(), waves=waves), 0)  # the widest estimate fits
    assert works_of(load_config(CONTROLLERS / "self_tuned.yaml", ControllerConfig)) == (None, None)


def test_a_law_of_another_kind_is_not_renewed(tmp_path: Path) -> None:
    ship = (CONTROLLERS / "../ships/thesis_first.yaml").resolve()
    path = tmp_path / "any.yaml"
    path.write_text(
        f"name: any\nvessel: {ship}\nlaw: {{kind: passive}}\nsea_estimate: {{renew: true}}\n"
    )
    with pytest.raises(ConfigError, match=r"sea_estimate.renew.*is for a law of kind self_tuned"):
        load_config(path, ControllerConfig)
