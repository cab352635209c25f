"""A law that remembers its own doing is reset when an operator arms, and never in charge."""

import pytest
from controller_bench import ControllerBench, ToyLaw

from utank_hil.canbus import Mode
from utank_hil.control.interface import StartsAnew


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
