"""All monitors of a controller node, fed once a tick; one look is due in each tick.

Motion, drive, twin and levels are looked at every 50 ms, all else every 100 ms. So a tick pays for
one look, and the running integral of the rate is all that is done in every tick. What was due in
ticks that the loop has lost is done in the next one: models of equal steps stay in time.
"""

import math
from collections.abc import Callable, Collection, Iterable
from typing import Final

from utank_hil.base.tick import LONG_AGO_NS, TICK_NS, TICK_S
from utank_hil.canbus import PassiveTwin as PassiveTwinMessage
from utank_hil.canbus import Quality
from utank_hil.canbus.enumerations import DriveState
from utank_hil.canbus.events import ModelSummary
from utank_hil.canbus.measurements import Measurements
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.retuning.estimate import ShipFigures
from utank_hil.safety.monitors.drive import DriveFollowing, Saturation
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.harbour import HarbourWatch
from utank_hil.safety.monitors.level_stuck import LevelStuck, Volume
from utank_hil.safety.monitors.motion import MotionPair, MotionWatch, SpikeCount
from utank_hil.safety.monitors.senders import MEAN_FRAME_BITS, Heard, Senders, Stream
from utank_hil.safety.monitors.tank_equation import TankEquation
from utank_hil.safety.monitors.thresholds import MonitorThresholds, SensorFigures, thresholds_of
from utank_hil.safety.passive_twin import PassiveTwin
from utank_hil.safety.situation import OwnState

ROUND_TICKS: Final = 10
LONG_S: Final = ROUND_TICKS * TICK_S
SHORT_TICKS: Final = ROUND_TICKS // 2
"""Most ticks that are made up for: nothing is then done twice with the same sample."""
SHORT_S: Final = SHORT_TICKS * TICK_S
STALE_MS: Final = 100.0
"""Older measurements are a gap, after which a comparison begins anew."""
SILENT_S: Final = 1.0
"""A longer silence is judged by its own row of the fault table."""
BACKLOG_NS: Final = 200_000_000
"""What is received first may have waited in the interface's queue, and be old."""
GAP_PERIODS: Final = 0.05
"""Of the roll's: over a gap so long roll and level run straight, to a hundredth of their swing."""
LATE_ROUND_S: Final = 1.5 * LONG_S
"""Never less, however small the ship."""
UNWATCHED_PERIODS: Final = 1.0
LONG_PERIODS: Final = 3.0
"""So long longer gaps may keep the tank's equation from judging, though measurements come."""

ROOM_OF_VALVE: Final = 1.1
"""On the twin's thresholds: the loss of a valve is known by half."""
MOST_CHANGE: Final = 10.0
"""Of inertia and stiffness by loading, either way: more is an error of the identification."""
MOST_DAMPING_RATIO: Final = 1.0
"""Of ship and tank, as identified."""

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_DRIVE_ENABLED: Final = DriveState.OPERATION_ENABLED
_UNWATCHED_LONG: Final = Finding.UNWATCHED | Finding.UNWATCHED_LONG

# places of the looks in `Monitors._looks`, and in which tick of a round each is due
_MOTION, _DRIVE, _TWIN, _WATER, _LEVELS, _BUS = range(6)
_ROUND: Final = (
    *(_MOTION, _DRIVE, _TWIN, _WATER, _LEVELS),
    *(_MOTION, _DRIVE, _TWIN, _BUS, _LEVELS),
)


class Monitors:
    """The monitors of one ship.

    `roll_limit_rad` is the largest roll under control, `bit_rate` that of the bus. `compares` says
    whether the law is meant to roll the ship less than its passive twin; one without a loop is
    not. `motion_cycles_s` are the times between two samples of each motion sensor, `of_hull` says
    whether the ship has hull data. `harbour` judges the water, which is held or creeps, in the
    place of the monitors of water that swings.
    """

    def __init__(
        self,
        plant: DesignPlant,
        roll_limit_rad: float,
        sensors: SensorFigures,
        bit_rate: int,
        *,
        compares: bool = True,
        second_motion: bool = False,
        motion_cycles_s: tuple[float, ...] = (TICK_S, TICK_S),
        of_hull: bool = False,
        harbour: HarbourWatch | None = None,
    ) -> None:
        self.thresholds: MonitorThresholds = thresholds_of(
            plant, roll_limit_rad, sensors, of_hull=of_hull
        )
        thresholds, ship, tank = self.thresholds, plant.ship, plant.tank
        self._spikes = SpikeCount()
        self.drive = DriveFollowing(plant.lag_s, thresholds, SHORT_S)
        self._saturation = Saturation(thresholds)
        self._level_stuck = LevelStuck(ship, tank, thresholds, LONG_S)
        self.volume = Volume(thresholds)
        room = ROOM_OF_VALVE if plant.valve else 1.0
        self._open_loss = plant.valve.open_loss if plant.valve else 0.0
        self.twin = PassiveTwin(
            ship, tank, SHORT_S, thresholds.amplified_roll_rad, self._open_loss, room=room
        )
        self._ship, self._tank = ship, tank
        self._followed: ModelSummary | ShipFigures | None = None
        # what a valve that is nearly shut holds back is uncertain: only a wrong sign counts then
        self._water_free = plant.valve is None
        self._counts_of_water = ~0 if self._water_free else Finding.WATER_SIGN
        self._compares, self._harbour = compares, harbour
        #: What is judged of each motion sensor by itself.
        self.watches = tuple(
            MotionWatch(thresholds, cycle_s) for cycle_s in motion_cycles_s[: 1 + second_motion]
        )
        #: The tank's equation with the roll of the motion sensor in use.
        self.equation = TankEquation(ship, tank, thresholds, LONG_S, valve=not self._water_free)
        self.used = 0  #: Place of the motion sensor in use.
        self._pair = MotionPair(thresholds, SHORT_S)
        self._frames_per_s = bit_rate / MEAN_FRAME_BITS
        self.senders = Senders((), self._frames_per_s)
        self._phase = 0
        self._last_ns = self._motion_ns = self._senders_ns = 0
        self._round_ns = self._looked_ns = 0
        self._begun = False
        self._judges_from_ns = 0
        self._longest_gap_s = max(GAP_PERIODS * thresholds.tank_period_s, LATE_ROUND_S)
        self._unwatched_s = 0.0
        self._wrong_ns = LONG_AGO_NS
        # a wrong sign is not seen where the roll passes through zero
        self._doubted_ns = round(thresholds.tank_period_s * 1e9)
        #: Whether the water was seen to move as roll and pressure push it, and is watched since.
        self.confirmed = harbour is not None  # a wrong sign moves little before it is found
        self._looks: tuple[Callable[[Measurements, OwnState], int], ...] = (
            self._look_at_motion,
            self._look_at_drive,
            self._look_at_twin,
            self._look_at_water,
            self._look_at_levels,
            self._look_at_bus,
        )
        self._found_by = [0] * len(self._looks)
        self._level_found = self._water_found = 0
        self.found = 0  #: Present findings, bits of `Finding`.

    def follow(self, found: ModelSummary | ShipFigures | None) -> None:
        """Compare the law in charge with the twin of the ship that it was designed for.

        None stands for the ship of the configuration, which is taken too in the place of an
        identified one that can't be this one.
        """
        if found is self._followed:
            return
        self._followed = found
        ship, tank = self._ship, self._tank
        if found is not None and _may_be(found, ship):
            identified = found.ship(ship)
            (k11, k12), (_, k22) = coupled_matrices(identified, tank)[2].tolist()
            if k11 * k22 > k12 * k12:  # stable with the tank's water
                ship = identified
                if isinstance(found, ModelSummary):
                    tank = found.tank(tank)
        self.twin.take(ship, tank)

    def watch(self, receivers: Iterable[Heard], expected: Collection[int]) -> None:
        """Watch the pace of messages; of those `expected`, by identifier, the silence too."""
        streams = [
            Stream(receiver, silent_s=SILENT_S if receiver.can_id in expected else math.inf)
            for receiver in receivers
        ]
        self.senders = Senders(streams, self._frames_per_s)

    def twin_message(self) -> PassiveTwinMessage:
        """What the panels are shown of the twin: degraded by what degrades the motion sensor."""
        twin = self.twin
        quality = Quality.DEGRADED if self.watches[self.used].found else Quality.GOOD
        return PassiveTwinMessage(quality, twin.roll_rad, twin.rms_rad, twin.ship_rms_rad)

    def update(self, measured: Measurements, own: OwnState, used: int = 0) -> int:
        """Look at one tick and return `found`; `used` is the place of the motion sensor in use."""
        now_ns = measured.now_ns
        if not self._begun:
            self._begin(measured)
        self.follow(own.designed_for)
        if used != self.used:  # they may be mounted apart
            self.used = used
            self._restart_water()
        elapsed_s = (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        for watch, sample in zip(self.watches, measured.motions, strict=True):
            watch.turn(sample, elapsed_s)
        due = 1
        if elapsed_s > 1.5 * TICK_S:
            due = min(round(elapsed_s / TICK_S), SHORT_TICKS)
        found_by = self._found_by
        while due:
            due -= 1
            phase = self._phase
            self._phase = phase + 1 if phase < ROUND_TICKS - 1 else 0
            look = _ROUND[phase]
            found_by[look] = self._looks[look](measured, own)
        found = self.watches[used].found | self._water_found
        for each in found_by:
            found |= each
        self.found = found
        return found

    def _begin(self, measured: Measurements) -> None:
        """Count time, and frames, from the first tick on: the clock may be that of the machine."""
        now_ns = measured.now_ns
        self._begun = True
        self._judges_from_ns = now_ns + BACKLOG_NS
        self._last_ns = self._motion_ns = self._senders_ns = now_ns - TICK_NS
        self._round_ns = self._looked_ns = now_ns - TICK_NS
        self.senders.begin(measured.foreign)

    def _look_at_motion(self, measured: Measurements, own: OwnState) -> int:  # noqa: ARG002
        now_ns, motions = measured.now_ns, measured.motions
        elapsed_s = (now_ns - self._motion_ns) * 1e-9
        self._motion_ns = now_ns
        backlog = now_ns < self._judges_from_ns
        fresh = True
        for watch, sample in zip(self.watches, motions, strict=True):
            stale = backlog or sample.age_ms > STALE_MS
            watch.update(sample, elapsed_s, stale=stale, water_moves=self.equation.water_moves)
            fresh = fresh and not stale
        if len(motions) == 1:
            return 0
        first, second = motions
        return self._pair.update(
            first.roll_rad - second.roll_rad if fresh else math.nan,
            first.roll_rate_rad_s - second.roll_rate_rad_s,
        )

    def _restart_water(self) -> None:
        """Begin anew with the tank's equation."""
        self.equation.restart()
        self._water_found = 0

    def _look_at_drive(self, measured: Measurements, own: OwnState) -> int:
        return self.drive.update(
            own.command_pa,
            measured.pressure_pa if measured.pump_age_ms <= STALE_MS else math.nan,
            measured.level_m,
            own.level_rate_m_s,
            enabled=measured.drive_state is _DRIVE_ENABLED,
            limited=measured.drive_held_back,
            at_speed=measured.drive_at_speed,
        )

    def _look_at_twin(self, measured: Measurements, own: OwnState) -> int:
        twin, motion, level_rate_m_s = self.twin, measured.motions[self.used], own.level_rate_m_s
        if own.excused:
            twin.excuse()
        # the last pressure that was measured may have ended long ago
        fresh = measured.pump_age_ms <= STALE_MS
        pressure_pa = measured.pressure_pa if fresh else own.command_pa
        # what a valve that is not open takes from the water acts like a pump
        if self._harbour is not None:
            pressure_pa = self._harbour.balance_pa(measured.level_m, motion.roll_rad)
        else:
            pressure_pa -= own.held_pa - self._open_loss * abs(level_rate_m_s) * level_rate_m_s
        twin.update(
            motion.roll_rad,
            motion.roll_rate_rad_s,
            level_rate_m_s,
            pressure_pa,
            counts=motion.age_ms <= STALE_MS,  # gaps hide no law that loses
        )
        return Finding.ROLL_AMPLIFIED if twin.amplified and self._compares else 0

    def _look_at_water(self, measured: Measurements, own: OwnState) -> int:
        now_ns = measured.now_ns
        elapsed_s = (now_ns - self._round_ns) * 1e-9
        steps = max(round(elapsed_s / LONG_S), 1)
        if elapsed_s > self._longest_gap_s:
            steps = 1
            self._restart_water()
            self._level_stuck.restart()
            self._level_found = 0
        motion = measured.motions[self.used]
        oldest_ms = max(motion.age_ms, measured.tank_age_ms, measured.pump_age_ms)
        if self._harbour is not None:
            if oldest_ms <= STALE_MS:
                self._round_ns = now_ns
                self._level_found = self._harbour.update(motion, measured, steps)
            return self._level_found
        unwatched = self._note_watch(now_ns, elapsed_s, oldest_ms)
        if oldest_ms > STALE_MS:
            return self._level_found | unwatched
        self._round_ns = now_ns
        level_m, pressure_pa = measured.level_m, measured.pressure_pa - own.held_pa
        self._water_found = self._counts_of_water & self.equation.update(
            motion.roll_rad, level_m, pressure_pa, steps, own.held_pa
        )
        if self._water_free and self.equation.settled:
            slope_push = self.equation.slope_push
            for _ in range(steps):
                self._level_found = self._level_stuck.update(
                    motion.roll_rad, level_m, pressure_pa, slope_push
                )
        suspect = self.equation.suspect  # a turn may be the reason
        if suspect or self._water_found or self.watches[self.used].found & Finding.DRIFT_LASTS:
            self._wrong_ns = now_ns
            self.confirmed = False
        elif self.equation.obeyed and now_ns - self._wrong_ns > self._doubted_ns:
            self.confirmed = True
        return self._level_found | unwatched

    def _note_watch(self, now_ns: int, elapsed_s: float, oldest_ms: float) -> int:
        """Note for how long, with measurements that come, the water has said nothing."""
        shortest_s = UNWATCHED_PERIODS * self.thresholds.tank_period_s
        longest_s = LONG_PERIODS * self.thresholds.tank_period_s
        if self.equation.settled:
            self._unwatched_s = 0.0
        elif oldest_ms <= SILENT_S * 1e3:  # of a silence, which others judge, no more than of a gap
            self._unwatched_s += min((now_ns - self._looked_ns) * 1e-9, SILENT_S)
        self._looked_ns = now_ns
        unwatched = self._unwatched_s > shortest_s
        if unwatched or elapsed_s > shortest_s:
            self.confirmed = False
        if not unwatched:
            return 0
        return _UNWATCHED_LONG if self._unwatched_s > longest_s else Finding.UNWATCHED

    def _look_at_levels(self, measured: Measurements, own: OwnState) -> int:  # noqa: ARG002
        if measured.tank_age_ms > STALE_MS:
            return self._found_by[_LEVELS]
        return self.volume.update(measured.port_level_m, measured.starboard_level_m, SHORT_S)

    def _look_at_bus(self, measured: Measurements, own: OwnState) -> int:
        elapsed_s = (measured.now_ns - self._senders_ns) * 1e-9
        self._senders_ns = measured.now_ns
        found = self.senders.update(measured.foreign, elapsed_s)
        found |= self._saturation.update(
            own.command_pa, drive_limited=measured.drive_held_back, elapsed_s=LONG_S
        )
        noisy = self._found_by[_LEVELS] & Finding.NOISE
        if self._spikes.update(measured.levels_discarded, LONG_S) and not noisy:
            found |= Finding.SPIKES
        return found


def _may_be(found: ModelSummary | ShipFigures, configured: RollShip) -> bool:
    """Whether an identified ship is the configured one in any loading."""
    inertia, stiffness = found.inertia_kg_m2, found.stiffness_nm_rad
    # written so that NaN fails too
    if not (
        1 / MOST_CHANGE <= inertia / configured.inertia_kg_m2 <= MOST_CHANGE
        and 1 / MOST_CHANGE <= stiffness / configured.stiffness_nm_rad <= MOST_CHANGE
    ):
        return False
    damping_ratio = found.damping_nms_rad / (2 * math.sqrt(inertia * stiffness))
    of_tank = found.tank_damping_ratio if isinstance(found, ModelSummary) else 0.0
    return 0.0 <= damping_ratio <= MOST_DAMPING_RATIO and 0.0 <= of_tank <= MOST_DAMPING_RATIO
