"""Laws of one's own: what the factory may return, and what is said when it is no controller."""

import pickle
import sys
from pathlib import Path

import control
import numpy as np
import pytest

from utank_hil.base.parameters import ParameterError
from utank_hil.control import DesignPlant
from utank_hil.control.python_law import PythonDesign
from utank_hil.dynamics import RollShip, Tank

PLANT = DesignPlant(
    RollShip(1.9275e9, 4.81875e8, 4.81875e7),
    Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10),
)

SOURCE = """
import control
import numpy as np


class Gain:
    def __init__(self, gain=1e5, sample_time_s=0.1):
        self.sample_time_s, self.gain = sample_time_s, gain

    def step(self, y, reference=None):
        return np.array([self.gain * y[0]])

    def applied(self, u):
        pass

    def reset(self):
        pass


def for_plant(plant, share):
    return Gain(share * plant.limits.pressure_pa)


def with_linear(dt=0.1):
    law = Gain()
    law.linear = control.ss([], [], [], [[1e5]], dt)
    return law


def with_another_linear():
    law = with_linear()
    law.gain = 2e5
    return law


ONE = Gain()


def always_the_same():
    return ONE


def without_reset():
    law = Gain()
    law.reset = None
    return law


def of_scalar():
    law = Gain()
    law.step = lambda y: 1.0
    return law


def that_raises_at_rest():
    law = Gain()
    law.step = lambda y: 1 / 0
    return law


def that_fails():
    raise OSError("no licence")


def that_leaves():
    raise SystemExit(0)


def that_leaves_at_rest():
    law = Gain()
    law.step = lambda y: that_leaves()
    return law


not_callable = 3
"""


@pytest.fixture(autouse=True)
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_laws.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "own_laws", raising=False)


def built(name: str, measured: tuple[str, ...] = ("roll_rad",), **parameters):
    return PythonDesign(f"own_laws:{name}", measured, parameters).build(PLANT)


def test_each_controller_is_a_new_one_with_the_configured_parameters() -> None:
    law = built("Gain", gain=2e5)
    first, second = law.controller(), law.controller()
    assert first is not second
    assert first.step(np.array([0.5])) == [1e5]
    assert law.linear is None
    assert law.closes_loop


def test_a_factory_that_asks_for_the_plant_gets_it() -> None:
    assert built("for_plant", share=0.5).controller().step(np.array([1.0])) == [25e3]


def test_a_law_s_own_state_space_is_judged_in_the_loops_count() -> None:
    law = built("with_linear")
    z = np.exp(1j * np.array([0.1, 1.0]))
    np.testing.assert_allclose(law.linear.response(z)[:, 0, 0], 1e5 / z)
    assert control.ss([], [], [], [[1e5]], 0.1).D == 1e5


@pytest.mark.parametrize(
    ("name", "parameters", "key", "message"),
    [
        ("nothing", {}, "factory", "module own_laws has no function nothing"),
        ("not_callable", {}, "factory", "has no function not_callable"),
        ("Gain", {"gian": 1.0}, "parameters", "unexpected keyword argument 'gian'"),
        ("for_plant", {}, "parameters", "missing a required argument: 'share'"),
        ("that_fails", {}, "factory", "failed: OSError: no licence"),
        ("that_leaves", {}, "factory", "failed: SystemExit: 0"),
        ("that_leaves_at_rest", {}, "factory", "fails at rest: SystemExit: 0"),
        ("without_reset", {}, "factory", "without reset"),
        ("of_scalar", {}, "factory", "gives 1.0, not a pressure of shape"),
        ("that_raises_at_rest", {}, "factory", "fails at rest: ZeroDivisionError"),
        ("Gain", {"sample_time_s": "fast"}, "factory", "sample_time_s is 'fast'"),
        ("with_another_linear", {}, "factory", "answers an impulse of 0.001 with 200 Pa at step 1"),
        ("always_the_same", {}, "factory", "returned the same controller twice"),
        ("with_linear", {"dt": 0.2}, "factory", "has sample_time_s 0.1, but its linear has 0.2"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(name, parameters, key, message) -> None:
    with pytest.raises(ParameterError) as caught:
        built(name, **parameters)
    ((found, reason),) = caught.value.problems
    assert found == key
    assert message in reason


def test_a_module_that_is_not_there_is_said_with_where_it_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"install it, or name its file, ./own_lows.py:Gain"):
        PythonDesign("own_lows:Gain", ("roll_rad",)).build(PLANT)
    with pytest.raises(ParameterError, match=rf"can't import {tmp_path}/own_lows.py: FileNotFound"):
        PythonDesign(f"{tmp_path}/own_lows.py:Gain", ("roll_rad",)).build(PLANT)


def test_a_file_that_leaves_is_refused_and_does_not_end_the_command(tmp_path: Path) -> None:
    (tmp_path / "leaves.py").write_text("raise SystemExit(0)", encoding="utf-8")
    with pytest.raises(ParameterError, match=r"can't import .*leaves.py: SystemExit: 0"):
        PythonDesign(f"{tmp_path}/leaves.py:Gain", ("roll_rad",)).build(PLANT)


def test_a_file_is_a_module_of_its_own_and_its_law_goes_to_another_process(tmp_path: Path) -> None:
    law = PythonDesign(f"{tmp_path}/own_laws.py:Gain", ("roll_rad",), {"gain": 3e5}).build(PLANT)
    again = pickle.loads(pickle.dumps(law.controller.args))
    assert again[0].endswith("own_laws.py:Gain")
    assert law.controller().step(np.array([0.5])) == [1.5e5]
    assert "own_laws" not in sys.modules


@pytest.mark.parametrize(
    "factory", ["own_laws", "own_laws.Gain", "own laws:Gain", ":Gain", "a:b:c"]
)
def test_a_factory_is_a_module_and_a_function(factory: str) -> None:
    with pytest.raises(
        ParameterError, match=r"factory must be of the form package\.module:function"
    ):
        PythonDesign(factory, ("roll_rad",))


def test_what_it_measures_has_a_name() -> None:
    with pytest.raises(ParameterError, match="measured must name outputs among roll_rad"):
        PythonDesign("own_laws:Gain", ("pitch_rad",))
