"""The Linux calls that Python 3.11 has no function for: modules, mounts, namespaces, links."""

import ctypes
import fcntl
import os
import socket
import struct

CLONE_NEWUSER = 0x10000000
CLONE_NEWNET = 0x40000000

_PR_SET_KEEPCAPS, _PR_CAP_AMBIENT, _PR_CAP_AMBIENT_RAISE = 8, 47, 2
_CAP_NET_ADMIN = 12
_CAPABILITY_VERSION_3 = 0x20080522
_SYS_INIT_MODULE = 175  # x86-64, the one machine that user-mode Linux is packaged for
_RB_POWER_OFF = 0x4321FEDC
_RTM_NEWLINK = 16
_NLM_F_REQUEST_ACK, _NLM_F_CREATE_EXCL = 0x005, 0x600
_IFLA_IFNAME, _IFLA_LINKINFO, _IFLA_INFO_KIND = 3, 18, 1
_IFF_UP = 1
_SIOCGIFFLAGS = 0x8913

_libc = ctypes.CDLL(None, use_errno=True)


def _check(result: int, what: str) -> None:
    if result < 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error), what)


def mount(kind: str, target: str) -> None:
    """Mount a fresh file system of ``kind`` (proc, tmpfs, ...) on ``target``."""
    _check(_libc.mount(kind.encode(), target.encode(), kind.encode(), 0, None), f"mount {target}")


def load_module(path: bytes) -> None:
    """Insert the kernel module stored at ``path``."""
    with open(path, "rb") as file:
        image = file.read()
    size = ctypes.c_ulong(len(image))
    _check(_libc.syscall(_SYS_INIT_MODULE, image, size, b""), f"load {os.fsdecode(path)}")


def power_off() -> None:
    """End the running kernel at once, without syncing."""
    _check(_libc.reboot(_RB_POWER_OFF), "power off")


def unshare(flags: int) -> None:
    """Move the calling process into new namespaces (CLONE_* flags)."""
    _check(_libc.unshare(flags), "unshare")


def become(uid: int, gid: int, groups: list[int]) -> None:
    """Turn from root into a user who may still administer the network."""
    os.setgroups(groups)
    os.setresgid(gid, gid, gid)
    if uid:
        _check(_libc.prctl(_PR_SET_KEEPCAPS, 1, 0, 0, 0), "prctl")
        os.setresuid(uid, uid, uid)
        keep_net_admin()


def keep_net_admin() -> None:
    """Let the calling process keep CAP_NET_ADMIN, and it alone, through exec."""
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION_3, 0)
    mask = 1 << _CAP_NET_ADMIN
    sets = (ctypes.c_uint32 * 6)(mask, mask, mask, 0, 0, 0)  # effective, permitted, inheritable
    _check(_libc.capset(header, sets), "capset")
    _check(_libc.prctl(_PR_CAP_AMBIENT, _PR_CAP_AMBIENT_RAISE, _CAP_NET_ADMIN, 0, 0), "prctl")


def set_link_up(name: str) -> None:
    """Bring an existing network interface up."""
    _request_link(0, _attribute(_IFLA_IFNAME, name.encode() + b"\0"))


def create_vcan(name: str) -> None:
    """Create a virtual CAN interface and bring it up; the kernel loads what it needs if it can."""
    kind = _attribute(_IFLA_LINKINFO, _attribute(_IFLA_INFO_KIND, b"vcan"))
    _request_link(_NLM_F_CREATE_EXCL, _attribute(_IFLA_IFNAME, name.encode() + b"\0") + kind)


def can_is_usable(name: str) -> bool:
    """Whether the CAN interface ``name`` exists, is up, and a raw CAN socket can be bound to it."""
    try:
        with socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as can:
            can.bind((name,))
            answer = fcntl.ioctl(can, _SIOCGIFFLAGS, struct.pack("16s24x", name.encode()))
    except OSError:
        return False
    (flags,) = struct.unpack_from("H", answer, 16)
    return bool(flags & _IFF_UP)


def _attribute(kind: int, value: bytes) -> bytes:
    return struct.pack("HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def _request_link(flags: int, attributes: bytes) -> None:
    body = struct.pack("BxHiII", socket.AF_UNSPEC, 0, 0, _IFF_UP, _IFF_UP) + attributes
    head = struct.pack("IHHII", 16 + len(body), _RTM_NEWLINK, _NLM_F_REQUEST_ACK | flags, 1, 0)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as netlink:
        netlink.send(head + body)
        (error,) = struct.unpack_from("i", netlink.recv(4096), 16)
    if error:
        raise OSError(-error, os.strerror(-error), "network interface")
