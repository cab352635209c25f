"""The command inside a user-mode Linux kernel: the host's side.

The kernel is a child process that sees the host's files. Four of its serial lines, in raw mode, are
pipes of ours: control (both ways), standard input, standard output, standard error. The first
process inside, ``guest``, says on the control line when it listens, when it has taken a frame of
input, and how the command ended. The first input is what to run. Input goes frame by frame, each
awaited, because the kernel's serial lines stall when their buffer of 4 KiB runs full.
"""

import contextlib
import marshal
import mmap
import os
import secrets
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from tools.vcan_launcher import debian, xstate

BOOT_LIMIT_S = 60.0
POWER_OFF_LIMIT_S = 10.0
MEMORY_BYTES = 2 << 30  # a sparse file: only what is touched is used
FRAME_BYTES = 2048
NICENESS = -10  # where the user may set it
SI_KERNEL = 0x80  # origin of a signal typed at the terminal
FORWARDED = {
    signal.SIGHUP,
    signal.SIGINT,
    signal.SIGQUIT,
    signal.SIGTERM,
    signal.SIGUSR1,
    signal.SIGUSR2,
}
# The first two are benchmarks of RAID code, a second of a boot that takes a quarter without them.
BOOT_ARGUMENTS = (
    "initcall_blacklist=raid6_select_algo,calibrate_xor_blocks",
    "pty.legacy_count=0",
    "quiet",
    "root=/dev/root",
    "rootfstype=hostfs",
    "rw",
    "con=null",
    "con0=null,fd:1",
)
GUEST = str(Path(__file__).with_name("guest.py"))
MODULES = ("can-raw.ko", "can-bcm.ko", "vcan.ko")


class KernelError(Exception):
    """The user-mode kernel did not run the command; the message says why."""


def run(argv: list[bytes], env: dict[bytes, bytes]) -> int:
    """Run the command inside the user-mode kernel and return its exit code.

    When a signal ended the command, this process ends by the same signal. Raises `KernelError` if
    the kernel cannot be started or ends before the command does.
    """
    status = _Machine(argv, env).run()
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number != signal.SIGKILL:
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, [])
        os.kill(os.getpid(), number)
    return os.waitstatus_to_exitcode(status)


class _Machine:
    """One run of the kernel."""

    def __init__(self, argv: list[bytes], env: dict[bytes, bytes]) -> None:
        kernel, modules = _find_kernel()
        self._kernel = kernel
        self._specification = marshal.dumps(_specification(argv, env, modules))
        self._ready = threading.Event()
        self._taken = threading.Semaphore(0)
        self._reported = threading.Event()
        self._status = 0
        self._console = b""
        self._name = f"vcan-{secrets.token_hex(6)}"

    def run(self) -> int:
        """Boot, run the command, power off; return the command's wait status."""
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # in the background: no input, but no stop
        # An ignored signal (nohup) stays ignored; the others wait to be taken up by sigwaitinfo.
        awaited = {s for s in FORWARDED if signal.getsignal(s) is not signal.SIG_IGN}
        awaited.add(signal.SIGCHLD)
        signal.pthread_sigmask(signal.SIG_BLOCK, awaited)

        control_in, self._control = os.pipe()
        report, control_out = os.pipe()
        stdin_in, stdin = os.pipe()
        stdout, stdout_out = os.pipe()
        stderr, stderr_out = os.pipe()
        console, console_out = os.pipe()
        inside = (control_in, control_out, stdin_in, stdout_out, stderr_out)
        lines = (
            f"ssl0=fd:{control_in},fd:{control_out}",
            f"ssl1=fd:{stdin_in},null",
            f"ssl2=null,fd:{stdout_out}",
            f"ssl3=null,fd:{stderr_out}",
        )
        process = subprocess.Popen(
            [self._kernel, *self._arguments(), *lines, "--", "-I", "-S", _quoted(GUEST)],
            stdin=subprocess.DEVNULL,
            stdout=console_out,
            stderr=console_out,
            pass_fds=inside,
            process_group=0,  # Ctrl-C at the terminal must not reach the kernel itself
            preexec_fn=_in_kernel_process,
            env={"TMPDIR": _memory_directory(), "PATH": os.defpath, **xstate.environment()},
        )
        for fd in (*inside, console_out):
            os.close(fd)
        threads = [
            threading.Thread(target=target, args=args, daemon=True)
            for target, args in (
                (self._pump_out, (stdout, 1)),
                (self._pump_out, (stderr, 2)),
                (self._read_console, (console,)),
                (self._read_report, (report,)),
            )
        ]
        for thread in threads:
            thread.start()
        threading.Thread(target=self._pump_in, args=(stdin,), daemon=True).start()
        try:
            self._forward_signals(process, awaited)
        finally:
            with contextlib.suppress(ProcessLookupError):  # its helper processes too
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            shutil.rmtree(Path(tempfile.gettempdir()) / self._name, ignore_errors=True)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, awaited)  # for a reader who never takes the rest
        for thread in threads:
            thread.join()
        if not self._reported.is_set():
            raise KernelError(
                "the user-mode kernel "
                + ("ended before the command did" if self._ready.is_set() else "did not boot")
                + ". It needs ptrace (in a container: --cap-add SYS_PTRACE) and "
                f"{MEMORY_BYTES >> 20} MiB of memory. It said:\n"
                + self._console.decode(errors="replace").strip()
            )
        return self._status

    def _arguments(self) -> tuple[str, ...]:
        return (
            f"mem={MEMORY_BYTES >> 20}M",
            *BOOT_ARGUMENTS,
            f"uml_dir={tempfile.gettempdir()}/",
            f"umid={self._name}",
            f"init={_quoted(sys.executable)}",
        )

    def _forward_signals(
        self, process: "subprocess.Popen[bytes]", awaited: set[signal.Signals]
    ) -> None:
        """Hand signals on to the command until the kernel has ended."""
        boot_end = time.monotonic() + BOOT_LIMIT_S
        power_off_end = float("inf")
        while process.poll() is None:
            info = signal.sigtimedwait(awaited, 1.0)
            now = time.monotonic()
            if info is not None and info.si_signo != signal.SIGCHLD:
                # As without us: Ctrl-C goes to the command's whole group, kill(1) to the command.
                with contextlib.suppress(BrokenPipeError):
                    os.write(self._control, bytes((info.si_signo, info.si_code == SI_KERNEL)))
            if self._reported.is_set():
                power_off_end = min(power_off_end, now + POWER_OFF_LIMIT_S)
            if now > power_off_end or (now > boot_end and not self._ready.is_set()):
                return

    def _pump_in(self, line: int) -> None:
        """Send what to run, then standard input to its end."""
        self._ready.wait()
        with contextlib.suppress(BrokenPipeError):  # the kernel has ended
            for start in range(0, len(self._specification), FRAME_BYTES):
                self._send(line, self._specification[start : start + FRAME_BYTES])
            self._send(line, b"")
            while data := _read_stdin():
                self._send(line, data)
            self._send(line, b"")

    def _send(self, line: int, data: bytes) -> None:
        _write_all(line, struct.pack("<H", len(data)) + data)
        if data:
            self._taken.acquire()

    def _pump_out(self, line: int, target: int) -> None:
        """One output of the command, to its end; once nobody reads it the guest is notified."""
        while data := os.read(line, 65536):
            try:
                _write_all(target, data)
            except OSError:
                with contextlib.suppress(BrokenPipeError):
                    os.write(self._control, bytes((0, target)))
                break
        while os.read(line, 65536):  # so that the kernel can go on
            pass

    def _read_console(self, line: int) -> None:
        """Keep the kernel's last words, for the case that it fails."""
        while data := os.read(line, 65536):
            self._console = (self._console + data)[-8192:]

    def _read_report(self, line: int) -> None:
        """Take up what the guest says on the control line."""
        with os.fdopen(line, "rb") as report:
            while word := report.read(1):
                if word == b"R":
                    self._ready.set()
                elif word == b"T":
                    self._taken.release()
                else:
                    (self._status,) = struct.unpack("<i", report.read(4))
                    self._reported.set()


def _specification(
    argv: list[bytes], env: dict[bytes, bytes], modules: list[bytes]
) -> dict[str, Any]:
    """What the guest must know, in types that ``marshal`` carries."""
    same = os.path.sameopenfile(1, 2)
    terminals = [tuple(os.get_terminal_size(fd)) if os.isatty(fd) else None for fd in (1, 2)]
    umask = os.umask(0)
    os.umask(umask)
    return {
        "argv": argv,
        "env": env,
        "cwd": os.getcwdb(),
        "umask": umask,
        "user": (os.geteuid(), os.getegid(), os.getgroups()),
        "hostname": os.uname().nodename,
        "modules": modules,
        "terminals": terminals,
        "one_output": same,
    }


def _find_kernel() -> tuple[str, list[bytes]]:
    """The kernel's path and its CAN modules in the order of loading."""
    if os.uname().machine != "x86_64":
        raise KernelError("user-mode Linux exists for x86-64 only: provide vcan0 natively")
    if "User Mode Linux" in Path("/proc/cpuinfo").read_text():
        raise KernelError("this is a user-mode kernel already, and it cannot carry another")
    installed = shutil.which("linux.uml")
    root = Path("/") if installed else debian.unpacked("user-mode-linux")
    kernel = installed or str(root / "usr" / "bin" / "linux.uml")
    version = subprocess.run([kernel, "--version"], capture_output=True, text=True, check=True)
    tree = root / "usr" / "lib" / "uml" / "modules" / version.stdout.strip()
    needs = {}
    for line in (tree / "modules.dep").read_text().splitlines():
        path, _, before = line.partition(":")
        needs[Path(path).name] = [*reversed(before.split()), path]
    wanted = (path for name in MODULES for path in needs.get(name, ()))
    return kernel, [os.fsencode(tree / path) for path in dict.fromkeys(wanted)]


def _memory_directory() -> str:
    """A directory that has room for the kernel's memory and lets it be executed."""
    candidates = dict.fromkeys(("/dev/shm", tempfile.gettempdir(), "/var/tmp"))
    for directory in candidates:
        try:
            room = os.statvfs(directory)
            with tempfile.TemporaryFile(dir=directory) as file:
                file.truncate(mmap.PAGESIZE)
                access = mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC
                mmap.mmap(file.fileno(), mmap.PAGESIZE, prot=access).close()
        except OSError:
            continue
        if room.f_bavail * room.f_frsize >= MEMORY_BYTES:
            return directory
    raise KernelError(
        f"none of {', '.join(candidates)} has {MEMORY_BYTES >> 20} MiB free and permits execution; "
        "set TMPDIR to a directory that does"
    )


def _in_kernel_process() -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    # what runs in real time inside should not wait for what else the machine does
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)


def _quoted(path: str) -> str:
    """A path as one word of a kernel command line."""
    if '"' in path:
        raise KernelError(f"a kernel command line cannot carry the quote in {path}")
    return f'"{path}"'


def _read_stdin() -> bytes:
    try:
        return os.read(0, FRAME_BYTES)
    except OSError:  # closed, or the terminal of another job
        return b""


def _write_all(fd: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]
