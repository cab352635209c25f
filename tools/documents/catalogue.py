"""docs/can-catalogue.md, made from the DBC."""

import textwrap
from pathlib import Path

from cantools.database.can import Database, Message, Signal

from utank_hil.canbus import load_catalogue
from utank_hil.canbus.catalogue import DBC_PATH, read_data_ids
from utank_hil.canbus.endpoints import BUCKET_LIMIT, MAX_LOST, RESYNC_FRAMES
from utank_hil.runners.bus_model import LONGEST_FRAME_BITS

BIT_RATE = 250_000
PAGE = Path(__file__).resolve().parents[2] / "docs" / "can-catalogue.md"

INTRODUCTION = """\
# CAN catalogue

<!-- Written by tools/documents/catalogue.py from utank_hil/canbus/utank.dbc; do not edit. -->

## What it does
{comment}

* Identifiers are 29 bits in the manner of SAE J1939: priority, parameter group, and in the low byte
  the sender's source address.
* Frames have 8 bytes. Signals are unsigned and little endian.
* Physical value = raw * scale + offset, so all ones can mean "not available" for signed quantities
  too.
* Encoding saturates at the range. A value that is out of range, not available or not in a value
  table decodes to NaN or None and counts as missing.
* Catalogue version: {version}, the first number of the DBC's `VERSION`. The second is a 12-bit
  hash of its other lines; where it is not theirs, that hash is the version. HEARTBEAT and
  CTRL_STATUS carry it. Nodes whose versions differ keep the controller from arming.

### Protection
All messages but ADDRESS_CLAIM are protected in the style of AUTOSAR E2E Profile 2:

* Byte 0 is a CRC-8 (polynomial 0x2F, start value and final exclusive-or 0xFF) over bytes 1 to 7 and
  the data ID. The data ID is one byte that is not sent. The counter picks it from the message's
  list of sixteen (attribute `DataIDs`). A frame of another message fails this check.
* The low nibble of byte 1 is a counter that steps by one with every frame, 15 followed by 0. The
  first frame after a start has 1.
* The lists: message number n = 1, 2, ... as the eight bits `2 n + parity(n)`, exclusive-or 0x06,
  0x03, 0x0A, 0x11 for the counter's bits 0 to 3.

A receiver accepts the first good frame, then every frame whose counter follows:

* Up to {lost} missing frames are forgiven and counted.
* Anything else is discarded: wrong length, CRC or data ID, counter repeated or out of sequence. A
  discarded frame changes nothing: no value, no trusted counter.
* After a longer gap or a restart of the sender, the last of {resync} frames that follow one
  another is trusted again.
* A leaky bucket judges the stream: a discarded frame +1, an accepted one -1. The stream is invalid
  from {bucket} until the bucket is empty.

Four bits have limits. A gap of 16 frames looks like a repetition and one of 17 like none. A frame
delayed by 12 to 15 places looks like the next one. Receivers therefore judge age with their own
clock too. The CRC is for safety, not security: whoever may send on the bus can compute it.

## How to use it
* The DBC, `utank_hil/canbus/utank.dbc`, is the only source. Any CAN tool reads it.
* Add a sensor or a message: [how-to/message.md](how-to/message.md). `make docs` writes this page
  anew, `make check` fails if it is stale.
* In Python: `load_catalogue()`, then a `Transmitter` or `Receiver` a message
  (`canbus/endpoints.py`).

## What was measured
By exhaustion (`tests/canbus/test_e2e.py`): any three flipped bits of a frame are found (Hamming
distance 4), flips in the counter included. No message passes for another, not even with one flipped
bit.

Worst case of the bus load, at {bit_rate} bit/s, by the cycles above and the {bits} bits that a
frame has at most with bit stuffing and pause:

| nodes | frames a second | bus load |
|---|---|---|
{loads}

Added to these: the address claims at boot, and the frames that are sent on a change.

## Messages

| message | identifier | cycle | from | to | carries |
|---|---|---|---|---|---|
"""


def signals_of(message: Message) -> list[Signal]:
    """All signals but CRC and counter."""
    return [signal for signal in message.signals if signal.name not in ("crc", "counter")]


def cycle(message: Message) -> str:
    """Cycle time for the table."""
    return f"{message.cycle_time} ms" if message.cycle_time else "at boot"


def load_rows(messages: list[Message]) -> str:
    """Worst case of the bus load, for the nodes that most ships have and for all there may be."""
    nodes_of_most = ("CONTROLLER", "DRIVE", "SENSORS", "OPERATOR", "VALVE")
    valve = [message for message in messages if message.senders[0] in nodes_of_most]
    pump = [message for message in valve if "VALVE" not in message.name]
    rows = []
    for nodes, listed in (
        ("controller, drive, sensors, panel", pump),
        ("the same and a valve", valve),
        ("all: every message in its cycle", messages),
    ):
        frames = sum(1000 / message.cycle_time for message in listed if message.cycle_time)
        load = frames * LONGEST_FRAME_BITS / BIT_RATE
        rows.append(f"| {nodes} | {frames:.0f} | {load:.1%} |")
    return "\n".join(rows)


def overview_row(message: Message) -> str:
    """One message's row in the list of messages."""
    names = ", ".join(f"`{signal.name}`" for signal in signals_of(message))
    receivers = ", ".join(sorted(message.receivers))
    return (
        f"| [{message.name}](#{message.name.lower()}) | 0x{message.frame_id:08X} "
        f"| {cycle(message)} | {message.senders[0]} | {receivers} | {names} |"
    )


def signal_row(signal: Signal) -> str:
    """One signal's row in the table of its message."""
    place = f"{signal.start // 8}.{signal.start % 8}"
    scaled = signal.choices is None and signal.length > 1
    scale = f"{signal.scale}" if scaled else ""
    offset = f"{signal.offset}" if scaled and signal.offset else ""
    limits = f"{signal.minimum} to {signal.maximum}" if scaled else ""
    meaning = str(signal.comment)
    if signal.choices:
        width = (signal.length + 3) // 4
        table = ", ".join(f"0x{value:0{width}X} {name}" for value, name in signal.choices.items())
        meaning += f": {table}"
    return (
        f"| `{signal.name}` | {place} | {signal.length} | {scale} | {offset} | {limits} "
        f"| {signal.unit or ''} | {meaning} |"
    )


def section(message: Message) -> str:
    """The description of one message."""
    data_ids = read_data_ids(message)
    lines = [f"### {message.name}", "", textwrap.fill(str(message.comment), 100), ""]
    if data_ids is not None:
        lines += [f"Data IDs: `{data_ids.hex(' ').upper()}`", ""]
    lines += [
        "| signal | byte.bit | bits | scale | offset | range | unit | meaning |",
        "|---|---|---|---|---|---|---|---|",
        *(signal_row(signal) for signal in signals_of(message)),
    ]
    return "\n".join(lines)


def page() -> str:
    """Render the whole page."""
    database = Database()
    database.add_dbc_file(DBC_PATH)
    head = INTRODUCTION.format(
        comment=textwrap.fill(str(database.buses[0].comment), 100),
        version=load_catalogue().version,
        lost=MAX_LOST,
        resync=RESYNC_FRAMES,
        bucket=BUCKET_LIMIT,
        bit_rate=BIT_RATE,
        bits=LONGEST_FRAME_BITS,
        loads=load_rows(database.messages),
    )
    rows = "\n".join(overview_row(message) for message in database.messages)
    sections = "\n\n".join(section(message) for message in database.messages)
    return f"{head}{rows}\n\n{sections}\n"
