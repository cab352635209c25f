"""A process beside the loop is behind it in every queue."""

import os
from pathlib import Path

from utank_hil.base import background


def told_by_a_child(score):
    """Niceness and score of a process that has given way."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        background._SCORE = score
        background.give_way(5)
        os.write(writing, f"{os.nice(0)} {Path('/proc/self/oom_score_adj').read_text()}".encode())
        os._exit(0)
    os.waitpid(child, 0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        return pipe.read()


def test_it_runs_later_and_is_the_first_that_is_killed_for_memory():
    own = os.nice(0)
    assert told_by_a_child(background._SCORE).split() == [str(min(own + 5, 19)), "500"]


def test_where_there_is_no_score_it_runs_later_all_the_same(tmp_path):
    before = Path("/proc/self/oom_score_adj").read_text().strip()
    told = told_by_a_child(tmp_path / "missing" / "score").split()
    assert told == [str(min(os.nice(0) + 5, 19)), before]
