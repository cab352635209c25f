"""Speed of the nonlinear coupled model in an irregular sea at 50 Hz, side by side with others.

One core each, the same ship, tank and sea:

* this package's compiled Runge-Kutta kernel,
* the same equations in C (`dynamics.c`, built here with ``gcc -O3 -march=native``): as written,
  with the freedom to reassociate that the kernel has, and with ``-ffast-math``,
* scipy's ``solve_ivp`` on a right-hand side of plain Python floats, at equal accuracy,
* python-control's ``input_output_response`` on the same right-hand side.

Then how a batch grows from 1 to 100,000 ships on all cores, with its memory.
"""

import ctypes
import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tools.printing import command_line, show
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollModel, RollShip, Tank, WaveMoment, simulate, simulate_batch

STEP_S = 0.02
SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7, 1e8, restoring_odd_nm=(-1e8,))
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1, quadratic_loss=1.0)
MODEL = RollModel(SHIP, TANK)
REPEATS = 7
KERNEL = "compiled (numba)"


def sea(components: int, ships: int = 1) -> WaveMoment:
    """Random sea with the given number of components."""
    rng = np.random.default_rng(3)
    shape = (ships, components) if ships > 1 else (components,)
    amplitude = np.full(shape, 2e7 / math.sqrt(components))
    frequency = np.broadcast_to(np.linspace(0.3, 1.2, components), shape)
    return WaveMoment(amplitude, np.ascontiguousarray(frequency), rng.uniform(0, math.tau, shape))


FREEDOMS = {
    "C as written": (),
    "C, the kernel's freedom": (  # numba's reassoc, contract, nsz, arcp
        "-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math", "-freciprocal-math",
        "-ffp-contract=fast",
    ),
    "C, -ffast-math": ("-ffast-math",),
}  # fmt: skip
"""Flags of gcc beside ``-O3 -march=native``: how far it may change the arithmetic."""


def build_c(flags: tuple[str, ...]) -> ctypes.CDLL:
    """Compile and load the C version."""
    if shutil.which("gcc") is None:
        raise SystemExit("gcc is missing: apt-get install gcc")
    source = Path(__file__).with_suffix(".c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "dynamics.so"
        command = ["gcc", "-O3", "-march=native", *flags, "-shared", "-fPIC", str(source), "-o"]
        subprocess.run([*command, str(library), "-lm"], check=True)
        return ctypes.CDLL(str(library))


def c_run(library: ctypes.CDLL, wave: WaveMoment, duration_s: float) -> FloatArray:
    """Final state by the C version."""
    pointer = ctypes.POINTER(ctypes.c_double)

    def give(values: FloatArray) -> "ctypes._Pointer[ctypes.c_double]":
        return values.ctypes.data_as(pointer)

    row, table = np.array(MODEL.coefficients), MODEL.restoring.coefficients_nm
    amplitude, frequency, phase = (np.asarray(x, dtype=np.float64) for x in wave)
    state, biggest = np.zeros(4), ctypes.c_double()
    code = library.run(
        give(row), ctypes.c_double(1 / MODEL.restoring.piece_rad), *table.shape, give(table),
        len(amplitude), give(amplitude), give(frequency), give(phase), ctypes.c_double(0.0),
        ctypes.c_double(0.0), round(duration_s / STEP_S), ctypes.c_double(STEP_S), 256,
        give(state), ctypes.byref(biggest),
    )  # fmt: skip
    if code:
        raise RuntimeError("the water struck its limit: choose a smaller sea")
    return state


def plain_slope(wave: WaveMoment) -> Callable[[float, FloatArray], list[float]]:
    """Return the right-hand side in plain Python, the sea summed by numpy."""
    c = MODEL.coefficients
    k1, k3 = MODEL.restoring.coefficients_nm[0, 1::2].tolist()
    amplitude, frequency, phase = (np.asarray(x) for x in wave)

    def slope(t: float, x: FloatArray) -> list[float]:
        phi, rate, h, speed = x
        moment = float(amplitude @ np.cos(frequency * t + phase))
        sin, cos = math.sin(phi), math.cos(phi)
        roll_inertia = c.inertia + c.inertia_h2 * h * h
        roll_moment = (
            moment
            + c.weight_h * h * cos
            - (c.damping + c.quadratic_damping * abs(rate)) * rate
            - (k1 + k3 * phi * phi) * phi
            - 2 * c.inertia_h2 * h * speed * rate
            - (c.weight_lever - c.weight_h2 * h * h) * sin
        )
        force = (
            -(c.loss + c.quadratic_loss * abs(speed)) * speed
            + c.inertia_h2 * h * rate * rate
            + c.weight_h * sin
            - 2 * c.weight_h2 * h * cos
        )
        scale = 1 / (roll_inertia * c.level_inertia - c.coupling**2)
        return [
            rate,
            (c.level_inertia * roll_moment - c.coupling * force) * scale,
            speed,
            (roll_inertia * force - c.coupling * roll_moment) * scale,
        ]

    return slope


def seconds(
    run: Callable[[], object],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Shortest of several timings."""
    best = math.inf
    for _ in range(repeats):
        start = clock()
        run()
        best = min(best, clock() - start)
    return best


def compare(components: int) -> list[dict[str, Any]]:
    """Ship-seconds per second on one core, and the error of the final state."""
    wave = sea(components)
    slope = plain_slope(wave)
    span = 100.0
    exact = solve_ivp(slope, (0, span), np.zeros(4), "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    def error(state: FloatArray) -> float:
        return float(np.max(np.abs(state - exact)))

    def compiled(duration_s: float) -> FloatArray:
        every = round(duration_s / STEP_S)
        run = simulate(MODEL, duration_s, wave=wave, record_every=every)
        return np.asarray(run.state[-1])

    ours = error(compiled(span))
    tolerance = 1e-3
    while True:  # the loosest tolerance that is as accurate as the fixed step
        adaptive = solve_ivp(
            slope, (0, span), np.zeros(4), "DOP853", rtol=tolerance, atol=tolerance / 100
        )
        if error(adaptive.y[:, -1]) <= ours:
            break
        tolerance /= 2
    rows: list[dict[str, Any]] = []

    def add(name: str, duration_s: float, time_s: float, off: float) -> None:
        rows.append(
            {
                "method": name,
                "components": components,
                "ship_seconds_per_second": duration_s / time_s,
                "error": off,
            }
        )

    long = 4000.0
    taken_s, ends = race(components, long, span)
    for name, time_s in taken_s.items():
        add(name, long, time_s, error(ends[name]))
    adaptive_s = seconds(
        lambda: solve_ivp(
            slope, (0, span), np.zeros(4), "DOP853", rtol=tolerance, atol=tolerance / 100
        ),
        2,
    )
    add(f"solve_ivp DOP853, rtol {tolerance:.0e}", span, adaptive_s, error(adaptive.y[:, -1]))

    import control

    system = control.nlsys(
        lambda t, x, _u, _params: np.array(slope(t, x)), None, inputs=1, states=4, outputs=4
    )
    grid = np.linspace(0, span, round(span / STEP_S) + 1)
    options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance / 100}
    box: list[FloatArray] = []

    def respond() -> None:
        answer = control.input_output_response(
            system, grid, np.zeros(len(grid)), np.zeros(4), solve_ivp_kwargs=options
        )
        box.append(answer.states[:, -1])

    respond_s = seconds(respond, 1)
    add("control.input_output_response", span, respond_s, error(box[-1]))
    return rows


def race(
    components: int, duration_s: float, span_s: float
) -> tuple[dict[str, float], dict[str, FloatArray]]:
    """Least processor times of the kernel and of C in each freedom; their states after a span."""
    wave = sea(components)

    def compiled(duration_s: float) -> FloatArray:
        every = round(duration_s / STEP_S)
        return np.asarray(simulate(MODEL, duration_s, wave=wave, record_every=every).state[-1])

    runners: dict[str, Callable[[float], FloatArray]] = {KERNEL: compiled}
    for name, flags in FREEDOMS.items():
        runners[name] = partial(c_run, build_c(flags), wave)
    ends = {name: run(span_s) for name, run in runners.items()}
    taken_s = dict.fromkeys(runners, math.inf)
    for _ in range(REPEATS):  # interleaved, so that a busy machine slows all alike
        for name, run in runners.items():
            once_s = seconds(partial(run, duration_s), 1, time.thread_time)
            taken_s[name] = min(taken_s[name], once_s)
    return taken_s, ends


def ratios(components: int) -> dict[str, float]:
    """Speed of the kernel to that of C in each freedom."""
    taken_s, _ = race(components, 4000.0, STEP_S)
    return {name: taken_s[name] / taken_s[KERNEL] for name in FREEDOMS}


def scaling(ships: list[int], components: int) -> list[dict[str, Any]]:
    """Batches of growing size, each ship in a sea of its own, on all cores."""
    rows: list[dict[str, Any]] = []
    for count in ships:
        duration_s = max(1.0, min(1000.0, 1e5 / count))
        wave = sea(components, count)
        initial = np.zeros((count, 4))
        simulate_batch(MODEL, STEP_S, initial, wave=wave)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        taken = seconds(partial(simulate_batch, MODEL, duration_s, initial, wave=wave), 2)
        rows.append(
            {
                "ships": count,
                "ship_seconds_per_second": count * duration_s / taken,
                "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
                "grown_by_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
                "sea_mb": sum(np.asarray(x).nbytes for x in wave) / 1e6,
            }
        )
    return rows


def first_calls() -> dict[str, float]:
    """Seconds of the import and of the first call in a fresh process, with cached kernels."""
    code = (
        "import time; a = time.perf_counter(); import utank_hil.dynamics as d; "
        "b = time.perf_counter(); m = d.RollModel(d.RollShip(1e9, 1e8), d.Tank(17, 5, 17, 6)); "
        "d.simulate(m, 1.0); print(b - a, time.perf_counter() - b)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported, called = map(float, done.stdout.split())
    return {"import_s": imported, "first_call_s": called}


def main() -> int:
    """Measure and print."""
    parser = command_line(__doc__)
    parser.add_argument("--components", type=int, default=64, help="components of the sea")
    parser.add_argument("--ships", type=int, default=100_000, help="largest batch")
    arguments = parser.parse_args()
    sizes = [10**k for k in range(6) if 10**k <= arguments.ships]
    comparison = compare(arguments.components)
    result: dict[str, Any] = {
        "cores": os.cpu_count(),
        "step_s": STEP_S,
        "comparison": comparison,
        "ratio_to_c": {n: ratios(n) for n in (1, arguments.components)},
        "scaling": scaling(sizes, arguments.components),
        **first_calls(),
    }
    show(result, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
