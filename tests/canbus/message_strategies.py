"""Random messages and the list of all messages, for the tests of this folder."""

import math
from enum import IntEnum
from typing import Any, get_type_hints

from cantools.database.can import Database, Message
from hypothesis import strategies as st

from utank_hil.canbus import Address
from utank_hil.canbus.catalogue import DBC_PATH, common_name
from utank_hil.canbus.codec import field_kind
from utank_hil.canbus.messages import DBC_NAMES, AddressClaim

DATABASE = Database()
DATABASE.add_dbc_file(DBC_PATH)

Case = tuple[type[Any], Address, Message]


def _cases():
    kinds = {name: kind for kind, name in DBC_NAMES.items()}
    return [
        (kinds.get(dbc.name) or kinds[common_name(dbc.name, sender)], Address[sender], dbc)
        for dbc in DATABASE.messages
        for sender in dbc.senders
    ]


CASES = _cases()
CASE_IDS = [dbc.name for _, _, dbc in CASES]
PROTECTED = [case for case in CASES if case[0] is not AddressClaim]
PROTECTED_IDS = [dbc.name for _, _, dbc in PROTECTED]


def messages(case, *, wild=False):
    """Messages of a type, every value within its range or not available; `wild` ignores ranges."""
    kind, _, dbc = case
    fields = []
    for name, hint in get_type_hints(kind).items():
        signal = dbc.get_signal_by_name(name)
        what = field_kind(hint)
        if what is bool:
            fields.append(st.booleans())
        elif issubclass(what, IntEnum):
            fields.append(st.none() | st.sampled_from(what))
        elif what is int and wild:
            fields.append(st.none() | st.integers())
        elif what is int:
            fields.append(st.none() | st.integers(signal.minimum, signal.maximum))
        elif wild:
            fields.append(st.floats())
        else:
            fields.append(st.floats(signal.minimum, signal.maximum) | st.just(math.nan))
    return st.tuples(*fields).map(kind._make)
