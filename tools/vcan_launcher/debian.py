"""Debian packages, downloaded and unpacked without root into a cache directory."""

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path


class PackageError(Exception):
    """A package could not be had; the message names the remedy."""


def cache() -> Path:
    """Directory of what is kept: ``.cache/vcan`` of the project, or ``VCAN_CACHE_DIR``.

    Raises `PackageError` if it can't be made.
    """
    project = Path(__file__).resolve().parents[2]
    directory = Path(os.environ.get("VCAN_CACHE_DIR") or project / ".cache" / "vcan").absolute()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PackageError(
            f"cannot use {directory} ({error.strerror}); set VCAN_CACHE_DIR to a directory of yours"
        ) from error
    return directory


def unpacked(package: str) -> Path:
    """Directory that holds the unpacked ``package``, downloaded at first use.

    It is in the cache. Runs side by side wait for one another, and a half-unpacked package is never
    seen. Raises `PackageError` if the cache cannot be written, or the package can be neither found
    nor downloaded.
    """
    kept = cache()
    target = kept / package
    if target.is_dir():
        return target
    if not shutil.which("apt-get") or not shutil.which("dpkg-deb"):
        raise PackageError(f"{package} is missing and this is no Debian: install it by hand")
    try:
        with open(kept / "lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not target.is_dir():
                _fetch(package, target)
    except OSError as error:
        raise PackageError(
            f"cannot use {kept} ({error.strerror}); set VCAN_CACHE_DIR to a directory of yours"
        ) from error
    return target


def _fetch(package: str, target: Path) -> None:
    print(f"tools/vcan: downloading Debian's {package} into {target}", file=sys.stderr, flush=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix="unpack-") as name:
        work = Path(name)
        private = ["-o", f"Dir::State::Lists={work}/lists", "-o", f"Dir::Cache={work}/cache"]
        said = _apt(work, "download", package)
        if not list(work.glob("*.deb")):
            # No lists on this machine, or stale ones: fetch lists of our own. The result of the
            # update is not asked for: one broken source beside Debian's is none of our business.
            for directory in ("lists", "cache/archives"):
                (work / directory / "partial").mkdir(parents=True)
            said = _apt(work, *private, "-o", "Acquire::Languages=none", "update")
            said += _apt(work, *private, "download", package)
        debs = list(work.glob("*.deb"))
        if not debs:
            raise PackageError(
                f"cannot download {package}: check the network and the apt sources, or install it "
                f"(apt-get install {package}). apt said:\n{said.strip()}"
            )
        try:
            subprocess.run(["dpkg-deb", "-x", debs[0], work / "root"], check=True)
        except subprocess.CalledProcessError as error:
            raise PackageError(f"cannot unpack {debs[0].name}; is {target.parent} full?") from error
        (work / "root").rename(target)


def _apt(directory: Path, *arguments: str) -> str:
    options = ["-q", "-o", "APT::Sandbox::User=root", "-o", "Acquire::Retries=3"]
    done = subprocess.run(
        ["apt-get", *options, *arguments],
        cwd=directory,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    return done.stdout
