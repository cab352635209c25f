"""What a controller reports beside its frames: steps of retuning and of its alarm list.

The records are plain: recorder, announcer and report read them without what makes them.
"""

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from utank_hil.canbus.enumerations import AlarmState, Fault, Mode, RetuningState

if TYPE_CHECKING:
    from utank_hil.dynamics.ship import RollShip
    from utank_hil.dynamics.tank import Tank


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """A state change of an alarm, or a reset that was refused."""

    time_ns: int  #: Time on the node's clock.
    code: Fault
    state: AlarmState | None  #: State entered; None: a reset was refused since this lasts.
    mode: Mode  #: Mode of the controller.
    received: str = ""  #: Node, message and value that it is raised for, as far as they are known.


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """The identified ship, and the law's predicted performance."""

    roll_period_s: float  #: Natural roll period of the ship without tank water.
    period_deviation: float  #: Relative standard deviation of that period.
    inertia_kg_m2: float
    stiffness_nm_rad: float
    damping_nms_rad: float
    tank_damping_ratio: float
    held_out_fit: float  #: Worst one-step fit of an output on validation data.
    peak_sensitivity: float  #: Peak of the sensitivity function on the identified ship.
    #: Relative reduction of the roll RMS in the recorded waves, against the passive tank.
    roll_below_passive: float

    def ship(self, configured: "RollShip") -> "RollShip":
        """The configured ship as it was identified."""
        return configured.with_figures(
            self.inertia_kg_m2, self.stiffness_nm_rad, self.damping_nms_rad
        )

    def tank(self, configured: "Tank") -> "Tank":
        """The configured tank as it was identified."""
        return replace(configured, damping_ratio=self.tank_damping_ratio)


@dataclass(frozen=True, slots=True)
class RetuningEvent:
    """A state change of the retuning controller, or a message without one."""

    time_ns: int  #: Time on the node's clock.
    state: RetuningState  #: State entered; the present state for a message.
    reasons: tuple[str, ...]  #: Why, in words.
    #: Ship that the law on trial, or the accepted law, was designed for.
    found: ModelSummary | None = None

    def as_json(self, start_ns: int = 0) -> dict[str, Any]:
        """The event, ready for `json.dumps`; `time_s` counts from `start_ns`."""
        return {
            "time_s": (self.time_ns - start_ns) * 1e-9,
            "state": self.state.name,
            "reasons": list(self.reasons),
            "found": None if self.found is None else asdict(self.found),
        }
