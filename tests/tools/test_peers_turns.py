"""Side by side: everybody does all tasks in order, and what they take is seen."""

import numpy as np
import pytest
from rich.progress import Progress

from tools.peers import peers_environment
from tools.peers.memory import peak_mb
from tools.peers.turns import in_turns, percentiles_us

pytestmark = pytest.mark.slow


def test_each_does_all_tasks_in_order_before_the_next_does():
    calls = []
    solvers = {
        name: lambda task, name=name: calls.append((name, task)) or 2.0 * task for name in "ab"
    }
    costs = in_turns(solvers, [1, 2, 3], rounds=2, progress=Progress(disable=True))
    assert calls == [(name, task) for _ in range(2) for name in "ab" for task in (1, 2, 3)]
    assert costs["b"].answers.tolist() == [2.0, 4.0, 6.0]
    assert (costs["a"].time_s > 0).all()
    assert np.isfinite(costs["a"].time_s).all()


def test_percentiles_are_in_microseconds():
    found = percentiles_us(np.arange(101) * 1e-6)
    assert found == pytest.approx({"p50_us": 50, "p99_us": 99, "max_us": 100})


def test_memory_at_its_height_is_seen_though_it_is_freed():
    assert peak_mb(lambda: np.ones(8_000_000).sum()) == pytest.approx(64, abs=4)
    assert peak_mb(lambda: None) < 2


def test_a_missing_package_is_named_with_the_remedy():
    said = r"^no_such_peer is not in this environment: run `make peers`"
    with pytest.raises(SystemExit, match=said), peers_environment():
        import no_such_peer  # noqa: F401
