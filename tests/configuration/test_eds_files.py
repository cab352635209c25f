"""EDS and DCF of other makers: the PDOs that a device sends as delivered, and who it is."""

import gzip
import re
from pathlib import Path

import canopen
import pytest
from others import others_file

from tests.canbus.test_profiles import device
from tests.canopen_nodes import Wire
from tests.nodes.canopen_peers import PROFILE, PUMP
from utank_hil.base.parameters import ParameterError
from utank_hil.canbus import Frame, Quality
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.drive_plan import Place
from utank_hil.configuration.device_files import Eds, with_eds
from utank_hil.configuration.devices import DevicesSection


def entry(index, part, kind, value=""):
    section = f"{index:04X}" if part is None else f"{index:04X}sub{part}"
    return (
        f"[{section}]\nParameterName=a name # of no use\nObjectType=0x7\nAccessType=rw\n"
        f"DataType={kind}\nDefaultValue={value}\n"
    )


def record(index, kind, values):
    head = f"[{index:04X}]\nParameterName=several\nObjectType=9\nSubNumber={len(values)}\n"
    return head + "".join(entry(index, n, kind, value) for n, value in values.items())


SENSOR = (
    "[DeviceInfo]\nVendorName=of nobody\n"
    + record(0x1800, 7, {0: 5, 1: "$NODEID+0x40000180", 2: "255 ; by its timer", 5: 20})
    + record(0x1A00, "0x7", {0: 2, 1: "0x60200010", 2: "0x21000120"})
    + entry(0x6020, None, "0x0003")
    + record(0x2100, 8, {0: 1, 1: ""})
)
COMPACT = """[1A00]
ObjectType=0x8
DataType=7
CompactSubObj=3
[1A00Value]
NrOfEntries=3
1=0x60200010
2=0x00050008
3=0x21000120
"""
REFUSED_BY_CANOPEN = ("faulhaber-605.3150.55-D.eds", "cia-301.eds")  # for a letter, a comment
MOTION = {
    "node": 4, "messages": {"m": "TPDO1"}, "age_ms": 50,
    "signals": {
        "roll_rad": {"from": "m.6020h:0", "scale": 1e-4},
        "roll_rate_rad_s": {"from": "m.2100h:1", "scale": 1.0},
    },
    "protection": {"unchanged_ms": 500},
}  # fmt: skip


def written(tmp_path, text=SENSOR, name="sensor.eds"):
    path = tmp_path / name
    path.write_text(text)
    return str(path)


def test_a_motion_sensor_by_its_eds_as_canopen_sends_it(tmp_path):
    path = written(tmp_path)
    assert Eds(path).sent(1)["cycle_ms"] == 20
    found, heard = device(eds=path, **MOTION)
    assert found.cycle_ns == 20_000_000
    wire = Wire()
    node = canopen.LocalNode(4, path)
    wire.add_node(node)
    pdo = node.tpdo[1]
    pdo.read(from_od=True)
    pdo[0].raw, pdo[1].raw = -1234, 0.25
    pdo.transmit()
    ((can_id, data),) = wire.said
    found.takers[can_id | STANDARD].take(Frame(can_id | STANDARD, data), 0)
    assert heard == [(0, (pytest.approx(-0.1234), 0.25, Quality.GOOD))]


def test_keys_that_are_indented_are_read(tmp_path):
    """As an editor leaves them; nothing in CiA 306 continues a value in another line."""
    lines = SENSOR.splitlines()
    inset = "\n".join(f"\t {line}" if line.startswith("Def") else line for line in lines)
    assert Eds(written(tmp_path, inset)).sent(1) == Eds(written(tmp_path)).sent(1)
    assert Eds(written(tmp_path, inset)).sent(1)["cycle_ms"] == 20


def test_the_short_form_of_an_array_and_a_gap_in_a_pdo(tmp_path):
    begin, end = SENSOR.index("[1A00]"), SENSOR.index("[6020]")
    found = Eds(written(tmp_path, SENSOR[:begin] + COMPACT + SENSOR[end:])).sent(1)
    starts = {name: layout["start"] for name, layout in found["signals"].items()}
    assert starts == {"6020h:0": 0, "gap 2": 16, "2100h:1": 24}
    assert (found["bytes"], found["cob"]) == (7, 0x180)
    lely = Eds(str(others_file("devices/eds/lely-simple.eds"))).sent(1)
    assert list(lely["signals"]) == ["4001h:0"]


def test_a_gap_in_a_pdo_is_in_what_is_written_and_read_back(tmp_path):
    begin, end = SENSOR.index("[1A00]"), SENSOR.index("[6020]")
    path = written(tmp_path, SENSOR[:begin] + COMPACT + SENSOR[end:])
    found, _ = device(eds=path, canopen_profile=410, **MOTION)
    steps = found.plan.steps
    mapping = [step.value for step in steps if step.place.number == 0x1A00]
    assert mapping == [0, 0x60200010, 0x00050008, 0x21000120, 3]
    assert Place(5) not in [step.place for step in steps]  # a type has nothing to be read
    (message,) = found.plan.messages
    assert message.length == 7


def test_two_gauges_by_a_makers_eds_as_canopen_sends_them():
    path = str(others_file("devices/eds/systec-IoX4_8AI.eds"))
    gauge = {"scale": 1e-3}
    section = {
        "eds": path, "node": 7, "messages": {"inputs": "TPDO1"}, "high_level_m": 4.6,
        "signals": {"port_level_m": gauge | {"from": "inputs.7130h:1"},
                    "starboard_level_m": gauge | {"from": "inputs.7130h:2"}},
        "valid_when": [{"from": f"inputs.6150h:{n}", "mask": 7, "in": [0]} for n in (1, 2)],
        "age_ms": 100, "protection": {"unchanged_ms": 2000},
    }  # fmt: skip
    with pytest.raises(ValueError, match=r"cycle_ms is required.*TPDO1 is sent on a change"):
        device("levels", **section)
    found, heard = device("levels", cycle_ms=20, **section)
    wire = Wire()
    node = canopen.LocalNode(7, path)
    wire.add_node(node)
    pdo = node.tpdo[1]
    pdo.read(from_od=True)
    for place, raw in enumerate((1200, 0, -800, 0)):
        pdo[place].raw = raw
    pdo.transmit()
    ((can_id, data),) = wire.said
    found.takers[can_id | STANDARD].take(Frame(can_id | STANDARD, data), 0)
    assert heard[0][1][:2] == (1.2, -0.8)
    assert heard[0][1].quality is Quality.GOOD


@pytest.mark.parametrize("path", ["eds", "profiles"])
def test_values_of_every_file_of_others_are_those_of_canopen(path):
    compared = 0
    for file in sorted(Path(others_file(f"devices/{path}")).iterdir()):
        eds = Eds(str(file))
        if file.name in REFUSED_BY_CANOPEN:
            continue
        theirs = canopen.import_od(str(file))
        for index in (0x1000, *range(0x1800, 0x1804), *range(0x1A00, 0x1A04), 0x1018):
            if index not in theirs or (file.name == "lely-simple.eds" and index >= 0x1A00):
                continue  # of that file it loses the mapping
            whole = theirs[index]
            for part in [whole] if not hasattr(whole, "values") else whole.values():
                if eds.node is None and part.default is not None:
                    place = Place(index, part.subindex)
                    assert eds.number(place) == part.default, (file.name, place)
                    compared += 1
    assert compared > 10


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("=20\n", "=020\n", "1800h:5 is 020: octal or decimal"),
        ("=20\n", "=fast\n", "1800h:5 is 'fast', and must be a whole number"),
        ("0x40000180", "0xC0000180", "1800h:1 has bit 31: TPDO1 is off as delivered"),
        ("0x60200010", "", "1A00h:1 has no value, and is mapped"),
        ("=2\n", "=0\n", "1A00h:0 is 0: TPDO1 carries nothing"),
        ("0x60200010", "0x60200020", "1A00h:1 maps 32 bits of 6020h:0, which has 16"),
        ("=2\n", "=65\n", "1A00h:0 is 65: a PDO maps 1 to 64"),
        ("0x60200010", "0x60210010", "6021h:0 is mapped, and is not there"),
        ("0x0003", "0x0009", "6020h:0 has the data type 9: no number"),
        ("0x60200010", "0x00070030", "1A00h:2 ends beyond the 8 bytes"),
        ("[1800sub1]", "[1800sub8]", "1800h:1 has no value: TPDO1 is not in this device"),
        ("VendorName=of nobody", "of nobody", "is no EDS"),
        ("[2100sub1]", "[2100sub0]", "is no EDS"),
        ("VendorName", "\n[DeviceComissioning]\nNodeID=0x9\nV", "the DCF of node 9, not of no"),
    ],
)
def test_errors_name_file_object_and_remedy(tmp_path, old, new, reason):
    path = written(tmp_path, SENSOR.replace(old, new, 1))
    with pytest.raises(ValueError, match=rf"sensor\.eds:? .*{re.escape(reason)}"):
        with_eds({"eds": path, **MOTION})


@pytest.mark.parametrize("messages", [None, {"m": "TPDO0"}, {"m": {"cob": 384}}, ["TPDO1"]])
def test_messages_must_be_pdos(tmp_path, messages):
    with pytest.raises(ValueError, match="messages names its PDOs"):
        device(eds=written(tmp_path), **(MOTION | {"messages": messages}))


def test_a_mapping_of_nothing_repeated_ends(tmp_path):
    text = f"[1A00]\nDataType=7\nCompactSubObj={10**18}\nDefaultValue=0x00050000\n"
    path = written(tmp_path, "[1800]\nSubNumber=2\n" + entry(0x1800, 1, 7, "0x181") + text)
    with pytest.raises(ValueError, match=r"1A00h:0 is 10+: a PDO maps 1 to 64"):
        Eds(path).sent(1)


def test_a_file_is_read_compressed_and_a_huge_one_is_refused(tmp_path):
    packed = tmp_path / "sensor.eds.gz"
    packed.write_bytes(gzip.compress(SENSOR.encode()))
    assert Eds(str(packed)).number(Place(0x1800, 5)) == 20
    packed.write_bytes(gzip.compress(bytes(1 << 23)))
    with pytest.raises(ValueError, match=r"sensor\.eds\.gz: holds more than 4194304 bytes"):
        Eds(str(packed))


def test_no_file(tmp_path):
    with pytest.raises(ValueError, match=r"none\.eds can't be read: No such file"):
        device(eds=str(tmp_path / "none.eds"), **MOTION)


def drive(name, **more):
    given = {key: value for key, value in PROFILE.items() if key != "identity"}
    del given["profile"]  # an EDS of a drive is one by CiA 402
    file = {"eds": str(others_file(f"devices/eds/{name}"))}
    return DevicesSection(pump=given | file | more)


def test_a_drives_identity_is_that_of_its_file():
    found = drive("maxon-epos4_50_15_node1.dcf", node=1, mode="cyclic_torque")
    assert found.pump.identity == (0xFB, 0x65520000, 0x1700000, 0x29001321)
    given = drive("maxon-epos4_50_15_node1.dcf", node=1, mode="velocity", identity=[1])
    assert given.pump.identity == (1,)
    assert DevicesSection.model_validate(found.model_dump(mode="json")) == found


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("maxon-epos4_50_15_node1.dcf", "is the DCF of node 1, not of node 5"),
        ("technosoft-iPOS.eds", r"no 1016h \(heartbeat consumer\)"),
        ("systec-IO-C12.eds", "1000h:0 says profile 401; a drive has 402"),
        ("faulhaber-605.3150.68-B.eds", "6502h:0 is 0x25, without mode torque: choose velocity; "
         "there is no 6071h:0.*another echo.*there is no 6077h:0.*another drive.*"
         "there is no 0x6007: set it to null"),
    ],
)  # fmt: skip
def test_a_drive_that_cannot_be_led_is_refused(name, reason):
    with pytest.raises((ParameterError, ValueError), match=reason):
        drive(name)


@pytest.mark.parametrize(
    ("name", "vendor"), [("trinamic-TMCM-1240.dcf", 0x286), ("faulhaber-605.3150.68-B.eds", 0x147)]
)
def test_a_drive_without_any_torque_object_is_led_by_its_speed(name, vendor):
    require = dict.fromkeys(("0x6007", "0x605A", "0x605E"))
    found = drive(name, node=1, mode="velocity", require=require)
    assert found.pump.identity[0] == vendor
    assert not list(found.pump.problems())
    assert [place.number for place, _ in found.pump.plan(0, PUMP).measured] == [0x606C, 0x6061]


@pytest.mark.parametrize("require", [[1], 5, "0x6007"])
def test_what_is_required_is_a_mapping_with_an_eds_too(require):
    with pytest.raises(ValueError, match=r"require\n.*valid dictionary"):
        drive("maxon-epos4_50_15_node1.dcf", node=1, mode="cyclic_torque", require=require)


def test_what_a_drives_file_lacks_is_said_before_the_quay():
    with pytest.raises((ParameterError, ValueError), match="without mode torque: choose cyclic_"):
        drive("maxon-epos4_50_15_node1.dcf", node=1)
    with pytest.raises((ParameterError, ValueError), match=r"no 6074h:0.*another echo"):
        drive("maxon-epos4_50_15_node1.dcf", node=1, mode="cyclic_torque", echo="demand")
