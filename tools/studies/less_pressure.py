"""The first law with a share of the pressure: of its command, of its gain, or by gains of its own.

    python -m tools.studies.less_pressure --json     # --seeds, --seconds, --workers

The first ship, linear, loaded to other roll periods than that of its file, in seas of the ITTC's
spectrum, with the bench's limits, rate, lag, delay and sensor noise. The share that pays is learnt
with a twin of the file's ship. All ways see the same waves. Figures are the roll over that of the
passive tank: of the whole time, mean of the seeds, and the greatest of all windows.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from tools.printing import command_line, show
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.loop.margins import of_period
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import DesignPlant
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw
from utank_hil.control.lqg import GentleController
from utank_hil.retuning.estimate import ShipFigures
from utank_hil.retuning.renewing import FIRST_EFFORT, LIMITED_EFFORT, Effort
from utank_hil.sea import EffectiveSlope, Sea, ittc

CONTROLLER: Final = Path("configs/controllers/self_tuning.yaml")
MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
SEAS: Final = ((4.0, 6.0), (6.0, 8.0), (3.0, 8.0), (8.0, 10.0), (9.0, 13.0), (4.0, 10.0),
               (8.0, 16.0))  # fmt: skip
"""Significant heights in m and peak periods in s: from small to what saturates the pump."""
LOADS: Final = (0.85, 1.0, 1.15, 1.3)  #: Scales of the roll period, as the law is designed for.
OF_COMMAND: Final = "share of the command"
OF_GAIN: Final = "share of the gain"
GAINS: Final = "gains for less pressure"
WAYS: Final = (OF_COMMAND, OF_GAIN, GAINS)
WINDOW_S: Final = 300.0
FIRST_SEED: Final = 300


class Learning:
    """A law with the share that pays; `of_command` takes the share after the clipping."""

    def __init__(
        self,
        controller: GentleController | ConstrainedController,
        plant: DesignPlant,
        *,
        of_command: bool = False,
    ) -> None:
        self._of_command = of_command
        self._law, self._most_pa = controller, plant.limits.pressure_pa
        self._use = controller.use if isinstance(controller, GentleController) else controller.allow
        self.sample_time_s = self._law.sample_time_s
        self.effort = Effort(ShipFigures.of(plant.ship).roll_period_s / self.sample_time_s)
        self._plans = isinstance(controller, ConstrainedController)
        self._first_share = 1.0 if self._plans else FIRST_EFFORT
        self.effort.clear(self._first_share)
        self._twin = plant.sampled(("roll_rad",), self.sample_time_s)
        self._made = np.zeros(len(self._twin.A))
        self._asked_pa = self._applied_pa = 0.0

    def reset(self) -> None:
        """Forget everything."""
        self._law.reset()
        self.effort.clear(self._first_share)
        self._asked_pa = self._applied_pa = 0.0
        self._made[:] = 0.0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take a measurement and return the command."""
        limited = abs(self._applied_pa - self._asked_pa) > LIMITED_EFFORT * self._most_pa
        passive_rad = float(y[0] - (self._twin.C @ self._made)[0])
        self.effort.update(float(y[0]), passive_rad, limited=limited, plans=self._plans)
        share = self.effort.share
        self._use(1.0 if self._of_command else share)
        clipped = np.clip(self._law.step(y, reference), -self._most_pa, self._most_pa)
        asked = share * clipped if self._of_command else clipped
        self._asked_pa = float(asked[0])
        return asked

    def applied(self, u: FloatArray) -> None:
        """Take the mean of the commands since the last step."""
        self._applied_pa = float(u[0])
        self._law.applied(u)
        self._made = self._twin.A @ self._made + self._twin.B @ u


@cache
def first_law() -> tuple[ConstrainedLaw, DesignPlant]:
    """The first law of the shipped self-tuning controller, and the ship of its file."""
    config = load_config(CONTROLLER, ControllerConfig)
    assert isinstance(config.law, SelfTunedDesign)
    law = config.law.build(config.plant, first=True).linear
    assert isinstance(law, ConstrainedLaw)
    return law, config.plant


def roll_over_passive(
    way: str, load: float, hs_m: float, tp_s: float, seconds: float, seed: int
) -> FloatArray:
    """Roll over the passive tank's by one of `WAYS`: of the whole time, then of each window."""
    law, plant = first_law()
    if way != GAINS:
        law = replace(law, gentler=None)
    loaded = replace(plant, ship=of_period(plant.ship, load))
    waves = Sea.irregular(ittc(hs_m, tp_s), seed)
    moment = waves.roll_moment(plant.ship.stiffness_nm_rad, EffectiveSlope(0.5))
    count = round(seconds / TICK_S)
    passive = passive_motion(loaded.ship, loaded.tank, moment, TICK_S, count + 1)
    controller = Learning(law.clipped(), plant, of_command=way == OF_COMMAND)
    run = simulate_loop(loaded, passive, controller, MEASURED, seed=seed)
    squares = np.square(np.column_stack([run.motion[:count, 0], passive[:count, 0]]))
    size = round(WINDOW_S / TICK_S)
    parts = [squares, *(squares[at : at + size] for at in range(0, count - size + 1, size))]
    means = np.array([part.mean(axis=0) for part in parts])
    return np.asarray(np.sqrt(means[:, 0] / means[:, 1]))


def case(load: float, hs_m: float, tp_s: float, seconds: float, seeds: int) -> dict[str, str]:
    """Figures of one load and sea, by each way."""
    found = {"sea": f"{hs_m:g} m {tp_s:g} s", "roll period": f"x {load:g}"}
    drawn = range(FIRST_SEED, FIRST_SEED + seeds)
    for way in WAYS:
        ratios = np.array(
            [roll_over_passive(way, load, hs_m, tp_s, seconds, seed) for seed in drawn]
        )
        found[way] = f"{ratios[:, 0].mean():.2f} ({ratios[:, 1:].max():.2f})"
    return found


def main(words: Sequence[str] | None = None) -> None:
    """Print a table of all loads and seas."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=900.0)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args(words)
    with (
        one_thread_each(),
        ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool,
    ):
        started = [
            pool.submit(case, load, *sea, arguments.seconds, arguments.seeds)
            for load in LOADS
            for sea in SEAS
        ]
        rows: list[dict[str, Any]] = []
        for future in started:
            rows.append(future.result())
            print(*rows[-1].values(), sep=", ", file=sys.stderr, flush=True)
    show(rows, arguments)


if __name__ == "__main__":
    main()
