"""How far ahead a predictor sees the roll, by the sea that it has in it.

    python -m tools.studies.forecast_errors --seeds 8               # --seconds, --json

The first ship with her tank passive in the storm hour, roll, roll rate and level measured as on the
bus. Kalman predictors that differ in their model of the waves alone forecast her roll; printed is
the RMS of the error as a share of the roll's RMS (a forecast of zero has 1), mean and 95 %
confidence interval, and the passive roll that the model itself would have:

* one oscillator at the peak, as the shipped GPC has it;
* one oscillator for each band of the spectrum, their widths those of the bands, their heights
  fitted to it by non-negative least squares;
* the factor of the spectrum, as the shipped constrained law has it.
"""

import argparse
import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import nnls

from tools.printing import show
from tools.studies.trial_setup import (
    STORM_HOUR,
    measured_hour,
    parsed,
    parser,
    seeds_of,
    shipped,
)
from utank_hil.analysis.loop.loop_simulation import passive_motion
from utank_hil.analysis.motion.confidence import mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.control import ConstrainedDesign, DesignPlant, PredictiveDesign
from utank_hil.control.constrained.sea_plant import sea_plant
from utank_hil.control.lqg import kalman_predictor
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, noise_covariance, transition_and_step
from utank_hil.sea import EffectiveSlope, Sea

AHEAD = (6, 11, 21, 41, 61)  # samples
GRID_RAD_S = np.linspace(0.1, 3.2, 1500)


@dataclass(frozen=True)
class Oscillators:
    """Waves as white noises through oscillators.

    Attributes
    ----------
    frequency_rad_s, damping_ratio, slope_rad : ndarray, shape (n,)
        The last is the RMS of each one's share of the effective slope.
    """

    frequency_rad_s: FloatArray
    damping_ratio: FloatArray
    slope_rad: FloatArray

    def densities(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of each at unit variance, shape (len(omega), n)."""
        w, zeta, omega = self.frequency_rad_s, self.damping_ratio, omega_rad_s[:, None]
        response = (w**2 - omega**2) ** 2 + (2 * zeta * w * omega) ** 2
        density: FloatArray = 4 * zeta * w**3 / np.pi / response
        return density


@dataclass(frozen=True)
class Model:
    """What a predictor believes: ship, passive tank and waves, sampled.

    Attributes
    ----------
    plant : LinearModel
        Its outputs are `STATES`.
    covariance : ndarray, shape (n, n)
        Of the process noise.
    """

    name: str
    plant: LinearModel
    covariance: FloatArray

    def passive_roll_rms_rad(self) -> float:
        """Roll that the model itself would have."""
        state = solve_discrete_lyapunov(self.plant.A, self.covariance)
        row = self.plant.C[STATES.index("roll_rad")]
        return float(np.sqrt(row @ state @ row))


def design() -> ConstrainedDesign:
    """The shipped constrained design: what is measured, and the noise that all assume."""
    found = shipped("constrained_gpc").law
    assert isinstance(found, ConstrainedDesign)
    return found


def at_the_peak() -> Oscillators:
    """The one oscillator of the shipped GPC."""
    gpc = shipped("gpc").law
    assert isinstance(gpc, PredictiveDesign)
    sea = gpc.predictor
    return Oscillators(
        np.array([sea.wave_peak_rad_s]),
        np.array([sea.wave_damping_ratio]),
        np.array([sea.wave_slope_rad]),
    )


def one_a_band() -> Oscillators:
    """An oscillator for each band that holds energy, fitted to the spectrum."""
    spectrum = design().sea.spectrum
    full = spectrum.density > 0
    centres = 2 * np.pi * spectrum.frequency_hz[full]
    widths = 2 * np.pi * np.diff(spectrum.band_edges_hz[full], axis=1)[:, 0]
    unfitted = Oscillators(centres, widths / (2 * centres), np.ones(len(centres)))
    wanted = design().sea.slope_density(GRID_RAD_S)
    variances, _ = nnls(unfitted.densities(GRID_RAD_S), wanted)
    return dataclasses.replace(unfitted, slope_rad=np.sqrt(variances))


def oscillator_model(name: str, waves: Oscillators) -> Model:
    """Ship and passive tank under oscillators."""
    vessel, shipped_law = shipped("constrained_gpc").vessel, design()
    a_ship, b_ship = state_matrices(vessel.ship, vessel.tank)
    n, count = len(STATES), len(waves.frequency_rad_s)
    slope_effect = b_ship[:, 1] * vessel.ship.stiffness_nm_rad
    a = np.zeros((n + 2 * count,) * 2)
    noise = np.zeros((len(a), count + 2))
    a[:n, :n] = a_ship
    for i, (w, zeta, slope) in enumerate(
        zip(waves.frequency_rad_s, waves.damping_ratio, waves.slope_rad, strict=True)
    ):
        angle, rate = n + 2 * i, n + 2 * i + 1
        a[:n, angle] = slope_effect * slope
        a[angle, rate] = 1.0
        a[rate, [angle, rate]] = -(w**2), -2 * zeta * w
        noise[rate, i] = math.sqrt(4 * zeta * w**3)
    noise[:n, count] = b_ship[:, 0] * shipped_law.pressure_noise_pa_rt_s
    noise[:n, count + 1] = slope_effect * shipped_law.slope_noise_rad_rt_s
    b = np.zeros((len(a), 1))
    transition, effect = transition_and_step(a, b, shipped_law.sample_time_s)
    plant = LinearModel(
        transition, effect, np.eye(n, len(a)), np.zeros((n, 1)), shipped_law.sample_time_s
    )
    return Model(name, plant, noise_covariance(a, noise, shipped_law.sample_time_s))


def factor_model(name: str) -> Model:
    """Ship and passive tank under the factor of the spectrum, no heel."""
    vessel, shipped_law = shipped("constrained_gpc").vessel, design()
    plant, covariance = sea_plant(
        shipped_law.sea,
        DesignPlant(vessel.ship, vessel.tank, delay_s=0.0, lag_s=0.0),
        pressure_noise_pa_rt_s=shipped_law.pressure_noise_pa_rt_s,
        slope_noise_rad_rt_s=shipped_law.slope_noise_rad_rt_s,
        heel_time_s=shipped_law.heel_time_s,
        sample_time_s=shipped_law.sample_time_s,
    )
    return Model(name, plant, covariance)


def errors(model: Model, motion: FloatArray, seed: int) -> list[float]:
    """RMS of the forecasts' errors as shares of the roll's RMS, one for each of `AHEAD`."""
    shipped_law = design()
    rows = [STATES.index(name) for name in shipped_law.measured]
    noise = np.random.default_rng(seed).standard_normal((len(motion), len(rows)))
    measured = motion[:, rows] + noise * np.array(shipped_law.measurement_std)
    plant = model.plant
    gain, _ = kalman_predictor(
        plant._replace(C=plant.C[rows], D=plant.D[rows]),
        model.covariance,
        np.diag(np.square(shipped_law.measurement_std)),
    )
    closed = plant.A - gain @ plant.C[rows]
    state, states = np.zeros(len(plant.A)), np.empty((len(motion), len(plant.A)))
    for k, y in enumerate(measured):
        state = closed @ state + gain @ y
        states[k] = state  # of sample k + 1, from the measurements up to k
    roll, shares = motion[:, 0], []
    for ahead in AHEAD:
        row = plant.C[STATES.index("roll_rad")] @ np.linalg.matrix_power(plant.A, ahead - 1)
        error = roll[ahead:] - states[:-ahead] @ row
        shares.append(float(np.sqrt(np.mean(error**2)) / np.sqrt(np.mean(roll**2))))
    return shares


def motions(arguments: argparse.Namespace) -> list[FloatArray]:
    """Passive motion of the ship, one for each seed."""
    vessel, shipped_law = shipped("constrained_gpc").vessel, design()
    found = []
    for seed in seeds_of(arguments):
        sea = Sea.irregular(measured_hour(STORM_HOUR), seed)
        moment = sea.roll_moment(
            vessel.ship.stiffness_nm_rad, EffectiveSlope(shipped_law.sea.effective_slope)
        )
        count = round(arguments.seconds / shipped_law.sample_time_s)
        found.append(
            passive_motion(vessel.ship, vessel.tank, moment, shipped_law.sample_time_s, count)
        )
    return found


def main() -> None:
    """Forecast with each model and print the table."""
    arguments = parsed(parser(__doc__, seeds=8, first_seed=501))
    bank = one_a_band()
    models = [
        oscillator_model("one oscillator", at_the_peak()),
        oscillator_model(f"{len(bank.slope_rad)} oscillators", bank),
        factor_model(f"factor, {design().sea.order} states"),
    ]
    records = motions(arguments)
    true_deg = float(np.mean([np.rad2deg(np.sqrt(np.mean(one[:, 0] ** 2))) for one in records]))
    shares = {
        model.name: np.array(
            [
                errors(model, motion, seed)
                for seed, motion in zip(seeds_of(arguments), records, strict=True)
            ]
        )
        for model in track(models, "models", console=Console(stderr=True))
    }
    summary = {
        "ahead_s": [ahead * design().sample_time_s for ahead in AHEAD],
        "passive_roll_rms_deg": true_deg,
        "models": {
            model.name: {
                "error_shares": shares[model.name].tolist(),
                "mean_error_shares": shares[model.name].mean(axis=0).tolist(),
                "half_widths": [mean_interval(each).half_width for each in shares[model.name].T],
                "passive_roll_rms_deg": math.degrees(model.passive_roll_rms_rad()),
            }
            for model in models
        },
    }
    show(summary, arguments)


if __name__ == "__main__":
    main()
