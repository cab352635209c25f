"""Each retuning event leaves the controller's node once, in the tick in which it happens."""

import pytest
from fault_bench import storm

from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import RetuningState
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.retuning import Refusal, RetuningEvent, RetuningSettings, SimulatedRetuner
from utank_hil.runners import Lockstep
from utank_hil.telemetry.events import EventReader, EventWriter

SECOND = 1_000_000_000
SCRIPT = (TimedAction(1.0, Action.ARM), TimedAction(2.0, Action.RETUNE))
SETTINGS = RetuningSettings((6.0, 20.0), identification_s=10.0, trial_s=30.0, pulse_pa=10e3)


@pytest.mark.slow
def test_events_are_handed_on_when_they_happen_and_no_event_twice():
    config = storm().controllers["gpc"].model_copy(update={"retuning": SETTINGS})
    heard: list[tuple[int, RetuningEvent]] = []
    times_s: list[float] = []
    retuner = SimulatedRetuner(lambda _record: Refusal(("no [good]", "too short")), 3.0)
    with EventWriter() as writer, EventReader(writer.name) as reader:

        def tell(event, start_ns):
            assert start_ns == node.start_ns
            heard.append((len(times_s), event))  # place of the row that this tick is to write
            writer.write_event(event, start_ns)

        node = build_controller_node(
            config,
            commissioned=True,
            retuner=retuner,
            sink=lambda row: times_s.append(row[0]),
            event_sink=tell,
        )
        lockstep = Lockstep([*build_ship_side(storm(), 1, SCRIPT).nodes, node])
        lockstep.run_until(60 * SECOND)
        told = reader.read_events()
    assert [event for _, event in heard] == list(node.law.events)
    for place, event in heard:
        assert times_s[place] == pytest.approx((event.time_ns - node.start_ns) / SECOND, abs=1e-9)
    identify, design, refused = [event for _, event in heard if event.state != RetuningState.IDLE]
    assert identify.state is RetuningState.IDENTIFY
    assert design.state is RetuningState.DESIGN
    assert refused.state is RetuningState.REFUSED
    assert refused.reasons == ("no [good]", "too short")
    assert told[-1].time_ns == refused.time_ns - node.start_ns
    assert told[-1].reasons == refused.reasons
