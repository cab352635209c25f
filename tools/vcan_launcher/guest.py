"""The first process inside the user-mode kernel: sets it up, runs the command, reports, powers off.

Started by ``uml`` as ``python -I -S guest.py``; the serial lines are described there.
"""

import contextlib
import fcntl
import marshal
import os
import signal
import socket
import struct
import sys
import termios
import threading
import time
from collections.abc import Iterator
from typing import Any, NoReturn

sys.path.insert(0, os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))

from tools.vcan_launcher import linux
from tools.vcan_launcher.command import execute

CONTROL, STDIN, STDOUT, STDERR = (f"/dev/ttyS{number}" for number in range(4))
READY, TAKEN, ENDED = b"R", b"T", b"E"  # what is said on the control line
GRACE_S = 1.0  # between SIGTERM and SIGKILL for what the command leaves behind


def main() -> None:
    """Be the first process."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # not Python's handler between fork and exec
    try:
        control, stdin = _open_line(CONTROL), _open_line(STDIN)
        os.write(control, READY)
        specification = marshal.loads(b"".join(_frames(stdin, control)))
        _set_up(specification)
        status = _run(specification, control, stdin)
        os.sync()
        os.write(control, ENDED + struct.pack("<i", status))
        termios.tcdrain(control)
    except Exception:
        sys.excepthook(*sys.exc_info())  # to the console, which the launcher keeps
    linux.power_off()


def _set_up(specification: dict[str, Any]) -> None:
    for kind, target in (
        ("proc", "/proc"),
        ("sysfs", "/sys"),
        ("devpts", "/dev/pts"),
        ("tmpfs", "/dev/shm"),
    ):
        if target.startswith("/dev/"):  # the kernel has mounted /dev, empty but for the devices
            os.mkdir(target)
        linux.mount(kind, target)
    os.symlink("/proc/self/fd", "/dev/fd")
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        os.symlink(f"/proc/self/fd/{number}", f"/dev/{name}")
    # it counts a real-time process's time in ticks of 10 ms: one that runs for a part of each tick,
    # as a loop of 10 ms does, seems to take all, and all real-time processes are held for 50 ms
    with open("/proc/sys/kernel/sched_rt_runtime_us", "w") as limit:
        limit.write("-1")
    socket.sethostname(specification["hostname"])
    for module in specification["modules"]:
        linux.load_module(module)
    linux.set_link_up("lo")
    linux.create_vcan("vcan0")


def _run(specification: dict[str, Any], control: int, stdin: int) -> int:
    """Run the command to its end, outputs drained; return its wait status."""
    reader, writer = os.pipe()
    one_output = specification["one_output"]
    sizes = specification["terminals"]
    outputs = [_output(size) for size in (sizes[:1] if one_output else sizes)]
    streams = (reader, outputs[0][1], outputs[-1][1])
    child = os.fork()
    if child == 0:
        _become_command(specification, streams)
    for fd in set(streams):
        os.close(fd)
    unread: set[int] = set()
    threading.Thread(target=_control, args=(control, child, unread), daemon=True).start()
    threading.Thread(target=_pump_in, args=(stdin, control, writer), daemon=True).start()
    pumps = [
        threading.Thread(target=_pump_out, args=(source, _open_line(line), number, unread))
        for (source, _), line, number in zip(outputs, (STDOUT, STDERR), (1, 2), strict=False)
    ]
    for pump in pumps:
        pump.start()
    pid = 0
    while pid != child:  # the first process inherits, and has to reap, every orphan
        pid, status = os.wait()
    _end_orphans()
    for pump in pumps:
        pump.join()
    return status


def _become_command(specification: dict[str, Any], streams: tuple[int, ...]) -> NoReturn:
    try:
        os.setsid()
        for number, fd in enumerate(streams):
            os.fchown(fd, *specification["user"][:2])  # so that /dev/stdout can be opened
            os.dup2(fd, number)
        os.closerange(3, 256)
        linux.become(*specification["user"])
        os.umask(specification["umask"])
        os.chdir(specification["cwd"])
        execute(specification["argv"], specification["env"])
    except Exception as error:  # such as a current directory below the host's own /dev/shm
        os.write(2, f"tools/vcan: inside the user-mode kernel: {error}\n".encode())
        os._exit(125)


def _output(size: tuple[int, int] | None) -> tuple[int, int]:
    """Reader and writer of a pipe, or of a terminal of ``size`` (columns, lines)."""
    if size is None:
        return os.pipe()
    reader, writer = os.openpty()
    attributes = termios.tcgetattr(writer)
    attributes[1] &= ~termios.OPOST  # the host's terminal does this
    termios.tcsetattr(writer, termios.TCSANOW, attributes)
    columns, lines = size
    fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
    return reader, writer


def _control(line: int, child: int, unread: set[int]) -> None:
    """Do what the launcher says: (signal, whether to the group), or (0, output nobody reads)."""
    while len(message := _read_exactly(line, 2)) == 2:
        number, operand = message
        if number == 0:
            unread.add(operand)
            continue
        with contextlib.suppress(ProcessLookupError):
            (os.killpg if operand else os.kill)(child, number)
    # The launcher is gone.
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.kill(-1, number)
            time.sleep(GRACE_S)
    os.sync()
    linux.power_off()


def _pump_in(line: int, control: int, target: int) -> None:
    with contextlib.suppress(BrokenPipeError):  # the command reads no further
        for data in _frames(line, control):
            _write_all(target, data)
    os.close(target)


def _frames(line: int, control: int) -> Iterator[bytes]:
    """What the launcher sends by length and bytes, to the length 0; each frame is acknowledged."""
    while size := struct.unpack("<H", _read_exactly(line, 2))[0]:
        yield _read_exactly(line, size)
        os.write(control, TAKEN)


def _pump_out(source: int, line: int, number: int, unread: set[int]) -> None:
    while (data := _read(source)) and number not in unread:
        _write_all(line, data)
    os.close(source)  # if the command still writes, it gets an error as from any closed pipe
    termios.tcdrain(line)


def _end_orphans() -> None:
    """End whatever the command has left running; the kernel is about to go."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.kill(-1, number)
        end = time.monotonic() + GRACE_S
        while time.monotonic() < end:
            try:
                pid, _ = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return
            if pid == 0:
                time.sleep(0.005)


def _open_line(path: str) -> int:
    """Open a serial line, raw: every byte passes as it is."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(fd)
    attributes[0] = attributes[1] = attributes[3] = 0  # input, output, local flags
    attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    attributes[6][termios.VMIN], attributes[6][termios.VTIME] = 1, 0
    termios.tcsetattr(fd, termios.TCSANOW, attributes)
    return fd


def _read(fd: int) -> bytes:
    try:
        return os.read(fd, 65536)
    except OSError:  # how a terminal says that it has been closed
        return b""


def _read_exactly(fd: int, size: int) -> bytes:
    """Read ``size`` bytes, fewer only at the end."""
    data = b""
    while len(data) < size and (more := os.read(fd, size - len(data))):
        data += more
    return data


def _write_all(fd: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]


if __name__ == "__main__":
    main()
