"""The fault table, the enumeration and the DBC have the same codes."""

from cantools.database.can import Database

from utank_hil.canbus import Fault
from utank_hil.canbus.catalogue import DBC_PATH
from utank_hil.safety import judging
from utank_hil.safety.faults import FAULTS, fault_text

NOT_AVAILABLE = 255

#: Declared, so that finding them needs no other catalogue. A row for one takes it from here.
RESERVED = {
    Fault.COUNTER_FROZEN,
}  # fmt: skip


def test_each_code_of_the_dbc_has_one_row_or_is_reserved_and_each_row_has_a_code():
    database = Database()
    database.add_dbc_file(DBC_PATH)
    signal = database.get_message_by_name("CTRL_STATUS").get_signal_by_name("fault")
    codes = {int(value): str(name) for value, name in signal.choices.items()}
    assert codes.pop(Fault.NONE) == "NONE"
    assert codes.pop(NOT_AVAILABLE) == "NOT_AVAILABLE"
    rows = [row.code for row in FAULTS]
    assert codes == {code.value: code.name for code in (*rows, *RESERVED)}
    assert len(rows) + len(RESERVED) == len(codes)


def test_people_read_what_happened_and_what_to_do():
    for row in FAULTS:
        assert fault_text(row.code) == f"{row.code.name}: {row.happened} {row.remedy}"
        assert row.happened.endswith(".")
        assert row.remedy.endswith(".")
    assert fault_text(Fault.NONE) == "NONE"


def test_of_several_conditions_the_first_of_the_table_is_named():
    assert judging.first(0b10100) == judging.CONDITIONS[2]
    assert judging.first(0) is None
