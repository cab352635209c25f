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
_LOSS = "a pascal at a metre a second: the valve does not move by that"
_NOT_NONE = "for the type checker: it is not None, and no place is 0"
_LONG_AGO = "any time so long ago is as good"
_ANEW = "the first frame is one of a panel that starts anew, whatever else"
_LONGER_WAY = "what is not there adds nothing, to rounding: the longer way to the same"
_DIFFERENCES = "only differences of it are used"
_NEVER_THERE = "no computed value is exactly there"
_AT_THE_BOUND = "a value at the bound is the bound"
_SHORTCUT = "all conditions are looked at, in the same order, where some would do"
_TEN_OR_MORE = "it is zero, or ten or more"
NO_DIFFERENCE: dict[str, dict[str, str]] = {
    "utank_hil/safety/monitors/standstill.py": {
        "Standstill.__init__: self._same = self.still = 0 -> ": _SET_FIRST,
        "Standstill.__init__: self._same = self.still = 0 -> self._same = self.still = 1": (
            _SET_FIRST
        ),
        "Standstill.take: if abs(step_m - self._step_m) > JERK_M: -> "
        "if abs(step_m - self._step_m) >= JERK_M:": _NEVER_THERE,
        "Standstill.take: if self.still or (self._same == STILL_LEVELS and self._noisy > "
        "_LEFT_OF_IT): -> if self.still or (self._same == STILL_LEVELS and self._noisy >= "
        "_LEFT_OF_IT):": _NEVER_THERE,
        "gauges_stand_still: return one > 0 and other > 0 or one >= STILL_ALONE or other >= "
        "STILL_ALONE -> return one > 1 and other > 0 or one >= STILL_ALONE or other >= "
        "STILL_ALONE": _TEN_OR_MORE,
        "gauges_stand_still: return one > 0 and other > 0 or one >= STILL_ALONE or other >= "
        "STILL_ALONE -> return one > 0 and other > 1 or one >= STILL_ALONE or other >= "
        "STILL_ALONE": _TEN_OR_MORE,
    },
    "utank_hil/safety/supervisor.py": {
        "Supervisor.__init__: self._enabling_until_ns = 0 -> self._enabling_until_ns = 1": (
            "PASSIVE is never at the beginning of the clock"
        ),
        "Supervisor._note_passive_drive: self._enabling_until_ns = 0 -> "
        "self._enabling_until_ns = 1": "a nanosecond after the beginning of the clock, likewise",
        ": _NEVER_NS: Final = 1 << 62 -> _NEVER_NS: Final = 2 << 62": _NEVER,
        ": _NEVER_NS: Final = 1 << 62 -> _NEVER_NS: Final = 1 << 63": _NEVER,
        "Supervisor.__init__: self._begin_noting(0) -> ": _SET_FIRST,
        "Supervisor.__init__: self._begin_noting(0) -> self._begin_noting(1)": _SET_FIRST,
        "Supervisor.__init__: self._zero_at_ns = _NEVER_NS -> ": _SET_FIRST,
        "Supervisor._note_drive: if enabled and departures <= DEPARTURES: -> "
        "if enabled and departures < DEPARTURES:": _NEVER_THERE,
        "Supervisor._continue_reset: seen.drive_out_ms = 0.0 -> seen.drive_out_ms = 1.0": _OF_40_MS,
        "Supervisor._begin_arming: seen.drive_out_ms = 0.0 -> seen.drive_out_ms = 1.0": _OF_40_MS,
    },
    "utank_hil/safety/judging.py": {
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
    "utank_hil/safety/safety_limits.py": {
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
    "utank_hil/nodes/orders.py": {
        ": NEVER_HEARD_NS: Final = -(1 << 62) -> NEVER_HEARD_NS: Final = -(2 << 62)": _LONG_AGO,
        ": NEVER_HEARD_NS: Final = -(1 << 62) -> NEVER_HEARD_NS: Final = -(1 << 63)": _LONG_AGO,
        "Orders.accept: heard = order or self.receiver.intact(frame) -> "
        "heard = self.receiver.intact(frame)": _LONGER_WAY,
        "Orders.__init__: self._out_of_sequence = 0 -> self._out_of_sequence = 1": _ANEW,
        "Orders.obey: if before is None or self._anew or "
        "now_ns - self.heard_ns > self._gap_ns: -> "
        "if self._anew or now_ns - self.heard_ns > self._gap_ns:": _ANEW,
    },
    "utank_hil/nodes/hardwired.py": {
        "HardwiredHeard.accept: heard = inputs or self.receiver.intact(frame) -> "
        "heard = self.receiver.intact(frame)": _LONGER_WAY,
    },
    "utank_hil/nodes/inbox.py": {
        "Inbox.__init__: self._second_beat = 0 -> self._second_beat = 1": (
            "no heartbeat has either identifier"
        ),
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
        "(self._gates is None or self._gates.motions[0].passes(motion.roll_rad, "
        "motion.roll_rate_rad_s, now_ns)): -> if math.isfinite(motion.roll_rad - "
        "motion.roll_rate_rad_s) and (self._gates is None or "
        "self._gates.motions[0].passes(motion.roll_rad, motion.roll_rate_rad_s, now_ns)):": _SUM,
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
    "utank_hil/nodes/controller.py": {
        "ControllerNode.__init__: self._engaged = self._interrupted = False -> "
        "self._engaged = self._interrupted = True": "nobody is in charge at the first answer",
        "ControllerNode._note_causes: if first_stopping(seen, supervisor.limits): -> if True:": (
            "a shortcut: nothing stops the pump then"
        ),
        "ControllerNode._note_causes: if supervisor.degraded: -> if True:": (
            "a shortcut: nothing halves the pressure then"
        ),
        ": QUIET_START_NS: Final = 10000000000 -> QUIET_START_NS: Final = 10000000001": (
            _A_NANOSECOND
        ),
        "ControllerSettings: @dataclass(frozen=True, slots=True) -> "
        "@dataclass(frozen=False, slots=True)": _NOBODY_SETS,
        "ControllerNode._observe: held_pa = 0.0 if valve is None else valve.held_pa(self.inbox, "
        "rate_m_s) -> held_pa = 1.0 if valve is None else valve.held_pa(self.inbox, rate_m_s)": (
            "1 Pa beside the 5 kPa from which the tank's equation judges"
        ),
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
        "ControllerNode._fresh: return max(self.seen.motion_age_ms, self.seen.tank_age_ms) <= "
        "FRESH_MS -> return max(self.seen.motion_age_ms, self.seen.tank_age_ms) < FRESH_MS": (
            _AT_50_MS
        ),
        "ControllerNode.__init__: self._watched_share, self._watched_step = (0.0, 1.0) -> "
        "self._watched_share, self._watched_step = (0.0, 1.25)": "more than all is all",
        "ControllerNode._watch: if seen.motion_age_ms > limits.motion_age_ms or seen.tank_age_ms > "
        "limits.tank_age_ms: -> if seen.motion_age_ms >= limits.motion_age_ms or "
        "seen.tank_age_ms > limits.tank_age_ms:": _AT_THE_BOUND,
        "ControllerNode._watch: if seen.motion_age_ms > limits.motion_age_ms or seen.tank_age_ms > "
        "limits.tank_age_ms: -> if seen.motion_age_ms > limits.motion_age_ms or "
        "seen.tank_age_ms >= limits.tank_age_ms:": _AT_THE_BOUND,
        "ControllerNode._control: self._law_pa = 0.0 -> self._law_pa = 1.0": _ROUNDED,
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
        "PumpDrive.__init__: self._accepted_ns = 0 -> ": _SET_FIRST,
        "PumpDrive.__init__: self._accepted_ns = 0 -> self._accepted_ns = 1": _SET_FIRST,
        "PumpDrive.__init__: self._timeout_ns = 0 -> ": _SET_FIRST,
        "PumpDrive.__init__: self._timeout_ns = 0 -> self._timeout_ns = 1": _SET_FIRST,
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
    "utank_hil/safety/monitors/level_stuck.py": {
        "LevelStuck.restart: self._moved_m = self._rate_m_s = 0.0 -> ": _SET_FIRST,
        "LevelStuck.restart: self._moved_m = self._rate_m_s = 0.0 -> "
        "self._moved_m = self._rate_m_s = 1.0": _SET_FIRST,
        "LevelStuck.update: return _LEVEL_STUCK if abs(self._moved_m) > BANDS * self._band_m "
        "else 0 -> return _LEVEL_STUCK if abs(self._moved_m) >= BANDS * self._band_m else 0": (
            _NEVER_THERE
        ),
    },
    "utank_hil/safety/monitors/noise.py": {
        "within: return -most if value < -most else most if value > most else value -> "
        "return -most if value <= -most else most if value > most else value": _AT_THE_BOUND,
        "within: return -most if value < -most else most if value > most else value -> "
        "return -most if value < -most else most if value >= most else value": _AT_THE_BOUND,
    },
    "utank_hil/safety/monitors/spikes.py": {
        "SpikeGate.__init__: self._value_ns = -(1 << 62) -> self._value_ns = -(2 << 62)": _LONG_AGO,
        "SpikeGate.__init__: self._value_ns = -(1 << 62) -> self._value_ns = -(1 << 63)": _LONG_AGO,
        "SpikeGate.__init__: self._in_a_row = 0 -> ": _SET_FIRST,
        "SpikeGate.__init__: self._in_a_row = 0 -> self._in_a_row = 1": _SET_FIRST,
    },
    "utank_hil/safety/monitors/senders.py": {
        "Stream.update: if receiver.changes: -> if True:": (
            "a shortcut: without changes nothing is taken off"
        ),
        "Senders.__init__: self._now_s = 0.0 -> self._now_s = 1.0": _DIFFERENCES,
        "Senders.__init__: self._damaged_s = [-math.inf] * DAMAGED_FRAMES -> "
        "self._damaged_s = [-3.141592653589793] * DAMAGED_FRAMES": _LONG_AGO,
        "Senders.update: if stream.damaged: -> if True:": "no frames more are no change",
    },
    "utank_hil/safety/monitors/drive.py": {
        "DriveFollowing.__init__: self._enabled = False -> self._enabled = True": (
            "what has just begun may begin again"
        ),
        "DriveFollowing._judge: along_pa = pressure_pa if expected_pa > 0 else -pressure_pa -> "
        "along_pa = pressure_pa if expected_pa >= 0 else -pressure_pa": (
            "where none is expected both ways are judged alike"
        ),
        "Saturation.__init__: self._found = False -> self._found = True": (
            "the first update is of no side yet, and sets it"
        ),
        "Saturation.update: side = math.copysign(1.0, command_pa) -> "
        "side = math.copysign(1.25, command_pa)": "only its sign is used",
    },
    "utank_hil/safety/monitors/motion.py": {
        "Stuck.update: self._sum_rad = keep * (self._sum_rad + left_rad) -> "
        "self._sum_rad = keep * (self._sum_rad - left_rad)": "the same sum with the other sign",
        "RollAgainstRate.update: if abs(summed_rad) < 0.5 * limit_rad: -> "
        "if abs(summed_rad) <= 0.5 * limit_rad:": _NEVER_THERE,
    },
    "utank_hil/safety/monitors/motion_sign.py": {
        "SignTest._judge: if evidence < STEP and self._elapsed_s < LONGEST_S: -> "
        "if evidence <= STEP and self._elapsed_s < LONGEST_S:": _NEVER_THERE,
        "SignTest._judge: if judged and evidence >= LEAST: -> "
        "if judged and evidence > LEAST:": _NEVER_THERE,
    },
    "utank_hil/safety/monitors/repetition.py": {
        ": MIXED: Final = 7.0 -> MIXED: Final = 8.75": "any mixture is as good",
        "Repetition.take: sample = roll_rad + MIXED * rate_rad_s -> "
        "sample = roll_rad - MIXED * rate_rad_s": "any mixture is as good",
        "Repetition.take: if before is not None or self._lag: -> if True:": _SHORTCUT,
        "Repetition._follow: if self._lag and kept[place - self._lag] == sample: -> "
        "if kept[place - self._lag] == sample:": "without a lag it is the oldest sample's place",
        "Repetition._follow: self._lag = 0 if before is None else (place - before) % len(kept) or "
        "len(kept) -> self._lag = 1 if before is None else (place - before) % len(kept) or "
        "len(kept)": "no sample counts that is the last",
    },
    "utank_hil/safety/monitors/motion_watch.py": {
        "MotionWatch.__init__: self._last_rate_rad_s = 0.0 -> self._last_rate_rad_s = 1.0": (
            "the first sample has none before it to be compared with"
        ),
        "MotionWatch.__init__: self.heard_ns = 0 -> self.heard_ns = 1": (
            "how far she turned before the first sample is not used"
        ),
    },
    "utank_hil/safety/monitors/motion_pair.py": {
        "MotionPair._compare: over = abs(self._roll_rad) > self._roll_limit_rad or "
        "abs(self._rate_rad_s) > self._rate_limit_rad_s -> over = abs(self._roll_rad) >= "
        "self._roll_limit_rad or abs(self._rate_rad_s) > self._rate_limit_rad_s": _NEVER_THERE,
        "MotionPair._compare: over = abs(self._roll_rad) > self._roll_limit_rad or "
        "abs(self._rate_rad_s) > self._rate_limit_rad_s -> over = abs(self._roll_rad) > "
        "self._roll_limit_rad or abs(self._rate_rad_s) >= self._rate_limit_rad_s": _NEVER_THERE,
    },
    "utank_hil/safety/monitors/thresholds.py": {
        "SensorFigures: @dataclass(frozen=True, slots=True) -> "
        "@dataclass(frozen=False, slots=True)": _NOBODY_SETS,
        "MonitorThresholds: @dataclass(frozen=True, slots=True) -> "
        "@dataclass(frozen=False, slots=True)": _NOBODY_SETS,
        "_unconfirmed_share: heel_rad = abs(np.linalg.solve(stiffness, [0.0, push_n])[0]) -> "
        "heel_rad = abs(np.linalg.solve(stiffness, [1.0, push_n])[0])": (
            "a newton metre heels no ship"
        ),
        "_unconfirmed_share: least = UNCONFIRMED_SHARE * heel_rad <= "
        "math.radians(UNCONFIRMED_HEEL_DEG) -> least = UNCONFIRMED_SHARE * heel_rad < "
        "math.radians(UNCONFIRMED_HEEL_DEG)": _AT_THE_BOUND,
    },
    "utank_hil/safety/passive_twin.py": {
        "PassiveTwin.__init__: def __init__(self, ship: RollShip, tank: Tank, period_s: float, "
        "least_roll_rad: float, open_loss: float=0.0, *, room: float=1.0) -> None: -> def "
        "__init__(self, ship: RollShip, tank: Tank, period_s: float, least_roll_rad: float, "
        "open_loss: float=1.0, *, room: float=1.0) -> None:": _LOSS,
        "PassiveTwin.update: if not abs(float(made[0])) < MOST_MADE_RAD: -> if not "
        "abs(float(made[0])) <= MOST_MADE_RAD:": "no pump makes exactly one radian",
        "PassiveTwin.update: made[:4] = 0.0 -> made[:5] = 0.0": _SET_FIRST,
        **dict.fromkeys(
            (
                "PassiveTwin.take: self._straight = len(self._pieces) == 1 and "
                f"(not any(self._pieces[0][:-2])) -> self._straight = {straight}"
                for straight in (
                    "len(self._pieces) != 1 and (not any(self._pieces[0][:-2]))",
                    "len(self._pieces) == 2 and (not any(self._pieces[0][:-2]))",
                    "len(self._pieces) == 1 and (not any(self._pieces[0][:2]))",
                )
            ),
            _LONGER_WAY,
        ),
        "PassiveTwin.take: self._straight = len(self._pieces) == 1 and "
        "(not any(self._pieces[0][:-2])) -> self._straight = not any(self._pieces[0][:-2])": (
            "no table of levers begins with a piece that is exactly straight"
        ),
        "PassiveTwin.take: self._straight = len(self._pieces) == 1 and "
        "(not any(self._pieces[0][:-2])) -> self._straight = len(self._pieces) == 1 and "
        "(not any(self._pieces[0][:-3]))": "an odd polynomial has no even power",
        "PassiveTwin.update: if self._damping or not self._straight: -> if True:": _LONGER_WAY,
        "PassiveTwin.update: if self._loss: -> if True:": _LONGER_WAY,
        "PassiveTwin._moment_beside_nm: if self._straight: -> if False:": _LONGER_WAY,
        "PassiveTwin._moment_beside_nm: return moment_nm -> ": _LONGER_WAY,
        "PassiveTwin._judge: if before_s < -self._anew_s <= self._losing_s: -> if before_s <= "
        "-self._anew_s <= self._losing_s:": _NEVER_THERE,
        "PassiveTwin._judge: if before_s < -self._anew_s <= self._losing_s: -> if before_s < "
        "-self._anew_s < self._losing_s:": _NEVER_THERE,
        "PassiveTwin._judge: on_record = self.amplified or self._record_power > self._record ** 2 "
        "* self._twin_record_power -> on_record = self.amplified or self._record_power >= "
        "self._record ** 2 * self._twin_record_power": _NEVER_THERE,
        "PassiveTwin._judge: self.amplified = self._losing_s > self._patience_s -> "
        "self.amplified = self._losing_s >= self._patience_s": _NEVER_THERE,
        "PassiveTwin._righting_nm: if heel > self._piece_rad: -> if heel >= self._piece_rad:": (
            "where two pieces meet they are equal"
        ),
        "PassiveTwin._righting_nm: index = min(int(heel / self._piece_rad), len(self._pieces) - 1) "
        "-> index = min(int(heel / self._piece_rad), len(self._pieces) - 2)": (
            "the last two pieces are one polynomial: there is no knot between them"
        ),
        "PassiveTwin._righting_nm: return value if roll_rad >= 0 else -value -> "
        "return value if roll_rad > 0 else -value": "upright it is zero either way",
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


_NODE = (
    "tests/nodes/test_controller.py",
    "tests/nodes/test_controller_faults.py",
    "tests/nodes/test_law_that_plans.py",
)
_SUPERVISOR = "tests/safety/test_supervisor.py"
_MONITORS = "utank_hil/safety/monitors"

TARGETS = (
    Target("utank_hil/safety/supervisor.py", (_SUPERVISOR,), _NODE),
    Target("utank_hil/safety/judging.py", (_SUPERVISOR,), ("tests/safety/test_alarms.py",)),
    Target(
        "utank_hil/safety/safety_limits.py",
        (_SUPERVISOR, "tests/safety/test_safety_limits.py"),
        _NODE,
    ),
    Target("utank_hil/control/limits.py", ("tests/control/test_limiter.py",)),
    Target("utank_hil/control/limiter.py", ("tests/control/test_limiter.py",)),
    Target(
        "utank_hil/canbus/endpoints.py",
        ("tests/canbus/test_endpoints.py",),
        ("tests/canbus/test_codec.py", "tests/nodes/test_orders.py"),
    ),
    Target("utank_hil/canbus/e2e.py", ("tests/canbus/test_e2e.py",)),
    Target(
        "utank_hil/nodes/inbox.py",
        ("tests/nodes/test_inbox.py",),
        (
            "tests/nodes/test_lost_levels.py",
            "tests/nodes/test_valve_command.py",
            "tests/nodes/test_stations.py",
            "tests/safety/test_monitoring.py",
            *_NODE,
        ),
    ),
    Target("utank_hil/nodes/command_echo.py", ("tests/nodes/test_command_echo.py",)),
    Target(
        "utank_hil/nodes/orders.py",
        ("tests/nodes/test_orders.py",),
        ("tests/nodes/test_stations.py", "tests/nodes/test_inbox.py", *_NODE),
    ),
    Target(
        "utank_hil/nodes/stations.py",
        ("tests/nodes/test_stations.py",),
        ("tests/nodes/test_inbox.py", *_NODE),
    ),
    Target("utank_hil/nodes/hardwired.py", ("tests/nodes/test_hardwired.py",), _NODE),
    Target("firmware_sim/drive.py", ("tests/firmware_sim/test_drive.py",)),
    Target("firmware_sim/drive_states.py", ("tests/firmware_sim/test_drive_states.py",)),
    Target(
        "utank_hil/nodes/controller.py",
        (
            "tests/safety/test_alarms.py",
            "tests/nodes/test_valve_command.py",
            "tests/nodes/test_pump_that_is_off.py",
            "tests/nodes/test_law_that_starts_anew.py",
            "tests/nodes/test_estimates_on_the_bus.py",
            *_NODE,
        ),
        (
            "tests/nodes/test_lost_levels.py",
            "tests/safety/test_monitoring.py",
            "tests/runners/test_lockstep.py",
            "tests/nodes/test_invariants.py",
            "tests/firmware_sim/test_vessel_without_pump.py",
            "tests/faults/test_retuning_events.py",
        ),
    ),
    Target(
        f"{_MONITORS}/level_stuck.py",
        ("tests/safety/monitors/test_level_stuck.py",),
        ("tests/safety/monitors/test_tank_equation.py",),
    ),
    Target(f"{_MONITORS}/volume.py", ("tests/safety/monitors/test_volume.py",)),
    Target(f"{_MONITORS}/noise.py", ("tests/safety/monitors/test_noise.py",)),
    Target(
        f"{_MONITORS}/spikes.py",
        ("tests/safety/monitors/test_spikes.py",),
        ("tests/safety/test_monitoring.py",),
    ),
    Target(f"{_MONITORS}/senders.py", ("tests/safety/monitors/test_senders.py",)),
    Target(
        f"{_MONITORS}/drive.py",
        ("tests/safety/monitors/test_drive_following.py",),
        ("tests/safety/monitors/test_drive_of_the_first_ship.py",),
    ),
    Target(
        f"{_MONITORS}/motion.py",
        ("tests/safety/monitors/test_motion_sums.py",),
        ("tests/safety/monitors/test_roll_against_rate.py",),
    ),
    Target(
        f"{_MONITORS}/motion_sign.py",
        ("tests/safety/monitors/test_motion_sign.py",),
        ("tests/safety/monitors/test_motion_sums.py",),
    ),
    Target(f"{_MONITORS}/standstill.py", ("tests/safety/monitors/test_standstill.py",)),
    Target(f"{_MONITORS}/repetition.py", ("tests/safety/monitors/test_repetition.py",)),
    Target(
        f"{_MONITORS}/motion_watch.py",
        ("tests/safety/monitors/test_motion_watch.py",),
        ("tests/safety/test_monitoring.py",),
    ),
    Target(f"{_MONITORS}/motion_pair.py", ("tests/safety/monitors/test_motion_pair.py",)),
    Target(f"{_MONITORS}/thresholds.py", ("tests/safety/monitors/test_thresholds.py",)),
    Target(
        "utank_hil/safety/passive_twin.py",
        ("tests/safety/test_passive_twin_judging.py",),
        ("tests/safety/test_passive_twin.py",),
    ),
)
