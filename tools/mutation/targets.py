"""The files that are mutated, the tests that are to notice, and what no test can notice."""

from dataclasses import dataclass

NO_DIFFERENCE: dict[str, dict[str, str]] = {}


@dataclass(frozen=True)
class Target:
    """One file of the safety code.

    Attributes
    ----------
    file : str
    tests : tuple of str
        Those that mirror it.
    behind : tuple of str
        Further tests, for mutants that the first ones let live.
    """

    file: str
    tests: tuple[str, ...]
    behind: tuple[str, ...] = ()


_NODE = ("tests/runtime/test_controller_node.py", "tests/runtime/test_controller_faults.py")
_SUPERVISOR = "tests/runtime/test_supervisor.py"

TARGETS = (
    Target("utank_hil/runtime/supervisor.py", (_SUPERVISOR,), _NODE),
    Target("utank_hil/runtime/judging.py", (_SUPERVISOR,), ("tests/runtime/test_alarms.py",)),
    Target(
        "utank_hil/runtime/safety_limits.py",
        (_SUPERVISOR, "tests/runtime/test_safety_limits.py"),
        _NODE,
    ),
    Target("utank_hil/control/limits.py", ("tests/control/test_limits.py",)),
    Target(
        "utank_hil/canbus/endpoints.py",
        ("tests/canbus/test_endpoints.py",),
        ("tests/canbus/test_codec.py", "tests/runtime/test_orders.py"),
    ),
    Target("utank_hil/canbus/e2e.py", ("tests/canbus/test_e2e.py",)),
    Target(
        "utank_hil/runtime/inbox.py",
        ("tests/runtime/test_inbox.py",),
        (
            "tests/runtime/test_lost_levels.py",
            "tests/runtime/test_valve_command.py",
            "tests/runtime/test_stations.py",
            "tests/runtime/test_monitoring.py",
            *_NODE,
        ),
    ),
    Target("firmware_sim/drive.py", ("tests/firmware_sim/test_drive.py",)),
    Target("firmware_sim/drive_states.py", ("tests/firmware_sim/test_drive_states.py",)),
    Target(
        "utank_hil/runtime/controller_node.py",
        _NODE,
        (
            "tests/runtime/test_valve_command.py",
            "tests/runtime/test_law_that_starts_anew.py",
            "tests/runtime/test_lost_levels.py",
            "tests/runtime/test_monitoring.py",
            "tests/runtime/test_alarms.py",
            "tests/runtime/test_lockstep.py",
            "tests/runtime/test_invariants.py",
            "tests/firmware_sim/test_vessel_without_pump.py",
            "tests/faults/test_retuning_events.py",
        ),
    ),
)
