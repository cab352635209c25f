"""The evidence: what is run, what is kept of it, when it is out of date, the tables made of it."""

import json
import math
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tools.documents import sea_tables, tables, write
from tools.evidence import record, sources
from tools.evidence.__main__ import main
from tools.evidence.parts import PARTS, Part
from tools.studies import many_seas, renewed_seas, sea_estimates

TOY = Part("toy", "python -m tools.thesis.derive_tank_forces --json", "nothing", 1)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of results of its own."""
    folder = tmp_path / "kept"
    folder.mkdir()
    monkeypatch.setattr(record, "FOLDER", folder)
    monkeypatch.setattr(record, "PRINTED", tmp_path / "printed")
    return folder


def keep(part: Part, result: object) -> None:
    kept = {"part": part.name, "command": part.command, "sources": record.sources(part)}
    record.file_of(part).write_text(json.dumps(kept | {"date": "2026-01-01", "result": result}))


def test_every_part_is_of_a_module_that_is_there_and_every_result_of_a_part() -> None:
    assert len({part.name for part in PARTS}) == len(PARTS)
    for part in PARTS:
        words = shlex.split(part.command)
        module = words[words.index("-m") + 1]
        assert Path(module.replace(".", "/") + ".py").is_file(), part.name
    assert {file.stem for file in record.FOLDER.iterdir()} <= {part.name for part in PARTS}


@pytest.mark.slow
def test_a_part_may_be_a_command_of_the_product() -> None:
    part = next(part for part in PARTS if "firmware_sim" in part.command)
    assert record.sources(part)


def test_every_study_benchmark_and_comparison_is_a_part() -> None:
    commands = " ".join(part.command for part in PARTS)
    for pattern in ("studies/*", "thesis/*", "benchmarks/*", "peers/compare_*"):
        for file in Path("tools").glob(f"{pattern}.py"):
            if "argparse" in file.read_text() and "No command of its own" not in file.read_text():
                assert f"tools.{file.parent.name}.{file.stem} " in commands


@pytest.mark.slow
def test_result_is_current_until_its_command_or_its_code_changes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert record.state(TOY) == "not run yet"
    keep(TOY, {})
    assert record.state(TOY) == "current"
    assert record.state(replace(TOY, command=TOY.command + " --more")) == "other command"
    monkeypatch.setattr(record, "digest_of", lambda files: "another")
    assert record.state(TOY) == "other code"


def test_digest_is_of_what_the_code_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    digests = []
    for number, text in enumerate(
        (
            "def f(x):\n    return x + 1\n",
            'def f(x):\n    """Add one."""\n\n    return (x + 1)  # more\n',
            "def f(x):\n    return x + 2\n",
        )
    ):
        place = tmp_path / str(number)
        place.mkdir()
        monkeypatch.setattr(sources, "ROOT", place)
        (place / "a.py").write_text(text)
        digests.append(sources.digest_of([place / "a.py"]))
    assert digests[0] == digests[1] != digests[2]


def test_code_of_a_part_is_what_its_tool_imports_and_no_more() -> None:
    tool = sources.ROOT / "tools" / "thesis" / "derive_tank_forces.py"
    found = {file.relative_to(sources.ROOT).as_posix() for file in sources.imported([tool])}
    assert {"utank_hil/dynamics/wrench.py", "utank_hil/__init__.py"} <= found
    assert not {name for name in found if name.startswith(("firmware_sim", "utank_hil/canbus"))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("python -m tools.benchmarks.codec --help", "printed no JSON object"),
        ("python -m tools.benchmarks.codec --nonsense", "exit code 2"),
    ],
)
def test_part_that_fails_keeps_what_was_there_and_what_it_printed(
    folder: Path, command: str, reason: str
) -> None:
    part = replace(TOY, command=command)
    keep(part, "old")
    with pytest.raises(record.PartError, match=reason):
        record.run(part)
    assert [record.read(part)["result"], *folder.iterdir()] == ["old", record.file_of(part)]
    assert (record.PRINTED / f"{part.name}.out").exists()


@pytest.mark.slow
def test_tests_as_a_part_say_how_each_ended_and_what_it_printed(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("cases") / "test_cases.py"
    file.write_text("def test_good():\n    print('three')\n")
    part = replace(
        TOY, command=f"python -m tools.evidence.pytest_part --rootdir {file.parent} {file}"
    )
    record.run(part)
    kept = json.loads(record.file_of(part).read_text())
    ((name, test),) = kept["result"]["tests"].items()
    assert name.endswith("test_good")
    assert (test["outcome"], test["printed"]) == ("passed", ["three"])
    assert (kept["command"], record.state(part)) == (part.command, "current")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", kept["date"])
    assert kept["machine"]["cores"] >= 1
    assert kept["versions"]["numpy"]
    file.write_text("def test_bad():\n    assert False\n")
    with pytest.raises(record.PartError, match="exit code 1"):
        record.run(part)


@pytest.mark.slow
def test_only_what_is_missing_or_out_of_date_is_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ran: list[str] = []

    def run(part: Part) -> dict[str, float]:
        ran.append(part.name)
        if part.name == "cost_codec":
            raise record.PartError("it is busy")
        return {"seconds": 1.0}

    monkeypatch.setattr("tools.evidence.__main__.run", run)
    names = ["linear_law_tables", "cost_codec", "cost_slice"]
    keep(next(part for part in PARTS if part.name == names[0]), {})
    arguments = [word for name in names for word in ("--part", name)]
    for force, expected in ((["--force"], names), ([], names[1:])):
        ran.clear()
        monkeypatch.setattr("sys.argv", ["evidence", *arguments, *force])
        assert main() == 1  # the others are run all the same
        assert ran == expected
        assert "it is busy" in capsys.readouterr().out


def test_table_of_a_document_is_made_anew_and_a_stale_one_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tables, "DOCS", tmp_path)
    monkeypatch.setattr(write, "pages", tables.pages)
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- table: errata terms -->\nold\n<!-- end of table -->\nafter\n")
    assert write.main(["--check"]) == 1
    assert "page.md is stale: run `make docs`" in capsys.readouterr().err
    assert write.main([]) == 0
    lines = page.read_text().splitlines()
    assert (lines[0], lines[-1]) == ("before", "after")
    assert lines[2] == "| equation | term | printed coefficient | first principles |"
    assert "old" not in lines
    assert write.main(["--check"]) == 0
    page.write_text("<!-- table: errors -->\n<!-- end of table -->\n")
    assert write.main([]) == 1
    assert "page.md: no table 'errors'" in capsys.readouterr().err


def test_table_without_its_result_names_the_part_to_run(folder: Path) -> None:
    with pytest.raises(tables.TableError, match="--part linear_law_tables"):
        tables.table("law margins")


def test_measured_hours_are_counted_by_their_roll_and_judged_by_their_intervals() -> None:
    def group(
        passive_deg: float, below: float, half_width: float, kilowatts: float
    ) -> dict[str, Any]:
        law = {
            "roll_below_passive": {"mean": below, "half_width": half_width},
            "power_mean_w": {"mean": 1e3 * kilowatts},
        }
        passive = {"roll_rms_rad": {"mean": math.radians(passive_deg)}}
        return {"runs": {"passive": passive, "self-tuning": law}}

    groups = [group(0.2, 0.5, 0.1, 100), group(1.5, -0.2, 0.1, 500), group(1.6, -0.1, 0.2, 700)]
    heading, *rows = sea_tables.february_hours({"groups": groups})
    assert [row[0] for row in rows] == ["below 0.25°", "above 1°", "all"]
    assert rows[1][1:] == ["2", "-15.0%", "-20% ± 10", "1", "600", "1.2"]
    assert rows[2][1:] == ["3", "6.7%", "-20% ± 10", "1", "433", "1.3"]
    assert {len(row) for row in rows} == {len(heading)}


def test_seas_under_way_are_told_by_share_and_power_and_their_mean_is_last() -> None:
    def run(share: float) -> dict[str, Any]:
        law = {"below_passive": share / 2, "share": share, "power_w": 1e5, "active": 1.0}
        return {"passive_deg": 2.0, "bound_deg": 1.0, **dict.fromkeys(renewed_seas.LAWS, law)}

    calm, storm = (
        renewed_seas.summary([run(share - 0.1), run(share + 0.1)]) for share in (0.3, 0.7)
    )
    mean = dict.fromkeys(renewed_seas.LAWS, storm["renewed"])
    result = {"seas": {"calm": calm, "storm": storm}, "mean of the first sixteen": mean}
    heading, *rows = sea_tables.renewed_seas(result)
    half = round(100 * 0.1 * math.sqrt(2) * 12.706 / math.sqrt(2))  # Student's t, one of freedom
    assert rows[0][:5] == ["calm", "2.00", *3 * [f"30% ± {half}"]]
    assert rows[1][5:] == ["35.0%", "100", "100", "100"]
    assert rows[2][:3] == ["mean of the first sixteen", "", f"70% ± {half}"]
    assert {len(row) for row in rows} == {len(heading)}


def test_a_sea_of_any_spectrum_is_sailed_by_all_laws_and_the_passive_tank() -> None:
    sea = many_seas.seas()["2 m 14 s and 1.5 m 6 s"]
    jobs = renewed_seas.jobs(sea, 3)
    assert [job.name for job in jobs] == ["passive", *renewed_seas.LAWS]
    drawn = {job.scenario.sea.sea(job.seed).amplitude_m.tobytes() for job in jobs}
    assert len(drawn) == 1
    assert jobs[-1].controller.sea_estimate.renew


def test_a_ship_that_is_not_told_is_counted_and_has_no_error() -> None:
    def part(of_ship: str, stiffness: float, law: str = "gpc") -> sea_estimates.Part:
        figures = dict.fromkeys(("moment", "height", "peak", "spectrum_db", "stated"), 0.0)
        return sea_estimates.Part(
            "storm", law, 8.8, 20.0, "GOOD", of_ship, **figures,
            stiffness=stiffness, period=0.0, stiffness_deviation=0.01,
        )  # fmt: skip

    parts = [part("GOOD", -0.06), part("GOOD", 0.04), part("UNCERTAIN", 0.5)]
    (row,) = sea_estimates.loadings([*parts, part("GOOD", 0.9, "passive")])
    assert (row["parts"], row["told"], row["within"], row["worst"]) == (3, 2, 1, 0.06)
    told = sea_tables.stiffness_by_loading({"loadings": [row]})[1]
    assert told == ["20", "8.8", "3", "2", "1", "6.0%"]
