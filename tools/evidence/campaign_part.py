"""Run a study of configs/studies as a part: one JSON object with its groups, and its rows if few.

    python -m tools.evidence.campaign_part configs/studies/storm_seeds.yaml

What was computed before, by the same code, is not computed again.
"""

import contextlib
import io
import json
import sys
import time
from pathlib import Path

from firmware_sim.campaign.store import read_results
from firmware_sim.commands.campaign import campaign
from utank_hil.commands.common import new_app

FOLDER = Path(".cache/campaigns")
MOST_ROWS = 1000


def main() -> int:
    """Run the study that the command line names."""
    study = Path(sys.argv[1])
    out = FOLDER / study.stem
    app = new_app()
    app.command()(campaign)
    printed, begin = io.StringIO(), time.monotonic()
    with contextlib.redirect_stdout(printed):
        code = app([str(study), "--out", str(out), "--resume", "--json"], standalone_mode=False)
    if code:
        return int(code)
    summary = json.loads(printed.getvalue())
    results = read_results(out)
    rows = [
        {**{key: case[key] for key in results.keys}, **row}
        for case in results.cases
        for row in results.rows.get(case["case"], ())
    ]
    found = {
        "cases": summary["cases"],
        "wall_s": time.monotonic() - begin,
        "groups": summary["groups"],
        "failures": summary["failures"],
        "rows": rows if len(rows) <= MOST_ROWS else [],
    }
    # JSON knows no nan
    sys.stdout.write(json.dumps(json.loads(json.dumps(found), parse_constant=lambda _: None)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
