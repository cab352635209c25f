"""Compiling where nothing can be kept."""

import pytest
from numba.core.caching import CacheImpl

from utank_hil.dynamics.jit import njit


def twice(number: float) -> float:
    return 2 * number


@pytest.mark.parametrize("kept", [True, False])
def test_what_can_not_be_kept_is_compiled_all_the_same(
    monkeypatch: pytest.MonkeyPatch, *, kept: bool
) -> None:
    if not kept:  # as in an installation that is not to be written, of a user without a home
        monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    compiled = njit()(twice)
    assert compiled(21.0) == 42.0
    assert (compiled.stats.cache_path is not None) is kept
