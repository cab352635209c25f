"""All monitors of a controller node, fed once a tick; one of them is due in each tick.

Motion, drive, twin and volume are due every 50 ms, all else every 100 ms. So a tick pays for one of
them, and the gates and the running integral of the rate are all that is done in every tick. What
was due in ticks that the loop has lost is done in the next one: models of equal steps stay in time.
"""

import math
from collections.abc import Collection, Iterable
from typing import Final

import numpy as np

from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import PassiveTwin as PassiveTwinMessage
from utank_hil.canbus import Quality
from utank_hil.canbus.events import ModelSummary
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.motion_sensors import MotionSensors
from utank_hil.retuning.estimate import ShipFigures
from utank_hil.safety.monitors.drive import DriveFollowing, Saturation
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import GaugeStuck, LevelStuck
from utank_hil.safety.monitors.motion import RollAgainstRate
from utank_hil.safety.monitors.motion_pair import MotionPair, SensorEvidence
from utank_hil.safety.monitors.motion_watch import MotionWatch
from utank_hil.safety.monitors.noise import Noise
from utank_hil.safety.monitors.senders import Heard, Senders, Stream
from utank_hil.safety.monitors.spikes import SpikeCount, SpikeGates
from utank_hil.safety.monitors.standstill import gauges_stand_still
from utank_hil.safety.monitors.tank_equation import TankEquation
from utank_hil.safety.monitors.thresholds import MonitorThresholds, SensorFigures, thresholds_of
from utank_hil.safety.monitors.volume import Volume
from utank_hil.safety.observations import MEAN_FRAME_BITS, Observations
from utank_hil.safety.passive_twin import PassiveTwin

ROUND_TICKS: Final = 10
LONG_S: Final = ROUND_TICKS * TICK_S
SHORT_TICKS: Final = ROUND_TICKS // 2
"""Of more lost ticks no more is made up for: nothing is then done twice with the same sample."""
SHORT_S: Final = SHORT_TICKS * TICK_S
SPARE_MS: Final = 30.0
"""An older measurement of the other motion sensor is not changed over to."""
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

_LEVEL_STUCK: Final = int(Finding.LEVEL_STUCK)
_NOISE: Final = int(Finding.NOISE)
_SPIKES: Final = int(Finding.SPIKES)
_AMPLIFIED: Final = int(Finding.ROLL_AMPLIFIED)
_WATER_SIGN: Final = int(Finding.WATER_SIGN)
_MOTION_SIGN: Final = int(Finding.MOTION_SIGN)
_VOLUME: Final = int(Finding.VOLUME)
_UNWATCHED: Final = int(Finding.UNWATCHED)
_UNWATCHED_LONG: Final = int(Finding.UNWATCHED | Finding.UNWATCHED_LONG)


class Monitors:
    """The monitors of one ship.

    Parameters
    ----------
    plant : DesignPlant
    roll_limit_rad : float
        Largest roll under control.
    sensors : SensorFigures
    bit_rate : int
        Of the bus.
    compares : bool
        Whether the law is meant to roll the ship less than her passive twin; one that stimulates
        her is not.
    second_motion : bool
        Whether there is a second motion sensor.

    Attributes
    ----------
    thresholds : MonitorThresholds
    twin : PassiveTwin
    drive : DriveFollowing
    volume : Volume
        The monitors whose statistics are of interest.
    confirmed : bool
        Whether the water was seen to move as roll and pressure push it, and is watched since.
    found : int
        Bits of `Finding`, of now.
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
    ) -> None:
        self.thresholds: MonitorThresholds = thresholds_of(plant, roll_limit_rad, sensors)
        thresholds, ship, tank = self.thresholds, plant.ship, plant.tank
        self.gates = SpikeGates(thresholds)
        self._spikes = SpikeCount()
        self.drive = DriveFollowing(plant.lag_s, thresholds, SHORT_S)
        self._saturation = Saturation(thresholds)
        self._level_stuck = LevelStuck(ship, tank, thresholds, LONG_S)
        self._port_stuck, self._starboard_stuck = GaugeStuck(thresholds), GaugeStuck(thresholds)
        self.volume = Volume(thresholds)
        room = ROOM_OF_VALVE if plant.valve else 1.0
        self._open_loss = plant.valve.open_loss if plant.valve else 0.0
        self.twin = PassiveTwin(
            ship, tank, SHORT_S, thresholds.amplified_roll_rad, self._open_loss, room=room
        )
        self._ship, self._tank = ship, tank
        self._followed: ModelSummary | ShipFigures | None = None
        # what a valve that is nearly shut holds back is uncertain: only a wrong sign is told then
        self._water_free = plant.valve is None
        self._told_by_water = ~0 if self._water_free else _WATER_SIGN
        self._compares = compares
        first, second = [
            SensorEvidence(
                MotionWatch(thresholds, gate),
                TankEquation(ship, tank, thresholds, LONG_S, valve=not self._water_free),
            )
            for gate in self.gates.motions
        ]
        self._of_first = self._used = first
        self._spare = second if second_motion else None
        self._pair = MotionPair(thresholds, SHORT_S)
        self._frames_per_s = bit_rate / MEAN_FRAME_BITS
        self._senders = Senders((), self._frames_per_s)
        self._phase = 0
        self._last_ns = self._motion_ns = self._senders_ns = 0
        self._round_ns = self._looked_ns = 0
        self._begun = False
        self._judges_from_ns = 0
        self._longest_gap_s = max(GAP_PERIODS * thresholds.roll_period_s, LATE_ROUND_S)
        self._unwatched_s = 0.0
        self.confirmed = False
        self._of_pair = self._of_drive = self._of_level = self._of_volume = 0
        self._of_senders = self._of_twin = self._of_saturation = self._of_watch = 0
        self.found = 0

    def follow(self, found: ModelSummary | ShipFigures | None) -> None:
        """Compare the law in charge with the twin of the ship that it was designed for.

        Parameters
        ----------
        found : ModelSummary, ShipFigures or None
            As identified; None for the ship of the configuration, which is taken too in the place
            of one that can't be hers.
        """
        if found is self._followed:
            return
        self._followed = found
        ship, tank = self._ship, self._tank
        if found is not None and _may_be(found, ship):
            hers = found.ship(ship)
            if np.linalg.det(coupled_matrices(hers, tank)[2]) > 0:  # stable with the tank's water
                ship = hers
                if isinstance(found, ModelSummary):
                    tank = found.tank(tank)
        self.twin.take(ship, tank)

    @property
    def motion(self) -> RollAgainstRate:
        """Of the motion sensor in use, as the two that follow."""
        return self._used.watch.motion

    @property
    def rate_noise(self) -> Noise:
        """Noise of the roll rate."""
        return self._used.watch.rate_noise

    @property
    def equation(self) -> TankEquation:
        """The tank's equation."""
        return self._used.equation

    def watch(self, receivers: Iterable[Heard], expected: Collection[int]) -> None:
        """Watch the pace of messages; of those `expected`, by identifier, the silence too."""
        streams = [
            Stream(receiver, silent_s=SILENT_S if receiver.can_id in expected else math.inf)
            for receiver in receivers
        ]
        self._senders = Senders(streams, self._frames_per_s)

    def twin_message(self) -> PassiveTwinMessage:
        """What the panels are shown of the twin: degraded by what degrades the motion sensor."""
        twin = self.twin
        quality = Quality.DEGRADED if self._used.watch.found else Quality.GOOD
        return PassiveTwinMessage(quality, twin.roll_rad, twin.rms_rad, twin.ship_rms_rad)

    def update(
        self,
        now_ns: int,
        inbox: Inbox,
        seen: Observations,
        level_rate_m_s: float,
        *,
        excused: bool,
        held_pa: float = 0.0,
    ) -> int:
        """Look at one tick.

        Parameters
        ----------
        now_ns : int
        inbox : Inbox
            What was received.
        seen : Observations
            Ages, and the pressure commanded last.
        level_rate_m_s : float
            As estimated.
        excused : bool
            The law in charge is not to be judged by the roll, see `LawExchange.excused`.
        held_pa : float
            Pressure that a valve takes from the water.

        Returns
        -------
        int
            `found`.
        """
        if not self._begun:
            self._begin(now_ns, inbox)
        elapsed_s = (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        motions, spare = inbox.motions, self._spare
        if motions is not None and spare is not None:
            if (motions.used is motions.first) is not (self._used is self._of_first):
                self._used, self._spare = spare, self._used  # the other one is silent
                spare = self._spare
            _turn(spare.watch, motions.spare.roll_rate_rad_s, motions.spare.heard_ns, elapsed_s)
        _turn(self._used.watch, inbox.roll_rate_rad_s, inbox.motion_ns, elapsed_s)
        due = 1
        if elapsed_s > 1.5 * TICK_S:
            due = min(round(elapsed_s / TICK_S), SHORT_TICKS)
        while due:
            due -= 1
            phase = self._phase
            self._phase = phase + 1 if phase < ROUND_TICKS - 1 else 0
            if phase == 0 or phase == 5:
                self._look_at_motion(now_ns, inbox, seen)
            elif phase == 1 or phase == 6:
                self._of_drive = self.drive.update(
                    seen.command_pa,
                    inbox.pressure_pa if seen.pump_age_ms <= STALE_MS else math.nan,
                    inbox.level_m,
                    level_rate_m_s,
                    enabled=seen.drive_enabled,
                    limited=inbox.drive_held_back,
                )
            elif phase == 2 or phase == 7:
                self._look_at_twin(inbox, seen, level_rate_m_s, held_pa, excused=excused)
            elif phase == 3:
                self._look_at_water(now_ns, inbox, seen, held_pa)
            elif phase == 4 or phase == 9:
                if seen.tank_age_ms <= STALE_MS:
                    port_m, starboard_m = inbox.port_level_m, inbox.starboard_level_m
                    volume = self.volume.update(port_m, starboard_m, SHORT_S)
                    stuck = self._port_stuck.update(port_m, starboard_m)
                    stuck |= self._starboard_stuck.update(starboard_m, port_m)
                    if not volume & _VOLUME:
                        stuck = 0
                    if gauges_stand_still(self.gates.port, self.gates.starboard):
                        stuck = _LEVEL_STUCK
                    self._of_volume = volume | stuck
            else:
                of_senders_s = (now_ns - self._senders_ns) * 1e-9
                self._senders_ns = now_ns
                self._of_senders = self._senders.update(inbox.foreign, of_senders_s)
                self._of_saturation = self._saturation.update(
                    seen.command_pa, drive_limited=inbox.drive_held_back, elapsed_s=LONG_S
                )
                noisy = self._of_volume & _NOISE
                if self._spikes.update(self.gates.levels_discarded, LONG_S) and not noisy:
                    self._of_saturation |= _SPIKES
        used = self._used
        self.found = found = (
            used.watch.found
            | used.water
            | self._of_pair
            | self._of_drive
            | self._of_level
            | self._of_volume
            | self._of_senders
            | self._of_twin
            | self._of_saturation
            | self._of_watch
        )
        return found

    def _begin(self, now_ns: int, inbox: Inbox) -> None:
        """Count time, and frames, from the first tick on: the clock may be that of the machine."""
        self._begun = True
        self._judges_from_ns = now_ns + BACKLOG_NS
        self._last_ns = self._motion_ns = self._senders_ns = now_ns - TICK_NS
        self._round_ns = self._looked_ns = now_ns - TICK_NS
        self._senders.begin(inbox.foreign)

    def _look_at_motion(self, now_ns: int, inbox: Inbox, seen: Observations) -> None:
        elapsed_s = (now_ns - self._motion_ns) * 1e-9
        self._motion_ns = now_ns
        backlog = now_ns < self._judges_from_ns
        stale = backlog or seen.motion_age_ms > STALE_MS
        self._used.watch.update(inbox.roll_rad, inbox.roll_rate_rad_s, elapsed_s, stale=stale)
        motions, spare = inbox.motions, self._spare
        if motions is None or spare is None:
            return
        other = motions.spare
        spare_stale = backlog or seen.motion_spare_age_ms > STALE_MS
        spare.watch.update(other.roll_rad, other.roll_rate_rad_s, elapsed_s, stale=spare_stale)
        both = not (stale or spare_stale)
        spare = self._leave_accused(inbox, motions, seen, spare)
        other = motions.spare
        self._of_pair = self._pair.update(
            inbox.roll_rad - other.roll_rad if both else math.nan,
            inbox.roll_rate_rad_s - other.roll_rate_rad_s,
            self._used,
            spare,
        )
        motions.used.accused, motions.spare.accused = self._used.accused, spare.accused

    def _leave_accused(
        self, inbox: Inbox, motions: MotionSensors, seen: Observations, spare: SensorEvidence
    ) -> SensorEvidence:
        """Use the other motion sensor if something speaks against this one alone.

        Returns
        -------
        SensorEvidence
            Of the one that is not in use.
        """
        used = self._used
        if seen.motion_spare_age_ms > SPARE_MS or spare.found or spare.accused:
            return spare
        if not (used.found or used.accused):
            return spare
        motions.used.accused = used.accused = True
        inbox.exchange_motion(motions)
        self.twin.excuse()  # of what the other one said
        self._used, self._spare = spare, used
        return used

    def _look_at_twin(
        self,
        inbox: Inbox,
        seen: Observations,
        level_rate_m_s: float,
        held_pa: float,
        *,
        excused: bool,
    ) -> None:
        twin = self.twin
        if excused:
            twin.excuse()
        # the last pressure that was measured may have ended long ago
        pressure_pa = inbox.pressure_pa if seen.pump_age_ms <= STALE_MS else seen.command_pa
        # what a valve that is not open takes from the water acts like a pump
        pressure_pa -= held_pa - self._open_loss * abs(level_rate_m_s) * level_rate_m_s
        # gaps of a motion sensor, or two that disagree now and then, hide no law that loses
        sure = seen.motion_age_ms <= STALE_MS and not self._pair.unclear
        roll_rad, rate_rad_s = inbox.roll_rad, inbox.roll_rate_rad_s
        twin.update(roll_rad, rate_rad_s, level_rate_m_s, pressure_pa, counts=sure)
        self._of_twin = _AMPLIFIED if twin.amplified and self._compares else 0

    def _look_at_water(self, now_ns: int, inbox: Inbox, seen: Observations, held_pa: float) -> None:
        elapsed_s = (now_ns - self._round_ns) * 1e-9
        steps = max(round(elapsed_s / LONG_S), 1)
        if elapsed_s > self._longest_gap_s:
            steps = 1
            self._used.restart_water()
            if self._spare is not None:
                self._spare.restart_water()
            self._level_stuck.restart()
            self._of_level = 0
        oldest_ms = max(seen.motion_age_ms, seen.tank_age_ms, seen.pump_age_ms)
        self._note_watch(now_ns, elapsed_s, oldest_ms)
        if oldest_ms > STALE_MS:
            return
        self._round_ns = now_ns
        roll_rad, level_m = inbox.roll_rad, inbox.level_m
        pressure_pa = inbox.pressure_pa - held_pa
        if self._water_free:
            for _ in range(steps):
                self._of_level = self._level_stuck.update(roll_rad, level_m, pressure_pa)
        told, equation = self._told_by_water, self._used.equation
        frozen = self._used.watch.repetition.frozen
        water = told & equation.update(
            roll_rad, level_m, pressure_pa, steps, held_pa, frozen=frozen
        )
        self._used.water = water
        wrong = water or self._used.watch.found & _MOTION_SIGN
        self.confirmed = not wrong and (self.confirmed or equation.obeyed)
        motions, spare = inbox.motions, self._spare
        if motions is None or spare is None:
            return
        if seen.motion_spare_age_ms > STALE_MS:
            spare.restart_water()
        else:
            spare_rad = motions.spare.roll_rad
            frozen = spare.watch.repetition.frozen
            spare.water = told & spare.equation.update(
                spare_rad, level_m, pressure_pa, steps, held_pa, frozen=frozen
            )
        self._leave_accused(inbox, motions, seen, spare)

    def _note_watch(self, now_ns: int, elapsed_s: float, oldest_ms: float) -> None:
        """Note for how long, with measurements that come, nothing was told by the water."""
        shortest_s = UNWATCHED_PERIODS * self.thresholds.roll_period_s
        longest_s = LONG_PERIODS * self.thresholds.roll_period_s
        if self._used.equation.settled:
            self._unwatched_s = 0.0
        elif oldest_ms <= SILENT_S * 1e3:  # of a silence, which others judge, no more than of a gap
            self._unwatched_s += min((now_ns - self._looked_ns) * 1e-9, SILENT_S)
        self._looked_ns = now_ns
        unwatched = self._unwatched_s > shortest_s
        self._of_watch = 0
        if unwatched:
            self._of_watch = _UNWATCHED_LONG if self._unwatched_s > longest_s else _UNWATCHED
        if unwatched or elapsed_s > shortest_s:
            self.confirmed = False


def _turn(watch: MotionWatch, rate_rad_s: float, heard_ns: int, elapsed_s: float) -> None:
    """Integrate the rate up to the newest sample: where some were lost, the roll is as old."""
    watch.waited_s += elapsed_s
    if heard_ns != watch.heard_ns:
        watch.heard_ns = heard_ns
        watch.turned_rad += rate_rad_s * watch.waited_s
        watch.waited_s = 0.0


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
