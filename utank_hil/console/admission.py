"""The gate as a command uses it: what is wrong with a law is said, and ends the command."""

from pathlib import Path

from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig
from utank_hil.configuration.files import located
from utank_hil.console.common import fail, fail_with
from utank_hil.console.terminal import notes
from utank_hil.control import BuiltLaw
from utank_hil.gate import MOST_STEP_S, JudgedLaw, judge


def judge_law(
    config: ControllerConfig, path: Path, key: str = "", *, with_delay_margin: bool = True
) -> JudgedLaw:
    """The law of a configuration, judged; one that can't be ends the command with exit code 2.

    `path` is the file it was read from and `key` where in it, to name the place of what is wrong.
    """
    try:
        with notes.busy(f"{config.name}: designing its law"):  # takes seconds at times
            return judge(config, with_delay_margin=with_delay_margin)
    except ParameterError as error:
        fail_with(located(error, path, key))


def admit(config: ControllerConfig, path: Path, key: str = "") -> BuiltLaw:
    """The law of a configuration, judged; a refused one ends the command with exit code 2."""
    found = judge_law(config, path, key, with_delay_margin=False)
    for failure in found.failures:
        notes.say(failure, yellow=f"{config.name}, margins:")
    if not found.accepted:
        place = ": ".join(filter(None, (str(path), key, config.name)))
        if found.step_s > MOST_STEP_S:
            fail(f"{place}: the law's step is too slow for the loop: make it faster")
        fail(
            f"{place}: the law misses its margins; redesign it (utank-hil check may name one that "
            "passes), or set accept_low_margins: true"
        )
    return found.law
