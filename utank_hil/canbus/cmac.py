"""AES-CMAC (RFC 4493) with AES-128, and the file that a key is in."""

import errno
import os
import stat
from pathlib import Path
from typing import Final

KEY_BYTES: Final = 16


def cmac(key: bytes, message: bytes) -> bytes:
    """The 16 bytes that show that who wrote the message has the key."""
    # few ships have a key, and the others start without this library
    from cryptography.hazmat.primitives.ciphers.algorithms import AES
    from cryptography.hazmat.primitives.cmac import CMAC

    code = CMAC(AES(key))
    code.update(message)
    return code.finalize()


class KeyFileError(OSError):
    """The file of a key can't be used; `strerror` has the remedy."""

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"


def read_key(file: Path) -> bytes:
    """A file's key, 32 hexadecimal digits that only its owner may read; KeyFileError tells more."""

    def refused(reason: str) -> KeyFileError:
        return KeyFileError(errno.EACCES, reason, str(file))

    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise refused(
            f"the key of the panel can't be read ({error.strerror}). It stays on the ship: without "
            "it nobody can arm, and no log of the ship be replayed"
        ) from error
    with os.fdopen(descriptor, "rb") as opened:
        status = os.fstat(opened.fileno())
        others = 0o037 if status.st_uid == 0 != os.geteuid() else 0o077  # systemd's credentials
        if not stat.S_ISREG(status.st_mode) or status.st_mode & others:
            raise refused(f"others may read or write this key: chmod 600 {file}")
        if status.st_uid not in (0, os.geteuid()):
            raise refused("this key is another user's: chown it to the service's user")
        content = opened.read(100).decode("ascii", "replace").strip()
    try:
        key = bytes.fromhex(content)
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise refused(f"a key is 32 hexadecimal digits: openssl rand -hex 16 > {file}")
    cmac(key, b"")  # a library that is missing is found now and not in the loop
    return key
