"""Extended registers of processors with AMX, which the user-mode kernel up to 6.12 can't set.

A small library is loaded before the C library and does it. It is compiled at first use, by the
machine's C compiler or by Debian's small one.
"""

import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from tools.vcan_launcher import debian

SOURCE = Path(__file__).with_name("whole_xstate.c")


def environment() -> dict[str, str]:
    """What the user-mode kernel's environment needs on this processor.

    Raises `debian.PackageError` if there is no compiler and none can be had.
    """
    if "amx_tile" not in Path("/proc/cpuinfo").read_text().split():
        return {}
    # named for the source's content: another source is another library
    library = debian.cache() / f"whole_xstate-{_hash_of(SOURCE)}.so"
    if not library.exists():
        _compile(library)
    return {"LD_PRELOAD": str(library)}


def _hash_of(file: Path) -> str:
    """Twelve hexadecimal digits that differ for another content."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:12]


def _compile(library: Path) -> None:
    compiler = shutil.which("cc")
    command = [compiler] if compiler else [str(debian.unpacked("tcc") / "usr" / "bin" / "tcc")]
    with tempfile.TemporaryDirectory(dir=library.parent, prefix="compile-") as name:
        made = Path(name) / "library.so"
        done = subprocess.run(
            [*command, "-shared", "-fPIC", "-nostdlib", "-o", made, SOURCE],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise debian.PackageError(f"{command[0]} can't compile {SOURCE}: {done.stderr.strip()}")
        os.replace(made, library)
