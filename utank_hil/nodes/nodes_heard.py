"""Which nodes are on the bus: their versions by their heartbeats, their names by their claims."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

from utank_hil.canbus import Address, AddressClaim, Catalogue, Fault, Heartbeat
from utank_hil.nodes.actuators_heard import ABSENT_NS
from utank_hil.nodes.plausibility import NEVER_HEARD_NS
from utank_hil.nodes.routing import Routing
from utank_hil.nodes.stations import ADDRESSES, Stations

_OWN_ADDRESS: Final = int(Address.CONTROLLER)
SOURCE_ADDRESS: Final = 0xFF
"""Part of an identifier that is the sender's address, by SAE J1939-21."""
CONFLICT_NS: Final = 10_000_000_000
"""Silence after which a second sender of an address counts as gone."""
VERSION_NS: Final = 5_000_000_000
"""A version that was not confirmed for so long is not known any more: fifty heartbeats."""
STRANGE_NS: Final = 1_000_000_000
"""Silence after which a second motion sensor of another version counts as gone."""


class NodesHeard:
    """The other nodes of the ship; `versions` are those of catalogue and ship that they must have.

    `matched` are the addresses that have to be heard. A second motion sensor is missed by its
    measurements, not waited for. `received` takes in words what a fault was judged by.
    """

    def __init__(
        self,
        routing: Routing,
        catalogue: Catalogue,
        versions: tuple[int, int],
        matched: Sequence[Address],
        stations: Stations,
        received: dict[Fault, str],
    ) -> None:
        self._versions, self._received, self._stations = versions, received, stations
        self._second_beat = 0
        self._strange_ns = self._conflict_ns = self._claimed_twice_ns = NEVER_HEARD_NS
        self._matched_ns: dict[int, int] = {}
        self._names: dict[int, int | None] = {}
        for address in matched:
            heartbeat = catalogue.receiver(Heartbeat, address)
            self._matched_ns[heartbeat.can_id] = NEVER_HEARD_NS
            if address is Address.SENSORS_2:
                self._second_beat = heartbeat.can_id
                self._matched_ns[heartbeat.can_id] = ABSENT_NS
            routing.subscribe(heartbeat, partial(self._take_beat, heartbeat.can_id))
        for address in (*matched, *ADDRESSES.values()):
            claims = catalogue.receiver(AddressClaim, address)
            take = partial(self._take_claim, address, claims.can_id)
            routing.accept(claims.can_id, claims.accept, take)
        self._find_oldest()

    @property
    def beats(self) -> Iterable[int]:
        """Identifiers of the heartbeats that have to be heard."""
        return self._matched_ns

    def matches(self, now_ns: int) -> bool:
        """Whether all have confirmed their versions of late."""
        oldest_ns, strange_ns = self._oldest_ns, self._strange_ns
        return now_ns - oldest_ns <= VERSION_NS and now_ns - strange_ns > STRANGE_NS

    def own_address_used(self, now_ns: int) -> bool:
        """Whether another node has sent from the controller's address of late."""
        return now_ns - self._conflict_ns <= CONFLICT_NS

    def address_used_twice(self, now_ns: int) -> bool:
        """Whether two nodes have claimed one address of late."""
        return now_ns - self._claimed_twice_ns <= CONFLICT_NS

    def takes_own(self, can_id: int, now_ns: int) -> bool:
        """Take note of a frame from the controller's own address; False if it is from another."""
        if can_id & SOURCE_ADDRESS != _OWN_ADDRESS:
            return False
        self._conflict_ns = now_ns
        self._received[Fault.ADDRESS_CONFLICT] = f"identifier 0x{can_id:08X}"
        return True

    def _take_beat(self, can_id: int, beat: Heartbeat, now_ns: int) -> None:
        versions = (beat.catalogue_version, beat.configuration_version)
        matches = versions == self._versions
        if not matches:
            self._received[Fault.VERSION_MISMATCH] = (
                f"{Address(can_id & SOURCE_ADDRESS).name.lower()}: heartbeat 0x{can_id:08X}, "
                f"catalogue {versions[0]} and ship {versions[1]}, here {self._versions[0]} and "
                f"{self._versions[1]}"
            )
        if can_id == self._second_beat:  # silent, it is not waited for
            self._strange_ns = NEVER_HEARD_NS if matches else now_ns
            return
        self._matched_ns[can_id] = now_ns if matches else NEVER_HEARD_NS
        self._find_oldest()

    def _find_oldest(self) -> None:
        self._oldest_ns = min(self._matched_ns.values(), default=ABSENT_NS)

    def _take_claim(self, address: int, can_id: int, claim: AddressClaim, now_ns: int) -> None:
        self._stations.started(address)
        if self._names.setdefault(can_id, claim.name) != claim.name:
            self._claimed_twice_ns = now_ns
            was = self._names[can_id]
            self._received[Fault.FOREIGN_SENDER] = (
                f"{Address(address).name.lower()}: address claim 0x{can_id:08X}, name "
                f"{claim.name} after {was}"
            )
            self._names[can_id] = claim.name  # of a device that was replaced
