"""What came of a message, in words, for the text of an alarm."""

from utank_hil.canbus import Catalogue
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.device import MessageHeard
from utank_hil.canbus.profiles.device_plan import ForeignDevices
from utank_hil.safety.monitors.senders import Heard


def message_words(heard: Heard, catalogue: Catalogue, foreign: ForeignDevices) -> str:
    """Who sends a message, its name, identifier and bus, and how often it was rejected, and why."""
    device, name, _ = foreign.said().get(heard.can_id, ("", "", False))
    if not device:
        known = catalogue.by_id[heard.can_id]
        device, name = known.source.name.lower(), known.codec.name
    bus, digits = foreign.buses[heard.can_id >> BUS_SHIFT], 3 if heard.can_id & STANDARD else 8
    number = f"0x{heard.can_id & STANDARD - 1:0{digits}X}"
    if isinstance(heard, MessageHeard):
        name = heard.name  # several may have one identifier
        if heard.of_group:
            number = f"PGN {heard.can_id >> 8 & 0x3FFFF} of 0x{heard.can_id & 0xFF:02X}"
    parts = [f"{device}: {name} {number}{bus and f' on {bus}'}"]
    parts += ["never heard"] * (not heard.heard)
    parts += [f"{count} with {why.value}" for why, count in heard.rejected.items() if count]
    if isinstance(heard, MessageHeard) and heard.unwell:
        parts.append(heard.unwell)
    return ", ".join(parts)
