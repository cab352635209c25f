"""What commands that run a loop share: the bus, and how the loop is scheduled."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import TypeVar

from utank_hil.canbus import Port, PortError
from utank_hil.console.common import failing, why
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import notes
from utank_hil.runners import real_time_scheduling, stop_on_signals

PortT = TypeVar("PortT", bound=Port)


@contextmanager
def opened(opens: Callable[[], PortT]) -> Iterator[tuple[PortT, Callable[[], bool]]]:
    """Yield a port, and what says whether to stop; the command ends if the bus can't be had."""
    with failing(OSError, code=ExitCode.NO_BUS):
        port = opens()
    with closing(port), stop_on_signals() as stop:
        try:
            port.receive()  # frames of before are not judged
        except PortError as error:  # it may come back: what runs judges that
            notes.say(why(error), yellow="the bus does not work yet:")
        yield port, stop


def require_bus(bus: str) -> None:
    """End the command if nothing can be heard on a bus now."""
    from utank_hil.canbus.socketcan import SocketCanPort

    with (
        failing(OSError, at=f"--bus {bus}", code=ExitCode.NO_BUS),
        closing(SocketCanPort(bus)) as port,
    ):
        port.receive()


@contextmanager
def scheduled(words: str = "") -> Iterator[None]:
    """Schedule a loop, say how far that succeeded, and what runs."""
    with real_time_scheduling() as scheduling:
        for line in (*scheduling, *filter(None, [words])):
            notes.say(line)
        yield
