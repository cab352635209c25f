"""AES-CMAC, RFC 4493, with the cipher of FIPS 197, and the file that a key is in.

Some frames a second are authenticated, so plain Python is fast enough. Its time depends on key and
content: who can measure it to the microsecond on this machine has more to read than the key.
"""

import errno
import os
import stat
from functools import cache
from pathlib import Path
from typing import Final

BLOCK: Final = 16
_ROUNDS: Final = 10


def _twice(byte: int) -> int:
    """Product with x in the field of AES."""
    return (byte << 1) ^ (0x11B if byte & 0x80 else 0)


def _substitutes() -> bytes:
    """The S-box: inverse in the field, then the affine map, FIPS 197 5.1.1."""
    box, power, inverse = bytearray(256), 1, 1
    for _ in range(255):
        power ^= _twice(power)  # times 3, which generates all of the field
        for shift in (1, 2, 4):  # divided by 3
            inverse ^= inverse << shift & 0xFF
        inverse ^= 0x09 if inverse & 0x80 else 0
        box[power] = _affine(inverse)
    box[0] = 0x63
    return bytes(box)


def _affine(byte: int) -> int:
    mixed = 0x63
    for turn in range(5):
        mixed ^= (byte << turn | byte >> (8 - turn)) & 0xFF
    return mixed


_BOX: Final = _substitutes()


@cache
def _round_keys(key: bytes) -> tuple[bytes, ...]:
    words = [key[place : place + 4] for place in range(0, BLOCK, 4)]
    constant = 1
    while len(words) < 4 * (_ROUNDS + 1):
        word = words[-1]
        if len(words) % 4 == 0:
            word = bytes(_BOX[each] for each in word[1:] + word[:1])
            word = bytes((word[0] ^ constant, *word[1:]))
            constant = _twice(constant)
        words.append(_xor(words[-4], word))
    return tuple(b"".join(words[place : place + 4]) for place in range(0, len(words), 4))


def _xor(first: bytes, second: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(first, second, strict=True))


def encrypted(key: bytes, block: bytes) -> bytes:
    """A block of 16 bytes by AES-128."""
    first, *others = _round_keys(key)
    state = _xor(block, first)
    for number, round_key in enumerate(others, start=1):
        state = bytes(_BOX[state[5 * place % BLOCK]] for place in range(BLOCK))  # rows turned, too
        if number < _ROUNDS:
            state = b"".join(_mixed(state[place : place + 4]) for place in range(0, BLOCK, 4))
        state = _xor(state, round_key)
    return state


def _mixed(column: bytes) -> bytes:
    total = column[0] ^ column[1] ^ column[2] ^ column[3]
    after = column[1:] + column[:1]
    return bytes(a ^ total ^ _twice(a ^ b) for a, b in zip(column, after, strict=True))


def cmac(key: bytes, message: bytes) -> bytes:
    """The 16 bytes that show that who wrote the message has the key."""
    subkey = _doubled(encrypted(key, bytes(BLOCK)))
    whole, rest = divmod(len(message), BLOCK)
    if whole and not rest:
        whole, last = whole - 1, message[-BLOCK:]
    else:
        subkey = _doubled(subkey)
        last = (message[whole * BLOCK :] + b"\x80").ljust(BLOCK, b"\0")
    state = bytes(BLOCK)
    for place in range(0, whole * BLOCK, BLOCK):
        state = encrypted(key, _xor(state, message[place : place + BLOCK]))
    return encrypted(key, _xor(state, _xor(last, subkey)))


def _doubled(block: bytes) -> bytes:
    number = int.from_bytes(block, "big") << 1
    number ^= (number >> 128) * ((1 << 128) | 0x87)
    return number.to_bytes(BLOCK, "big")


class KeyFileError(OSError):
    """The file of a key can't be used; `strerror` has the remedy."""

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"


def read_key(file: Path) -> bytes:
    """The key in a file of 32 hexadecimal digits that only its owner may read.

    KeyFileError names file and remedy.
    """

    def refused(reason: str) -> KeyFileError:
        return KeyFileError(errno.EACCES, reason, str(file))

    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise refused(
            f"the key of the panel can't be read ({error.strerror}). It stays on the ship: without "
            "it nobody can arm, and no log of hers be replayed"
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
    if len(key) != BLOCK:
        raise refused(f"a key is 32 hexadecimal digits: openssl rand -hex 16 > {file}")
    return key
