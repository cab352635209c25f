"""Units: what is recorded can be turned back into the column it came from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.units import UNITS, column_of, field_of

STEMS = st.from_regex(r"[a-z]{1,8}(_[a-z]{3,8}){0,2}", fullmatch=True)


@given(stem=STEMS, suffix=st.sampled_from([unit.suffix for unit in UNITS]))
def test_a_recorded_name_leads_back_to_its_column(stem, suffix):
    column = stem + suffix
    try:
        field = field_of(column)
    except ValueError:  # the stem itself ends in a unit that is not SI
        assert stem.endswith(tuple(u.shown_suffix for u in UNITS if u.shown_suffix != u.suffix))
        return
    assert column_of(field.name) == (column, field.unit)


@pytest.mark.parametrize(
    ("column", "name", "value", "shown"),
    [
        ("roll_rad", "roll_deg", np.pi, 180.0),
        ("roll_rate_rad_s", "roll_rate_deg_s", np.pi / 2, 90.0),
        ("pressure_actual_pa", "pressure_actual_kpa", 5e4, 50.0),
        ("port_level_m", "port_level_m", 4.88, 4.88),
        ("bus_load", "bus_load_percent", 0.23, 23.0),
        ("tick_duration_s", "tick_duration_ms", 3e-4, 0.3),
        ("pump_power_w", "pump_power_kw", 1500.0, 1.5),
        ("overruns", "overruns", 3.0, 3.0),
    ],
)
def test_people_get_the_units_they_read(column, name, value, shown):
    field = field_of(column)
    assert field.name == name
    assert value * field.unit.scale == pytest.approx(shown, rel=1e-15)


def test_all_signals_have_names_of_their_own():
    assert len({field_of(column).name for column in SIGNALS}) == len(SIGNALS)


@pytest.mark.parametrize(
    "column", ["roll_deg", "pressure_kpa", "tick_duration_ms", "bus_load_percent"]
)
def test_columns_that_are_not_si_are_refused(column):
    with pytest.raises(ValueError, match=column):
        field_of(column)
