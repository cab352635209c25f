"""A period that no loading of the configured ship has is warned of."""

import pytest

from utank_hil.commands.identify import unlike_period


@pytest.mark.parametrize(("found_s", "said"), [(5.33, "0.51 times"), (14.0, "1.33 times")])
def test_a_period_of_another_ship_is_warned_of(found_s: float, said: str) -> None:
    warning = unlike_period(10.5, found_s)
    assert said in warning
    assert "too short" in warning


@pytest.mark.parametrize("found_s", [7.5, 10.5, 13.5])
def test_a_loading_s_period_is_not(found_s: float) -> None:
    assert unlike_period(10.5, found_s) == ""
