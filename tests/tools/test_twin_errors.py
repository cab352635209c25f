from tools.studies.twin_errors import cases


def test_the_nearest_hour_is_compared_and_every_alarm_of_a_sound_law() -> None:
    row = {
        "law": "valve_on_off",
        "sea": "storm",
        "maxima": {"roll over twin": [0.6, None, 1.02, 1.1, 0.9]},
        "found_in_hours": {"ROLL_AMPLIFIED": [3, 4], "DRIFT": [5]},
    }
    assert cases(row) == [("valve_on_off", "storm", 3), ("valve_on_off", "storm", 4)]
    # pd loses, and is found rightly
    assert cases(row | {"law": "pd"}) == [("pd", "storm", 4)]
    # an alarm whose statistic was known a moment later than the others' is no less one
    row["maxima"] = {"roll over twin": [0.6, None, 0.7, 0.7, 0.7]}
    assert cases(row) == [("valve_on_off", "storm", 3), ("valve_on_off", "storm", 4)]
    assert cases(row | {"found_in_hours": {}}) == []
    assert cases(row | {"maxima": {}, "found_in_hours": {}}) == []
