"""A counter that runs over all contents of a multiplexed identifier, with frames by cantools."""

import pytest
from cantools.database.can import Database

from firmware_sim.sensors import ForeignFrames
from utank_hil.canbus import Frame, SensorMotion, load_catalogue
from utank_hil.canbus.enumerations import Quality
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.configuration.device_section import DeviceSection

DBC = """VERSION ""
NS_ :
BS_:
BU_: C S
BO_ 801 MOTION: 6 S
 SG_ PAGE M : 0|4@1+ (1,0) [0|15] "" C
 SG_ COUNT : 4|4@1+ (1,0) [0|15] "" C
 SG_ ROLL m0 : 8|16@1- (0.001,0) [-3|3] "rad" C
 SG_ RATE m1 : 8|16@1- (0.001,0) [-3|3] "rad/s" C
 SG_ HEAVE m2 : 8|16@1- (0.001,0) [-3|3] "m" C
"""
MS = 1_000_000
DATABASE = Database()
DATABASE.add_dbc_string(DBC)


def plan(tmp_path, counts):
    path = tmp_path / "motion.dbc"
    path.write_text(DBC)
    section = DeviceSection.model_validate(
        {
            "dbc": str(path), "messages": {"angle": "MOTION", "gyro": "MOTION"},
            "signals": {"roll_rad": {"from": "angle.ROLL"},
                        "roll_rate_rad_s": {"from": "gyro.RATE"}},
            "protection": {"counters": ["angle.COUNT", "gyro.COUNT"], **counts},
            "cycle_ms": 10, "age_ms": 40, "same_instant_ms": 8, "accept_unprotected": True,
        }
    )  # fmt: skip
    assert not list(section.problems(SensorMotion))
    return section.plan(SensorMotion, "motion", 0)


class Bus:
    """The device, and its sensor as cantools encodes it: angle, rate and heave each 10 ms."""

    def __init__(self, tmp_path, counts):
        self.device = ProfiledDevice(plan(tmp_path, counts))
        self.seen, self.now_ns, self.count, self.last = [], 0, 0, b""
        self.device.deliver = lambda message, now_ns: self.seen.append(message)

    def send(self, page, name, value, *, lost=False):
        content = {"PAGE": page, "COUNT": self.count % 16, name: value}
        self.last = DATABASE.get_message_by_name("MOTION").encode(content)
        self.count, self.now_ns = self.count + 1, self.now_ns + MS
        if not lost:
            self.hear(self.last)

    def hear(self, data):
        frame = Frame(STANDARD | 801, data)
        self.device.takers[frame.can_id].take(frame, self.now_ns)

    def cycle(self, roll, lose=""):
        for page, name in enumerate(("ROLL", "RATE", "HEAVE")):
            self.send(page, name, (roll, 0.5, 1.0)[page], lost=name == lose)
        self.now_ns += 7 * MS

    @property
    def rejected(self):
        return [sum(each.rejected.values()) for each in self.device.watched]


@pytest.fixture
def bus(tmp_path):
    return Bus(tmp_path, {"counts": "identifier"})


def test_each_measurement_counts_and_nothing_is_rejected(bus):
    for k in range(40):
        bus.cycle(k / 1000)
    assert [each.roll_rad for each in bus.seen] == pytest.approx([k / 1000 for k in range(40)])
    assert {each.roll_rate_rad_s for each in bus.seen} == {0.5}
    assert (bus.rejected, bus.device.lost, bus.device.valid) == ([0, 0], 0, True)
    assert [each.heard for each in bus.device.watched] == [40, 40]


def test_where_it_is_not_said_it_counts_each_content_and_the_others_seem_lost(tmp_path):
    bus = Bus(tmp_path, {})
    for k in range(40):
        bus.cycle(k / 1000)
    assert bus.device.lost >= 70  # two of three seem to be missing


@pytest.mark.parametrize(("lose", "lost"), [("ROLL", [0, 1]), ("RATE", [0, 0]), ("HEAVE", [1, 0])])
def test_a_lost_frame_is_missed_once_by_the_frame_that_follows(bus, lose, lost):
    bus.cycle(0.1)
    bus.cycle(0.2, lose=lose)
    bus.cycle(0.3)
    assert [each.lost for each in bus.device.watched] == lost
    assert bus.rejected == [0, 0]
    rolls = [each.roll_rad for each in bus.seen]
    assert rolls == pytest.approx([0.1, 0.2, 0.3] if lose == "HEAVE" else [0.1, 0.3])


def test_a_frame_that_comes_again_is_rejected_also_after_another_content(bus):
    bus.cycle(0.1)
    bus.send(0, "ROLL", 0.2)
    old = bus.last
    bus.hear(old)
    bus.send(1, "RATE", 0.5)
    bus.hear(old)
    assert bus.rejected == [2, 0]
    bus.send(2, "HEAVE", 1.0)
    bus.cycle(0.3)
    assert [each.roll_rad for each in bus.seen] == pytest.approx([0.1, 0.2, 0.3])


def test_a_sensor_that_starts_anew_is_back_after_three_frames_of_any_content(bus):
    for k in range(5):
        bus.cycle(k / 1000)
    bus.count = 6  # by eight frames off
    bus.cycle(0.1)
    seen = len(bus.seen)
    bus.cycle(0.2)
    assert [each.roll_rad for each in bus.seen[seen:]] == pytest.approx([0.2])


def test_a_damaged_frame_of_another_content_counts_nothing(bus):
    bus.cycle(0.1)
    bus.hear(bus.last[:-1])
    bus.cycle(0.2)
    assert [each.roll_rad for each in bus.seen] == pytest.approx([0.1, 0.2])


def test_the_emulated_sensor_counts_all_its_contents_together(tmp_path):
    catalogue, of = load_catalogue(), plan(tmp_path, {"counts": "identifier"})
    frames = ForeignFrames(of, catalogue.transmitter(SensorMotion), catalogue.codec(SensorMotion))
    sent = [
        DATABASE.decode_message(801, frame.data)
        for tick in range(1, 20)
        for frame in frames.frames(SensorMotion(0.1, 0.2, Quality.GOOD), tick * 10 * MS, tick)
    ]
    assert [each["COUNT"] for each in sent] == [k % 16 for k in range(1, 39)]
    assert [each["PAGE"] for each in sent] == [0, 1] * 19
