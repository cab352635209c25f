"""What a forecast of the waves is worth in the storm hour, on seeds that nothing was tuned on.

    python -m tools.studies.preview_worth

The first ship, linear, in the storm hour, with the self-tuned law of `self_tuned.yaml`. Forecasts
have a point each 0.25 s. Share is the part of the way from the passive tank to the clairvoyant
bound within the same limits; with it the 95 % confidence interval of its mean. An error is the
moment of another sea of the same spectrum, and is stated, but where the forecast is late: then each
point is that of an earlier time, and is said to be perfect. `worse` is the greatest ratio of a
seed's roll to that without a forecast.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from typing import Final, NamedTuple

import numpy as np

from tools.printing import command_line, show
from tools.studies.clairvoyant import clairvoyant_bound
from tools.studies.share_of_possible import EFFECTIVE_SLOPE, STORM_HOUR, measured_hour, shipped
from utank_hil.analysis.loop.loop_simulation import SensorNoise, passive_motion, simulate_loop
from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.control import BuiltLaw
from utank_hil.control.constrained.design import previewed
from utank_hil.control.constrained.law import ConstrainedController
from utank_hil.control.interface import WaveForecast
from utank_hil.sea import EffectiveSlope, Sea

FIRST_SEED: Final = 61001
OTHER_SEA: Final = 5000  #: Seeds of the errors begin so much later.
SPACING_S: Final = 0.25
SETTLE_S: Final = 60.0
BOUND_TICKS: Final = 20


class Kind(NamedTuple):
    """A forecast."""

    horizon_s: float
    error: float = 0.0  #: Over the waves.
    late_s: float = 0.0
    factor: float = 1.0  #: On the moment, unsaid.


KINDS: Final = {
    "perfect, 5 s": Kind(5.0),
    "perfect, 10 s": Kind(10.0),
    "error half the waves, 5 s": Kind(5.0, 0.5),
    "error as large as the waves, 5 s": Kind(5.0, 1.0),
    "error twice the waves, 5 s": Kind(5.0, 2.0),
    "0.3 s late, 5 s": Kind(5.0, late_s=0.3),
    "1 s late, 5 s": Kind(5.0, late_s=1.0),
    "2 s late, 5 s": Kind(5.0, late_s=2.0),
    "half the moment, 5 s": Kind(5.0, factor=0.5),
    "sign reversed, 5 s": Kind(5.0, factor=-1.0),
}


class Fed:
    """A controller with what is said to it before each step."""

    def __init__(self, law: BuiltLaw, said: FloatArray, deviation_rad: float, kind: Kind) -> None:
        made = law.controller()
        assert isinstance(made, ConstrainedController)
        self.inner, self.sample_time_s = made, made.sample_time_s
        self._ticks = round(made.sample_time_s / TICK_S)
        self._said = said
        self._time_s = np.arange(0.0, kind.horizon_s + 1e-9, SPACING_S)
        self._ahead = np.round((self._time_s - kind.late_s) / TICK_S).astype(int)
        self._deviation_rad = np.full(len(self._time_s), deviation_rad)
        self._step = 0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Say what is to come, and step."""
        at = np.maximum(self._step * self._ticks + self._ahead, 0)
        self._step += 1
        self.inner.preview(WaveForecast(self._time_s, self._said[at], self._deviation_rad))
        return self.inner.step(y, reference)

    def applied(self, u: FloatArray) -> None:
        """Hand on what was applied."""
        self.inner.applied(u)

    def reset(self) -> None:
        """Reset the controller."""
        self.inner.reset()


@cache
def laws() -> tuple[BuiltLaw, BuiltLaw]:
    """The law without, and with, forecasts."""
    law = build_law(shipped("self_tuned"))
    return law, previewed(law, shipped("self_tuned").vessel.ship)


def run_seed(seconds: float, seed: int) -> dict[str, float]:
    """Roll RMS in rad by each forecast, in one sea."""
    config, (plain, foresees) = shipped("self_tuned"), laws()
    plant, count = config.plant, round(seconds / TICK_S)
    ship, spectrum = plant.ship, measured_hour(STORM_HOUR)
    seas = [Sea.irregular(spectrum, each) for each in (seed, seed + OTHER_SEA)]
    waves, others = (
        sea.roll_moment(ship.stiffness_nm_rad, EffectiveSlope(EFFECTIVE_SLOPE)) for sea in seas
    )
    passive = passive_motion(ship, plant.tank, waves, TICK_S, count + 1)
    run = partial(simulate_loop, plant, passive, measured=plain.measured, noise=SensorNoise(),
                  seed=seed)  # fmt: skip
    bound = clairvoyant_bound(plant, passive[::BOUND_TICKS])
    first = round(SETTLE_S / TICK_S)

    def rms(roll: FloatArray, every: int = 1) -> float:
        return float(np.sqrt(np.mean(np.square(roll[first // every :]))))

    found = {
        "passive": rms(passive[:, 0]),
        "clairvoyant": rms(bound.motion[:, 0], BOUND_TICKS),
        "no forecast": rms(run(plain.controller()).motion[:, 0]),
    }
    ahead = round(20.0 / TICK_S)
    moments = [each.series(TICK_S, count + ahead) / ship.stiffness_nm_rad
               for each in (waves, others)]  # fmt: skip
    for name, kind in KINDS.items():
        said = kind.factor * moments[0] + kind.error * moments[1]
        fed = Fed(foresees, said, float(kind.error * moments[0].std()), kind)
        found[name] = rms(run(fed).motion[:, 0])
    return found


def rows(results: list[dict[str, float]]) -> dict[str, dict[str, float]]:
    """Mean roll, share and the worst seed of each."""
    all_of = {name: np.array([each[name] for each in results]) for name in results[0]}
    passive, best, without = (all_of[name] for name in ("passive", "clairvoyant", "no forecast"))
    found = {}
    for name, roll in all_of.items():
        share = mean_interval((passive - roll) / (passive - best))
        found[name] = {
            "roll_rms_deg": float(np.rad2deg(roll.mean())),
            "share": share.mean,
            "share_half_width": share.half_width,
            "worse": float((roll / without).max()),
        }
    return found


def main() -> None:
    """Run all seeds and print the table."""
    made = command_line(__doc__)
    made.add_argument("--seeds", type=int, default=8, help="realisations, 2 or more (%(default)s)")
    made.add_argument("--seconds", type=float, default=1260.0, help="of each run (%(default)s)")
    made.add_argument("--workers", type=int, default=2)
    arguments = made.parse_args()
    run = partial(run_seed, arguments.seconds)
    with (
        one_thread_each(),
        ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool,
    ):
        results = list(pool.map(run, range(FIRST_SEED, FIRST_SEED + arguments.seeds)))
    show({"seeds": arguments.seeds, "seconds": arguments.seconds, "rows": rows(results)}, arguments)


if __name__ == "__main__":
    main()
