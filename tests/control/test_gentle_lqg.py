"""A linear law with gains for less pressure: stepping, and what it does to the roll."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.analysis.loop.margins import of_period, robustness
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import LQGLaw, SeaModel
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.lqg import SHARES, GentleController
from utank_hil.sea import Harmonics, ittc

CONFIG = load_config(Path("configs/controllers/self_tuning.yaml"), ControllerConfig)
PLANT = CONFIG.plant
MEASURED = ("roll_rad", "roll_rate_rad_s", "level_m")


@cache
def first_law() -> ConstrainedLaw:
    assert isinstance(CONFIG.law, SelfTunedDesign)
    law = CONFIG.law.build(PLANT, first=True).linear
    assert isinstance(law, ConstrainedLaw)
    return law


def of_share(share: float, *, scaled: bool = False) -> LQGLaw:
    """The linear law for a share of the pressure; `scaled` is a share of the whole command."""
    law = first_law().unlimited()
    if scaled or share == 1.0:
        return replace(law, gain=share * law.gain)
    return replace(law, gain=first_law().gentler[[SHARES.index(share) - 1]])  # type: ignore[index]


def stepped(controller: GentleController, shares: list[float], steps: int = 60) -> list[float]:
    rng = np.random.default_rng(1)
    commands = []
    for k in range(steps):
        controller.use(shares[k % len(shares)])
        commands.append(float(controller.step(0.03 * rng.normal(size=3))[0]))
        controller.applied(np.array([0.9 * commands[-1]]))
    return commands


@pytest.mark.parametrize("share", SHARES)
def test_with_one_share_it_is_the_law_of_that_gain(share: float) -> None:
    rng, alone = np.random.default_rng(1), of_share(share).controller()
    for command in stepped(first_law().clipped(), [share]):
        expected = float(alone.step(0.03 * rng.normal(size=3))[0])
        assert command == pytest.approx(expected, rel=1e-7, abs=1e-3)
        alone.applied(np.array([0.9 * command]))


@given(share=st.floats(0.0, 2.0))
def test_between_two_shares_the_command_is_between_theirs(share: float) -> None:
    controller = first_law().clipped()
    y = np.array([0.02, -0.01, 0.4])
    for _ in range(3):
        controller.step(y)
        controller.applied(np.zeros(1))
    commands = []
    rows = [*SHARES, 0.0]
    for each in (share, *rows):
        controller.use(each)
        memory = controller._memory.copy()
        commands.append(float(controller._advance[-1] @ memory))
    given_, of_rows = commands[0], commands[1:]
    assert of_rows[-1] == 0.0
    expected = np.interp(share, rows[::-1], of_rows[::-1])
    assert given_ == pytest.approx(float(expected), rel=1e-9, abs=1e-6)


def test_without_gains_it_takes_shares_of_the_gain() -> None:
    law = replace(first_law(), gentler=None)
    one = law.unlimited()
    alone = replace(one, gain=0.25 * one.gain).controller()
    rng = np.random.default_rng(1)
    for command in stepped(law.clipped(), [0.25]):
        expected = float(alone.step(0.03 * rng.normal(size=3))[0])
        assert command == pytest.approx(expected, rel=1e-7, abs=1e-3)
        alone.applied(np.array([0.9 * command]))


@pytest.mark.parametrize("load", [0.85, 1.0, 1.3])
@pytest.mark.parametrize("tp_s", [6.0, 8.0, 10.0, 14.0])
def test_with_less_pressure_the_roll_is_hardly_above_the_passive_one(
    load: float, tp_s: float
) -> None:
    """A share of the whole command, for less pressure, is worse; in 8 s it rolls the ship more."""
    plant = replace(PLANT, ship=of_period(PLANT.ship, load))
    sea = ittc(4.0, tp_s)
    model = SeaModel(tuple(sea.frequency_hz), tuple(sea.density), effective_slope=0.5)
    w = PLANT.ship.natural_frequency_rad_s * np.geomspace(0.2, 5, 400)
    slope = np.sqrt(2 * model.slope_density(w) * np.gradient(w))
    waves = Harmonics(PLANT.ship.stiffness_nm_rad * slope, w, np.zeros(len(w)))
    passive_rad = motion_in_sea(None, plant, MEASURED, waves).roll_rms_rad
    moved = [motion_in_sea(of_share(share), plant, MEASURED, waves) for share in SHARES]
    assert max(m.roll_rms_rad for m in moved) <= 1.02 * passive_rad
    pressures = [m.pressure_rms_pa for m in moved]
    assert pressures == sorted(pressures, reverse=True)
    assert pressures[-1] < 0.4 * pressures[0]
    if (load, tp_s) == (0.85, 8.0):
        tenth = motion_in_sea(of_share(0.1, scaled=True), plant, MEASURED, waves)
        assert tenth.roll_rms_rad > 1.2 * passive_rad


def test_gains_have_the_margins() -> None:
    for share in (0.5, 0.12):
        judged = robustness(of_share(share), PLANT, MEASURED, with_delay_margin=False)
        assert judged.failures() == ()
