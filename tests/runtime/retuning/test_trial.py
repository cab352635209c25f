import numpy as np
import pytest

from utank_hil.runtime.retuning.trial import Effort, MovingEffort, worsening


def test_effort_is_the_root_mean_square_of_the_latest_samples() -> None:
    rng = np.random.default_rng(1)
    rolls, pressures = rng.standard_normal((2, 50))
    moving = MovingEffort(20)
    assert moving.effort is None
    for k, (roll, pressure) in enumerate(zip(rolls, pressures, strict=True), start=1):
        moving.add(roll, pressure)
        part = slice(max(0, k - 20), k)
        assert moving.effort == pytest.approx(
            (np.sqrt(np.mean(rolls[part] ** 2)), np.sqrt(np.mean(pressures[part] ** 2)))
        )
        assert moving.full == (k >= 20)
    moving.clear()
    assert moving.effort is None


@pytest.mark.parametrize(
    ("roll", "pressure", "words"),
    [
        (1.2, 1.9, ()),
        (1.3, 1.0, ("roll",)),
        (0.5, 2.1, ("pressure",)),
        (2, 3, ("roll", "pressure")),
    ],
)
def test_worsening_beyond_a_factor_is_named(
    roll: float, pressure: float, words: tuple[str, ...]
) -> None:
    found = worsening(Effort(0.02, 1e4), Effort(0.02 * roll, 1e4 * pressure), 1.25, 2.0)
    assert len(found) == len(words)
    assert all(word in reason for word, reason in zip(words, found, strict=True))
