"""Pump and valve together: they make the pump law's pressure, and the pump as little as it must."""

import pickle
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shipped_designs import GPC_ROLL, LQG_ROLL_RATE_LEVEL
from test_semi_active import PLANT, VALVE

from utank_hil.analysis.loop.margins import robustness
from utank_hil.control.gain import PassiveDesign
from utank_hil.control.semi_active import OnOffValveDesign, PumpWithValve, PumpWithValveDesign


@dataclass
class Asking:
    """A pump law that wants one pressure, and keeps what it is told."""

    pressure_pa: float
    sample_time_s: float = 0.1
    told: list[float] = field(default_factory=list)

    def step(self, y, reference=None):
        return np.array([self.pressure_pa])

    def applied(self, u):
        self.told.append(float(u[0]))

    def reset(self):
        self.told.clear()


@given(st.floats(-5e4, 5e4), st.floats(-3, 3))
def test_pump_and_valve_make_the_pressure_that_the_pump_s_law_wants(wanted, flow):
    law = Asking(wanted)
    both = PumpWithValve(VALVE, law, 0)
    pressure, loss = both.step(np.array([flow]))
    assert VALVE.open_loss <= loss <= VALVE.shut_loss
    assert pressure - loss * abs(flow) * flow == pytest.approx(wanted, abs=1e-6)
    assert abs(pressure) <= abs(wanted) + 1e-6
    if wanted * flow >= 0:
        assert (pressure, loss) == (wanted, VALVE.open_loss)
    elif abs(wanted) <= VALVE.shut_loss * flow**2:
        assert pressure == pytest.approx(0, abs=1e-6)  # the valve makes all of it
    both.applied(np.array([pressure, loss]))
    assert law.told == [pytest.approx(wanted, abs=1e-6)]
    both.reset()
    assert law.told == []


@pytest.mark.parametrize("pump", [GPC_ROLL, LQG_ROLL_RATE_LEVEL], ids=["gpc", "lqg"])
def test_design_is_judged_by_the_pump_s_law_which_is_its_slope_at_rest(pump):
    alone, built = pump.build(PLANT), PumpWithValveDesign(pump).build(PLANT)
    assert built.at_rest
    assert not built.dissipates
    assert built.measured == (*alone.measured, "level_rate_m_s")
    assert built.linear_measured == alone.linear_measured == alone.measured
    together, law = pickle.loads(pickle.dumps(built)).controller(), alone.controller()
    for k in range(50):
        y = 1e-4 * np.sin(0.3 * k + np.arange(len(alone.measured)))
        pressure, loss = together.step(np.array([*y, 1e-5 * np.cos(0.3 * k)]))
        expected = law.step(y)
        assert pressure == pytest.approx(expected[0], rel=1e-3, abs=1e-3)
        together.applied(np.array([pressure, loss]))
        law.applied(expected)
    judged = [robustness(each.linear, PLANT, each.linear_measured) for each in (built, alone)]
    assert judged[0] == judged[1]


@pytest.mark.parametrize(
    ("pump", "message"),
    [
        (OnOffValveDesign(), "pump must be a law that drives a pump"),
        (PassiveDesign(), "pump.kind must be of a linear law"),
    ],
)
def test_design_on_another_law_is_refused(pump, message):
    with pytest.raises(ValueError, match=message):
        PumpWithValveDesign(pump).build(PLANT)
