"""Derive the tank's force, moment and fluid equation, and hold the thesis's print against them.

The water is a line of particles in three straight pieces. Newton's law for each, integrated
along the line, plus the momentum flux of the water turning at the two corners, gives the force and
moment on the ship; the line integral of (acceleration - g) gives the fluid's own equation. The
script

1. prints the derived expressions (`--print`),
2. checks them against `utank_hil.dynamics.wrench.tank_wrench` at random states, and
3. prints every term of the printed (2.11), (2.12), (2.14), (2.16), (4.2), (4.3) that differs
   (`--errata`), of which docs/thesis.md has the table.

The printed text is known through an optical character recognition; a slip may be its own.
"""

import argparse
import json
import sys

import numpy as np
import sympy as sp

from utank_hil.dynamics import GRAVITY_M_S2, Tank
from utank_hil.dynamics.wrench import tank_wrench

rho, At, Ap, L, H, Lx, Lz, g, h = sp.symbols("rho At Ap L H Lx Lz g h")
L_L, L_R = sp.symbols("L_L L_R")  # printed in (2.16), explained nowhere
hd, hdd = sp.symbols("h' h''")
u, v, w, p, q, r = sp.symbols("u v w p q r")
ud, vd, wd, pd, qd, rd = sp.symbols("u' v' w' p' q' r'")
sf, cf, st, ct = sp.symbols("sin(phi) cos(phi) sin(theta) cos(theta)")
phi = sp.Symbol("phi")
MOTION = (hdd, hd, u, v, w, p, q, r, ud, vd, wd, pd, qd, rd, st, ct, sf, cf, phi)

SUM = 2 * Lz * H - H**2 - h**2  # these two recur in every row
CUBE = 2 * H**3 - 6 * Lz * H**2 - 6 * Lz * h**2 + 6 * Lz**2 * H + 6 * H * h**2


def derive() -> tuple[sp.Matrix, sp.Matrix, sp.Expr]:
    """Force and moment on the ship and the residual, from the particles."""
    s = sp.Symbol("s")
    velocity, rate = sp.Matrix([u, v, w]), sp.Matrix([p, q, r])
    acceleration, rate_dot = sp.Matrix([ud, vd, wd]), sp.Matrix([pd, qd, rd])
    gravity = g * sp.Matrix([-st, ct * sf, ct * cf])
    half = L / 2
    pieces = (  # area, position along s, range of s, direction from port to starboard
        (At, sp.Matrix([Lx, -half, s]), (Lz - H + h, Lz), sp.Matrix([0, 0, 1])),
        (Ap, sp.Matrix([Lx, s, Lz]), (-half, half), sp.Matrix([0, 1, 0])),
        (At, sp.Matrix([Lx, half, s]), (Lz - H - h, Lz), sp.Matrix([0, 0, -1])),
    )
    force, moment, residual = sp.zeros(3, 1), sp.zeros(3, 1), sp.Integer(0)
    for area, position, (low, high), along in pieces:
        flow = At / area * along
        felt = (
            acceleration
            + rate.cross(velocity)
            + rate_dot.cross(position)
            + 2 * rate.cross(flow * hd)
            + rate.cross(rate.cross(position))
            + flow * hdd
            - gravity
        )

        def over(expression: sp.Expr, low: sp.Expr = low, high: sp.Expr = high) -> sp.Expr:
            return sp.integrate(sp.expand(expression), (s, low, high))

        force -= rho * area * felt.applyfunc(over)
        moment -= rho * area * position.cross(felt).applyfunc(over)
        residual += over(felt.dot(along))
    duct = sp.Matrix([0, At / Ap, 0])
    down = sp.Matrix([0, 0, 1])
    for y, before, after in ((-half, down, duct), (half, duct, -down)):
        flux = rho * At * hd**2 * (after - before)
        force -= flux
        moment -= sp.Matrix([Lx, y, Lz]).cross(flux)
    return force.applyfunc(sp.expand), moment.applyfunc(sp.expand), sp.expand(residual)


def printed() -> dict[str, sp.Expr]:
    """The right-hand sides as printed, by equation and component."""
    mass = 2 * H * At + L * Ap
    pull = Lz * h + H * h
    fluid = (
        rho * (2 * H + At / Ap * L) * hdd
        + 2 * h * rho * g * ct * cf - rho * g * L * ct * sf
        - rho * L * vd - 2 * rho * H * wd + 2 * rho * h * q * u - 2 * rho * h * p * v
        + rho * L * r * u - rho * L * p * w
        - rho * (2 * Lz - H) * h * p**2 - rho * (2 * Lz - H) * h * q**2
        + 2 * rho * Lx * h * p * r - rho * L * Lx * p * r - rho * (H * L + Lz * L) * q * r
        + 2 * rho * Lx * h * qd - rho * L * (Lz + H) * pd + rho * Lx * L * rd
    )  # fmt: skip
    linear = -(
        -rho * At * (2 * H + At / Ap * L) * hdd - 2 * rho * At * Lx * h * qd
        + rho * L * At * (Lz + H) * pd + rho * At * Lx * L * rd + rho * At * L * vd
        + 2 * rho * At * H * wd - 2 * At * h * rho * g + rho * At * g * L * phi
    )  # fmt: skip
    x = (
        rho * g * mass * st + rho * mass * ud - 2 * rho * At * h * q * hd - rho * At * L * r * hd
        - rho * mass * r * v + rho * mass * q * w - rho * Lx * mass * r**2 - rho * Lx * mass * q**2
        + rho * At * SUM * r * p + rho * Lz * L * Ap * r * p + rho * At * L * h * p * q
        - rho * L * h * At * rd + rho * (At * SUM + Lz * L * Ap) * qd
    )  # fmt: skip
    lift = At * SUM + Lz * L * Ap
    y = (
        rho * At * L * hdd + rho * g * mass * ct * sf + rho * mass * vd + 2 * rho * At * h * p * hd
        + rho * At * L * h * r**2 + rho * lift * q * r + rho * (2 * Lx * H + Lx * L * Ap) * p * q
        - rho * At * L * h * p**2 + rho * Lx * mass * rd - rho * lift * pd
        + rho * mass * r * u - rho * mass * p * w
    )  # fmt: skip
    z = (
        -2 * rho * At * h * hd + rho * g * mass * ct * cf + rho * mass * wd + rho * At * L * p * hd
        - rho * At * L * h * q * r + rho * Lx * mass * r * p - rho * lift * p**2 - rho * lift * q**2
        - rho * mass * q * u + rho * mass * p * v
        - 2 * rho * (Lx * H * At + Lx * L * Ap) * qd + rho * L * h * At * pd
    )  # fmt: skip
    k = (
        -rho * At * L * H * hdd - rho * Lz * L * At * hdd - rho * At * (SUM * vd + L * h * w)
        - rho * Ap * Lz * L * vd
        - rho * At * (SUM * r * u - SUM * p * w + L * h * q * u - L * h * p * v)
        - rho * Ap * (Lz * L * r * u - Lz * L * p * w) - 4 * rho * At * pull * p * hd
        - rho * At * L * pull * r**2 - rho * At * L * CUBE * q * r / 3 - rho * At * Lx * SUM * p * q
        + rho * At * L * (Lz * h - H * h) * p**2 + rho * At * L**2 * H * q * r / 2
        - rho * At * L * pull * q**2 + rho * At * L * Lx * h * r * p - rho * At * L * pull * p**2
        + rho * Ap * (-(Lz**2) * L * q * r - Lz * Lx * L * p * q + L**3 * q * r / 12)
        - rho * At * Lx * SUM * rd + rho * At * CUBE * pd / 3
        - rho * At * (L * Lx * h * qd - L**2 * H * pd / 2)
        + rho * Ap * (-Lz * Lx * L * rd + Lz**2 * L * pd + L**3 * pd / 12)
        - rho * g * At * (-SUM * ct * sf + L * h * ct * cf) + rho * g * Ap * Lz * L * ct * sf
    )  # fmt: skip
    m = (
        -rho * At * 2 * Lx * h * hdd + rho * At * (SUM * ud - 2 * Lx * H * wd)
        + rho * Ap * (Lz * L * ud - Lx * L * wd)
        + rho * At * (-SUM * r * v + SUM * q * w + 2 * Lx * H * q * u - 2 * Lx * H * p * v)
        + rho * Ap * (-Lz * L * r * v + Lz * L * q * w + Lx * L * q * u - Lx * L * p * v)
        - 4 * rho * At * pull * q * hd - 2 * rho * At * (Lz * L * r * hd + Lx * L * p * hd)
        - rho * At * Lx * SUM * r**2 / 2 + rho * At * (L_L**3 + L_R**3) * r * p / 3
        - rho * At * Lx * SUM * q**2 / 2 + rho * At * L * pull * p * q - L * Lx * h * q * r
        + rho * At * Lx * SUM * q**2 / 2 - 2 * rho * At * Lx**2 * H * r * p
        + rho * At * Lx * SUM * p**2 / 2
        + rho * Ap * L * (-Lz * Lx * r**2 + Lz**2 * r * p - Lx**2 * r * p + Lz * Lx * p**2)
        - rho * At * L * pull * rd + rho * At * CUBE * qd / 3
        - rho * At * (2 * Lx**2 * H * qd + L * Lx * h * pd) + rho * Ap * L * (Lz**2 + Lx**2) * qd
        + rho * g * At * SUM * st + 2 * rho * g * At * Lx * H * ct * cf
        + rho * g * Ap * L * (Lz * st + Lx * ct * cf)
    )  # fmt: skip
    n = (
        rho * Lx * L * At * hdd + rho * At * (-L * h * ud + 2 * Lx * H * vd)
        + rho * Ap * Lx * L * vd
        + rho * At * (L * h * r * v - L * h * q * w / 2 + 2 * Lx * H * r * u - 2 * Lx * H * p * w)
        + rho * Ap * (Lx * L * r * u - Lx * L * p * w)
        + 2 * rho * At * (-L * H * q * hd - 2 * Lx * h * pd)
        - rho * At * L * Lx * h * r**2 + rho * At * L * pull * r * p - rho * At * L * Lx * h * q**2
        + rho * At * L**2 * H * p * q / 2 - rho * At * L * Lx * h * r**2
        + rho * At * Lx * SUM * q * r / 2 + 2 * rho * At * Lx**2 * H * p * q
        - rho * At * L * Lx * h * p**2
        + rho * Ap * (L**3 * p * q / 12 + Lz * Lx * L * q * r + Lx**2 * L * p * q)
        + rho * At * (L**2 / 2 + 2 * Lx**2) * H * r * rd
        + rho * At * (L * pull * qd / 4 - Lx * SUM * pd)
        + rho * Ap * (L**3 * rd / 12 + Lx**2 * L * rd - Lz * Lx * L * pd)
        - rho * g * At * (L * h * st + 2 * Lx * H * ct * sf) - rho * g * Ap * Lx * L * ct * sf
    )  # fmt: skip
    roll_fluid = (
        rho * (2 * H + At / Ap * L) * hdd - rho * L * (Lz + H) * pd
        + 2 * rho * g * h * cf - rho * g * L * sf - rho * (2 * Lz - H) * h * p**2
    )  # fmt: skip
    roll_moment = (
        -rho * At * (CUBE / 3 + L**2 * H / 2 + Ap / At * Lz**2 * L + Ap / At * L**3 / 12) * pd
        + rho * At * (L * H + Lz * L) * hdd + 4 * rho * At * (Lz + H) * h * p * hd
        + 2 * rho * At * L * H * h * p**2 - rho * g * At * SUM * sf + rho * g * At * L * h * cf
        - rho * g * Ap * Lz * L * sf
    )  # fmt: skip
    return {
        "(2.11)": fluid, "(2.12)": linear, "(2.14) -X": x, "(2.14) -Y": y, "(2.14) -Z": z,
        "(2.16) -K": k, "(2.16) -L": m, "(2.16) -M": n, "(4.2)": roll_fluid, "(4.3)": roll_moment,
    }  # fmt: skip


def derived(force: sp.Matrix, moment: sp.Matrix, residual: sp.Expr) -> dict[str, sp.Expr]:
    """First principles' counterpart of every entry of `printed`."""
    roll_only = dict.fromkeys((u, v, w, q, r, ud, vd, wd, qd, rd, st), 0) | {ct: 1}
    slow = dict.fromkeys((hd, u, v, w, p, q, r, st), 0) | {ct: 1, cf: 1, sf: phi}
    # to first order in the level and the accelerations
    linear = sp.expand(rho * At * residual.subs(slow))
    linear -= sum(linear.coeff(x).coeff(h) * x * h for x in (ud, vd, wd, pd, qd, rd))
    return {
        "(2.11)": rho * residual, "(2.12)": linear,
        "(2.14) -X": -force[0], "(2.14) -Y": -force[1], "(2.14) -Z": -force[2],
        "(2.16) -K": -moment[0], "(2.16) -L": -moment[1], "(2.16) -M": -moment[2],
        "(4.2)": rho * residual.subs(roll_only), "(4.3)": moment[0].subs(roll_only),
    }  # fmt: skip


def differences(
    print_: dict[str, sp.Expr], truth: dict[str, sp.Expr]
) -> list[tuple[str, sp.Expr, sp.Expr, sp.Expr]]:
    """Rows (equation, product of motions, printed coefficient, derived coefficient)."""
    rows = []
    for name, expression in print_.items():
        ours, theirs = (
            sp.Poly(sp.expand(side), *MOTION).as_dict() for side in (truth[name], expression)
        )
        for powers in sorted(ours.keys() | theirs.keys(), reverse=True):
            one, other = ours.get(powers, sp.Integer(0)), theirs.get(powers, sp.Integer(0))
            if sp.expand(one - other) != 0:
                product = sp.Mul(*(x**k for x, k in zip(MOTION, powers, strict=True)))
                rows.append((name, product, sp.factor(other), sp.factor(one)))
    return rows


def errata(force: sp.Matrix, moment: sp.Matrix, residual: sp.Expr) -> list[list[str]]:
    """The rows of `differences` as text."""
    found = differences(printed(), derived(force, moment, residual))
    return [
        [name, *(str(cell).replace("**", "^").replace("*", " ") for cell in cells)]
        for name, *cells in found
    ]


def worst_difference(
    force: sp.Matrix, moment: sp.Matrix, residual: sp.Expr, states: int = 200
) -> float:
    """Largest relative difference between the derivation and `tank_wrench`."""
    rng = np.random.default_rng(11)
    names = (
        *(rho, At, Ap, L, H, Lx, Lz, g, h, hd, hdd, u, v, w, p, q, r),
        *(ud, vd, wd, pd, qd, rd, sf, cf, st, ct),
    )
    evaluate = sp.lambdify(names, [*force, *moment, residual], "numpy")
    worst = 0.0
    for _ in range(states):
        tank = Tank(
            width_m=rng.uniform(3, 30), height_m=rng.uniform(1, 8),
            reservoir_area_m2=rng.uniform(1, 30), duct_area_m2=rng.uniform(0.1, 10),
            lx_m=rng.uniform(-40, 40), lz_m=rng.uniform(-8, 8), density_kg_m3=1025.0,
        )  # fmt: skip
        level, speed, bend = rng.uniform(-1, 1, 3) * [tank.height_m, 3, 3]
        motion = rng.uniform(-2, 2, (4, 3))
        roll, pitch = rng.uniform(-1.4, 1.4, 2)
        expected = np.array(
            evaluate(
                1025.0, tank.reservoir_area_m2, tank.duct_area_m2, tank.width_m, tank.height_m,
                tank.lx_m, tank.lz_m, GRAVITY_M_S2, level, speed, bend, *motion.ravel(),
                np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch),
            )
        )  # fmt: skip
        velocity, rate, acceleration, rate_dot = motion
        values = tank_wrench(
            tank, level, speed, bend, velocity, rate, acceleration, rate_dot, roll, pitch
        )
        for ours, theirs in zip(values, np.split(expected, [3, 6]), strict=True):
            error = np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)
            worst = max(worst, float(error))
    return worst


def main() -> int:
    """Derive, check, and print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--print", action="store_true", help="print the derived expressions")
    parser.add_argument("--errata", action="store_true", help="print the terms that differ")
    parser.add_argument("--json", action="store_true", help="one JSON object with those terms")
    arguments = parser.parse_args()
    force, moment, residual = derive()
    if arguments.print:
        for name, expression in zip("XYZKMN", [*force, *moment], strict=True):
            print(f"{name} =", sp.collect(expression, MOTION), "\n")
        print("residual =", sp.collect(residual, MOTION), "\n")
    rows = errata(force, moment, residual) if arguments.errata or arguments.json else []
    worst = worst_difference(force, moment, residual)
    if arguments.json:
        print(json.dumps({"worst_difference": worst, "errata": rows}))
        return 0 if worst < 1e-10 else 1
    for name, *cells in rows:
        print(f"{name}: " + " | ".join(cells))
    print(f"tank_wrench agrees with the derivation to {worst:.1e}")
    return 0 if worst < 1e-10 else 1


if __name__ == "__main__":
    sys.exit(main())
