"""Frames that every node sends: address claim at boot, then heartbeats."""

import math

from utank_hil.base.tick import Schedule
from utank_hil.canbus import Address, AddressClaim, Catalogue, Frame, Heartbeat, NodeState

NANOSECONDS = 1e-9


class Housekeeping:
    """Address claim and heartbeat of a node; all must have one `configuration_version` to arm."""

    def __init__(self, address: Address, catalogue: Catalogue, configuration_version: int) -> None:
        self._claim = catalogue.transmitter(AddressClaim, address)
        self._heartbeat = catalogue.transmitter(Heartbeat, address)
        self._address = address
        self._catalogue_version = catalogue.version
        self._configuration_version = configuration_version
        self._boot_ns: int | None = None
        self._beats = Schedule(self._heartbeat.cycle_ns)

    def frames(self, now_ns: int, *, faulted: bool = False) -> list[Frame]:
        """Return the frames due at `now_ns`, usually none."""
        if not self._beats.due(now_ns):
            return []
        if self._boot_ns is None:
            self._boot_ns = now_ns
            # arbitrary address capable 0, function and identity by address: unique on this bus
            claim = self._claim.frame(AddressClaim(int(self._address)))
            return [claim, self._beat(0.0, faulted=faulted)]
        return [self._beat((now_ns - self._boot_ns) * NANOSECONDS, faulted=faulted)]

    def _beat(self, uptime_s: float, *, faulted: bool) -> Frame:
        return self._heartbeat.frame(
            Heartbeat(
                state=NodeState.FAULT if faulted else NodeState.OPERATIONAL,
                reset_cause=None,  # unknown to a process
                uptime_s=uptime_s,
                catalogue_version=self._catalogue_version,
                configuration_version=self._configuration_version,
                transmit_error_count=math.nan,
                receive_error_count=math.nan,
            )
        )
