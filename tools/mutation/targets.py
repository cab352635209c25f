"""The files that are mutated, the tests that are to notice, and what no test can notice."""

from dataclasses import dataclass

_NEVER = "any time that never comes is as good"
_SET_FIRST = "set before it is read, on every way there"
_OF_40_MS = "a millisecond of the 40 that are allowed"
_SUM = "a difference of numbers is finite exactly where their sum is"
_TOUCHING = "a millimetre from the limit the barrier asks for the whole brake on either side"
_NOBODY_SETS = "nobody sets what it holds"
_A_QUARTER = "a quarter more or less of what is as good as nothing"
_A_NANOSECOND = "a nanosecond, where ticks are ten milliseconds apart"
_BETWEEN = "no measurement and no set-point of the bus is exactly there"
_AT_50_MS = "whether a sample that is exactly 50 ms old is a gap in a record"
_SAME = "the same set-point is no step either way"
_FALSE = "None is as false as False"
_ROUNDED = "less than a step of the set-point on the bus"
_PHASE = "in which tick a status of every second tick comes is the same to all"
_A_MARGIN = "levels come in millimetres, and the limit has a margin of a tenth"
_FIRST = "before the first levels one more update by nothing, and after them a fresh start"
_AS_MANY = "a law answers as many commands as it names"
_LOSS = "a pascal at a metre a second: the valve does not move by that"
_NOT_NONE = "for the type checker: it is not None, and no place is 0"
_SHORTCUT = "all conditions are looked at, in the same order, where some would do"
NO_DIFFERENCE: dict[str, dict[str, str]] = {
    "utank_hil/runtime/supervisor.py": {
        ": _NEVER_NS: Final = 1 << 62 -> _NEVER_NS: Final = 2 << 62": _NEVER,
        ": _NEVER_NS: Final = 1 << 62 -> _NEVER_NS: Final = 1 << 63": _NEVER,
        "Supervisor.__init__: self._drive_enabled_ns = 0 -> ": _SET_FIRST,
        "Supervisor.__init__: self._drive_enabled_ns = 0 -> self._drive_enabled_ns = 1": _SET_FIRST,
        "Supervisor.__init__: self._zero_at_ns = _NEVER_NS -> ": _SET_FIRST,
        "Supervisor._continue_reset: seen.drive_out_ms = 0.0 -> seen.drive_out_ms = 1.0": _OF_40_MS,
        "Supervisor._begin_arming: seen.drive_out_ms = 0.0 -> seen.drive_out_ms = 1.0": _OF_40_MS,
    },
    "utank_hil/runtime/judging.py": {
        "_to_look_at: states = tuple((coded for coded in conditions if not coded[1].findings)) -> "
        "states = tuple((coded for coded in conditions if True))": _SHORTCUT,
        "_to_look_at: return lambda seen: conditions if seen.found & mask else states -> "
        "return lambda seen: conditions if True else states": _SHORTCUT,
        "_to_look_at: return lambda seen: conditions if seen.found & mask else states -> "
        "return lambda seen: conditions if seen.found | mask else states": _SHORTCUT,
        "_first_of.first: return None -> ": "a function that comes to its end returns None",
        ": _AWAITED: Final = sorted((coded for coded in _ALL if coded[1].awaited is not None), "
        "key=lambda coded: coded[1].awaited or 0) -> _AWAITED: Final = sorted((coded for coded in "
        "_ALL if coded[1].awaited is not None), key=lambda coded: coded[1].awaited)": (_NOT_NONE),
        ": _AWAITED: Final = sorted((coded for coded in _ALL if coded[1].awaited is not None), "
        "key=lambda coded: coded[1].awaited or 0) -> _AWAITED: Final = sorted((coded for coded in "
        "_ALL if coded[1].awaited is not None), key=lambda coded: coded[1].awaited or 1)": (
            _NOT_NONE
        ),
        ": first_lasting: Final = _first_of(_ENDING + tuple((c for c in _AWAITED if c not in "
        "_ENDING))) -> first_lasting: Final = _first_of(_ENDING + tuple((c for c in _AWAITED if "
        "True)))": _SHORTCUT,
    },
    "utank_hil/runtime/safety_limits.py": {
        "SafetyLimits: @dataclass(frozen=True, slots=True) -> "
        "@dataclass(frozen=False, slots=True)": _NOBODY_SETS,
    },
    "utank_hil/control/limiter.py": {
        "CommandLimiter.limit: if math.isfinite(desired_pa + level_m + level_rate_m_s): -> "
        "if math.isfinite(desired_pa + level_m - level_rate_m_s):": _SUM,
        "CommandLimiter.limit: if math.isfinite(desired_pa + level_m + level_rate_m_s): -> "
        "if math.isfinite(desired_pa - level_m + level_rate_m_s):": _SUM,
        "CommandLimiter._barrier_pa: if room_m <= 0.001: -> if room_m < 0.001:": _TOUCHING,
        "CommandLimiter._barrier_pa: if room_m <= 0.001: -> if room_m <= 0.00125:": _TOUCHING,
    },
    "utank_hil/canbus/endpoints.py": {
        ": _NO_COUNTER: Final = -1 -> _NO_COUNTER: Final = -2": "no counter has either value",
        "Receiver.__init__: self._run = 0 -> ": _SET_FIRST,
        "Receiver.__init__: self._run = 0 -> self._run = 1": _SET_FIRST,
        "Receiver.accept: if counter == self._expected: -> if False:": "the short way for most",
        "Receiver.accept: if self._bucket: -> if True:": "draining an empty bucket does nothing",
    },
    "utank_hil/runtime/inbox.py": {
        ": _ABSENT_NS: Final = 1 << 62 -> _ABSENT_NS: Final = 2 << 62": _NEVER,
        ": _ABSENT_NS: Final = 1 << 62 -> _ABSENT_NS: Final = 1 << 63": _NEVER,
        ": _Accept = Callable[[Frame], tuple[Any, ...] | None] -> "
        "_Accept = Callable[[Frame], tuple[Any, ...] & None]": "a type that nothing runs",
        "Inbox._on_either_motion: if math.isfinite(motion.roll_rad + "
        "motion.roll_rate_rad_s) and (gate is None or gate.passes(motion.roll_rad, "
        "motion.roll_rate_rad_s, now_ns)): -> if math.isfinite(motion.roll_rad - "
        "motion.roll_rate_rad_s) and (gate is None or gate.passes(motion.roll_rad, "
        "motion.roll_rate_rad_s, now_ns)):": _SUM,
        "Inbox._on_motion: if math.isfinite(motion.roll_rad + motion.roll_rate_rad_s) and "
        "(self._gates is None or self._gates.motion.passes(motion.roll_rad, "
        "motion.roll_rate_rad_s, now_ns)): -> if math.isfinite(motion.roll_rad - "
        "motion.roll_rate_rad_s) and (self._gates is None or "
        "self._gates.motion.passes(motion.roll_rad, motion.roll_rate_rad_s, now_ns)):": _SUM,
        "Inbox._on_tank: if abs(port_m - starboard_m) <= 2 * self._most_level_m and "
        "abs(port_m + starboard_m) <= self._most_sum_m and (self._gates is None or "
        "self._gates.levels_pass(port_m, starboard_m, now_ns)): -> if abs(port_m - "
        "starboard_m) < 2 * self._most_level_m and abs(port_m + starboard_m) <= "
        "self._most_sum_m and (self._gates is None or self._gates.levels_pass(port_m, "
        "starboard_m, now_ns)):": _A_MARGIN,
        "Inbox._on_tank: if abs(port_m - starboard_m) <= 2 * self._most_level_m and "
        "abs(port_m + starboard_m) <= self._most_sum_m and (self._gates is None or "
        "self._gates.levels_pass(port_m, starboard_m, now_ns)): -> if abs(port_m - "
        "starboard_m) <= 2 * self._most_level_m and abs(port_m + starboard_m) < "
        "self._most_sum_m and (self._gates is None or self._gates.levels_pass(port_m, "
        "starboard_m, now_ns)):": _A_MARGIN,
        "Inbox._count_cycles: if behind_ns > self._tank_patience_ns: -> "
        "if behind_ns >= self._tank_patience_ns:": _A_NANOSECOND,
    },
    "utank_hil/runtime/controller_node.py": {
        ": QUIET_START_NS: Final = 10000000000 -> QUIET_START_NS: Final = 10000000001": (
            _A_NANOSECOND
        ),
        "ControllerSettings: @dataclass(frozen=True, slots=True) -> "
        "@dataclass(frozen=False, slots=True)": _NOBODY_SETS,
        "ControllerNode.__init__: self.start_ns = self.last_ns = 0 -> ": _SET_FIRST,
        "ControllerNode.__init__: self.start_ns = self.last_ns = 0 -> "
        "self.start_ns = self.last_ns = 1": _SET_FIRST,
        "ControllerNode.__init__: self._law_pa = self._law_loss = 0.0 -> ": _SET_FIRST,
        "ControllerNode.__init__: self._law_pa = self._law_loss = 0.0 -> "
        "self._law_pa = self._law_loss = 1.0": _SET_FIRST,
        "ControllerNode.__init__: self._all_due = True -> ": _SET_FIRST,
        "ControllerNode.__init__: self._all_due = True -> self._all_due = False": _SET_FIRST,
        "ControllerNode.__init__: self._frames_sent = 0 -> self._frames_sent = 1": (
            "a frame more in the first second's load"
        ),
        "ControllerNode._note_applied: if name == VALVE and self._valve is not None: -> "
        "if name == VALVE:": "a law that commands a valve has one",
        "ControllerNode.stop: self.command_pa = 0.0 -> self.command_pa = 1.0": _ROUNDED,
        "ControllerNode._control: if not math.isfinite(self._law_pa + self._law_loss): -> "
        "if not math.isfinite(self._law_pa - self._law_loss):": _SUM,
        "ControllerNode._estimate: if (now_ns - inbox.tank_ns) * NANOSECONDS > level.next_due_s: "
        "-> if (now_ns - inbox.tank_ns) * NANOSECONDS >= level.next_due_s:": _BETWEEN,
        "ControllerNode._update_alarms: self._alarming = self._alarming or mode is not Mode.INIT "
        "or now_ns - self.start_ns >= QUIET_START_NS -> self._alarming = self._alarming or mode "
        "is not Mode.INIT or now_ns - self.start_ns > QUIET_START_NS": _A_NANOSECOND,
        "ControllerNode.__init__: self._observed_cycles = 0 -> self._observed_cycles = 1": _FIRST,
        "ControllerNode._look_at_motion: estimate = estimator.sample(now_ns, "
        "inbox.pressure_pa, (inbox.roll_rad, inbox.roll_rate_rad_s, inbox.level_m), "
        "fresh=max(seen.motion_age_ms, seen.tank_age_ms) <= FRESH_MS) -> estimate = "
        "estimator.sample(now_ns, inbox.pressure_pa, (inbox.roll_rad, inbox.roll_rate_rad_s, "
        "inbox.level_m), fresh=max(seen.motion_age_ms, seen.tank_age_ms) < FRESH_MS)": _AT_50_MS,
        "ControllerNode._control: self._law_pa = 0.0 -> self._law_pa = 1.0": _ROUNDED,
        "ControllerNode._answer: self._retuning.update(now_ns, "
        "self.inbox.stations.take_retuning(), engaged=self.supervisor.demand is "
        "Demand.CONTROL, fresh=max(seen.motion_age_ms, seen.tank_age_ms) <= FRESH_MS, "
        "passive_roll_rad=self.twin_roll_rad) -> self._retuning.update(now_ns, "
        "self.inbox.stations.take_retuning(), engaged=self.supervisor.demand is "
        "Demand.CONTROL, fresh=max(seen.motion_age_ms, seen.tank_age_ms) < FRESH_MS, "
        "passive_roll_rad=self.twin_roll_rad)": _AT_50_MS,
        "ControllerNode._answer: answered = dict(zip(self._law_commands, answer, "
        "strict=False)) -> answered = dict(zip(self._law_commands, answer, strict=True))": _AS_MANY,
        "ControllerNode._answer: return (float(answered.get(PRESSURE, 0.0)), "
        "float(answered.get(VALVE, 0.0))) -> return (float(answered.get(PRESSURE, 1.0)), "
        "float(answered.get(VALVE, 0.0)))": _ROUNDED,
        "ControllerNode._answer: return (float(answered.get(PRESSURE, 0.0)), "
        "float(answered.get(VALVE, 0.0))) -> return (float(answered.get(PRESSURE, 0.0)), "
        "float(answered.get(VALVE, 1.0)))": _LOSS,
    },
    "firmware_sim/drive.py": {
        ": STOPPED_SHARE = 0.02 -> STOPPED_SHARE = 0.025": _A_QUARTER,
        ": LONGEST_STOP_NS = 500000000 -> LONGEST_STOP_NS = 500000001": _A_NANOSECOND,
        "PumpDrive.__init__: self._accepted_ns = 0 -> self._accepted_ns = 1": _A_NANOSECOND,
        "PumpDrive.__init__: self._timeout_ns = 0 -> self._timeout_ns = 1": _A_NANOSECOND,
        "PumpDrive.__init__: self._moving_ns = 0 -> ": _SET_FIRST,
        "PumpDrive.__init__: self._moving_ns = 0 -> self._moving_ns = 1": _SET_FIRST,
        "PumpDrive.__init__: self._setpoint_pa = 0.0 -> ": _SET_FIRST,
        "PumpDrive.__init__: self._shown_state = self._states.state -> ": _SET_FIRST,
        "PumpDrive._permitted: if not abs(pressure_pa) <= limits.pressure_pa + "
        "ROUNDING_PA: -> if not abs(pressure_pa) < limits.pressure_pa + ROUNDING_PA:": _BETWEEN,
        "PumpDrive._permitted: return False -> return None": _FALSE,
        "PumpDrive._permitted: return False -> return None (2)": _FALSE,
        "PumpDrive._permitted: return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) "
        "+ 2 * ROUNDING_PA -> return step_pa <= self._reach_pa(now_ns) + 2 * ROUNDING_PA": _ROUNDED,
        "PumpDrive._permitted: return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) "
        "+ 2 * ROUNDING_PA -> return step_pa == 1.0 or step_pa <= self._reach_pa(now_ns) + "
        "2 * ROUNDING_PA": _ROUNDED,
        "PumpDrive._permitted: return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) "
        "+ 2 * ROUNDING_PA -> return step_pa == 0.0 or step_pa < self._reach_pa(now_ns) + "
        "2 * ROUNDING_PA": _ROUNDED,
        "PumpDrive._permitted: return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) "
        "+ 2 * ROUNDING_PA -> return step_pa == 0.0 or step_pa <= self._reach_pa(now_ns) + "
        "3 * ROUNDING_PA": _ROUNDED,
        "PumpDrive._step_away_pa: toward_zero = abs(pressure_pa) <= abs(setpoint_pa) and "
        "pressure_pa * setpoint_pa >= 0.0 -> toward_zero = abs(pressure_pa) < "
        "abs(setpoint_pa) and pressure_pa * setpoint_pa >= 0.0": _SAME,
        "PumpDrive._step_away_pa: return 0.0 if toward_zero else abs(pressure_pa - "
        "setpoint_pa) -> return 1.0 if toward_zero else abs(pressure_pa - setpoint_pa)": _ROUNDED,
        "PumpDrive.tick: if self._ticks % self._status_1_ticks == 0 or states.state is not "
        "self._shown_state: -> if self._ticks % self._status_1_ticks != 0 or states.state "
        "is not self._shown_state:": _PHASE,
        "PumpDrive.tick: if self._ticks % self._status_1_ticks == 0 or states.state is not "
        "self._shown_state: -> if self._ticks % self._status_1_ticks == 1 or states.state "
        "is not self._shown_state:": _PHASE,
        "PumpDrive.tick: self._ticks += 1 -> self._ticks -= 1": _PHASE,
        "PumpDrive._stopped: return share < STOPPED_SHARE or now_ns - self._moving_ns > "
        "LONGEST_STOP_NS -> return share <= STOPPED_SHARE or now_ns - self._moving_ns > "
        "LONGEST_STOP_NS": _BETWEEN,
        "PumpDrive._stopped: return share < STOPPED_SHARE or now_ns - self._moving_ns > "
        "LONGEST_STOP_NS -> return share < STOPPED_SHARE or now_ns - self._moving_ns >= "
        "LONGEST_STOP_NS": _BETWEEN,
    },
    "firmware_sim/drive_states.py": {
        "DriveStates.command: return -> ": "in FAULT no other word has a transition",
    },
}


@dataclass(frozen=True)
class Target:
    """One file of the safety code.

    Attributes
    ----------
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
    Target("utank_hil/control/limits.py", ("tests/control/test_limiter.py",)),
    Target("utank_hil/control/limiter.py", ("tests/control/test_limiter.py",)),
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
        (
            "tests/runtime/test_alarms.py",
            "tests/runtime/test_valve_command.py",
            "tests/runtime/test_pump_that_is_off.py",
            "tests/runtime/test_law_that_starts_anew.py",
            "tests/runtime/test_estimates_on_the_bus.py",
            *_NODE,
        ),
        (
            "tests/runtime/test_lost_levels.py",
            "tests/runtime/test_monitoring.py",
            "tests/runtime/test_lockstep.py",
            "tests/runtime/test_invariants.py",
            "tests/firmware_sim/test_vessel_without_pump.py",
            "tests/faults/test_retuning_events.py",
        ),
    ),
)
