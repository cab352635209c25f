"""Tables of laws, their margins and what a step of them costs."""

from tools.documents.rows import Rows, Table, number

Law = dict[str, float | None]
GRID = "+-30 % roll period, 0.8 to 1.25 of the inertia, +-20 % gain, 0 or 20 ms later"


def law_margins(result: dict[str, dict[str, Law]]) -> Rows:
    """What each law stands, a column a law."""
    laws = result["margins"]

    def row(name: str, column: str, form: str, limit: str, beyond: str = "any") -> list[str]:
        cells = (
            number(law[column], form) or beyond if column in law else "" for law in laws.values()
        )
        return [name, *cells, limit]

    return [
        ["", *laws, "asked for"],
        row("peak sensitivity", "peak of S", ".2f", "2 or less"),
        row("the same, 20 ms later", "S 20 ms late", ".2f", "stable"),
        row("least gain factor that keeps it stable", "gain from", ".2f", "0.8 or less"),
        row("greatest gain factor that does", "gain to", ".2f", "1.2 or more"),
        row("phase margin, deg", "phase margin °", ".0f", ""),
        row("extra delay that destabilizes, s", "delay margin s", ".3f", "above 0.020", "above 5"),
        row("pole of the law itself", "law's pole", ".3f", ""),
        row(f"greatest eigenvalue, {GRID}", "worst pole", ".4f", "below 1"),
        row("list under a steady moment, without washout", "list, no washout", ".2f", ""),
    ]


def passive_optimum(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """The best passive tanks, and the first ship's."""
    return [
        ["tank", "frequency ratio", "damping ratio", "greatest roll per static roll"],
        *(
            [name, *(f"{row[column]:.3f}" for column in list(row)[:2]),
             f"{row['greatest roll per static']:.2f}"]
            for name, row in result["passive"].items()
        ),
    ]  # fmt: skip


def printed_laws(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """Largest deviations from the printed coefficients."""
    shares = ("16 roll-only", "8 on u and roll", "4 on tank angle")
    return [
        ["ship", "roll damping, N m s", "tank damping", *shares],
        *(
            [
                name,
                f"{row['roll damping N m s']:.3g}",
                f"{row['tank damping']:.3f}",
                *(f"{100 * row[share]:.2g} %" for share in shares),
            ]
            for name, row in result["printed"].items()
            if "tank damping" in row
        ),
    ]


def printed_index(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """Performance indices relative to DPC (roll)."""
    laws = ["GPC (roll)", "DPC (roll, level)", "GPC (roll, level)"]
    return [
        ["relative to DPC (roll)", *laws],
        *(
            [name, *(f"{row[law]:.3f}" for law in laws)]
            for name, row in result["index"].items()
        ),
    ]  # fmt: skip


def step_costs(result: dict[str, dict[str, float]]) -> Rows:
    """Cost of a step of each controller."""
    return [
        ["law", "p50, us", "p99", "max", "bytes held in a step", "bytes kept"],
        *(
            [
                name,
                *(f"{cost[key]:.1f}" for key in ("p50_us", "p99_us")),
                *(f"{cost[key]:.0f}" for key in ("max_us", "held_bytes", "kept_bytes")),
            ]
            for name, cost in result.items()
        ),
    ]


TABLES: dict[str, Table] = {
    "law margins": ("linear_law_tables", law_margins),
    "passive optimum": ("linear_law_tables", passive_optimum),
    "printed laws": ("linear_law_tables", printed_laws),
    "printed index": ("linear_law_tables", printed_index),
    "step costs": ("cost_controllers", step_costs),
}
