"""Heel removal as a law: its physics, what it never does, and the ships that it refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim.plant import Plant
from utank_hil.base.parameters import ParameterError
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.heel_removal import (
    LEVEL_SHARE,
    SEATED,
    HeelingTank,
    HeelRemoval,
    HeelRemovalDesign,
    Phase,
)
from utank_hil.control.semi_active import built_pump_law
from utank_hil.dynamics.valves import locked_loss, valve_problems
from utank_hil.sea import Harmonics

CONFIG = load_config(Path("configs/controllers/heel_removal.yaml"), ControllerConfig)
VESSEL, PLANT, DESIGN = CONFIG.vessel, CONFIG.plant, CONFIG.law
TANK = HeelingTank.of(PLANT)
SHUT = PLANT.valve.shut_loss
SECOND_NS = 1_000_000_000


def law(design=DESIGN):
    return HeelRemoval(design, TANK, SHUT)


class Creeping:
    """Ship and water in balance at every instant, with a valve that goes where it is told."""

    def __init__(self, controller, heeling_rad, stiffness=1.0, opens_in_s=2.0):
        self.law, self.heeling_rad, self.stiffness = controller, heeling_rad, stiffness
        self.level_m, self.loss, self.step = 0.0, SHUT, (SHUT / TANK.throttle_loss)
        self.slower = self.step ** (controller.sample_time_s / opens_in_s)
        self.pumpings = 0

    @property
    def heel_rad(self):
        return (self.heeling_rad + TANK.heel_per_m * self.level_m) / self.stiffness

    def run(self, seconds):
        dt = self.law.sample_time_s
        for _ in range(round(seconds / dt)):
            self.law.applied(np.array([0.0, self.loss]))
            before = self.law.phase
            pressure, asked = self.law.step(np.array([self.heel_rad, self.level_m])).tolist()
            self.pumpings += before is Phase.HOLDS and self.law.phase is Phase.MOVES
            assert pressure == 0 or self.loss <= SEATED * TANK.throttle_loss
            pressure = np.clip(pressure, -PLANT.limits.pressure_pa, PLANT.limits.pressure_pa)
            driving = pressure - TANK.balance_pa(self.level_m, self.heel_rad)
            if self.loss < locked_loss(VESSEL.tank):
                self.level_m += np.sign(driving) * np.sqrt(abs(driving) / self.loss) * dt
            assert abs(self.level_m) <= TANK.most_m + 2 * TANK.flow_m_s * dt
            assert abs(self.level_m) < PLANT.limits.level_m
            towards = max(min(asked / self.loss, self.slower), 1 / self.slower)
            self.loss *= towards


def plant_at_rest(ship=VESSEL.ship):
    still = Harmonics(np.zeros(1), np.ones(1), np.zeros(1))
    return Plant(ship, VESSEL.tank, VESSEL.pump, still)


def test_the_heel_of_a_level_that_is_held_is_the_closed_form_and_that_of_the_nonlinear_ship():
    tank, ship, g = VESSEL.tank, VESSEL.ship, 9.80665
    moved_kg = tank.density_kg_m3 * tank.reservoir_area_m2  # a metre, from one side to the other
    stiffness = ship.stiffness_nm_rad + g * tank.water_lever_kgm
    assert TANK.heel_per_m == pytest.approx(moved_kg * g * tank.width_m / stiffness, rel=1e-12)
    plant, now_ns = plant_at_rest(), 0
    plant.impose_pressure(TANK.hold_pa_m * 1.0)
    plant.set_valve_loss(TANK.throttle_loss)
    levels = []
    for seconds in (200, 400):
        plant.advance(now_ns)
        now_ns += seconds * SECOND_NS
        plant.advance(now_ns)
        levels.append(plant.level_m)
        plant.set_valve_loss(SHUT)
        plant.impose_pressure(0.0)
    assert levels[0] == levels[1] > 0.9  # nothing passes, and nothing is lost
    assert plant.roll_rad == pytest.approx(TANK.heel_per_m * levels[0], rel=1e-3)


def test_the_throttled_water_creeps_at_the_rate_that_the_flow_pressure_is_for():
    plant, now_ns = plant_at_rest(), 0
    plant.set_valve_loss(TANK.throttle_loss)
    levels = []
    for _ in range(1000):
        pressure = TANK.balance_pa(plant.level_m, plant.roll_rad) + TANK.flow_pa
        plant.impose_pressure(pressure)
        now_ns += TICK_NS
        plant.advance(now_ns)
        levels.append(plant.level_m)
    rate = (levels[-1] - levels[400]) / (599 * TICK_NS * 1e-9)
    assert rate == pytest.approx(TANK.flow_m_s, rel=0.05)
    assert np.diff(levels[100:]).min() > 0  # it does not swing


@pytest.mark.parametrize("heel_deg", [0.5, -0.6])
def test_a_heel_is_taken_away_and_then_left_alone(heel_deg):
    quay = Creeping(law(), np.radians(heel_deg))
    quay.run(1200)
    assert abs(quay.heel_rad) < 1.1 * DESIGN.stop_rad
    pumped, level_m = quay.pumpings, quay.level_m
    assert 1 <= pumped <= 3
    quay.run(1200)
    assert (quay.pumpings, quay.law.phase) == (pumped, Phase.HOLDS)
    assert quay.level_m == pytest.approx(level_m, abs=1e-3)


def test_a_heel_between_stop_and_start_moves_nothing():
    quay = Creeping(law(), 0.95 * DESIGN.start_rad)
    quay.run(1200)
    assert quay.pumpings == 0
    quay.heeling_rad = 1.05 * DESIGN.start_rad
    quay.run(600)
    assert quay.pumpings > 0
    assert abs(quay.heel_rad) < DESIGN.stop_rad


def test_pumpings_keep_their_pause():
    design = replace(DESIGN, pause_s=300.0)
    quay = Creeping(law(design), 5 * TANK.heel_per_m)  # more than the tank can take away
    quay.run(295)
    assert quay.pumpings == 0
    quay.run(15)
    assert quay.pumpings == 1


@given(st.floats(-0.05, 0.05), st.floats(0.4, 4.0), st.floats(0.2, 20.0), st.floats(-0.04, 0.04))
@settings(max_examples=6, deadline=None)
def test_no_ship_and_no_valve_make_it_pump_against_a_seat_or_beyond_the_level(
    heeling_rad, stiffness, opens_in_s, change_rad
):
    quay = Creeping(law(), heeling_rad, stiffness, opens_in_s)
    quay.run(300)
    quay.heeling_rad += change_rad  # a load swings out, or goes ashore
    quay.run(300)  # `Creeping.run` asserts


@given(st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 2, st.sampled_from([0.0, 1e6, 1e9, SHUT]))))
@settings(max_examples=20, deadline=None)
def test_whatever_is_measured_the_valve_opens_while_water_is_to_be_moved_alone(samples):
    controller = law(replace(DESIGN, pause_s=0.0))
    for roll_rad, level_m, loss in samples:
        controller.applied(np.array([0.0, loss]))
        for _ in range(8):
            pressure, asked = controller.step(np.array([roll_rad, level_m])).tolist()
            assert (asked == SHUT) is (controller.phase is not Phase.MOVES)
            assert pressure == 0 or loss <= SEATED * TANK.throttle_loss
            assert abs(controller._wanted_m) <= TANK.most_m


def test_level_and_pressure_limit_what_is_asked_for():
    assert TANK.most_m * TANK.hold_pa_m + TANK.flow_pa <= PLANT.limits.pressure_pa
    low = replace(PLANT, limits=replace(PLANT.limits, level_m=1.0))
    assert HeelingTank.of(low).most_m == LEVEL_SHARE


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"fail_position": "open"}, "has fail_position: open, and without power the water runs"),
        ({"leakage": 0.1}, "has leakage: 0.1: to be tight it must be 0.000"),
        ({"kind": "air", "pipe_area_m2": 0.3, "leakage": 0.1}, "is kind: air, and air yields"),
    ],
)
def test_a_valve_that_does_not_hold_the_water_is_refused(changes, reason):
    valve = replace(VESSEL.valve, **changes)
    plant = replace(PLANT, valve=valve.range(VESSEL.tank))
    with pytest.raises(ParameterError, match=f"needs a valve that holds; it {reason}"):
        DESIGN.build(plant)


def test_a_ship_without_a_valve_is_refused():
    with pytest.raises(ParameterError, match="the vessel has none"):
        DESIGN.build(replace(PLANT, valve=None))


def test_a_heel_that_the_tank_can_not_take_away_is_refused():
    with pytest.raises(ParameterError, match=r"start_rad is 0.03, and tank and pump remove 0.012"):
        replace(DESIGN, start_rad=0.03).build(PLANT)
    with pytest.raises(ParameterError, match="stop_rad must be below start_rad"):
        HeelRemovalDesign(start_rad=0.01, stop_rad=0.01)


def test_it_can_not_be_the_pump_law_of_a_valve():
    with pytest.raises(ParameterError, match="pump must be a law that drives a pump"):
        built_pump_law(DESIGN, PLANT)


def test_a_valve_between_leaking_and_tight_still_suits_no_tank():
    tight = VESSEL.valve
    assert valve_problems(VESSEL.tank, tight) == []
    assert tight.loss(VESSEL.tank, 0.0) > locked_loss(VESSEL.tank)
    assert valve_problems(VESSEL.tank, replace(tight, leakage=1e-3)) != []
