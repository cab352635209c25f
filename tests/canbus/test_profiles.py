"""Devices of other makers, against cantools with the maker's own DBC and recorded frames."""

import math
import re
import struct

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nmea2000 import NMEA2000Decoder
from others import others_file

from utank_hil.canbus import Frame, Quality, Rejection, SensorMotion, SensorTank, Switch
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.device import HeardMessage, ProfiledDevice, Stamp
from utank_hil.canbus.profiles.device_plan import SLOPE_S, Crc8, MessageEncoder, MessagePlan
from utank_hil.canbus.profiles.field import ConditionPlan, Field
from utank_hil.configuration.devices import DevicesSection

MS = 1_000_000


def device(role="motion", **section):
    section.setdefault("accept_unprotected", True)
    foreign = DevicesSection(**{role: section}).foreign()
    plan = foreign.motions[0] if role == "motion" else getattr(foreign, role)
    heard = []
    found = ProfiledDevice(plan)
    found.deliver = lambda message, now_ns: heard.append((now_ns, message))
    return found, heard


def give(found, can_id, data, now_ns):
    found.takers[can_id].take(Frame(can_id, bytes(data)), now_ns)


def sbg_database():
    return cantools.database.load_file(
        others_file("devices/dbc/sbgCan.dbc"), encoding="cp1252", strict=False
    )


class Ellipse:
    """Sends what the maker's DBC says, encoded by cantools."""

    def __init__(self, found):
        self.found, self.database = found, sbg_database()

    def send(self, number, content, now_ns):
        message = self.database.get_message_by_frame_id(number)
        rest = {each.name: 0 for each in message.signals} | content
        data = message.encode(rest, strict=False)
        give(self.found, STANDARD | number, data, now_ns)

    def cycle(self, now_ns, *, roll=0.1, rate=-0.02, stamp=None, solution=20, gyros=547):
        stamp = now_ns // 1000 if stamp is None else stamp
        self.send(0x102, {"SOLUTION": solution}, now_ns)
        self.send(0x120, {"TIME_STAMP": stamp % 2**32, "STATUS": gyros}, now_ns)
        self.send(0x122, {"GYRO_X": rate}, now_ns)
        self.send(0x130, {"TIME_STAMP": stamp % 2**32}, now_ns)
        self.send(0x132, {"ROLL": roll}, now_ns + MS)


def ellipse(**section):
    found, heard = device(profile="sbg_ellipse", **section)
    return Ellipse(found), heard


def test_a_status_with_a_sign_counts_by_its_bits():
    status = ConditionPlan(Field(0, 8, 1, signed=True), (1 << 64) - 1, frozenset([0xFE, 0xFF]))
    assert [status.holds(bytes([each])) for each in (0xFE, 0xFF, 0x7F)] == [True, True, False]


def test_an_ellipse_as_cantools_encodes_it():
    sensor, heard = ellipse()
    for k in range(20):
        sensor.cycle(k * 10 * MS, roll=0.01 * k - 0.1, rate=0.5 - 0.05 * k)
    assert len(heard) == 19  # the first stamp proves nothing
    for k, (now_ns, sample) in enumerate(heard, 1):
        assert now_ns == (10 * k + 1) * MS
        assert sample.roll_rad == pytest.approx(0.01 * k - 0.1, abs=0.5e-4)
        assert sample.roll_rate_rad_s == pytest.approx(0.5 - 0.05 * k, abs=0.5e-3)
        assert sample.quality is Quality.GOOD
    assert sensor.found.valid


def test_sign_and_offset_of_the_ships_file():
    signals = {"roll_rad": {"sign": -1, "offset": 0.02}, "roll_rate_rad_s": {"sign": -1}}
    sensor, heard = ellipse(signals=signals)
    for k in range(3):
        sensor.cycle(k * 10 * MS, roll=0.1, rate=-0.02)
    sample = heard[-1][1]
    assert sample.roll_rad == pytest.approx(-0.12)
    assert sample.roll_rate_rad_s == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("solution", "gyros", "quality"),
    [
        (0x14, 0x223, Quality.GOOD),
        (0x11, 0x223, Quality.GOOD),
        (0x04, 0x223, Quality.BAD),  # attitude not valid
        (0x10, 0x223, Quality.BAD),  # not initialised
        (0x14, 0x023, Quality.BAD),  # gyros out of range
    ],
)
def test_its_status_says_whether_it_is_valid(solution, gyros, quality):
    sensor, heard = ellipse()
    for k in range(3):
        sensor.cycle(k * 10 * MS, solution=solution, gyros=gyros)
    assert [sample.quality for _, sample in heard] == [quality] * 2


def test_a_status_that_stays_away_ends_the_validity():
    sensor, heard = ellipse()
    sensor.cycle(0)
    sensor.cycle(10 * MS)
    send = sensor.send
    sensor.send = lambda number, *rest: number == 0x102 or send(number, *rest)
    for k in range(2, 10):
        sensor.cycle(k * 10 * MS)
    assert heard[0][1].quality is Quality.GOOD
    assert heard[-1][1].quality is Quality.BAD


def test_a_frozen_stamp_is_no_sample_and_one_that_wraps_is():
    sensor, heard = ellipse()
    for k in range(10):
        sensor.cycle(k * 10 * MS, stamp=2**32 - 45_000 + 10_000 * min(k, 6))
    assert len(heard) == 6


def test_a_restart_loses_two_samples():
    sensor, heard = ellipse()
    for k in range(10):
        sensor.cycle(k * 10 * MS, stamp=50_000_000 + 10_000 * k)
    before = len(heard)
    for k in range(10, 20):
        sensor.cycle(k * 10 * MS, stamp=10_000 * k)
    assert len(heard) == before + 9


@pytest.mark.parametrize("off_s", [60.0, 2040.0, 3600.0, 4400.0])
def test_a_sensor_that_was_off_is_back_whatever_its_stamp_says(off_s):
    """After 40 min of 71 a start from zero looks like a step forward, and after 71 any does."""
    sensor, heard = ellipse()
    for k in range(10):
        sensor.cycle(k * 10 * MS, stamp=2_400_000_000 + 10_000 * k)
    before = len(heard)
    for k in range(10):
        sensor.cycle(round((off_s * 1e3 + 10 * k) * MS), stamp=1_000_000 + 10_000 * k)
    assert len(heard) >= before + 8


def test_what_comes_late_is_left_out_though_it_moves_on():
    sensor, heard = ellipse()
    for k in range(100):
        late = 100 if k >= 50 else 0
        sensor.cycle((10 * k + late) * MS, stamp=10_000 * k)
    assert len(heard) == 49


@pytest.mark.parametrize("drift", [0.99, 1.01])
def test_a_clock_that_runs_off_by_one_percent_is_not_late(drift):
    sensor, heard = ellipse()
    for k in range(1000):
        sensor.cycle(10 * k * MS, stamp=round(10_000 * k * drift))
    assert len(heard) == 999


def test_a_lost_rate_leaves_no_pair_of_two_instants():
    sensor, heard = ellipse()
    for k in range(6):
        sensor.cycle(k * 10 * MS, roll=0.01 * k, rate=0.01 * k)
    sensor.send(0x130, {"TIME_STAMP": 60_000}, 60 * MS)
    sensor.send(0x132, {"ROLL": 0.06}, 61 * MS)
    sensor.cycle(70 * MS, roll=0.07, rate=0.07)
    assert heard[-1][1][:2] == pytest.approx((0.07, 0.07))
    assert len(heard) == 6


def test_a_longer_frame_is_refused():
    sensor, _ = ellipse()
    give(sensor.found, STANDARD | 0x132, bytes(8), 0)
    watched = {each.can_id: each for each in sensor.found.watched}
    assert watched[STANDARD | 0x132].rejected[Rejection.LENGTH] == 1


def test_the_same_ellipse_by_its_makers_dbc():
    found, heard = device(
        dbc=str(others_file("devices/dbc/sbgCan.dbc")),
        messages={"attitude": "SBG_ECAN_MSG_EKF_EULER", "rate": "SBG_ECAN_MSG_IMU_GYRO"},
        signals={
            "roll_rad": {"from": "attitude.ROLL"}, "roll_rate_rad_s": {"from": "rate.GYRO_X"},
        },
        cycle_ms=10, age_ms=40, protection={"unchanged_ms": 50},
    )  # fmt: skip
    sensor = Ellipse(found)
    for k in range(20):
        sensor.send(0x122, {"GYRO_X": 0.02}, k * 10 * MS)
        sensor.send(0x132, {"ROLL": -0.1}, k * 10 * MS)
    assert heard[0][1] == (pytest.approx(-0.1), pytest.approx(0.02), Quality.GOOD)
    assert [sample.quality for _, sample in heard] == [Quality.GOOD] * 6 + [Quality.BAD] * 14


@given(st.data())
def test_fields_are_cantools_signals(data):
    database = sbg_database()
    message = data.draw(st.sampled_from([m for m in database.messages if m.length]))
    signal = data.draw(st.sampled_from(message.signals))
    content = data.draw(st.binary(min_size=message.length, max_size=message.length))
    field = Field(
        signal.start, signal.length, message.length, big_endian=False, signed=signal.is_signed,
        real=signal.is_float, scale=float(signal.scale), offset=float(signal.offset),
    )  # fmt: skip
    told = message.decode(content, decode_choices=False)[signal.name]
    assert field.value(content) == pytest.approx(float(told))


@given(
    st.integers(1, 64),
    st.integers(0, 63),
    st.booleans(),
    st.booleans(),
    st.binary(min_size=8, max_size=8),
)
def test_any_place_in_a_frame_is_read_as_cantools_reads_it(bits, start, big, signed, content):
    order = "big_endian" if big else "little_endian"
    try:
        field = Field(start, bits, 8, big_endian=big, signed=signed)
    except ValueError:
        return
    signal = cantools.database.can.Signal("s", start, bits, byte_order=order, is_signed=signed)
    message = cantools.database.can.Message(1, "m", 8, [signal])
    told = message.decode(content, decode_choices=False)["s"]
    assert field.raw(content) == told
    word = field.put(int.from_bytes(content, "little"), float(told), 8)
    if bits <= 52:  # as a float it is exact
        assert word.to_bytes(8, "little") == content


def xsens(roll_deg, rate_rad_s, stamp):
    packed = {
        0x005: stamp.to_bytes(4, "big"),
        0x011: (3).to_bytes(4, "big"),
        0x022: round(roll_deg * 2**7).to_bytes(2, "big", signed=True) + bytes(4),
        0x032: round(rate_rad_s * 2**9).to_bytes(2, "big", signed=True) + bytes(4),
    }
    return packed.items()


def test_an_mti_has_its_most_byte_first():
    found, heard = device(profile="xsens_mti")
    for k in range(3):
        for number, data in xsens(-5.5, 0.125, 10_000 * k):
            give(found, STANDARD | number, data, 10 * k * MS)
    roll_rad, rate_rad_s, quality = heard[-1][1]
    assert roll_rad == pytest.approx(math.radians(-5.5))
    assert rate_rad_s == pytest.approx(0.125)
    assert quality is Quality.GOOD


def ssi2(roll_counts, rate_counts):
    slope = (0).to_bytes(3, "little") + roll_counts.to_bytes(3, "little") + b"\xff\xff"
    rates = b"\xff\xff" + rate_counts.to_bytes(2, "little") + bytes(4)
    return {0x0CF02990: slope, 0x0CF02A90: rates}


@pytest.mark.parametrize(
    ("roll", "rate", "good"),
    [
        (250 * 32768 + 32768 * 3, 250 * 128 - 64, True),
        (0xFAFFFF, 250 * 128, True),
        (0xFB0000, 250 * 128, False),
        (0xFE0000, 250 * 128, False),
        (250 * 32768, 0xFFFF, False),  # scaled first it is a plausible 262 degree/s
    ],
)
def test_j1939_counts_beyond_the_range_are_no_angle(roll, rate, good):
    found, heard = device(profile="j1939_ssi2", source=0x90)
    for can_id, data in ssi2(roll, rate).items():
        give(found, can_id, data, 0)
    sample = heard[-1][1]
    assert math.isfinite(sample.roll_rad + sample.roll_rate_rad_s) is good
    if rate == 250 * 128 - 64:
        assert sample.roll_rad == pytest.approx(math.radians(3))
        assert sample.roll_rate_rad_s == pytest.approx(math.radians(-0.5))


def n2k(source, **more):
    more.setdefault("cycle_ms", 50)  # as if it were fast enough
    return device(profile="n2k_attitude", source=source, age_ms=500, **more)


def candump(name):
    pattern = re.compile(r"\((\d+\.\d+)\) \S+ ([0-9A-F]{8})#([0-9A-F]*)")
    for line in others_file(f"devices/frames/{name}").read_text().splitlines():
        if found := pattern.match(line):
            time_s, can_id, data = found.groups()
            yield round((float(time_s) - 1.5e9) * 1e9), int(can_id, 16), bytes.fromhex(data)


def test_a_recorded_attitude_has_its_right_values():
    found, heard = n2k(0xCC)
    for now_ns, can_id, data in candump("n2k-candumpSample3.txt"):
        if can_id in found.takers:
            give(found, can_id, data, now_ns)
    rolls = [sample.roll_rad for _, sample in heard]
    assert len(rolls) == 175
    assert rolls[0] == pytest.approx(0.1279)
    assert (min(rolls), max(rolls)) == (pytest.approx(0.1219), pytest.approx(0.1293))


def test_the_nmea2000_package_reads_the_same():
    found, heard = n2k(0xCC)
    decoder, told = NMEA2000Decoder(), []
    log = others_file("devices/frames/n2k-candumpSample3.txt")
    lines = [line for line in log.read_text().splitlines() if " 09F119CC#" in line]
    for line in lines:
        message = decoder.decode(line)
        told += [field.value for field in message.fields if field.id == "roll"]
    for now_ns, can_id, data in candump("n2k-candumpSample3.txt"):
        if can_id in found.takers:
            give(found, can_id, data, now_ns)
    assert [sample.roll_rad for _, sample in heard] == pytest.approx(told)


def test_two_recorded_sensors_are_told_apart_by_their_source():
    first, of_first = n2k(0x1B)
    second, of_second = n2k(0x34)
    for now_ns, can_id, data in candump("n2k-two-attitudes.candump.log"):
        for found in (first, second):
            if can_id in found.takers:
                give(found, can_id, data, now_ns)
    means = [
        math.degrees(sum(s.roll_rad for _, s in heard) / len(heard))
        for heard in (of_first, of_second)
    ]
    assert means == [pytest.approx(-2.84, abs=0.05), pytest.approx(3.90, abs=0.05)]


def test_a_device_of_another_name_is_not_used():
    found, heard = n2k(0x1B, protection={"n2k_name": "0xC0FFEE0102030405"})
    roll = bytes.fromhex("FF7F7FE3008CFEFF")
    give(found, 0x09F1191B, roll, 0)
    assert heard[-1][1].quality is Quality.BAD  # nobody has claimed the address yet
    claim = 0x18EEFF1B
    give(found, claim, 0xC0FFEE0102030405.to_bytes(8, "little"), 1)
    give(found, 0x0DF1191B, roll, 2)
    assert heard[-1][1].quality is Quality.GOOD
    give(found, claim, 0xC0FFEE0102030406.to_bytes(8, "little"), 3)
    give(found, 0x0DF1191B, roll, 4)
    assert heard[-1][1].quality is Quality.BAD


def levels(**more):
    signal = {"scale": 0.25, "offset": -3.0}  # 4 to 20 mA over 4 m
    return device(
        "levels", profile="cia404_levels", node=7, high_level_m=1.5,
        signals={"port_level_m": signal, "starboard_level_m": signal}, **more,
    )  # fmt: skip


def inputs(port_ma, starboard_ma, port_status=0, starboard_status=0):
    port, starboard = (round(each * 1e3).to_bytes(2, "little") for each in (port_ma, starboard_ma))
    return port + bytes([port_status]) + starboard + bytes([starboard_status])


def test_two_gauges_of_20_ma():
    found, heard = levels()
    give(found, STANDARD | 0x187, inputs(12.0, 20.0), 0)
    sample = heard[-1][1]
    assert isinstance(sample, SensorTank)
    assert sample == (0.0, 2.0, Switch.OFF, Switch.ON, Quality.GOOD)


@pytest.mark.parametrize("content", [inputs(3.5, 12), inputs(12, 21.5), inputs(12, 12, 0, 1)])
def test_a_broken_wire_is_no_level(content):
    found, heard = levels()
    give(found, STANDARD | 0x187, content, 0)
    sample = heard[-1][1]
    whole = sample.quality is Quality.GOOD
    assert not (whole and math.isfinite(sample.port_level_m + sample.starboard_level_m))


def test_a_derived_rate_is_the_slope_of_the_roll():
    found, heard = device(profile="cia410", node=5)
    for k in range(5):
        data = bytes(2) + (100 + 10 * k).to_bytes(2, "little")
        give(found, STANDARD | 0x185, data, 10 * k * MS)
    assert isinstance(heard[-1][1], SensorMotion)
    assert heard[-1][1].roll_rad == pytest.approx(math.radians(1.4))
    assert heard[-1][1].roll_rate_rad_s == pytest.approx(math.radians(10))


def test_a_derived_rate_has_the_noise_of_two_rolls_a_slope_apart():
    """A slope over one cycle of 10 ms would have ten times as much, as much as a rolling ship."""
    found, heard = device(profile="cia410", node=5)
    noise = np.random.default_rng(3).normal(0, 2e-4, 2000)
    for k, roll_rad in enumerate(0.1 * np.sin(0.008 * np.arange(2000)) + noise):
        slopes = struct.pack("<hh", 0, round(math.degrees(roll_rad) * 100))
        give(found, STANDARD | 0x185, slopes, 10 * k * MS)
    rates = np.array([message.roll_rate_rad_s for _, message in heard[20:]])
    motion = 0.08 * np.cos(0.008 * (np.arange(20, 2000) - 5))  # half a slope late
    assert np.std(rates - motion) == pytest.approx(math.sqrt(2) * 2e-4 / SLOPE_S, rel=0.1)


def slopes(times_ms, roll_deg):
    """Derived rates in degrees a second, of rolls received at these times in milliseconds."""
    found, heard = device(profile="cia410", node=5)
    for k, time_ms in enumerate(times_ms):
        data = bytes(2) + round(100 * roll_deg(k)).to_bytes(2, "little", signed=True)
        give(found, STANDARD | 0x185, data, round(time_ms * MS))
    return [math.degrees(message.roll_rate_rad_s) for _, message in heard]


@pytest.mark.parametrize("clock", [0.99, 1.01])
def test_a_derived_rate_bears_that_ticks_and_the_sensor_beat(clock):
    """Frames are read at the ticks: now and then a tick has two of them, or none."""
    times_ms = [10 * math.ceil(0.999 * clock * k) for k in range(1000)]
    rates = slopes(times_ms, lambda k: 0.1 * k)
    assert rates[20:] == pytest.approx([10 / clock] * 980, rel=0.02)


def test_a_derived_rate_reaches_over_no_silence():
    times_ms = [*range(0, 200, 10), *range(3000, 3200, 10)]
    rates = slopes(times_ms, lambda k: 0.0 if k < 20 else 0.1 * k)
    assert math.isnan(rates[20])
    assert rates[21:] == pytest.approx([10.0] * 19)


@given(st.binary(min_size=7, max_size=7), st.integers(0, 255))
def test_the_checksum_is_the_published_one(content, flip):
    crc = Crc8(byte=7)
    data = content + bytes([crc.of(content + bytes(1))])
    message = HeardMessage(MessagePlan("m", (1,), 8, 10 * MS, crc=crc))
    assert message.passes(data)
    spoilt = data[:7] + bytes([data[7] ^ flip])
    assert message.passes(spoilt) is (flip == 0)


def test_the_checksum_of_the_check_string():
    assert Crc8(byte=9).of(b"123456789\0") == 0x4B  # SAE J1850 in the catalogue of CRCs


@pytest.mark.parametrize(
    ("counters", "accepted"),
    [
        ([0, 1, 2, 3, 0, 1], 6),
        ([0, 0, 0, 0], 1),
        ([0, 1, 1, 2, 2, 3], 4),
        ([0, 5, 6, 7, 8, 9], 4),  # after three in a row it is taken as a restart
    ],
)
def test_a_counter_must_move_on(counters, accepted):
    message = HeardMessage(
        MessagePlan("m", (1,), 1, 10 * MS, counter=Field(0, 4 if 9 in counters else 2, 1))
    )
    assert sum(message.passes(bytes([each])) for each in counters) == accepted


def test_a_stamp_that_stands_is_seen_at_once():
    stamp = Stamp(Field(0, 16, 2), 1e3, 40.0)
    times = [0, 10, 20, 20, 30]
    passed = [stamp.passes(t.to_bytes(2, "little"), 10 * k * MS) for k, t in enumerate(times)]
    assert passed == [False, True, True, False, True]


def test_what_is_encoded_keeps_every_condition_counter_and_stamp():
    """Two conditions of one status, counts with a sign, a stamp that its DBC has in seconds."""
    status = Field(0, 16, 8)
    conditions = tuple(
        ConditionPlan(status, mask, frozenset(allowed))
        for mask, allowed in ((0x10, {0x10}), (0x0F, {1, 2, 4}))
    )
    counter, stamp = Field(16, 4, 8, signed=True, scale=0.5), Field(32, 32, 8, scale=1e-6)
    plan = MessagePlan("m", (1,), 8, 10 * MS, (), conditions, counter, stamp=stamp)
    encoder = MessageEncoder(plan)
    frames = [encoder.frame((), k * 10 * MS).data for k in range(40)]
    assert all(each.holds(data) for data in frames for each in conditions)
    assert [counter.raw(data) % 16 for data in frames] == [k % 16 for k in range(1, 41)]
    assert [stamp.raw(data) for data in frames] == [10_000 * k for k in range(40)]
    missing = encoder.frame((), 0, missing=True).data
    assert not any(each.holds(missing) for each in conditions)


@pytest.mark.parametrize(
    ("field", "counts"),
    [
        (Field(0, 8, 8), 0),
        (Field(0, 1, 8), 0),
        (Field(0, 8, 8, most_raw=250), 251),
        (Field(0, 8, 8, signed=True), 0),
        (Field(0, 8, 8, signed=True, least_raw=-127), -128),
        (Field(0, 8, 8, signed=True, least_raw=-127, most_raw=127), -128),
        (Field(0, 8, 8, signed=True, most_raw=126), 127),
    ],
)
def test_what_is_not_available_is_the_first_count_beyond_the_values(field, counts):
    assert field.raw(field.put(0, math.nan, 8).to_bytes(8, "little")) == counts


@pytest.mark.parametrize("bits", [16, 32])
def test_a_real_number_is_cut_to_what_its_bits_hold(bits):
    field = Field(0, bits, 8, real=True, scale=1e-30)
    value = field.value(field.put(0, -1e30, 8).to_bytes(8, "little"))
    assert -math.inf < value < -6e-26


def test_counter_and_stamp_may_have_a_sign():
    message = HeardMessage(MessagePlan("m", (1,), 1, 10 * MS, counter=Field(0, 4, 1, signed=True)))
    accepted = [message.passes(bytes((each % 16,))) for each in (6, 7, 8, 9, 9, 14, 15, 0, 1)]
    assert accepted == [True, True, True, True, False, False, False, True, True]
    stamp = Stamp(Field(0, 16, 2, signed=True), 1000.0, 40)
    times = range(32_700, 32_860, 10)  # through the change of its sign
    passed = [stamp.passes((ms & 0xFFFF).to_bytes(2, "little"), ms * MS) for ms in times]
    assert passed == [False] + [True] * 15


@pytest.mark.parametrize("flow", [0, 0xFFFF])
def test_a_frozen_pressure_is_found_beside_a_flow_that_is_not_available(flow):
    signals = {
        "P": {"start": 0, "bits": 16, "unit": "Pa"},
        "Q": {"start": 16, "bits": 16, "unit": "l/s", "most_raw": 0xFAFF},
    }
    found, heard = device(
        "pump_sensor", profile="", cycle_ms=20, age_ms=100,
        messages={"m": {"id": 5, "bytes": 4, "signals": signals}},
        signals={"pressure_pa": {"from": "m.P"}, "flow_m3_s": {"from": "m.Q"}},
        protection={"unchanged_ms": 200},
    )  # fmt: skip
    for k in range(30):
        give(found, STANDARD | 5, struct.pack("<HH", 700, flow), 20 * k * MS)
    assert [each.quality for _, each in heard] == [Quality.GOOD] * 11 + [Quality.BAD] * 19
