import numpy as np

from tools.studies.preview_worth import KINDS, rows, run_seed


def test_a_forecast_is_worth_something_and_an_error_as_large_as_the_waves_costs_nothing() -> None:
    found = run_seed(240.0, 62001)
    without = found["no forecast"]
    assert found["clairvoyant"] < found["perfect, 10 s"] < 0.97 * without < without
    assert without < found["passive"]
    for name in KINDS:
        assert found[name] < 1.03 * without, name
    (table,) = [rows([found, {name: 1.1 * x for name, x in found.items()}])]
    assert table["passive"]["share"] == 0.0
    assert table["clairvoyant"]["share"] == 1.0
    assert table["no forecast"]["worse"] == 1.0
    assert np.isfinite(table["no forecast"]["share_half_width"])
