"""``utank-hil compare``: differences between runs, recordings or campaigns."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from rich.table import Table

from utank_hil.console.common import Json, argument, fail, failing, print_json
from utank_hil.console.terminal import Terminal, new_table, shown

if TYPE_CHECKING:
    from firmware_sim.comparison import Comparison, Difference

_SCALES: Final = {
    "rad": (180 / math.pi, "°"),
    "pa": (1e-3, "kPa"),
    "w": (1e-3, "kW"),
    "m": (1, "m"),
}


def compare(
    reference: Annotated[Path, argument("Bench or campaign folder; or a recording, log or table.")],
    others: Annotated[list[Path], argument("One or more of the same kind.")],
    json_: Json = False,
) -> None:
    """Compare runs, recordings or campaigns with the first: differences with 95 % intervals.

    **Example:** utank-hil compare out out/seed7

    Pieces of recordings of the same seed and sea are compared pair by pair; so are cases of
    campaigns in the same waves. What one study varies it compares itself (utank-hil campaign).
    """
    from firmware_sim.campaign.store import ABOUT
    from firmware_sim.comparison import compare_campaigns, compare_records
    from firmware_sim.report_page import RECORDING
    from utank_hil.base.text_files import where_instead

    places = [reference, *others]
    campaigns = [(place / ABOUT).is_file() for place in places]
    if any(campaigns) and not all(campaigns):
        fail("a campaign and a recording can't be compared: name things of one kind")
    files = [place / RECORDING if place.is_dir() else place for place in places]
    for place, file, campaign in zip(places, files, campaigns, strict=True):
        if not (file.is_file() or campaign):
            wanted = f"{RECORDING} or {ABOUT}" if place.is_dir() else "such file"
            named = "name a folder of `bench` or `campaign`, or a file"
            if not place.exists():
                named += f"; {where_instead(place)}"
            fail(f"{place}: there is no {wanted}; {named}")
    with failing(ValueError):
        if all(campaigns):
            found = compare_campaigns(reference, others)
        else:
            found = compare_records(files[0], files[1:])
    if json_:
        print_json({"reference": str(reference), "comparisons": [asdict(each) for each in found]})
        return
    console = Terminal()
    for source in dict.fromkeys(each.source for each in found):
        of_source = [each for each in found if each.source == source]
        console.table(_table(reference, of_source))
        for remark in dict.fromkeys(remark for each in of_source for remark in each.remarks):
            console.say(yellow=remark)


def _table(reference: Path, found: list["Comparison"]) -> Table:
    intervals = any(
        figure.half_width is not None for each in found for figure in each.figures.values()
    )
    table = new_table(
        f"{shown(Path(found[0].source))} against {shown(reference)}",
        *("first", "this", "difference", "%", "pairs"),
        names=("run",),
        caption="difference ± half width of its 95 % interval" if intervals else None,
    )
    for each in found:
        for words in (each.run, *(f"{name} {value}" for name, value in each.parameters.items())):
            table.add_row(words)
        for name, figure in each.figures.items():
            table.add_row(*_cells(name, figure))
    return table


def _cells(name: str, figure: "Difference") -> list[str]:
    words, _, unit = name.rpartition("_")
    scale, said = _SCALES.get(unit, (1.0, ""))
    width = "" if figure.half_width is None else f" ± {scale * figure.half_width:.3g}"
    return [
        "  " + (f"{words} {said}" if said else name).replace("_", " "),
        f"{scale * figure.reference:.4g}",
        f"{scale * figure.value:.4g}",
        f"{scale * figure.difference:+.3g}{width}",
        f"{figure.difference / figure.reference:+.1%}" if figure.reference else "",
        str(figure.count) if figure.paired else "none",
    ]
