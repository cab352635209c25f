"""Events through shared memory: what goes in comes out, however long, and nobody waits."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import AlarmState, Fault, Mode, RetuningState
from utank_hil.canbus.events import AlarmEvent, ModelSummary, RetuningEvent
from utank_hil.telemetry.events import EventReader, EventWriter, event_text, warns
from utank_hil.telemetry.ring import RingError

finite = st.floats(allow_nan=False, allow_infinity=False)
alarms = st.builds(
    AlarmEvent,
    st.integers(0, 1 << 62),
    st.sampled_from(Fault),
    st.none() | st.sampled_from(AlarmState),
    st.sampled_from(Mode),
)
events = alarms | st.builds(
    RetuningEvent,
    st.integers(0, 1 << 62),
    st.sampled_from(RetuningState),
    st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=80), max_size=4).map(tuple),
    st.none() | st.builds(ModelSummary, *9 * [finite]),
)


@given(st.lists(events, max_size=20), st.integers(0, 1 << 62))
def test_events_come_out_as_they_went_in_at_times_since_the_start(told, start_ns):
    with EventWriter() as writer, EventReader(writer.name) as reader:
        for event in told:
            writer.write_event(event, start_ns)
        assert reader.read_events() == [replace(e, time_ns=e.time_ns - start_ns) for e in told]
        assert reader.read_events() == []
        assert not told or reader.start_ns == start_ns
        assert not reader.ended
        assert reader.lost == 0


@pytest.mark.parametrize("character", ["a", "\x01", "é", "😀", '"', "\ud800"])
def test_reasons_too_long_for_the_ring_are_cut_and_the_rest_is_told(character):
    summary = ModelSummary(*[1 / 3] * 9)
    event = RetuningEvent(1, RetuningState.REFUSED, ("it was this: " + character * 9000,), summary)
    with EventWriter() as writer, EventReader(writer.name) as reader:
        writer.write_event(event, 0)
        (told,) = reader.read_events()
    assert told.reasons[0].startswith("it was this: ")
    assert told.reasons[0].endswith(" ...")
    assert len(told.reasons[0]) > 500
    assert (told.time_ns, told.state, told.found) == (1, RetuningState.REFUSED, summary)


def test_every_reader_hears_every_event_and_what_was_lost_is_counted():
    told = [RetuningEvent(number, RetuningState.IDENTIFY, ()) for number in range(100)]
    with EventWriter() as writer:
        early, late = EventReader(writer.name), EventReader(writer.name)
        writer.write_event(told[0], 0)
        assert early.read_events() == told[:1]
        for event in told[1:]:
            writer.write_event(event, 0)
    heard = late.read_events()
    assert heard == told[-len(heard) :]
    assert (len(heard), late.lost) == (64, 36)
    assert early.read_events() == heard
    assert early.ended
    assert late.ended
    early.close()
    late.close()


def test_writer_that_is_not_there_is_said_to_be_none():
    with pytest.raises(RingError, match="is its writer running"):
        EventReader("utank-no-such-ring")


def test_text_of_an_event_is_its_state_and_its_reasons():
    event = RetuningEvent(0, RetuningState.REFUSED, ("too short", "no pulses"))
    assert event_text(event) == "retuning REFUSED: too short; no pulses"
    assert event_text(RetuningEvent(0, RetuningState.DESIGN, ())) == "retuning DESIGN"


def test_alarms_and_refusals_warn_and_the_rest_is_news():
    def alarm(state):
        return AlarmEvent(0, Fault.LEVEL_LIMIT, state, Mode.FAULT)

    assert [state for state in (*AlarmState, None) if warns(alarm(state))] == [
        AlarmState.ACTIVE_UNACKNOWLEDGED, None,
    ]  # fmt: skip
    assert [state for state in RetuningState if warns(RetuningEvent(0, state, ()))] == [
        RetuningState.REFUSED, RetuningState.UNDONE,
    ]  # fmt: skip
