import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus.frame import STANDARD, Frame
from utank_hil.runners import frame_bits

frames = st.builds(
    Frame,
    st.integers(0, 2**29 - 1)
    | st.integers(STANDARD, STANDARD | 0x7FF)
    | st.sampled_from([0, 2**29 - 1, 0x08FF1080, 0x18EEFF81]),
    st.binary(max_size=8) | st.lists(st.sampled_from([0, 255, 0x0F, 0xF8]), max_size=8).map(bytes),
)


def crc_15(bits):
    """CRC by polynomial long division of the bit string, as the standard words it."""
    polynomial = "1100010110011001"  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    rest = [int(bit) for bit in bits + 15 * "0"]
    for position in range(len(bits)):
        if rest[position]:
            for offset, bit in enumerate(polynomial):
                rest[position + offset] ^= int(bit)
    return "".join(map(str, rest[-15:]))


def on_the_wire(frame):
    """Every bit of the frame as ISO 11898-1 writes it out, from start of frame to intermission."""
    identifier = f"{frame.can_id:029b}"
    head = "0" + identifier[:11] + "1" + "1" + identifier[11:] + "0" + "00"
    if frame.can_id & STANDARD:
        head = "0" + f"{frame.can_id & 0x7FF:011b}" + "0" + "0" + "0"
    plain = head + f"{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    plain += crc_15(plain)
    stuffed = ""
    for bit in plain:
        stuffed += bit
        if stuffed[-5:] in ("00000", "11111"):
            stuffed += "10"[int(bit)]
    return stuffed + "1" + "01" + "1111111" + "111"


def destuffed(wire):
    """What a receiver makes of the stuffed part: it drops the bit after five equal ones."""
    plain, run, skip = "", "", False
    for bit in wire:
        if not skip:
            plain += bit
        run = bit if run[-1:] != bit else run + bit
        skip = len(run) == 5
        run = "" if skip else run  # the bit that is dropped starts a run of its own
    return plain


def test_crc_of_the_test_is_the_published_one():
    # CRC-15/CAN of the ASCII digits 1 to 9, catalogue of parametrised CRC algorithms
    assert int(crc_15("".join(f"{ord(c):08b}" for c in "123456789")), 2) == 0x059E


@given(frames)
def test_length_equals_the_frame_written_out_bit_by_bit(frame):
    assert frame_bits(frame) == len(on_the_wire(frame))


@given(frames)
def test_written_out_frame_obeys_the_stuffing_rule_and_is_received_whole(frame):
    stuffed = on_the_wire(frame)[:-13]
    assert "000000" not in stuffed
    assert "111111" not in stuffed
    header = 34 if frame.can_id & STANDARD else 54
    assert len(destuffed(stuffed)) == header + 8 * len(frame.data)


@given(frames)
def test_length_is_within_the_published_bounds(frame):
    # Davis, Burns, Bril, Lukkien: Controller Area Network schedulability analysis refuted,
    # revisited and revised, Real-Time Systems 35 (2007): (80 + 10 s) bit times with 29-bit ids
    # and (55 + 10 s) with 11
    least, most = (47, 55) if frame.can_id & STANDARD else (67, 80)
    assert least + 8 * len(frame.data) <= frame_bits(frame) <= most + 10 * len(frame.data)


@pytest.mark.parametrize("can_id", [-1, STANDARD + 2**11, 2**30])
@pytest.mark.parametrize("data", [bytes(8), bytes(3)])
def test_identifier_out_of_range_is_refused(can_id, data):
    with pytest.raises(ValueError, match="29-bit"):
        frame_bits(Frame(can_id, data))


def test_more_than_eight_bytes_are_refused():
    with pytest.raises(ValueError, match="holds 8"):
        frame_bits(Frame(1, bytes(9)))
