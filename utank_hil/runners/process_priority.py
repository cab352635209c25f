"""Real-time settings of the loop process, requested from Linux and reported.

Each removes a measured cause of late ticks: other processes (SCHED_FIFO), page faults (mlockall),
deep CPU sleep states (/dev/cpu_dma_latency), the garbage collector, and other Python threads, which
hold the interpreter for 5 ms at a time. Without a refused setting the loop runs on.
"""

import ctypes
import gc
import os
import resource
import struct
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

PRIORITY: Final = 80  #: Above the kernel's interrupt threads (50), as cyclictest is usually run.
_MCL_CURRENT: Final = 1
_MCL_FUTURE: Final = 2
_CAP_IPC_LOCK: Final = 14
_CPU_DMA_LATENCY: Final = Path("/dev/cpu_dma_latency")


def _said(name: str, granted: bool, detail: str) -> str:
    """Return a setting in words; `detail` is the value in force, or the reason and the remedy."""
    return f"{name}: {'yes' if granted else 'NO'}, {detail}"


@contextmanager
def real_time_scheduling() -> Iterator[list[str]]:
    """Apply the real-time settings for the duration of the context, as far as permitted.

    Enter it when everything is imported and built: existing objects are frozen, and the garbage
    collector stays off. It yields a line for each setting, whether it is in force or why it is not.
    Leaving the context restores the former settings. RuntimeError is raised if there is another
    Python thread: it would delay ticks whatever the permissions.
    """
    others = [t.name for t in threading.enumerate() if t is not threading.current_thread()]
    if others:
        raise RuntimeError(
            f"the loop must be the only Python thread, found {', '.join(others)}: "
            "a thread beside it holds the interpreter for 5 ms at a time; use a process"
        )
    with ExitStack() as undo:
        collector = _garbage_collector_off(undo)
        yield [_fifo(undo), _memory_lock(undo), _no_cpu_sleep(undo), collector]


def _garbage_collector_off(undo: ExitStack) -> str:
    if gc.isenabled():
        undo.callback(gc.enable)
    undo.callback(gc.unfreeze)
    gc.collect()
    gc.freeze()
    gc.disable()
    return _said("garbage collector off", True, f"{gc.get_freeze_count()} objects frozen")


def _fifo(undo: ExitStack) -> str:
    name = "SCHED_FIFO"
    found = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        # Not for children: a stuck real-time child could not be ended on a busy machine.
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except PermissionError:
        limit, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
        return _said(
            name, False, f"real-time priority limit is {limit}, needs {PRIORITY} (LimitRTPRIO=)"
        )
    undo.callback(_restore_scheduler, *found)
    return _said(name, True, f"priority {PRIORITY}")


def _restore_scheduler(policy: int, param: os.sched_param) -> None:
    try:
        os.sched_setscheduler(0, policy, param)
    except PermissionError:  # without CAP_SYS_NICE, reset-on-fork stays set
        os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, param)


def _memory_lock(undo: ExitStack) -> str:
    name = "memory locked"
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    may_lock_any = int(_field("self/status", "CapEff"), 16) >> _CAP_IPC_LOCK & 1
    if limit != resource.RLIM_INFINITY and not may_lock_any:
        # A finite limit would make a later allocation fail: worse than a page fault.
        return _said(name, False, f"memory lock limit is {limit} bytes (LimitMEMLOCK=infinity)")
    size_kib = int(_field("self/status", "VmSize"))
    if size_kib > int(_field("meminfo", "MemAvailable")):
        return _said(
            name, False, f"{size_kib >> 10} MiB of address space exceed the memory available"
        )
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        return _said(name, False, os.strerror(ctypes.get_errno()))
    undo.callback(libc.munlockall)
    return _said(name, True, f"{int(_field('self/status', 'VmLck')) >> 10} MiB")


def _field(file: str, key: str) -> str:
    with (Path("/proc") / file).open() as lines:
        return next(line.split()[1] for line in lines if line.startswith(f"{key}:"))


def _no_cpu_sleep(undo: ExitStack) -> str:
    name = "no deep CPU sleep"
    try:
        request = undo.enter_context(_CPU_DMA_LATENCY.open("wb", buffering=0))
        request.write(struct.pack("i", 0))  # in force for as long as the file stays open
    except OSError as error:
        return _said(name, False, f"{_CPU_DMA_LATENCY}: {error.strerror}")
    return _said(name, True, f"{_CPU_DMA_LATENCY} held at 0 us")
