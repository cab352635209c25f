"""``vcan0`` from the running kernel, never changing the host's own network."""

import os
from pathlib import Path

from tools.vcan_launcher import linux


class NativeUnavailableError(Exception):
    """The running kernel cannot provide a ``vcan0``; the message says why."""


def enter() -> None:
    """Give this process, and what it becomes, a usable ``vcan0``.

    An existing interface that is up is used as it is. Otherwise the process moves into a network
    namespace of its own that has a loopback and a ``vcan0`` and vanishes with it; without root,
    inside a user namespace that keeps the user's id.

    NativeUnavailableError is raised: nothing has been changed then.
    """
    if linux.can_is_usable("vcan0"):
        return
    # Namespaces cannot be left again, so a child tries first.
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _enter_private_network()
        except OSError as error:
            os.write(write_end, str(error).encode())
        os._exit(0)
    os.close(write_end)
    with os.fdopen(read_end, "rb") as pipe:
        reason = pipe.read().decode()
    os.waitpid(child, 0)
    if reason:
        raise NativeUnavailableError(reason)
    _enter_private_network()


def _enter_private_network() -> None:
    uid, gid = os.geteuid(), os.getegid()
    try:
        linux.unshare(linux.CLONE_NEWNET)
    except PermissionError:
        linux.unshare(linux.CLONE_NEWUSER | linux.CLONE_NEWNET)
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"{uid} {uid} 1")
        Path("/proc/self/gid_map").write_text(f"{gid} {gid} 1")
    linux.set_link_up("lo")
    linux.create_vcan("vcan0")
    if not linux.can_is_usable("vcan0"):
        raise OSError("vcan0 was created but no CAN socket can be bound to it")
    if uid:
        linux.keep_net_admin()
