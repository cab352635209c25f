import numpy as np
import pytest

from utank_hil.arrays import FloatArray
from utank_hil.control import ARX
from utank_hil.retuning.change_monitor import ChangeMonitor
from utank_hil.retuning.history import SampleHistory


def _record(arx: ARX, samples: int, seed: int, noise: float) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, 1))
    y = np.zeros((samples, arx.outputs))
    for k in range(samples):
        y[k] = arx.beta[0] @ u[k] + noise * rng.standard_normal(arx.outputs)
        for i in range(1, min(arx.order, k) + 1):
            y[k] += arx.alpha[i - 1] @ y[k - i] + arx.beta[i] @ u[k - i]
    return u, y


TRUE = ARX(
    np.array([[[1.8, 0.02], [0.1, 0.5]], [[-0.85, 0.0], [0.0, 0.2]]]),
    np.array([[[0.01], [0.0]], [[0.02], [0.1]], [[0.0], [0.1]]]),
    0.2,
)
CHANGED = ARX(np.array([[[1.5, 0.02], [0.1, 0.5]], [[-0.85, 0.0], [0.0, 0.2]]]), TRUE.beta, 0.2)


def _watched(model: ARX, u: FloatArray, y: FloatArray, roll: int = 0) -> ChangeMonitor:
    monitor, history = ChangeMonitor(model, roll), SampleHistory(10, 2)
    for command, outputs in zip(u[:, 0], y, strict=True):
        monitor.watch(history, command, outputs[roll])
        history.add(command, outputs, fresh=True)
    return monitor


@pytest.mark.parametrize("roll", [0, 1])
def test_prediction_is_that_of_the_model(roll: int) -> None:
    u, y = _record(TRUE, 40, 1, 0.1)
    expected = TRUE.predict(u, y)[:, roll]
    monitor, history = ChangeMonitor(TRUE, roll), SampleHistory(7, 2)
    for k in range(40):
        if k >= TRUE.order:
            assert monitor.predict(history, u[k, 0]) == pytest.approx(expected[k], abs=1e-12)
        history.add(u[k, 0], y[k], fresh=True)


def test_ship_that_stays_the_same_is_no_change() -> None:
    assert 1 <= _watched(TRUE, *_record(TRUE, 12000, 2, 0.05)).change < 1.1


def test_changed_ship_changes_the_measure() -> None:
    u, y = _record(TRUE, 6000, 3, 0.05)
    later_u, later_y = _record(CHANGED, 6000, 4, 0.05)
    monitor = _watched(TRUE, np.vstack([u, later_u]), np.vstack([y, later_y]))
    assert monitor.change > 1.5
    monitor.restart()
    assert monitor.change == 1.0


def test_sea_that_only_grows_is_no_change() -> None:
    u, y = _record(TRUE, 6000, 3, 0.05)
    monitor = _watched(TRUE, np.vstack([u, 3 * u]), np.vstack([y, 3 * y]))
    assert monitor.change < 1.2


@pytest.mark.parametrize("coefficient", [1e30, 1.7e308])
def test_model_that_foretells_nonsense_leaves_a_finite_measure(coefficient: float) -> None:
    u, y = _record(TRUE, 4000, 3, 0.05)
    nonsense = ARX(np.full((2, 2, 2), coefficient), TRUE.beta, 0.2)
    with np.errstate(all="ignore"):
        monitor = _watched(nonsense, np.vstack([u, u]), np.vstack([y, -y]))
    assert 1.0 <= monitor.change < np.inf


def test_still_water_is_no_change() -> None:
    u, y = _record(TRUE, 6000, 3, 0.05)
    quiet = _watched(TRUE, np.vstack([u, 0 * u]), np.vstack([y, 0 * y]))
    assert quiet.change < 1.5
