"""The same programmes in do-mpc, written as its documentation shows: in states, sample by sample.

A discrete model in the states of the law's model; cost of a sample, cost of the end, bounds on the
input; what the level may exceed its limit by is a second input that counts in the first sample
only. do-mpc has no rate limit, no input that runs straight between knots and no limit at some
samples only: they are appended to its constraints (`prepare_nlp`, `nlp_cons`). It hands all that to
IPOPT, with MUMPS for the linear equations, starting from the last solution.
"""

import warnings
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from tools.peers import peers_environment
from tools.peers.plan_programmes import Programme, ProgrammeFamily
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.law import ConstrainedLaw

with peers_environment(), warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of features that were left out of its installation
    import casadi
    import do_mpc

_TOLERANCE = 1e-8


class DoMpc:
    """do-mpc's controller, set up once; `solve` is one `make_step`.

    Parameters
    ----------
    family : ProgrammeFamily
        For the units.
    design : ConstrainedDesign
        For the weights.
    law : ConstrainedLaw
        For the model.
    """

    def __init__(
        self, family: ProgrammeFamily, design: ConstrainedDesign, law: ConstrainedLaw
    ) -> None:
        unit_pa = law.limits.pressure_pa
        model, level_m = self._model(law, unit_pa)
        self._mpc = do_mpc.controller.MPC(model)
        settings = self._mpc.settings
        settings.t_step = law.sample_time_s
        settings.n_horizon = design.horizon
        settings.store_lagr_multiplier = False
        settings.supress_ipopt_output()
        settings.nlpsol_opts.update(
            {
                "ipopt.tol": _TOLERANCE,
                # it is a quadratic programme
                "ipopt.hessian_constant": "yes",
                "ipopt.jac_c_constant": "yes",
                "ipopt.jac_d_constant": "yes",
                "ipopt.mehrotra_algorithm": "yes",
            }
        )
        self._objective(family, design, law, model)
        self._offsets = self._mpc.get_tvp_template()
        self._mpc.set_tvp_fun(lambda _now: self._offsets)
        self._mpc.bounds["lower", "_u", "pressure"] = -1.0
        self._mpc.bounds["upper", "_u", "pressure"] = 1.0
        self._mpc.bounds["lower", "_u", "excess"] = 0.0
        self._mpc.prepare_nlp()
        self._mpc.ub_opt_x["_u", 1:, 0, "excess"] = 0.0
        self._constraints(family, law, level_m)
        self._mpc.create_nlp()
        self._mpc.set_initial_guess()

    @staticmethod
    def _model(law: ConstrainedLaw, unit_pa: float) -> tuple[Any, Any]:
        """do-mpc's model, and its level as a function of state, inputs and offset."""
        plant = law.model
        model = do_mpc.model.Model("discrete", "SX")
        x = model.set_variable("_x", "x", shape=(len(plant.A), 1))
        pressure = model.set_variable("_u", "pressure")
        model.set_variable("_u", "excess")
        offset_m = model.set_variable("_tvp", "level_offset_m")
        model.set_rhs("x", casadi.DM(plant.A) @ x + casadi.DM(plant.B * unit_pa) @ pressure)
        outputs = casadi.DM(plant.C) @ x + casadi.DM(plant.D * unit_pa) @ pressure
        model.set_expression("outputs", outputs)
        model.set_expression("level_m", outputs[law.level_output] + offset_m)
        model.setup()
        level_m = casadi.Function("level_m", [model.x, model.u, model.tvp], [model.aux["level_m"]])
        return model, level_m

    def _objective(
        self, family: ProgrammeFamily, design: ConstrainedDesign, law: ConstrainedLaw, model: Any
    ) -> None:
        """Cost of a sample and of the end, half of each as in the programme."""
        plant = law.model
        of_output = {"roll_rad": 1.0, "level_m": design.level_weight_rad2_m2}
        weight = np.diag([of_output.get(name, 0.0) for name in design.measured])
        rest = solve_discrete_lyapunov(plant.A.T, plant.C.T @ weight @ plant.C)
        outputs, pressure, excess = model.aux["outputs"], model.u["pressure"], model.u["excess"]
        sample = outputs.T @ casadi.DM(weight) @ outputs
        sample += design.pressure_weight_rad2 * pressure**2
        beyond = family.penalty * (excess + excess**2 / 2)
        end = model.x["x"].T @ casadi.DM(rest) @ model.x["x"]
        self._mpc.set_objective(
            mterm=end / (2 * family.cost), lterm=sample / (2 * family.cost) + beyond
        )
        self._mpc.set_rterm(pressure=0.0, excess=0.0)

    def _constraints(self, family: ProgrammeFamily, law: ConstrainedLaw, level_m: Any) -> None:
        """Rate, straight lines between the knots, and level at the samples where it is held."""
        mpc, horizon = self._mpc, law.horizon
        samples = len(horizon.interpolation)
        commands = [mpc.opt_x["_u", q, 0, "pressure"] for q in range(samples)]
        at_knots = casadi.vertcat(*(commands[q] for q in horizon.knots))
        before = casadi.vertcat(mpc.opt_p["_u_prev", "pressure"], at_knots[:-1])
        self._append(at_knots - before, -family.rise, family.rise)
        between = np.setdiff1d(np.arange(samples), horizon.knots)
        if len(between):
            all_commands = casadi.vertcat(*(commands[q] for q in between))
            straight = all_commands - casadi.DM(horizon.interpolation[between]) @ at_knots
            self._append(straight, np.zeros(len(between)), np.zeros(len(between)))
        excess = mpc.opt_x["_u", 0, 0, "excess"]
        for q in family.held:
            level = level_m(mpc.opt_x["_x", q, 0, -1], mpc.opt_x["_u", q, 0], mpc.opt_p["_tvp", q])
            both = casadi.vertcat(level - excess, level + excess)
            limit = np.array([family.level_m, np.inf])
            self._append(both, -limit[::-1], limit)

    def _append(self, rows: Any, lower: Any, upper: Any) -> None:
        self._mpc.nlp_cons.append(rows)
        self._mpc.nlp_cons_lb.append(lower)
        self._mpc.nlp_cons_ub.append(upper)

    def solve(self, programme: Programme) -> float:
        """One `make_step`."""
        for q, offset_m in enumerate(programme.level_offset_m):
            self._offsets["_tvp", q, "level_offset_m"] = offset_m
        self._mpc.u0 = np.array([[programme.last], [0.0]])
        answer = self._mpc.make_step(programme.state[:, None])
        return float(answer[0, 0]) if self._mpc.solver_stats["success"] else np.nan
