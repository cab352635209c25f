"""Over ten minutes of the bench's plant the energy adds up."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from roll_energy import energy

from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import load_config
from utank_hil.sea import Harmonics

STORM = load_config(Path("configs/scenarios/storm.yaml"), Scenario)


@pytest.mark.slow
def test_work_of_waves_and_pump_less_losses_is_the_change_of_energy() -> None:
    vessel, waves = STORM.vessel, STORM.wave_moment(1)
    tank = replace(vessel.tank, quadratic_loss=2.0, headroom_m=3.5, restitution=0.2)
    ship = replace(
        vessel.ship, quadratic_damping_nms2_rad2=2e8, restoring_odd_nm=(-1e8,), wind_moment_nm=5e6
    )
    heavy = Harmonics(4 * waves.amplitude, waves.frequency_rad_s, waves.phase_rad)
    plant = Plant(ship, tank, vessel.pump, heavy)
    plant.advance(0)
    upright_j = float(energy(ship, tank, [[0.0] * 4])[0])
    for tick in range(60_000):
        plant.drive_pump(25e3 * math.sin(0.55 * tick * 0.01), enabled=tick % 50_000 < 40_000)
        plant.advance((tick + 1) * TICK_NS)
    assert plant.strikes > 15
    rate_m_s = plant.flow_m3_s / tank.reservoir_area_m2
    state = [plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, rate_m_s]
    gained_j = float(energy(ship, tank, [state])[0]) - upright_j
    work_j = plant.wave_work_j + plant.pump_work_j
    assert plant.wave_work_j > 1e8
    assert work_j - plant.losses_j == pytest.approx(gained_j, abs=1e-6 * plant.wave_work_j)
