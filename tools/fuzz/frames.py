"""Random and mutated frames at the controller node and the drive, on a bench that sails the storm.

    python -m tools.fuzz.frames [--frames 100000] [--seed 1] [--json]

Beside what its own nodes send, the bench hears noise: frames of chance, frames that were heard
before with bits flipped, cut, lengthened, under another identifier or once more, and frames of
chance content with the right CRC and counter. The claims:

* nothing raises;
* a frame that is not whole (unknown identifier, wrong length or CRC) changes nothing but counts;
* the controller's pressure is within its limit, and zero where its mode has none;
* no warning of numpy.

Sessions differ in how much noise there is; in half of them the judges of load, pace and foreign
senders do not hear of it, so that the others are met under pressure too. The same seed makes the
same frames: a failure names seed and session, which `--seed` and `--session` run again.
"""

import random
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Final

from cantools.database.can import Database

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tools.printing import command_line, show
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Address, Frame, Mode, PumpCommand, load_catalogue
from utank_hil.canbus.catalogue import DBC_PATH, read_data_ids
from utank_hil.canbus.e2e import profile2_crc
from utank_hil.configuration import load_config
from utank_hil.control import BuiltLaw
from utank_hil.nodes.inbox import SOURCE_ADDRESS
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep

SESSION_TICKS = 1500
CYCLE_S = 4.0
"""From one reset and arming to the next."""
SCENARIO = Path("configs/scenarios/storm.yaml")
FEW_INTRUSIONS, MANY_INTRUSIONS = 0.01, 0.3
# frames a tick, by session in turn: drizzle, showers, and more than any bus can carry
BURSTS = (2, 4, 6, 8, 4, 30)
MOST_BURST = max(BURSTS)
"""Only with so many are the controller's own identifiers among them: they end all arming."""
_POWERED = (Mode.ACTIVE, Mode.PASSIVE, Mode.FAULT)

COUNTERS: Final = frozenset(
    ("frames", "foreign", "_tank_lost", "_cycles", "_tank_due_ns", "receiver", "rejected")
)
"""Attributes of inbox and orders that a frame may change without being believed."""


class FuzzError(AssertionError):
    """A claim that does not hold, with what is needed to see it again."""


@cache
def scenario() -> tuple[Scenario, BuiltLaw]:
    """The shipped storm and its GPC."""
    loaded = load_config(SCENARIO, Scenario)
    return loaded, build_law(loaded.controllers["gpc"])


@cache
def protection() -> dict[int, bytes | None]:
    """Data IDs of every identifier, by the DBC itself; None where it is unprotected."""
    database = Database()
    database.add_dbc_file(DBC_PATH)
    return {message.frame_id: read_data_ids(message) for message in database.messages}


def is_whole(frame: Frame) -> bool:
    """Whether a frame is one of the catalogue's, by the definition of the CRC."""
    if len(frame.data) != 8 or frame.can_id not in protection():
        return False
    ids = protection()[frame.can_id]
    return ids is None or frame.data[0] == profile2_crc(frame.data, ids)


class Noise:
    """Makes frames.

    Parameters
    ----------
    counters : callable
        The counter that the receiver of an identifier expects next.
    intrusions : float
        Share of frames that are made to be believed.
    """

    def __init__(
        self, draw: random.Random, counters: Callable[[int], int], intrusions: float
    ) -> None:
        self._draw = draw
        self._counters = counters
        self._intrusions = intrusions
        self.heard: deque[Frame] = deque(maxlen=500)
        self._ids = sorted(protection())
        self._kinds = self.chance, self.known, self.flipped, self.cut, self.masked
        self._intruding = self.again, self.forged

    def frame(self) -> tuple[str, Frame]:
        """The next frame and its kind."""
        intrudes = self._draw.random() < self._intrusions
        make = self._draw.choice(self._intruding if intrudes else self._kinds)
        return make.__name__, make()

    def chance(self) -> Frame:
        """Anything."""
        return Frame(self._draw.getrandbits(29), self._draw.randbytes(self._draw.randrange(9)))

    def known(self) -> Frame:
        """Anything, under an identifier of the catalogue."""
        return Frame(self._draw.choice(self._ids), self._draw.randbytes(8))

    def flipped(self) -> Frame:
        """A frame that was heard, with some bits flipped."""
        frame = self.again()
        data = bytearray(frame.data)
        for _ in range(self._draw.randint(1, 5)):
            bit = self._draw.randrange(8 * len(data)) if data else 0
            if data:
                data[bit // 8] ^= 1 << bit % 8
        return Frame(frame.can_id, bytes(data))

    def cut(self) -> Frame:
        """A frame that was heard, too short or too long."""
        frame = self.again()
        length = self._draw.choice((0, 1, 2, 6, 7, 9, 12, 64))
        return Frame(frame.can_id, (frame.data + self._draw.randbytes(64))[:length])

    def masked(self) -> Frame:
        """A frame that was heard, as another message."""
        return Frame(self._draw.choice(self._ids), self.again().data)

    def again(self) -> Frame:
        """A frame that was heard."""
        return self._draw.choice(self.heard) if self.heard else self.known()

    def forged(self) -> Frame:
        """Anything, with the right CRC and mostly the right counter."""
        can_id = self._draw.choice(self._ids)
        data = bytearray(self._draw.randbytes(8))
        if self._draw.random() < 0.3:  # not available, out of range
            start = self._draw.randrange(2, 8)
            data[start:] = b"\xff" * (8 - start)
        if self._draw.random() < 0.8:
            data[1] = data[1] & 0xF0 | self._counters(can_id)
        ids = protection()[can_id]
        if ids is not None:
            data[0] = profile2_crc(bytes(data), ids)
        return Frame(can_id, bytes(data))


class Session:
    """One bench and the noise at it.

    Parameters
    ----------
    burst : int
        Most frames of noise in a tick.
    hushed : bool
        Whether the judges of load, pace and senders are kept from hearing of it.
    counts : Counter
        Of what was done.
    """

    def __init__(self, seed: int, burst: int, *, hushed: bool, counts: Counter[str]) -> None:
        loaded, law = scenario()
        config = loaded.controllers["gpc"]
        script = [TimedAction(1.0, Action.ARM)]
        for cycle in range(1, int(SESSION_TICKS * 0.01 / CYCLE_S) + 1):
            begin_s = CYCLE_S * cycle
            script += [
                TimedAction(begin_s, Action.RESET),
                TimedAction(begin_s + 0.7, Action.PASSIVE),
                TimedAction(begin_s + 1.2, Action.ARM),
            ]
        side = build_ship_side(loaded, seed, tuple(script))
        assert side.drive is not None
        self.node = build_controller_node(config, law, commissioned=True)
        self.drive = side.drive
        self._counts, self._burst, self._hushed = counts, burst, hushed
        if hushed:
            self.node.safety.monitors = None
        self._limit_pa = config.limits.pressure_pa
        self._draw = random.Random(seed)
        self._commands = load_catalogue().receiver(PumpCommand)
        receivers = {receiver.can_id: receiver for receiver in self.node.inbox.watched}
        receivers[self._commands.can_id] = self._commands
        self._noise = Noise(
            self._draw,
            lambda can_id: _next_counter(receivers.get(can_id)),
            FEW_INTRUSIONS if hushed else MANY_INTRUSIONS,
        )
        self._lockstep = Lockstep([*side.nodes, self.node], trace=self._hear)
        inbox = self.node.inbox
        kept = (bool, int, float, Enum, type(None))
        self._shown = [
            name
            for name, value in vars(inbox).items()
            if name not in COUNTERS and isinstance(value, kept)
        ]

    def _hear(self, now_ns: int, sender: str, frame: Frame) -> None:  # noqa: ARG002
        self._noise.heard.append(frame)
        if frame.can_id != self._commands.can_id or sender != self.node.name:
            return
        command = self._commands.intact(frame)
        self._commands.accept(frame)
        assert command is not None
        mode = self.node.mode
        if not abs(command.pressure_pa) <= self._limit_pa + 4.0:
            raise FuzzError(f"commanded {command.pressure_pa} Pa")
        if command.pressure_pa and mode not in _POWERED:
            raise FuzzError(f"commanded {command.pressure_pa} Pa in {mode.name}")

    def _content(self) -> list[object]:
        """What the nodes hold that a frame may change."""
        inbox, drive = self.node.inbox, self.drive
        content: list[object] = [getattr(inbox, name) for name in self._shown]
        for sensor in inbox.motions:
            content += (sensor.roll_rad, sensor.roll_rate_rad_s, sensor.heard_ns)
        for orders in inbox.stations.orders.values():
            content += [value for name, value in vars(orders).items() if name not in COUNTERS]
        states = drive._states
        content += (states.state, states.fault, drive._setpoint_pa, drive._echo,
                    drive._accepted_ns, drive._timeout_ns, drive.refused)  # fmt: skip
        return [list(value) if isinstance(value, list) else value for value in content]

    def run(self, ticks: int, most_frames: int) -> int:
        """Sail and be disturbed; the frames of noise that there were."""
        done = 0
        for _ in range(ticks):
            self._lockstep.run_until(self._lockstep.now_ns + TICK_NS)
            count = min(self._draw.randint(0, self._burst), most_frames - done)
            for _ in range(count):
                self._disturb()
            done += count
            if done >= most_frames:
                break
        return done

    def _disturb(self) -> None:
        kind, frame = self._noise.frame()
        while self._burst < MOST_BURST and _is_own(frame):
            kind, frame = self._noise.frame()
        node, now_ns = self.node, self._lockstep.now_ns
        inbox = node.inbox
        whole = is_whole(frame)
        before = None if whole or _is_own(frame) else self._content()
        counted = inbox.frames, inbox.foreign, inbox._conflict_ns, inbox._claimed_twice_ns
        node.receive(frame, now_ns)
        self.drive.receive(frame, now_ns)
        if before is not None and self._content() != before:
            raise FuzzError(f"{frame} ({kind}) is not whole and changed what the nodes hold")
        if self._hushed:
            inbox.frames, inbox.foreign, inbox._conflict_ns, inbox._claimed_twice_ns = counted
        self._counts[kind] += 1
        self._counts["whole" if whole else "not whole"] += 1
        self._counts[f"in {node.mode.name}"] += 1


def _is_own(frame: Frame) -> bool:
    """Whether it comes from the controller's address, which stops it whatever it says."""
    return frame.can_id & SOURCE_ADDRESS == Address.CONTROLLER


def _next_counter(heard: Any) -> int:
    receiver = getattr(heard, "receiver", heard)  # of a panel's orders
    return 0 if receiver is None or receiver.counter is None else (receiver.counter + 1) & 15


def fuzz(frames: int, seed: int, session: int = 0) -> Counter[str]:
    """Disturb benches with so many frames; counts of what was done.

    Raises `FuzzError` if a claim does not hold.
    """
    counts: Counter[str] = Counter()
    done = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        while done < frames:
            burst = BURSTS[session % len(BURSTS)]
            try:
                bench = Session(seed + session, burst, hushed=session % 2 == 0, counts=counts)
                done += bench.run(SESSION_TICKS, frames - done)
            except Exception as error:
                raise FuzzError(f"seed {seed}, session {session}: {error!r}") from error
            session += 1
    counts["sessions"] = session
    return counts


def main() -> None:
    """Fuzz, and print the counts."""
    parser = command_line(__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--session", type=int, default=0, help="begin with this one")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    counts = fuzz(arguments.frames, arguments.seed, arguments.session)
    seconds = time.perf_counter() - begin
    result = {
        "frames": arguments.frames, "seed": arguments.seed, "failures": 0,
        "seconds": round(seconds, 1), "counts": dict(sorted(counts.items())),
    }  # fmt: skip
    show(result, arguments)


if __name__ == "__main__":
    main()
