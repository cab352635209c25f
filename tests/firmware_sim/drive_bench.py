"""A pump drive on a table: commands by hand, its reports decoded."""

from pathlib import Path

import numpy as np

from firmware_sim.drive import PumpDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario_sections import DriveLimits
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    ControlWord,
    DriveStatus1,
    DriveStatus2,
    Frame,
    PumpCommand,
    load_catalogue,
)
from utank_hil.configuration import Vessel, load_config
from utank_hil.sea import Harmonics

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
CATALOGUE = load_catalogue()
MS = 1_000_000
ENABLE = (ControlWord.SHUTDOWN, ControlWord.SWITCH_ON, ControlWord.ENABLE_OPERATION)


def calm_plant() -> Plant:
    calm = Harmonics(np.zeros(1), np.full(1, 0.5), np.zeros(1))
    return Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, calm)


class DriveBench:
    """Time, commander and listener around one drive."""

    def __init__(self, limits: DriveLimits | None = None, start_ns: int = 0) -> None:
        self.plant = calm_plant()
        self.drive = PumpDrive(
            self.plant,
            DriveLimits() if limits is None else limits,
            CATALOGUE,
            configuration_version=7,
        )
        self.now_ns = start_ns
        self.commands = CATALOGUE.transmitter(PumpCommand)
        self._status_1 = CATALOGUE.receiver(DriveStatus1)
        self._status_2 = CATALOGUE.receiver(DriveStatus2)
        self.status_1: DriveStatus1 | None = None
        self.status_2: DriveStatus2 | None = None
        self.sent_ns: list[int] = []
        self.frames: list[Frame] = []

    @property
    def told(self) -> DriveStatus1:
        """What DRIVE_STATUS_1 last said."""
        assert self.status_1 is not None
        return self.status_1

    def command(
        self,
        pressure_pa: float = 0.0,
        word: ControlWord = ControlWord.ENABLE_OPERATION,
        timeout_s: float = 0.05,
    ) -> None:
        """Send one command, received now."""
        frame = self.commands.frame(PumpCommand(pressure_pa, word, timeout_s))
        self.drive.receive(frame, self.now_ns)

    def tick(self) -> None:
        """Tick the drive now, listen to it, and let 10 ms pass."""
        self.frames = list(self.drive.tick(self.now_ns))
        for frame in self.frames:
            if frame.can_id == self._status_1.can_id:
                self.status_1 = self._status_1.accept(frame)
                self.sent_ns.append(self.now_ns)
            elif frame.can_id == self._status_2.can_id:
                self.status_2 = self._status_2.accept(frame)
        self.now_ns += TICK_NS

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.tick()

    def enable(self) -> None:
        """Lead the drive to operation enabled, ending on a tick after which a status is due."""
        self.ticks(2)
        for word in ENABLE:
            self.command(0.0, word)
            self.ticks(2)

    def drive_at(self, pressure_pa: float, step_pa: float = 2000.0) -> None:
        """Raise the command in permitted steps, every 20 ms."""
        asked_pa = 0.0
        while asked_pa != pressure_pa:
            asked_pa += min(max(pressure_pa - asked_pa, -step_pa), step_pa)
            self.command(asked_pa)
            self.ticks(2)
