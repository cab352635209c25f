"""Valve laws: energy, range of the valve, and where they gain."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shipped_designs import GPC_ROLL, LQG_ROLL_RATE_LEVEL

from tools.thesis.capsize import controlled_run
from tools.thesis.simulate import WaveMoment
from utank_hil.control.gain import GainLaw, PDDesign
from utank_hil.control.interface import DesignPlant
from utank_hil.control.semi_active import (
    ClippedValve,
    ClippedValveDesign,
    OnOffValve,
    OnOffValveDesign,
)
from utank_hil.control.stimulation import StimulationDesign
from utank_hil.dynamics import RollModel, RollShip, Tank
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.valves import ValveRange, duct_valve_loss

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.03)
ROLLS = StimulationDesign(amplitude_rad=0.02, period_s=12.3, ramp_s=120, roll_limit_rad=0.1)
VALVE = ValveRange(0.0, duct_valve_loss(TANK, 0.1))
states = st.lists(st.floats(-3, 3), min_size=4, max_size=4).map(np.array)


@given(states)
def test_on_off_shuts_only_where_the_throttle_takes_energy_out_of_roll(y):
    loss = OnOffValve(VALVE).step(y)[0]
    model = RollModel(SHIP, TANK)
    shut, opened = (model.derivative(y, 0.0, 0.0, x) for x in (VALVE.shut_loss, 0.0))
    power = (shut[1] - opened[1]) * y[1]  # of the throttle, on roll per inertia
    if abs(power) > 1e-9:
        assert (loss == VALVE.shut_loss) == (power < 0)


def test_on_off_holds_its_place_within_the_threshold():
    valve = OnOffValve(VALVE, threshold_rad_m_s2=0.01)
    small, shut, opened = (np.array([0.0, 0.1, 0.0, rate]) for rate in (0.05, 0.2, -0.2))
    assert valve.step(small)[0] == 0
    assert valve.step(shut)[0] == VALVE.shut_loss
    assert valve.step(small)[0] == VALVE.shut_loss
    assert valve.step(opened)[0] == 0
    valve.step(shut)
    valve.reset()
    assert valve.step(small)[0] == 0


@given(states, st.floats(-1e5, 1e5))
def test_clipped_valve_makes_of_the_pump_s_pressure_what_a_throttle_can(y, gain):
    pump = GainLaw(np.array([[0.0, gain, 0.0, 0.0]]), 0.1)
    loss = ClippedValve(VALVE, pump.controller()).step(y)[0]
    wanted = pump.controller().step(y)[0]
    assert VALVE.open_loss <= loss <= VALVE.shut_loss
    made = -loss * abs(y[3]) * y[3]
    if VALVE.open_loss < loss < VALVE.shut_loss:
        assert made == pytest.approx(wanted, rel=1e-9)
    assert made * y[3] <= 0  # never power into the water
    assert abs(made) <= abs(wanted) * (1 + 1e-9)


def test_pump_s_law_is_told_the_pressure_that_the_valve_made():
    told = []

    class Pump:
        sample_time_s = 0.1

        def step(self, y, reference=None):
            return np.array([-1e9])

        def applied(self, u):
            told.append(float(u[0]))

        def reset(self):
            told.append("reset")

    valve = ClippedValve(VALVE, Pump())
    loss = valve.step(np.array([0.0, 0.1, 0.0, 0.5]))
    assert loss[0] == VALVE.shut_loss
    valve.applied(loss)
    assert told == [pytest.approx(-VALVE.shut_loss * 0.25)]
    valve.reset()
    assert told[-1] == "reset"


@pytest.mark.slow
def test_on_off_beats_every_fixed_opening_in_waves_slower_than_the_tank():
    model = RollModel(SHIP, TANK)
    wave = WaveMoment([SHIP.stiffness_nm_rad * 0.02], [0.45], [0.0])

    class Fixed:
        sample_time_s = 0.1

        def __init__(self, loss):
            self._loss = np.array([loss])

        def step(self, y, reference=None):
            return self._loss

        def applied(self, u):
            pass

    def rms(controller):
        rolls = []
        controlled_run(
            model,
            controller,
            wave,
            1200.0,
            valve=True,
            step_s=0.05,
            each_step=lambda time, state, command: rolls.append(state[0]),
        )
        return np.std(rolls[6000:])

    fixed = min(rms(Fixed(duct_valve_loss(TANK, s))) for s in (1.0, 0.5, 0.3, 0.2, 0.15, 0.1))
    assert rms(OnOffValve(VALVE)) < 0.9 * fixed


@pytest.mark.parametrize("losses", [(-1.0, 1.0), (2.0, 1.0), (0.0, math.inf), (math.nan, 1.0)])
def test_range_out_of_order_is_refused(losses):
    with pytest.raises(ValueError, match="open_loss"):
        ValveRange(*losses)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"threshold_rad_m_s2": -1.0}, "threshold_rad_m_s2 must be zero or more"),
        ({"threshold_rad_m_s2": math.inf}, "threshold_rad_m_s2 must be"),
        ({"sample_time_s": -1.0}, "sample_time_s must be 0.001 to 10"),
        ({"sample_time_s": math.nan}, "sample_time_s must be"),
    ],
)
def test_valve_law_out_of_range_is_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        OnOffValve(VALVE, **change)


PLANT = DesignPlant(SHIP, TANK, valve=VALVE)


def test_design_of_the_on_off_law_throttles_the_plant_s_valve():
    built = OnOffValveDesign(threshold_rad_m_s2=0.01).build(PLANT)
    assert built.measured == STATES
    assert built.dissipates
    assert built.controller().step(np.array([0.0, 0.1, 0.0, 0.5]))[0] == VALVE.shut_loss


@pytest.mark.parametrize("pump", [GPC_ROLL, LQG_ROLL_RATE_LEVEL], ids=["gpc", "lqg"])
def test_design_of_the_clipped_law_hands_the_pump_s_law_its_own_measurements(pump):
    built = ClippedValveDesign(pump).build(PLANT)
    measured = pump.predictor.measured
    assert built.measured == (*measured, "level_rate_m_s")
    assert built.dissipates
    alone, clipped = pump.build(PLANT).controller(), built.controller()
    flow = 0.3
    for time in np.arange(0, 20, alone.sample_time_s):
        y = 0.1 * np.sin(0.5 * time + np.arange(len(measured)))
        pressure = alone.step(y)[0]
        loss = clipped.step(np.array([*y, flow]))[0]
        wanted = -pressure / flow**2 if pressure < 0 else 0.0
        assert loss == pytest.approx(min(max(wanted, VALVE.open_loss), VALVE.shut_loss))
        alone.applied(np.array([-loss * flow**2]))
        clipped.applied(np.array([loss]))


@pytest.mark.parametrize("design", [OnOffValveDesign(), ClippedValveDesign(GPC_ROLL)])
def test_law_of_a_valve_can_go_to_another_process(design):
    built = design.build(PLANT)
    y = np.array([0.02, 0.1, 0.3, 0.5])[-len(built.measured) :]
    there = pickle.loads(pickle.dumps(built)).controller()
    assert there.step(y) == built.controller().step(y)


@pytest.mark.parametrize(
    ("design", "plant", "message"),
    [
        (OnOffValveDesign(), replace(PLANT, valve=None), "the vessel has none"),
        (ClippedValveDesign(PDDesign()), replace(PLANT, valve=None), "the vessel has none"),
        (ClippedValveDesign(OnOffValveDesign()), PLANT, "pump must be a law that drives a pump"),
        (ClippedValveDesign(ROLLS), PLANT, "pump.kind must be of a law that takes roll"),
    ],
)
def test_design_of_a_valve_s_law_that_can_not_be_is_refused(design, plant, message):
    with pytest.raises(ValueError, match=message):
        design.build(plant)
