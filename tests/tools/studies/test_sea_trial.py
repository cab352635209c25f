"""Trials: the same waves for all, figures against their definitions, processes as one thread."""

import dataclasses

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from shipped_designs import GPC_ROLL

from tools.studies.sea_trial import (
    CLAIRVOYANT,
    NO_TANK,
    PASSIVE,
    Entrant,
    Trial,
    TrialShip,
    run_trial,
    run_trials,
)
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.motion.bare_ship import roll_without_tank
from utank_hil.base.tick import TICK_S
from utank_hil.control import DesignPlant, PredictiveLaw, PumpLimits
from utank_hil.sea import EffectiveSlope, Sea, jonswap

LIMITS = PumpLimits(pressure_pa=30e3)
GPC = Entrant("gpc", GPC_ROLL.law(DesignPlant(SHIP, TANK)), ("roll_rad",), LIMITS)
SEA = jonswap(4.0, 10.0)
TRIAL = Trial(SEA, 3, TrialShip(DesignPlant(SHIP, TANK)), (GPC,), 60.0, LIMITS)


def still(gain: float = 0.0) -> PredictiveLaw:
    """A law that answers the roll with a constant gain."""
    return PredictiveLaw(np.zeros((1, 1, 1)), np.full((1, 1, 1), gain), np.zeros((1, 1, 1)), 0.2)


def test_figures_are_those_of_the_runs_by_hand():
    figures = run_trial(TRIAL)
    moment = Sea.irregular(SEA, 3).roll_moment(SHIP.stiffness_nm_rad, EffectiveSlope(0.5))
    bare = roll_without_tank(SHIP, moment, TICK_S, 6001)
    waves = passive_motion(SHIP, TANK, moment, TICK_S, 6001)
    run = simulate_loop(
        DesignPlant(SHIP, TANK, limits=LIMITS), waves, GPC.law.controller(), ("roll_rad",), seed=3
    )
    assert figures[NO_TANK].roll_rms_rad == pytest.approx(np.sqrt(np.mean(bare**2)))
    assert figures[PASSIVE].roll_rms_rad == pytest.approx(np.sqrt(np.mean(waves[:, 0] ** 2)))
    assert figures[PASSIVE].pressure_rms_pa == 0
    gpc = figures["gpc"]
    assert gpc.roll_rms_rad == pytest.approx(np.sqrt(np.mean(run.motion[:, 0] ** 2)))
    assert gpc.level_rms_m == pytest.approx(np.sqrt(np.mean(run.motion[:, 2] ** 2)))
    assert gpc.level_peak_m == np.abs(run.motion[:, 2]).max()
    assert gpc.pressure_rms_pa == pytest.approx(np.sqrt(np.mean(run.pressure_pa**2)))
    assert gpc.power_peak_w == pytest.approx((run.pressure_pa * run.motion[:, 3]).max() * 17.11)
    assert figures[CLAIRVOYANT].roll_rms_rad < gpc.roll_rms_rad


def test_a_law_is_held_back_where_it_asks_for_more_than_the_pump_gives():
    # a gain on roll small enough never to be cut, and one that always is
    modest, greedy = (
        Entrant(name, still(gain), ("roll_rad",), PumpLimits(30e3, 1e9, 1e3))
        for name, gain in (("modest", 1e3), ("greedy", 1e9))
    )
    trial = dataclasses.replace(TRIAL, entrants=(modest, greedy), bound_limits=None)
    figures = run_trial(trial)
    assert figures["modest"].held_back == 0
    assert figures["greedy"].held_back > 0.9
    assert CLAIRVOYANT not in figures


def test_what_a_ramp_ends_in_within_a_sample_is_not_held_back():
    slow = Entrant("slow", still(1e4), ("roll_rad",), PumpLimits(30e3, 30e3, 1e3))
    figures = run_trial(dataclasses.replace(TRIAL, entrants=(slow,), bound_limits=None))
    assert figures["slow"].pressure_rms_pa > 0
    assert figures["slow"].held_back == 0


def test_pump_gain_scales_what_the_pump_does_to_the_ship():
    # half the gain on twice the law is the same loop, where nothing is limited
    wide = PumpLimits(1e9, 1e12, 1e6)
    whole, half = (
        run_trial(
            Trial(
                SEA,
                3,
                TrialShip(DesignPlant(SHIP, TANK), pump_gain=gain),
                (Entrant("law", still(4e5 / gain), ("roll_rad",), wide),),
                60.0,
            )
        )["law"]
        for gain in (1.0, 0.5)
    )
    assert half.roll_rms_rad == pytest.approx(whole.roll_rms_rad, rel=1e-9)
    assert half.pressure_rms_pa == pytest.approx(whole.pressure_rms_pa, rel=1e-9)


@pytest.mark.slow
def test_processes_give_what_one_thread_gives_in_order_and_tell_progress():
    trials = [dataclasses.replace(TRIAL, seed=seed, duration_s=20.0) for seed in (5, 6, 7)]
    told = []
    assert run_trials(trials, told.append) == [run_trial(trial) for trial in trials]
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])


@pytest.mark.slow
def test_an_error_in_a_process_reaches_the_caller():
    flooded = dataclasses.replace(TRIAL, bound_limits=PumpLimits(10.0, 100.0, 0.01))
    with pytest.raises(ValueError, match="level_m"):
        run_trials([flooded])


def test_two_entrants_of_one_name_are_refused():
    with pytest.raises(ValueError, match="names of their own, got gpc, gpc"):
        run_trial(dataclasses.replace(TRIAL, entrants=(GPC, GPC)))
