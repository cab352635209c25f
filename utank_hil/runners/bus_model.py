"""Simulated CAN bus for lockstep: bit timing and arbitration.

Modelled: bit rate, arbitration by identifier, non-preemptive transmission, bit stuffing and
intermission. Every queued frame of every node takes part in every arbitration, as in a CAN
controller with one mailbox per message; frames of equal identifier in queueing order. Not modelled:
limits of queues, collisions of two nodes that send the same identifier. Errors and retransmission
are those of `firmware_sim.fault_injection.bench_parts`.
"""

from functools import lru_cache
from heapq import heappop, heappush
from typing import Final

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, STANDARD, Frame

LONGEST_FRAME_BITS: Final = 160  #: Of a frame with eight data bytes.
INTERMISSION_BITS: Final = 3
_AFTER_CRC_BITS: Final = 10 + INTERMISSION_BITS
_CRC_BITS: Final = 15
_CRC_POLYNOMIAL: Final = 0x4599
_HEADER_BITS: Final = 39
_SHORT_HEADER_BITS: Final = 19
# State of the stuffing rule: 5 * (last bit) + (number of equal bits so far, 0 to 4).
_STATES: Final = 10


def _after_bits(state: int, bits: int, length: int) -> tuple[int, int]:
    """Return the state after the last `length` bits of `bits`, and the stuff bits in them."""
    stuffed = 0
    for position in range(length - 1, -1, -1):
        bit = bits >> position & 1
        last, run = divmod(state, 5)
        run = run + 1 if bit == last else 1
        if run == 5:
            stuffed += 1
            bit, run = 1 - bit, 1
        state = bit * 5 + run
    return state, stuffed


def _stuffing_tables() -> tuple[bytes, bytes]:
    """By 256 times the state plus the byte: the next state, and the stuff bits."""
    after = [_after_bits(state, byte, 8) for state in range(_STATES) for byte in range(256)]
    return bytes(state for state, _ in after), bytes(stuffed for _, stuffed in after)


def _crc(bits: int, length: int) -> int:
    register = 0
    for position in range(length - 1, -1, -1):
        feedback = (bits >> position ^ register >> (_CRC_BITS - 1)) & 1
        register = (register << 1 & 0x7FFF) ^ (_CRC_POLYNOMIAL * feedback)
    return register


_TABLES: Final = _stuffing_tables()
_AFTER: Final = _TABLES[0]
_STUFFED: Final = _TABLES[1]
# The CRC is held left-aligned in 16 bits, as two bytes; these tables advance them by one byte.
_CRC_HIGH: Final = bytes(_crc(byte, 8) >> 7 for byte in range(256))
_CRC_LOW: Final = bytes(_crc(byte, 8) << 1 & 0xFF for byte in range(256))


@lru_cache(maxsize=4096)
def _after_header(can_id: int, length: int) -> tuple[int, int, int, int]:
    """Return CRC and state after the DLC, and the frame's bits except later stuff bits."""
    if not 0 <= can_id < 1 << 29 and not STANDARD <= can_id <= STANDARD | LONGEST_STANDARD_ID:
        raise ValueError(f"can_id {can_id:#x}: not a 29-bit identifier")
    if length > 8:
        raise ValueError(f"frame {can_id:#x}: {length} data bytes, a CAN frame holds 8")
    # RTR, IDE and r0 follow an identifier of 11 bits, all dominant
    header, bits = (can_id & LONGEST_STANDARD_ID) << 7 | length, _SHORT_HEADER_BITS
    if not can_id & STANDARD:  # SRR and IDE are recessive; start of frame, RTR, r1 and r0 are not
        header = can_id >> 18 << 27 | 0b11 << 25 | (can_id & 0x3FFFF) << 7 | length
        bits = _HEADER_BITS
    state, stuffed = _after_bits(0, header, bits)
    plain = bits + 8 * length + _CRC_BITS + _AFTER_CRC_BITS
    crc = _crc(header, bits)
    return crc >> 7, crc << 1 & 0xFF, state, plain + stuffed


def frame_bits(frame: Frame) -> int:
    """Return the number of bits of a frame, with stuff bits and intermission.

    They are 67 + 8 n bits without stuffing, and at most 160 for eight data bytes. ValueError is
    raised if the identifier has more than 29 bits or there are more than 8 bytes.
    """
    can_id, data = frame
    crc_high, crc_low, state, bits = _after_header(can_id, len(data))
    for byte in data:
        index = crc_high ^ byte
        crc_high = _CRC_HIGH[index] ^ crc_low
        crc_low = _CRC_LOW[index]
        place = state << 8 | byte
        state = _AFTER[place]
        bits += _STUFFED[place]
    place = state << 8 | crc_high
    bits += _STUFFED[place]
    # seven bits are left; padding with the complement of the last one adds no stuff bit
    return bits + _STUFFED[_AFTER[place] << 8 | crc_low | ~crc_low >> 1 & 1]


class SimulatedBus:
    """A CAN bus in simulated time, which starts at 0; a bit must take whole nanoseconds."""

    def __init__(self, bit_rate: int = 250_000) -> None:
        if bit_rate <= 0 or 1_000_000_000 % bit_rate:
            raise ValueError(
                f"bit_rate {bit_rate}: must divide 1e9, as 125000, 250000, 500000, 1000000 do"
            )
        self._bit_ns: Final = 1_000_000_000 // bit_rate
        self._intermission_ns: Final = INTERMISSION_BITS * self._bit_ns
        # (rank by identifier, order of queueing, frame, sender, time on the wire)
        self._waiting: list[tuple[int, int, Frame, int, int]] = []
        self._order = 0
        self._in_flight: tuple[int, int, Frame] | None = None
        self._free_ns = 0  # end of the latest transmission
        self._busy_ns = 0  # of all transmissions begun
        self.frames = 0  #: Frames whose transmission has begun.

    def queue(self, sender: int, frame: Frame, now_ns: int, more_bits: int = 0) -> None:
        """Queue a frame for transmission from `now_ns` on; calls must be in order of time.

        It keeps the bus for `more_bits` longer than its own bits take. ValueError is raised if the
        identifier or the payload is too long for CAN.
        """
        duration_ns = (frame_bits(frame) + more_bits) * self._bit_ns
        self._order += 1
        can_id = frame.can_id
        # twice, so that an identifier of 11 bits goes before all that begin with it
        rank = (can_id & LONGEST_STANDARD_ID) << 19 if can_id & STANDARD else 2 * can_id + 1
        heappush(self._waiting, (rank, self._order, frame, sender, duration_ns))
        if self._free_ns < now_ns:
            self._free_ns = now_ns

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance the bus; end (ns), sender and frame of all that ended before, oldest first."""
        arrived = []
        waiting, in_flight = self._waiting, self._in_flight
        while in_flight is not None or (waiting and self._free_ns < before_ns):
            if in_flight is None:
                start_ns = self._free_ns
                _, _, frame, sender, duration_ns = heappop(waiting)
                self._free_ns = end_ns = start_ns + duration_ns
                self.frames += 1
                self._busy_ns += duration_ns
                in_flight = end_ns - self._intermission_ns, sender, frame
            if in_flight[0] >= before_ns:
                break
            arrived.append(in_flight)
            in_flight = None
        self._in_flight = in_flight
        return arrived

    def load(self, now_ns: int) -> float:
        """Return the bus load, 0 to 1, from time 0 to `now_ns`, to which the bus was advanced."""
        busy_ns = self._busy_ns - max(0, self._free_ns - now_ns)
        return busy_ns / now_ns if now_ns else 0.0
