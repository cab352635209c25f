from toy_nodes import SelectiveNode, ToyNode

from utank_hil.runners.node import heard_by

SENSORS, DRIVE = SelectiveNode("sensors"), SelectiveNode("drive", hears=frozenset({1}))
PANEL = SelectiveNode("panel", hears=frozenset({1, 2}))


def test_group_hears_what_any_of_its_nodes_names():
    assert heard_by([]) == heard_by([SENSORS]) == frozenset()
    assert heard_by([SENSORS, DRIVE, PANEL]) == {1, 2}


def test_group_with_a_node_that_names_nothing_hears_everything():
    assert heard_by([SENSORS, ToyNode("controller"), DRIVE]) is None
