"""The thesis's first ship in a sea, her pump driven by a law that knows limits only."""

from dataclasses import replace

import numpy as np

from utank_hil.control import DesignPlant
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.sea import EffectiveSlope, Sea

SAMPLE_TIME_S = 0.2
SUBSTEPS = 4
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
SHIP = RollShip(1.9275e9, 4.81875e8, 4.81875e7)
PLANT = DesignPlant(SHIP, TANK)
NOISE = (2e-4, 5e-4, 3.5e-3)


def loaded(period_s, inertia=1.0):
    """The ship with another inertia and roll period."""
    inertia_kg_m2 = SHIP.inertia_kg_m2 * inertia
    stiffness = inertia_kg_m2 * (2 * np.pi / period_s) ** 2
    return replace(SHIP, inertia_kg_m2=inertia_kg_m2, stiffness_nm_rad=stiffness)


def wave_moment_nm(spectrum, duration_s, seed):
    """Moment of a beam sea on the configured ship, at each of the steps of `motion_in`."""
    sea = Sea.irregular(spectrum, seed)
    slope = EffectiveSlope(0.5).moment(sea.omega_rad_s, sea.heading_rad, SHIP.stiffness_nm_rad)
    time_s = np.arange(0, duration_s, SAMPLE_TIME_S / SUBSTEPS)
    moment = np.zeros(len(time_s))
    for each in range(len(sea.omega_rad_s)):
        angle = sea.omega_rad_s[each] * time_s + sea.phase_rad[each] + np.angle(slope[each])
        moment += abs(slope[each]) * sea.amplitude_m[each] * np.cos(angle)
    return moment


def motion_in(moment_nm, ship=SHIP, most_pa=30000.0, seed=1, noise=NOISE):
    """Roll, rate and level at each sample, with sensor noise; the pump swings against the rate.

    It gives all it has whichever way the ship rolls, like a law that is far beyond its limits, and
    holds for a quarter of a second.
    """
    a, b = state_matrices(ship, TANK)
    step = np.hstack(transition_and_step(a, b, SAMPLE_TIME_S / SUBSTEPS))
    x = np.zeros(6)
    states = np.empty((len(moment_nm), 4))
    held = 5
    for k, moment in enumerate(moment_nm):
        if k % held == 0:
            x[4] = -most_pa * np.tanh(x[1] / 0.005)
        x[5] = moment
        states[k] = x[:4]
        x[:4] = step @ x
    kept = states[::SUBSTEPS, :3]
    return kept + np.random.default_rng(seed).standard_normal(kept.shape) * noise
