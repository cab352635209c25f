"""Frames that anybody can make: of the catalogue's identifiers, with the right CRC and counter."""

import warnings

import numpy as np
import pytest
from cantools.database.can import Database
from controller_bench import CATALOGUE, LIMITS, VESSEL, ControllerBench
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from firmware_sim.drive import PumpDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario_sections import DriveLimits
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, Mode
from utank_hil.canbus.catalogue import DBC_PATH, read_data_ids
from utank_hil.canbus.e2e import profile2_crc
from utank_hil.sea import Harmonics

DATABASE = Database()
DATABASE.add_dbc_file(DBC_PATH)
DATA_IDS = {message.frame_id: read_data_ids(message) for message in DATABASE.messages}
UNPOWERED = (Mode.INIT, Mode.STANDBY)
CALM = Harmonics(np.zeros(1), np.full(1, 0.5), np.zeros(1))

contents = st.binary(min_size=8, max_size=8) | st.integers(2, 7).flatmap(
    lambda known: st.binary(min_size=known, max_size=known).map(lambda data: data.ljust(8, b"\xff"))
)
forgeries = st.tuples(st.sampled_from(sorted(DATA_IDS)), contents, st.sampled_from([1, 1, 1, 0, 3]))

bursts_of = st.lists(forgeries, min_size=5, max_size=20)


@pytest.mark.slow
# to shrink forty frames takes minutes
@settings(max_examples=30, phases=[Phase.generate])
@given(
    st.lists(
        st.tuples(st.lists(forgeries, min_size=5, max_size=20), st.integers(1, 10)), max_size=5
    )
)
def test_whatever_has_the_right_crc_raises_nothing_and_lifts_no_limit(bursts):
    bench = ControllerBench()
    plant, limits = Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, CALM), DriveLimits()
    drive = PumpDrive(plant, limits, CATALOGUE, configuration_version=7)
    bench.arm()
    bench.law.answer_pa = 40e3
    watched = (getattr(each, "receiver", each) for each in bench.node.inbox.watched)
    heard = {receiver.can_id: receiver for receiver in watched}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for burst, ticks in bursts:
            for can_id, content, step in burst:
                data, ids = bytearray(content), DATA_IDS[can_id]
                expected = heard[can_id].counter if can_id in heard else None
                data[1] = data[1] & 0xF0 | ((expected or 0) + step) & 15
                if ids is not None:
                    data[0] = profile2_crc(bytes(data), ids)
                frame = Frame(can_id, bytes(data))
                bench.send(frame)
                drive.receive(frame, bench.now_ns)
            for _ in range(ticks):
                bench.tick()
                list(drive.tick(bench.now_ns))
                assert abs(bench.pressure_pa) <= LIMITS.pressure_pa
                assert abs(plant.pressure_pa) <= limits.pressure_pa + 4.0
                if bench.commands[-1][0] == bench.now_ns - TICK_NS and bench.node.mode in UNPOWERED:
                    assert bench.pressure_pa == 0.0
