"""An echo counts while it moves and is not far behind the commands."""

import pytest

from utank_hil.nodes.actuators import CommandEcho
from utank_hil.nodes.plausibility import NEVER_HEARD_NS


def longest_silence(late, commands=200):
    """Most commands from one echo that counts to the next, where each comes so many late."""
    echo = CommandEcho()
    longest = 0
    for command in range(commands):
        echo.sent(command % 16)
        if command >= late:
            echo.heard((command - late) % 16, command)
            longest = max(longest, command - max(echo.heard_ns, late))
    return longest


@pytest.mark.parametrize("late", range(18))
def test_commands_that_all_come_late_are_as_lost_as_those_that_do_not_come(late):
    in_time = late <= 3 or late >= 16  # four bits of counter
    assert longest_silence(late) == (0 if in_time else 199 - late)


def test_an_echo_that_stands_still_does_not_count_whatever_is_sent():
    echo = CommandEcho()
    for command in range(64):
        echo.sent(command % 16)
        echo.heard(3 if command >= 3 else None, command)
    assert echo.heard_ns == 3


def test_one_that_goes_to_and_fro_counts_only_where_the_commands_are():
    echo = CommandEcho()
    silent = []
    for command in range(64):
        echo.sent(command % 16)
        echo.heard(command % 2, command)
        silent.append(command - echo.heard_ns)
    assert max(silent) >= 11


def test_before_the_first_command_there_is_none():
    assert CommandEcho(7).heard_ns == 7
    echo = CommandEcho()
    for counter in range(16):  # of a controller before this one
        echo.heard(counter, 5)
    assert echo.heard_ns == NEVER_HEARD_NS
    echo.sent(1)
    echo.heard(1, 6)
    echo.heard(None, 7)
    echo.heard(1, 8)
    assert echo.heard_ns == 6


def test_a_status_of_before_the_first_command_is_no_echo_of_it():
    echo = CommandEcho()
    echo.heard(1, 5)
    echo.sent(1)
    echo.heard(1, 5)
    assert echo.heard_ns == NEVER_HEARD_NS
