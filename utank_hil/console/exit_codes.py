"""The exit codes of the commands: here, and as a table in ``docs/deployment.md``."""

from enum import IntEnum


class ExitCode(IntEnum):
    """How a command ended, for scripts and service managers."""

    commands: str  #: Those that may end so.
    meaning: str

    def __new__(cls, value: int, commands: str, meaning: str) -> "ExitCode":
        """Make a member of its number, its commands and its meaning."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.commands, member.meaning = commands, meaning
        return member

    OK = (
        0,
        "all",
        "Done as asked. `run` without a latched fault and `firmware-sim`: stopped by Ctrl-C or "
        "SIGTERM, too.",
    )
    REFUSED = (
        1,
        "`bus`, `check`, `commission`, `conform`, `identify`, `init`, `faults`, `replay`",
        "Something on a bus is missing, wrong or double, a law misses its margins, a commissioning "
        "is not passed, a device does not conform to its profile, a model or its law is refused, "
        "no tank can be for a ship, a row of the fault campaign failed, or a replay differs. Of "
        "any command, with a traceback: an error in the program.",
    )
    USAGE = (
        2,
        "all",
        "An option, a file or a configuration is wrong, or results can't be written. Starting "
        "again does not help.",
    )
    NO_BUS = (
        3,
        "`run`, `commission`, `conform`, `panel`, `bench`, `bus`, `faults`, `firmware-sim`",
        "The CAN interface can't be opened; of `run`, another controller is on it.",
    )
    BUS_LOST = (4, "`run`", "Ended while the CAN bus could not be used, or with its loss latched.")
    FAULT = 5, "`run`", "Ended with another fault latched."
    NOT_RANKED = (
        6,
        "`bench`",
        "The results are written, but a run is marked and not ranked: the ship capsized, the "
        "controller ended in a fault or was too seldom in charge, or rows are missing.",
    )
    SYSTEM = (
        7,
        "all",
        "The system refused what the command needs, such as a process or memory, or a process of "
        "it was killed. `bench` and `faults` keep what there is. Starting again may "
        "help.",
    )
    INTERRUPTED = (
        130,
        "all but `panel`, `monitor`",
        "Ctrl-C or SIGTERM before the end; of `run`, before it has opened the bus; of "
        "`firmware-sim`, before the first sample. `bench`, `campaign` and `faults` keep what "
        "there is.",
    )
    UNREAD = (
        141,
        "all",
        "What read standard output has ended, such as `head`: as other programs end by SIGPIPE.",
    )
