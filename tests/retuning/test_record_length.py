from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.identification import okid, validate
from utank_hil.retuning.settings import (
    LAGS,
    estimation_samples,
    least_samples,
    record_problems,
)

CONFIGS = Path("configs").resolve()


@given(order=st.integers(2, 500), outputs=st.integers(1, 4))
def test_least_record_leaves_enough_for_both_parts_and_one_sample_less_does_not(
    order: int, outputs: int
) -> None:
    def enough(samples: int) -> bool:
        first = estimation_samples(samples)
        rows, columns = first - order, (order + 1) * (outputs + 1) - outputs + 3
        return rows > columns and samples - first - max(order, LAGS) >= 100

    least = least_samples(order, outputs)
    assert enough(least)
    assert not enough(least - 1)


@pytest.mark.parametrize(("order", "outputs"), [(5, 1), (40, 2), (60, 4)])
def test_least_record_is_identified_and_validated(order: int, outputs: int) -> None:
    rng = np.random.default_rng(1)
    samples = least_samples(order, outputs)
    u, y = rng.standard_normal((samples, 1)), rng.standard_normal((samples, outputs))
    first = estimation_samples(samples)
    found = okid(
        u[:first],
        y[:first],
        order,
        sample_time_s=0.2,
        disturbance_frequencies_rad_s=(0.6,),
        disturbance_polynomial_degree=0,
    )
    checked = validate(found.arx, u[first:], y[first:], (0.6,), LAGS, 0)
    assert checked.rows >= 100


def test_both_rules_are_told_with_the_remedy() -> None:
    assert record_problems(120, 2500, 2, 0.2, 6.0) == []
    found = dict(record_problems(20, 300, 2, 0.2, 6.0))
    assert "remembers 4 s" in found["order"]
    assert "raise it to 30 or more" in found["order"]
    assert "order 20 needs 125 s, it has 60" in found["identification_s"]


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ({"order": 20}, "retuning.order", "20 remembers 4 s"),
        ({"order": 200, "identification_s": 120.0}, "retuning.identification_s", "needs 300 s"),
        ({"identification_s": 4000.0}, "retuning.identification_s", "3600 at most"),
    ],
)
def test_retuning_that_could_only_be_refused_is_refused_before_the_ship_is_pulsed(
    tmp_path: Path, changes: dict[str, float], key: str, reason: str
) -> None:
    content = yaml.safe_load((CONFIGS / "controllers" / "adaptive_dpc.yaml").read_text())
    content["vessel"] = str(CONFIGS / "ships" / "thesis_first.yaml")
    content["retuning"] |= changes
    path = tmp_path / "controller.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as caught:
        load_config(path, ControllerConfig)
    assert reason in {problem.key: problem.reason for problem in caught.value.problems}[key]
