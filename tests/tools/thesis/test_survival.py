"""Sampled controllers on the nonlinear model: the run itself, bisection, and the contest of 4.5."""

import math

import numpy as np
import pytest

from tools.thesis.capsize import (
    LAWS,
    PATTI_B,
    WAVE_RAD_S,
    capsize_threshold,
    contest,
    controlled_run,
    largest_survivable_wave,
)
from tools.thesis.simulate import WaveMoment, simulate
from utank_hil.control import CommandLimiter, PassiveController, PumpLimits

WAVE = WaveMoment([5e4], [WAVE_RAD_S], [0.0])


class Sine:
    """A pressure that swings in time, whatever is measured."""

    sample_time_s = 0.1

    def __init__(self):
        self.times, self.told = 0, []

    def step(self, y, reference=None):
        self.times += 1
        return np.array([3e3 * math.sin(0.06 * (self.times - 1))])

    def applied(self, u):
        self.told.append(float(u[0]))


def test_run_is_that_of_simulate_with_the_same_held_pressure():
    states, pressures = [], []
    result = controlled_run(
        PATTI_B,
        Sine(),
        WAVE,
        60.0,
        initial=np.array([0.05, 0.0, 0.1, 0.0]),
        each_step=lambda time, state, command: (
            states.append(state.copy()),
            pressures.append(command),
        ),
    )
    expected = simulate(
        PATTI_B,
        60.0,
        (0.05, 0.0, 0.1, 0.0),
        wave=WAVE,
        pressure_pa=pressures,
        hold_s=0.1,
        record_every=5,
    )
    np.testing.assert_allclose(states, expected.state[:-1], rtol=1e-9, atol=1e-12)
    assert result.max_command == max(map(abs, pressures))
    assert math.isinf(result.capsized_s)


def test_controller_is_told_what_the_limiter_left():
    controller = Sine()
    limits = PumpLimits(pressure_pa=1e3, rate_pa_s=1e4, level_m=1.9)
    limiter = CommandLimiter(limits, PATTI_B.tank, 0.1)
    result = controlled_run(PATTI_B, controller, WAVE, 30.0, limiter=limiter)
    assert max(map(abs, controller.told)) == 1e3 == result.max_command
    assert np.abs(np.diff(controller.told)).max() <= 1e3 * (1 + 1e-12)


def test_valve_command_is_a_loss():
    class Shut(PassiveController):
        def step(self, y, reference=None):
            return np.array([1e9])

    wave = WaveMoment([2e4], [WAVE_RAD_S], [0.0])
    result = controlled_run(PATTI_B, Shut(), wave, 60.0, valve=True)
    assert result.max_level_m < 0.05


@pytest.mark.evidence
def test_bisection_agrees_with_the_scan_for_the_passive_tank_and_its_capsize_time():
    def survives(amplitude):
        wave = WaveMoment([amplitude], [WAVE_RAD_S], [0.0])
        controller = PassiveController(sample_time_s=0.1)
        return math.isinf(controlled_run(PATTI_B, controller, wave, 120.0).capsized_s)

    found = largest_survivable_wave(survives, 3e5, tolerance=0.005)
    threshold = capsize_threshold(PATTI_B, WAVE_RAD_S, 3e5, duration_s=120.0, cells=300)
    assert survives(found)
    assert not survives(found / (1 - 0.006))
    assert found > 0.99 * threshold.safe_nm
    assert largest_survivable_wave(lambda _: True, 1.0) == math.inf


def test_unknown_law_is_refused():
    with pytest.raises(ValueError, match="no law"):
        contest("sliding mode")


# as printed, and long enough for the fourth wave to capsize her with the passive tank
DURATION_S = [100.0, pytest.param(300.0, marks=pytest.mark.evidence)]


@pytest.mark.evidence
@pytest.mark.parametrize("duration_s", DURATION_S)
def test_contest_at_the_printed_amplitudes(duration_s):
    none = contest("no tank", duration_s=duration_s)
    passive = contest("passive", duration_s=duration_s)
    linearized = contest("feedback linearization, level braked", 20e3, duration_s)
    printed = contest("feedback linearization (4.11)", duration_s=duration_s)
    # without a tank the first printed amplitude capsizes her, as printed
    assert none.survivable_nm < 5.086e4
    assert [math.isinf(run.capsized_s) for run in none.runs] == [False] * 4
    # the tank more than doubles what she survives; the last amplitude capsizes her
    assert passive.survivable_nm > 2 * none.survivable_nm
    assert [math.isinf(run.capsized_s) for run in passive.runs] == [True, True, True, False]
    # feedback linearization within a 20 kPa pump rolls less than the passive tank
    for run, bare in zip(linearized.runs[:3], passive.runs[:3], strict=True):
        assert run.max_roll_rad < 0.8 * bare.max_roll_rad
        assert run.max_command <= 20e3
        assert run.strikes == 0
    # as printed, and with no limit of the pump, it survives the last amplitude too
    assert math.isinf(printed.runs[3].capsized_s)
    assert printed.runs[3].max_command > 100e3


@pytest.mark.evidence
@pytest.mark.parametrize("duration_s", DURATION_S)
@pytest.mark.parametrize("law", [law for law in LAWS if law.startswith("fuzzy")])
def test_fuzzy_laws_survive_what_the_passive_tank_does_up_to_the_second_amplitude(law, duration_s):
    found = contest(law, duration_s=duration_s)
    assert [math.isinf(run.capsized_s) for run in found.runs[:2]] == [True, True]
    assert found.survivable_nm > 5.086e4
