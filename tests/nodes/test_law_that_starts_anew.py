"""A law that remembers its own doing is reset when an operator arms, and never in charge."""

import pytest
from controller_bench import VESSEL, ControllerBench, ToyLaw

from utank_hil.assembly import measure_of
from utank_hil.canbus import AlarmState, Fault, Mode, Quality, SensorMotion
from utank_hil.control import DesignPlant
from utank_hil.control.interface import StartsAnew
from utank_hil.control.stimulation import StimulationDesign
from utank_hil.dynamics import STATES


class Learning(ToyLaw):
    """A law that is to forget what it learned."""

    starts_anew = True


def test_it_is_told_from_others_by_its_mark():
    assert isinstance(Learning(0.02), StartsAnew)
    assert not isinstance(ToyLaw(0.02), StartsAnew)


@pytest.mark.parametrize("law", [Learning, ToyLaw])
def test_it_is_reset_when_it_is_armed_again(law):
    bench = ControllerBench(law=law(0.02))
    bench.arm()
    bench.law.calls.clear()
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(800)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    assert bench.node.mode is Mode.ACTIVE
    assert ("reset" in bench.law.calls) is (law is Learning)


def test_a_reset_in_charge_takes_nothing_from_it():
    bench = ControllerBench(law=Learning(0.02))
    bench.arm()
    bench.law.calls.clear()
    bench.order_is(reset=True)
    bench.run(200)
    assert bench.node.mode is Mode.ACTIVE
    assert "reset" not in bench.law.calls


def test_a_stimulation_that_passes_its_own_limit_raises_an_alarm_until_it_is_armed_again():
    design = StimulationDesign(0.05, 12.3, 20.0, roll_limit_rad=0.1)
    told = []
    bench = ControllerBench(
        law=design.build(DesignPlant(VESSEL.ship, VESSEL.tank)).controller(),
        measure=measure_of(STATES),
        event_sink=lambda event, _: told.append((event.code, event.state)),
    )
    bench.arm()
    bench.run(1000)
    bench.motion = SensorMotion(0.11, 0.0, Quality.GOOD)
    bench.run(300)
    bench.motion = SensorMotion(0.0, 0.0, Quality.GOOD)
    bench.run(20_000)
    assert bench.node.mode is Mode.ACTIVE
    assert bench.pressure_pa == 0
    assert told == [(Fault.HEEL_LIMIT, AlarmState.ACTIVE_UNACKNOWLEDGED)]
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(200)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(12_000)
    assert bench.pressure_pa != 0
    assert told[1:] == [(Fault.HEEL_LIMIT, AlarmState.RECTIFIED_UNACKNOWLEDGED)]
