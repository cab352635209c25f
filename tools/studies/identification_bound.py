"""How much of what can be known is found: identification in a storm against the Cramer-Rao bound.

    python -m tools.studies.identification_bound [--records 12] [--samples 2500] [--json]

Relative error of the frequency response from pressure to roll and level over 0.2-1.2 rad/s, root
mean square over records of random pulses in the measured storm. The bound is that of an unbiased
estimate by someone who knows the spectrum of waves and noise exactly: here a vector autoregression
of order 40 fitted to another, long realisation. One bound is for any model of four states, the
other for inertia, stiffness, ship damping and tank damping.
"""

import dataclasses
from collections.abc import Callable

import control
import numpy as np
from scipy.signal import dlsim

from tools.peers.identification_records import (
    MEASURED,
    PLANT,
    SAMPLE_TIME_S,
    SEAS,
    SHIP,
    TANK,
    Matrices,
    record,
    respond,
    response,
    response_error,
    sampled_plant,
)
from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollShip, Tank
from utank_hil.identification import era, okid
from utank_hil.identification.ship_fit import fit_ship
from utank_hil.sea import Sea, load_ndbc

ORDER = 120
NOISE_ORDER, NOISE_SAMPLES = 40, 25_000
NOISE = 0.01
STEP = 1e-5

Noise = tuple[FloatArray, FloatArray]
"""Coefficients, shape (p, 2, 2), and whitening matrix of an autoregression."""


def matrices_of(ship: RollShip, tank: Tank) -> Matrices:
    """Ship and tank from pressure to roll and level, the pressure held from sample to sample."""
    plant = dataclasses.replace(PLANT, ship=ship, tank=tank)
    return plant.sampled(MEASURED, SAMPLE_TIME_S)[:4]


def of_physics(theta: FloatArray) -> Matrices:
    """Inertia, stiffness and damping of the ship, damping of the tank; logarithms of factors."""
    inertia, stiffness, damping, tank_damping = np.exp(theta).tolist()
    ship = dataclasses.replace(
        SHIP,
        inertia_kg_m2=SHIP.inertia_kg_m2 * inertia,
        stiffness_nm_rad=SHIP.stiffness_nm_rad * stiffness,
        damping_nms_rad=SHIP.damping_nms_rad * damping,
    )
    return matrices_of(ship, dataclasses.replace(TANK, damping_ratio=0.1 * tank_damping))


def of_four_states(theta: FloatArray) -> Matrices:
    """Every number of A, B and C of the true model, as additions to a balanced form."""
    plant = sampled_plant()
    _, vectors = np.linalg.eig(np.asarray(plant.A))
    shift = np.column_stack([vectors[:, ::2].real, vectors[:, ::2].imag])  # real modal form
    a = np.linalg.solve(shift, np.asarray(plant.A) @ shift)
    b = np.linalg.solve(shift, np.asarray(plant.B)[:, :1])
    c = np.asarray(plant.C) @ shift
    return (
        a + theta[:16].reshape(4, 4),
        b * (1 + theta[16:20, None]),
        c * (1 + theta[20:].reshape(2, 4)),
        np.zeros((2, 1)),
    )


def noise_model(scale: float, deviation: FloatArray, seed: int) -> Noise:
    """Autoregression of a long realisation of the storm's motions and the sensors' noise."""
    storm = load_ndbc(SEAS / "ndbc_41010_2019-02_spectral_density.txt")
    moment = Sea.irregular(storm.at("2019-02-10T05:40"), 1000 + seed).roll_moment(
        SHIP.stiffness_nm_rad
    )
    time_s = np.arange(NOISE_SAMPLES, dtype=np.float64) * SAMPLE_TIME_S
    v = respond(np.zeros(NOISE_SAMPLES), moment.at(time_s))
    v = v * scale / np.std(v[:, 0])
    v = v + deviation * np.random.default_rng(seed).standard_normal(v.shape)
    past = np.hstack([v[NOISE_ORDER - i : -i] for i in range(1, NOISE_ORDER + 1)])
    coefficients = np.linalg.lstsq(past, v[NOISE_ORDER:], rcond=None)[0]
    errors = v[NOISE_ORDER:] - past @ coefficients
    whiten = np.linalg.inv(np.linalg.cholesky(errors.T @ errors / len(errors)))
    taps = np.asarray(coefficients.reshape(NOISE_ORDER, 2, 2).transpose(0, 2, 1))
    return taps, np.asarray(whiten)


def bound(
    model: Callable[[FloatArray], Matrices],
    size: int,
    u: FloatArray,
    noise: Noise,
    right: FloatArray,
) -> FloatArray:
    """Least relative error of each output's response, shape (2,), for a model of `size` numbers."""
    alpha, whiten = noise
    slopes, moves = [], []
    for direction in STEP * np.eye(size):
        ends = [model(direction), model(-direction)]
        outputs = [dlsim((*end, SAMPLE_TIME_S), u)[1] for end in ends]
        slope = (outputs[0] - outputs[1]) / (2 * STEP)
        white = slope[NOISE_ORDER:].copy()
        for i, taps in enumerate(alpha, start=1):
            white -= slope[NOISE_ORDER - i : -i] @ taps.T
        slopes.append((white @ whiten.T).ravel())
        moves.append((response(*ends[0]) - response(*ends[1])) / (2 * STEP))
    information = np.array(slopes) @ np.array(slopes).T
    root = np.sqrt(information.diagonal())
    root[root == 0] = 1.0  # a change that shows nowhere
    covariance = np.linalg.pinv(information / np.outer(root, root), rcond=1e-10, hermitian=True)
    covariance = covariance / np.outer(root, root)
    variance = np.einsum("iwk,ij,jwk->k", np.conj(moves), covariance, np.array(moves)).real
    return np.asarray(np.sqrt(variance) / np.linalg.norm(right, axis=0))


def found(u: FloatArray, y: FloatArray) -> dict[str, Matrices]:
    """What each method makes of a record."""
    result = okid(u, y, ORDER, sample_time_s=SAMPLE_TIME_S)
    realized = era(result.markov, 4, sample_time_s=SAMPLE_TIME_S)
    # begun with a ship of another loading
    ship = dataclasses.replace(SHIP, stiffness_nm_rad=1.4 * SHIP.stiffness_nm_rad)
    fit = fit_ship(result, u, dataclasses.replace(PLANT, ship=ship), MEASURED)
    return {
        "OKID, ERA": matrices(realized),
        "OKID, ship fit": matrices_of(fit.ship, fit.tank),
    }


def matrices(system: control.StateSpace) -> Matrices:
    """The four of a model."""
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    return a, b, c, d


def main() -> None:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--records", type=int, default=12)
    parser.add_argument("--samples", type=int, default=2500, help="of each record, 0.2 s apart")
    arguments = parser.parse_args()
    if arguments.records < 1 or arguments.samples < 1000:
        parser.error("--records must be 1 or more and --samples 1000 or more")
    right = response(*of_physics(np.zeros(4)))
    squares: dict[str, list[FloatArray]] = {}
    for seed in range(arguments.records):
        u, y = record(arguments.samples, NOISE, sea="storm", seed=seed)
        calm = respond(u, np.zeros(len(u)))
        errors = {name: response_error(model) for name, model in found(u, y).items()}
        noise = noise_model(float(np.std(calm[:, 0])), NOISE * np.std(y, axis=0), seed)
        errors["bound, four states"] = bound(of_four_states, 28, u, noise, right)
        errors["bound, ship and tank"] = bound(of_physics, 4, u, noise, right)
        for name, error in errors.items():
            squares.setdefault(name, []).append(error**2)
    rows = {name: np.sqrt(np.mean(values, axis=0)).tolist() for name, values in squares.items()}
    show(rows, arguments)


if __name__ == "__main__":
    main()
