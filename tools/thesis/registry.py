"""Every figure and group of printed numbers of chapters 2 to 4 of the source, in its order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from tools.thesis.adaptive_figures import (
    figure_3_11,
    figure_3_12,
    figure_3_13,
    figure_3_14,
    figure_3_15,
)
from tools.thesis.capsize_amplitudes import figure_capsize
from tools.thesis.damping import figure_damping
from tools.thesis.figure import Figure
from tools.thesis.friction_families import (
    figure_2_3,
    figure_2_4,
    figure_2_5,
    figure_2_6,
    figure_3_1,
)
from tools.thesis.fuzzy_parameters import figure_4_12, figure_4_13, figure_4_16
from tools.thesis.gains import figure_first_ship, figure_gains, figure_magnification
from tools.thesis.law_figures import figure_3_6, figure_3_7, figure_3_8, figure_3_9, figure_3_10
from tools.thesis.membership import figure_4_5
from tools.thesis.optimum import figure_3_2, figure_3_3, figure_3_4, figure_tank_place
from tools.thesis.patti_b import figure_contest
from tools.thesis.phase_plane import figure_4_1, table_4_1
from tools.thesis.pump_power import figure_2_7
from tools.thesis.still_water import figure_2_8
from tools.thesis.survival_figures import (
    figure_4_6,
    figure_4_7,
    figure_4_8,
    figure_4_9,
    figure_4_10,
    figure_4_11,
    figure_4_14,
    figure_4_15,
)


@dataclass(frozen=True, slots=True)
class Entry:
    """One figure or group of numbers."""

    key: str  #: Number of the figure, or name of the group.
    title: str
    #: What makes it anew; None for a sketch, of which there is nothing to compute.
    make: Callable[[], Figure] | None = None
    word: str = ""  #: What a sketch shows.

    @property
    def heading(self) -> str:
        """Number, if it has one, and title."""
        return f"{self.key}  {self.title}" if self.key[0].isdigit() else self.title

    def as_json(self) -> dict[str, str | None]:
        """Key, title and word."""
        return {"key": self.key, "title": self.title, "word": self.word or None}


ENTRIES: Final = (
    Entry(
        "magnification", "Magnification factors (introduction of chapter 2)", figure_magnification
    ),
    Entry("2.1", "Active U-tube tank", word="sketch of ship and tank"),
    Entry("2.2", "Inner pressure loop", word="block diagram"),
    Entry("2.3", "Roll by pump pressure: magnitude", figure_2_3),
    Entry("2.4", "Roll by pump pressure: phase", figure_2_4),
    Entry("2.5", "Water by pump pressure: magnitude", figure_2_5),
    Entry("2.6", "Water by pump pressure: phase", figure_2_6),
    Entry("2.7", "Stimulator moment per pump power", figure_2_7),
    Entry("2.8", "Roll on still water: pump on at 0, off at 141 s", figure_2_8),
    Entry("3.1", "Phases of roll and water by waves", figure_3_1),
    Entry("tank-height", "Effect of the tank's height Lz (3.2)", figure_tank_place),
    Entry("3.2", "Optimal frequency and damping ratio of the water", figure_3_2),
    Entry("3.3", "Roll at the optimal frequency ratio", figure_3_3),
    Entry("3.4", "Roll at the optimal damping ratio", figure_3_4),
    Entry("3.5", "Predictive control with identification", word="block diagram"),
    Entry("first-ship", "Numbers of the first ship (3.7, 3.8)", figure_first_ship),
    Entry("gains", "Printed gains of DPC and GPC (3.8)", figure_gains),
    Entry("3.6", "Roll over frequency with PD, LQR, GPC and DPC", figure_3_6),
    Entry("3.7", "Roll over time with PD, LQR, GPC and DPC", figure_3_7),
    Entry("3.8", "Pump pressure over time with LQR, GPC and DPC", figure_3_8),
    Entry("3.9", "Control horizon of DPC (roll, level)", figure_3_9),
    Entry("3.10", "Roll reduced per pressure", figure_3_10),
    Entry("3.11", "Adaptive DPC on roll and level", figure_3_11),
    Entry("3.12", "Record for identification: pulses, roll and water", figure_3_12),
    Entry("3.13", "Adaptive DPC on roll", figure_3_13),
    Entry("3.14", "Record for identification: pulses and roll", figure_3_14),
    Entry("3.15", "Adaptive GPC on roll", figure_3_15),
    Entry("4.1", "Phase plane without damping", figure_4_1),
    Entry("4.2", "Feedback linearization", word="block diagram"),
    Entry("4.3", "Fuzzy system", word="block diagram"),
    Entry("4.4", "Feedback connection of two systems", word="block diagram"),
    Entry("table-4.1", "Parameters of Patti-B (Table 4.1)", table_4_1),
    Entry("4.5", "Membership functions", figure_4_5),
    Entry("4.6", "Roll over time, wave moment 50.9 kN m", figure_4_6),
    Entry("4.7", "Roll rate over roll, wave moment 50.9 kN m", figure_4_7),
    Entry("4.8", "Roll over time, wave moment 78.6 kN m", figure_4_8),
    Entry("4.9", "Roll rate over roll, wave moment 78.6 kN m", figure_4_9),
    Entry("4.10", "Roll over time, the greatest waves", figure_4_10),
    Entry("4.11", "Roll rate over roll, the greatest waves", figure_4_11),
    Entry("capsize", "Wave moments that capsize Patti-B (4.5)", figure_capsize),
    Entry("contest", "Who capsizes, and in what wave (4.5)", figure_contest),
    Entry("4.12", "Parameter λ of (4.23), wave moment 78.6 kN m", figure_4_12),
    Entry("4.13", "Parameter θ of (4.23), wave moment 78.6 kN m", figure_4_13),
    Entry("4.14", "Roll over time with (4.20), wave moment 78.6 kN m", figure_4_14),
    Entry("4.15", "Roll rate over roll with (4.20), wave moment 78.6 kN m", figure_4_15),
    Entry("4.16", "Parameter λ of (4.20), wave moment 78.6 kN m", figure_4_16),
    Entry("damping", "Gains of roll damping (4.5, 5.1)", figure_damping),
)


class UnknownFigureError(ValueError):
    """A key that is not in the registry."""


def chosen(keys: Sequence[str]) -> tuple[Entry, ...]:
    """Entries of some keys, in the order of the source; all of them for no key.

    Raises `UnknownFigureError` if there is no such figure.
    """
    known = {entry.key for entry in ENTRIES}
    for key in keys:
        if key not in known:
            raise UnknownFigureError(
                f"no figure {key!r}; --list shows all of them: "
                + ", ".join(entry.key for entry in ENTRIES)
            )
    return tuple(entry for entry in ENTRIES if not keys or entry.key in keys)
