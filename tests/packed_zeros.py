"""Many zeros as zlib packs them, without packing them all: seconds for each worker of a run."""

import zlib

_PART = 1 << 20


def packed_zeros(size, before=b""):
    """A whole zlib stream of `size` zeros, a multiple of 1 MB, after some bytes."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    head = packer.compress(before) + packer.flush(zlib.Z_FULL_FLUSH)
    part = packer.compress(bytes(_PART)) + packer.flush(zlib.Z_FULL_FLUSH)
    high, low = divmod(zlib.adler32(before), 1 << 16)
    checksum = ((high + size * low) % 65521 << 16 | low).to_bytes(4, "big")  # each zero adds `low`
    return b"\x78\xda" + head + part * (size // _PART) + packer.flush() + checksum
