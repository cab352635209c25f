"""A system that systemd boots, with the controller's service on it as docs/deployment.md says.

It runs in namespaces of its own inside the emulated kernel: a root directory in memory with the
programs of this machine (/usr), the project, and what a ship's PC has besides. The unit is the one
of deploy/ but for the name of the interface.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

ROOT = Path("/mnt")
PROJECT = Path(__file__).resolve().parents[2]
SYSTEMD = Path("/lib/systemd/systemd")
SERVICE = "utank-hil"
ETC = ROOT / "etc/utank-hil"
LOGS = ROOT / "var/log/utank-hil"
BOOT_S = 60.0

_PROGRAM = """#!/bin/sh
export PYTHONPATH=/opt/project:/opt/packages LD_LIBRARY_PATH=/opt/python/lib
exec /opt/python/bin/python3 -c 'import sys
from utank_hil.cli import main
sys.argv[0] = "utank-hil"
main()' "$@"
"""
_FIRST = f"""set -e
mount --make-rprivate /
mount -t proc proc {ROOT}/proc
mount -t sysfs sysfs {ROOT}/sys
mount -t cgroup2 cgroup2 {ROOT}/sys/fs/cgroup
mount --rbind /dev {ROOT}/dev
mount -t tmpfs tmpfs {ROOT}/run
cd {ROOT}
pivot_root . before
umount -l /before
exec env -i container=emulated PATH=/usr/bin:/usr/sbin {SYSTEMD} --unit=ship.target \
    --log-target=journal-or-kmsg --show-status=0
"""


def needed_here():
    """Skip where such a system can't be booted; where CI runs, it must be possible."""
    missing = ""
    if "User Mode Linux" not in Path("/proc/cpuinfo").read_text(encoding="utf-8"):
        missing = "not in the emulated kernel: tools/vcan --uml .venv/bin/pytest ..."
    elif os.geteuid() != 0:
        missing = "only root can mount"
    elif not SYSTEMD.exists():
        missing = "no systemd: apt-get install systemd"
    if missing:
        assert "UTANK_HIL_CI" not in os.environ, missing
        pytest.skip(missing)


class BootedSystem:
    """systemd as the first process of a system of its own; closed, all of it is gone."""

    def __init__(self, channel):
        _make_root(channel)
        self._init = subprocess.Popen(
            ["unshare", "--pid", "--fork", "--kill-child", "--mount", "sh", "-c", _FIRST],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        deadline = time.monotonic() + BOOT_S
        while self.run("systemctl", "is-system-running") not in ("running", "degraded"):
            assert time.monotonic() < deadline, "systemd has not come up"
            time.sleep(0.3)

    def run(self, *command, succeeds=False):
        """What a command prints that is run on it."""
        children = Path(f"/proc/{self._init.pid}/task/{self._init.pid}/children")
        first = children.read_text(encoding="utf-8").split()
        if not first:
            return ""
        inside = ["nsenter", "--target", first[0], "--mount", "--pid"]
        return subprocess.run(
            [*inside, *command], check=succeeds, capture_output=True, text=True, timeout=200
        ).stdout.strip()

    def shown(self, name):
        """One of `systemctl show` of the service."""
        return self.run("systemctl", "show", SERVICE, "--value", "--property", name)

    @property
    def journal(self):
        """What the service has said, and systemd of it."""
        return self.run("journalctl", "--no-pager", "--unit", SERVICE, "--output", "cat")

    def wait(self, name, value, timeout_s=180.0):
        """Until a property has a value."""
        deadline = time.monotonic() + timeout_s
        while (found := self.shown(name)) != value:
            assert time.monotonic() < deadline, f"{name} is {found}\n{self.journal}"
            time.sleep(0.1)

    def close(self):
        """End it with all that runs on it."""
        self._init.kill()
        self._init.wait(30)
        subprocess.run(["umount", "--recursive", ROOT], check=True)


def _make_root(channel):
    """The directory that the system sees as its root."""
    subprocess.run(["mount", "-t", "tmpfs", "tmpfs", ROOT], check=True)
    for name in ("before", "dev", "proc", "run", "sys", "tmp", "var/log", "etc/systemd/system"):
        (ROOT / name).mkdir(parents=True)
    (ROOT / "tmp").chmod(0o1777)
    for name in ("bin", "lib", "lib64", "sbin"):
        (ROOT / name).symlink_to(f"usr/{name}")
    # a Python below /root, or a project below /home, is out of the service's sight
    for source, name in (
        ("/usr", "usr"),
        (sys.base_prefix, "opt/python"),
        (sysconfig.get_path("purelib"), "opt/packages"),
        (PROJECT, "opt/project"),
    ):
        (ROOT / name).mkdir(parents=True)
        subprocess.run(["mount", "--bind", source, ROOT / name], check=True)
    etc = ROOT / "etc"
    for name in ("ld.so.cache", "nsswitch.conf", "passwd", "group"):
        if Path("/etc", name).exists():
            shutil.copy(Path("/etc", name), etc / name)
    with (etc / "group").open("a", encoding="utf-8") as groups:
        groups.write("cpu-latency:x:990:\n")
    (etc / "machine-id").write_text(f"{1:032x}\n", encoding="utf-8")
    # nothing here says which devices there are
    (etc / "systemd/system.conf").write_text(
        "[Manager]\nDefaultDeviceTimeoutSec=1s\n", encoding="utf-8"
    )
    units = etc / "systemd/system"
    (units / "ship.target").write_text(
        "[Unit]\nRequires=systemd-journald.service\n", encoding="utf-8"
    )
    unit = (PROJECT / f"deploy/{SERVICE}.service").read_text(encoding="utf-8")
    assert unit.count(" --bus can0 ") == 1
    (units / f"{SERVICE}.service").write_text(
        unit.replace(" --bus can0 ", f" --bus {channel} "), encoding="utf-8"
    )
    program = ROOT / "opt/utank-hil/bin/utank-hil"
    program.parent.mkdir(parents=True)
    program.write_text(_PROGRAM, encoding="utf-8")
    program.chmod(0o755)
    ETC.mkdir()
