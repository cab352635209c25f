"""A law that ends on a limit of its own, on the bus: what is told, how it starts again."""

import math

import numpy as np
import pytest
from controller_bench import VESSEL, ControllerBench, ToyLaw

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Fault, Mode, Quality, SensorMotion
from utank_hil.control.stimulation import Stimulation

PLAN = Stimulation(
    ship=VESSEL.ship,
    tank=VESSEL.tank,
    amplitude_rad=0.05,
    period_s=12.5,
    ramp_s=4.0,
    pressure_pa=50e3,
    roll_limit_rad=0.12,
    level_limit_m=3.0,
)
FULL_PA = PLAN.amplitude_rad / PLAN.gains[0]
ON_COURSE_PA = 0.3 * FULL_PA
BEYOND = SensorMotion(0.13, 0.0, Quality.GOOD)
LEVEL = SensorMotion(0.0, 0.0, Quality.GOOD)


class Stimulating(ToyLaw):
    """The stimulation, on the roll and level that the bench measures."""

    def __init__(self, plan: Stimulation = PLAN) -> None:
        super().__init__(plan.sample_time_s)
        self.law = plan.controller()

    @property
    def passed_limit(self) -> str:
        return self.law.passed_limit

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        return self.law.step(np.array([y[0], 0.0, y[1], 0.0]), reference)

    def applied(self, u: FloatArray) -> None:
        self.law.applied(u)

    def reset(self) -> None:
        self.calls.append("reset")
        self.law.reset()


def rolling_bench(plan: Stimulation = PLAN) -> ControllerBench:
    """Armed, with the ramp in behind it."""
    bench = ControllerBench(law=Stimulating(plan))
    bench.arm()
    assert greatest_pa(bench, 12.0) > ON_COURSE_PA
    return bench


def greatest_pa(bench: ControllerBench, duration_s: float) -> float:
    before = len(bench.commands)
    bench.run(1e3 * duration_s)
    return max(abs(command.pressure_pa) for _, command in bench.commands[before:])


def pass_limit(bench: ControllerBench) -> None:
    bench.motion = BEYOND
    bench.run(50)
    bench.motion = LEVEL
    bench.run(400)  # down at the rate limit


def rearm(bench: ControllerBench) -> None:
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(800)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    assert bench.node.mode is Mode.ACTIVE


@pytest.mark.parametrize(
    ("passed", "fault"), [("roll", Fault.HEEL_LIMIT), ("level", Fault.LEVEL_LIMIT)]
)
def test_operator_is_told_that_the_law_ended_and_why(passed: str, fault: Fault) -> None:
    bench = rolling_bench()
    assert bench.status.fault is Fault.NONE
    assert not bench.status.alarm
    if passed == "roll":
        pass_limit(bench)
    else:
        bench.tank = bench.tank._replace(port_level_m=-3.1, starboard_level_m=3.1)
        bench.run(50)
        bench.tank = bench.tank._replace(port_level_m=0.0, starboard_level_m=0.0)
        bench.run(1000)
    assert (bench.status.mode, bench.status.fault) == (Mode.ACTIVE, fault)
    assert bench.status.alarm
    assert bench.node.fault is fault
    assert bench.column("fault")[-1] == fault
    assert greatest_pa(bench, 15.0) == 0
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(800)
    assert (bench.status.mode, bench.status.fault) == (Mode.STANDBY, fault)


@pytest.mark.parametrize("reset_first", [False, True])
def test_armed_again_it_starts_again_from_zero(reset_first: bool) -> None:
    bench = rolling_bench()
    pass_limit(bench)
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(800)
    if reset_first:
        bench.order_is(reset=True)
        bench.run(200)
        assert bench.status.fault is Fault.NONE
        bench.order_is(reset=False)
        bench.run(100)
    rearm(bench)
    assert bench.status.fault is Fault.NONE
    assert greatest_pa(bench, 0.5) < 0.1 * FULL_PA
    assert greatest_pa(bench, 12.0) > ON_COURSE_PA


def test_reset_in_charge_does_not_start_it_again() -> None:
    bench = rolling_bench()
    pass_limit(bench)
    bench.order_is(reset=True)
    assert greatest_pa(bench, 15.0) == 0
    assert bench.node.fault is Fault.HEEL_LIMIT


def test_after_its_time_it_ramps_out_on_the_bus_and_armed_again_it_ramps_in() -> None:
    bench = rolling_bench(Stimulation(**{**_fields(PLAN), "duration_s": 16.0}))
    bench.run(8e3)  # 16 s in charge, 4 s of ramp
    assert greatest_pa(bench, 15.0) == 0
    assert bench.node.mode is Mode.ACTIVE
    assert bench.node.fault is Fault.NONE
    rearm(bench)
    assert greatest_pa(bench, 12.0) > ON_COURSE_PA


def test_disarming_takes_the_pressure_away_at_once_whatever_the_plan() -> None:
    bench = rolling_bench()
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(math.ceil(1e3 * 2 * FULL_PA / 100e3) + 40)
    assert bench.pressure_pa == 0


def test_law_that_knows_the_ship_only_is_not_reset() -> None:
    bench = ControllerBench()
    bench.arm()
    bench.order_is(mode_request=Mode.STANDBY, arm=False, reset=True)
    bench.run(800)
    assert "reset" not in bench.law.calls


def _fields(plan: Stimulation) -> dict[str, object]:
    return {name: getattr(plan, name) for name in plan.__dataclass_fields__}
