"""Mistakes of a user at the command line: each is told by its place and with a remedy."""

import math
import re
import shlex
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from utank_hil.cli import app

CONFIGS = Path("configs").resolve()
GPC, FIRST, STORM = "controllers/gpc.yaml", "ships/thesis_first.yaml", "scenarios/storm.yaml"
SHIP = ("--length", "90", "--beam", "14", "--displacement", "2800", "--gm", "1.1")

#: Words of the command with {configs} and {here}, then what the message must name.
MISTAKES: list[tuple[str, str, tuple[str, ...]]] = [
    # a file of another kind, or none
    ("a ship to run", f"run {{configs}}/{FIRST} --bus can0", ("thesis_first.yaml", "controller")),
    ("a scenario to run", f"run {{configs}}/{STORM} --bus can0", ("storm.yaml", "controller")),
    ("a controller to the bench", f"bench {{configs}}/{GPC}", ("gpc.yaml", "scenario")),
    ("a ship to the bench", f"bench {{configs}}/{FIRST}", ("thesis_first.yaml", "scenario")),
    ("a scenario to a campaign", f"campaign {{configs}}/{STORM}", ("storm.yaml", "study")),
    ("a controller to the panel", f"panel {{configs}}/{GPC} --bus can0", ("gpc.yaml", "ship")),
    ("a folder to check", "check {here}", ("{here}", "file")),
    ("a table to check", "check {here}/table.csv", ("table.csv",)),
    ("an empty file", "check {here}/empty.yaml", ("empty.yaml", "is empty and must hold")),
    ("an empty file to the bench", "bench {here}/empty.yaml", ("is empty and must hold",)),
    ("an empty study", "campaign {here}/empty.yaml", ("is empty and must hold",)),
    ("items indented unlike", "campaign {here}/items.yaml", ("line 4", "items of one list")),
    ("an item among keys", "campaign {here}/mixed.yaml", ("line 3", "keys or items, not both")),
    ("no space after a colon", "check {here}/colon.yaml", ("line 4", "a colon and a space")),
    ("a minute in a number", "check {here}/minute.yaml", ("period_s", "'0:22'", "number alone")),
    ("a percent", "check {here}/percent.yaml", ("damping_ratio", "as a share, 0.02")),
    ("a report of a ship", f"report {{configs}}/{FIRST}", ("is no log", ".frames")),
    ("a replay of a ship", f"replay {{configs}}/{FIRST}", ("is no .frames file", "--config")),
    ("a ship to faults", f"faults --scenario {{configs}}/{FIRST}", ("is a ship", "scenario")),
    ("a sea that is a ship", f"design tank {{configs}}/{FIRST} --scenario {{configs}}/{FIRST}",
     ("is a ship, and a scenario is wanted",)),
    ("a scenario to design", f"design tank {{configs}}/{STORM}", ("is a scenario", "a ship is")),
    ("a folder to the bench", "bench {here}", ("is a folder; name a file in it",)),
    ("an empty decay", "identify decay {here}/nothing.csv", ("line 1", "time_s,roll_deg")),
    ("a typo in a row", "identify decay {here}/typo.csv", ("line 3", "roll_deg", "'x'")),
    ("length and beam swapped", "init {here}/new --length 14 --beam 90 --displacement 2800 "
     "--gm 1.1 --roll-period 10", ("--beam", "swap the two")),
    ("kilograms", "init {here}/new --length 90 --beam 14 --displacement 2800000 --gm 1.1 "
     "--roll-period 10", ("--displacement", "in tonnes")),
    ("feet", "init {here}/new --length 295 --beam 46 --displacement 2800 --gm 3.6 "
     "--roll-period 10", ("--displacement", "in metres")),
    ("a recording that is not there", "monitor {here}/nothing", ("is not there",)),
    ("tabs", "check {here}/tabs.yaml", ("tabs.yaml", "line 2", "tab")),
    ("a key under a value", "check {here}/indent.yaml", ("indent.yaml", "line 3", "indented")),
    ("letters of Windows", "check {here}/latin.yaml", ("latin.yaml", "UTF-8")),
    ("a file that is not there", "bench {here}/strom.yaml", ("strom.yaml", "no such file")),
    ("no recording", "report {here}/table.csv", ("table.csv",)),
    ("nothing to report", "report {here}", ("{here}",)),
    ("a replay of a table", "replay {here}/table.csv", ("table.csv",)),
    ("an export of a text", "export {here}/tabs.yaml --to {here}/out.csv", ("tabs.yaml",)),
    ("an export to nothing", "export {here}/table.csv", ("--to",)),
    # options
    ("a misspelt command", "bnech", ("No such command", "bnech")),
    ("a misspelt option", "bench --sede 3", ("--seed",)),
    ("no bus", f"run {{configs}}/{GPC}", ("--bus",)),
    ("an empty bus", f"run {{configs}}/{GPC} --bus ''", ("bus",)),
    ("a bus by its device", f"run {{configs}}/{GPC} --bus /dev/ttyUSB0", ("/dev/ttyUSB0",)),
    ("a seed with a point", "bench --seed 1.5", ("--seed", "integer")),
    ("an outlet without a port", f"run {{configs}}/{GPC} --bus can0 --outward udp://127.0.0.1",
     ("--outward", "127.0.0.1:10110")),
    # a ship from its papers
    ("a GM in centimetres", "init {here}/a --length 90 --beam 14 --displacement 2800 --gm 110 "
     "--roll-period 10", ("gm", "metres")),
    ("a GM in centimetres, the period by formula", "init {here}/a --length 90 --beam 14 "
     "--displacement 2800 --gm 110 --draught 4", ("--gm", "the metacentre 11.3 m above", "metres")),
    ("no stability", "init {here}/a --length 90 --beam 14 --displacement 2800 --gm -1", ("gm",)),
    ("neither draught nor period", f"init {{here}}/a {' '.join(SHIP)}",
     ("roll-period", "draught")),
    ("a folder in use", f"init {{here}}/used {' '.join(SHIP)} --roll-period 10",
     ("ship.yaml", "another folder")),
    ("a tank broader than the ship", f"init {{here}}/a {' '.join(SHIP)} --roll-period 10 "
     "--tank-breadth 20", ("--tank-breadth", "20 m", "beam 14 m")),
    ("a share of GM in per cent", f"init {{here}}/a {' '.join(SHIP)} --roll-period 10 --gm-loss 15",
     ("gm-loss",)),
    # a record of the ship
    ("a record's degrees as radians", "identify decay {here}/radians.csv", ("roll_deg",)),
    ("a record's milliseconds as seconds", "identify decay {here}/milliseconds.csv",
     ("rolls in", "in seconds")),
    ("a record that runs backward", "identify decay {here}/backward.csv", ("rising times",)),
    ("decimals with a comma", "identify decay {here}/comma.csv", ("line 2, time_s", "a point")),
    ("a record of other columns", "identify decay {here}/shifts.csv", ("in SI units it has",
     "heel_rad")),
    ("an end before the beginning", "identify decay {here}/radians.csv --from 90 --to 20",
     ("--from 90", "--to 20")),
    ("kilograms for tonnes", "identify inclining {here}/shifts.csv --displacement 2000000",
     ("GM would be", "N m", "2e+06 t")),
    # commands that take another's files
    ("rows that are none", "faults --rows nothing", ("--rows", "nothing")),
    ("a controller for the decay's ship", f"identify decay {{here}}/radians.csv "
     f"--ship {{configs}}/{GPC}", ("gpc.yaml", "a ship is wanted")),
    ("a controller for the tank's sea", f"design tank {{configs}}/{FIRST} "
     f"--scenario {{configs}}/{GPC}", ("gpc.yaml", "a scenario is wanted")),
    ("an outlet of the web", f"run {{configs}}/{GPC} --bus can0 --outward http://127.0.0.1:80",
     ("--outward", "modbus://")),
    ("an export onto itself", "export {here}/table.csv --to {here}/table.csv",
     ("table.csv", "another file")),
    ("a duration with its unit", "bench --duration 5min", ("--duration", "number")),
    ("a length with its unit", "init {here}/a --length 90m --beam 14 --displacement 2800 --gm 1.1",
     ("--length", "number")),
    ("a controller to the tank's", f"design tank {{configs}}/{GPC}", ("is a controller", "ship")),
    ("results that are not there", "compare {here}/out1 {here}/out2", ("out1", "bench")),
    ("results into a file", f"bench {{configs}}/{STORM} --out {{here}}/table.csv",
     ("table.csv", "--out")),
    ("a bus in simulated time", "bench --bus can0", ("--bus", "--realtime")),
    ("a format by another name", "export {here}/table.csv --to {here}/out.mat",
     ("out.mat", ".parquet")),
    ("a port that is none", f"panel {{configs}}/{FIRST} --bus can0 --web "
     "--listen 127.0.0.1:99999", ("--listen", "port")),
    ("all addresses by another name", f"panel {{configs}}/{FIRST} --bus can0 --web --listen 0:0",
     ("--listen", "one address")),
    *((f"no file for {words.partition(' ')[0]} {number}", words,
       ("tabel.csv", "did you mean {here}/table.csv?"))
      for number, words in enumerate((
          "report {here}/tabel.csv", "replay {here}/tabel.csv", "bench {here}/tabel.csv",
          "export {here}/tabel.csv --to {here}/x.csv", "check {here}/tabel.csv",
          "compare {here}/tabel.csv {here}/table.csv", "monitor {here}/tabel.csv",
          "identify decay {here}/tabel.csv", f"identify log {{here}}/tabel.csv {{configs}}/{GPC}",
          f"identify sea {{here}}/tabel.csv --ship {{configs}}/{FIRST}",
          "identify inclining {here}/tabel.csv --displacement 2000", "bus {here}/tabel.csv",
          "hull {here}/tabel.csv --gm 1 --gyration 3", "campaign {here}/tabel.csv",
          "design tank {here}/tabel.csv", "faults {here}/tabel.csv",
          "run {here}/tabel.csv --bus can0", "panel {here}/tabel.csv --bus can0",
          "commission {here}/tabel.csv --bus can0",
      ))),
    ("a folder that is not there", "report {here}/nothing/a.frames",
     ("there is no folder {here}/nothing",)),
    ("a name like no other", "replay {here}/zzzzzzzz.frames", ("it is not in {here}",)),
    ("an address with two points", f"panel {{configs}}/{FIRST} --bus can0 --web "
     "--listen 127.0..1:8047", ("--listen", "one address")),
    ("a sea of no height", f"init {{here}}/a {' '.join(SHIP)} --roll-period 10 --hs 0",
     ("--hs", "positive")),
]  # fmt: skip

#: Changes of a shipped file, and what the message must name.
IN_A_FILE: list[tuple[str, str, str, object, tuple[str, ...]]] = [
    ("a name that is no file", GPC, "vessel", "my_ship.yaml", ("vessel", "my_ship.yaml")),
    ("a law without a kind", GPC, "law", {"gain": 1}, ("law", "kind")),
    ("a law of another name", GPC, "law", {"kind": "pid"}, ("law", "pid", "gpc")),
    ("a comma for a point", GPC, "limits", {"level_m": "3,5"}, ("limits.level_m", "3,5")),
    ("a unit behind the number", GPC, "limits", {"pressure_pa": "50 kPa"},
     ("limits.pressure_pa", "50 kPa")),
    ("a list for a number", GPC, "bit_rate", [250_000], ("bit_rate",)),
    ("yes for a number", GPC, "bit_rate", True, ("bit_rate",)),
    ("no sea", STORM, "sea", None, ("sea",)),
    ("a sea of another kind", STORM, "sea", {"kind": "johnswap"}, ("sea", "jonswap")),
    ("a duration in words", STORM, "duration_s", "one hour", ("duration_s", "one hour")),
    ("no controllers", STORM, "controllers", {}, ("controllers",)),
    ("an order that is none", STORM, "operator", [{"time_s": 5.0, "action": "armed"}],
     ("operator", "arm")),
    ("an order before the beginning", STORM, "operator", [{"time_s": -5.0, "action": "arm"}],
     ("operator", "time_s")),
    ("a negative duration", STORM, "duration_s", -60.0, ("duration_s", "-60")),
    ("no number", STORM, "duration_s", float("nan"), ("duration_s", "nan")),
    ("a seed in words", STORM, "seed", "first", ("seed", "first")),
    ("a misspelt key", GPC, "limtis", {"level_m": 3.5}, ("limtis", "limits")),
    ("a misspelt key inside", GPC, "limits", {"level": 3.5}, ("limits.level", "level_m")),
    ("a limit of nothing", GPC, "limits", {"pressure_pa": 0}, ("limits.pressure_pa", "0")),
    ("a delay in milliseconds", GPC, "delay_s", 50, ("delay_s", "50")),
    ("a sea without its height", STORM, "sea", {"kind": "jonswap", "tp_s": 10.0}, ("hs_m",)),
    ("a wave height in centimetres", STORM, "sea",
     {"kind": "jonswap", "hs_m": 450.0, "tp_s": 10.0}, ("hs_m", "450")),
    ("a settling beyond the end", STORM, "settle_s", 1e6, ("settle_s",)),
    ("a law of no file", GPC, "law", {"kind": "python", "factory": "mine:make"},
     ("law.kind", "--allow-code")),
    ("a controller called passive", STORM, "controllers",
     {"passive": str(CONFIGS / GPC)}, ("controllers", "passive", "rename")),
    ("a fault of a signal that is none", STORM, "faults",
     [{"kind": "stuck", "message": "SENSOR_MOTION", "signals": ["roll_deg"], "at_s": 50}],
     ("faults.0.signals.0", "roll_rad")),
    ("a slope as a number", STORM, "sea",
     {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "effective_slope": 0.7},
     ("sea.effective_slope", "0.7", "beam_m, coefficient, depth_m")),
    ("a course of waves without directions", STORM, "sea",
     {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "course_deg": 20},
     ("sea.course_deg", "heading_deg")),
    ("a date of home", STORM, "sea", {"kind": "measured", "time": "10.02.2019 05:40",
     "file": str(CONFIGS / "seas/ndbc_41010_2019-02_spectral_density.txt")},
     ("sea.time", "2019-02-10T05:40")),
    ("an hour between two records", STORM, "sea", {"kind": "measured", "time": "2019-02-10T05:41",
     "file": str(CONFIGS / "seas/ndbc_41010_2019-02_spectral_density.txt")},
     ("sea.time", "the nearest is of 2019-02-10T05:40")),
    ("a table of waves that is not there", STORM, "sea",
     {"kind": "tabulated", "file": "waves.csv"}, ("sea.file", "waves.csv", "beside the file")),
    ("a negative spreading", STORM, "sea",
     {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "spreading": -2}, ("sea.spreading", "zero")),
    ("a time with its unit", STORM, "operator", [{"time_s": "5 s", "action": "arm"}],
     ("operator.0.time_s", "5 s", "the number alone")),
    ("one order that is no list", STORM, "operator", {"time_s": 5.0, "action": "arm"},
     ("operator", "a list")),
    ("half the name of a plant", STORM, "plant", "sway", ("plant", "sway_roll_yaw")),
    ("a ship that sways without a hull", STORM, "plant", "sway_roll_yaw", ("hull", "required")),
    ("laws as a list", STORM, "controllers", ["gpc.yaml"], ("controllers", "gpc.yaml", "mapping")),
    ("a fault of nearly that name", STORM, "faults",
     [{"kind": "stuckk", "message": "SENSOR_MOTION"}], ("faults.0.kind", "did you mean stuck")),
    ("a wave without a period", STORM, "sea",
     {"kind": "regular", "amplitude_m": 1.0, "period_s": 0}, ("sea.period_s", "above 0")),
    ("matrices that are not there", GPC, "law",
     {"kind": "state_space", "measured": ["roll_rad"], "system": "./x.npz"},
     ("law.system", "x.npz", "No such file", "beside the file")),
    ("a scenario for a ship", GPC, "vessel", str(CONFIGS / STORM), ("vessel", "storm.yaml")),
]  # fmt: skip


@pytest.fixture
def here(tmp_path: Path) -> Path:
    (tmp_path / "table.csv").write_text("time_s,roll_deg\n0,1\n")
    (tmp_path / "empty.yaml").write_text("")
    (tmp_path / "tabs.yaml").write_text("name: ship\n\tship: 1\n")
    (tmp_path / "indent.yaml").write_text("name: mine\nsea: {kind: jonswap}\n  hs_m: 3\n")
    (tmp_path / "items.yaml").write_text("name: mine\nset:\n    - 1\n   - 2\n")
    (tmp_path / "mixed.yaml").write_text("grid:\n  seed: [1, 2]\n  - sea.hs_m: [1, 2]\n")
    ship = "ship: {displacement_t: 900, gm_m: 1, roll_period_s: 8, damping_ratio: 0.05}"
    for name, old, new in (
        ("minute", "period_s: 8", "period_s: '0:22'"), ("percent", "0.05", "2%")
    ):  # fmt: skip
        (tmp_path / f"{name}.yaml").write_text(f"name: mine\n{ship.replace(old, new)}\ntank: {{}}")
    (tmp_path / "colon.yaml").write_text("name: mine\nship:\n  displacement_t:900\n  gm_m: 1\n")
    (tmp_path / "nothing.csv").write_text("")
    (tmp_path / "typo.csv").write_text("time_s,roll_deg\n0,5\n0.1,x\n")
    (tmp_path / "latin.yaml").write_bytes("name: Größe\n".encode("latin-1"))
    swings = [(0.1 * n, 8 * 0.995**n * math.cos(0.06 * n)) for n in range(1000)]
    for name, head, rows in (
        ("radians", "time_s,roll_rad", swings),
        ("milliseconds", "time_s,roll_deg", [(1e3 * t, roll) for t, roll in swings]),
        ("backward", "time_s,roll_deg", swings[::-1]),
        ("shifts", "moment_nm,heel_deg", [(1e3 * n, 0.1 * n) for n in range(-3, 4)]),
    ):
        lines = [head, *(f"{one:.6g},{other:.6g}" for one, other in rows)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines))
    (tmp_path / "comma.csv").write_text("time_s;roll_deg\n0,0;5,1\n0,1;4,9\n")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "ship.yaml").write_text("name: mine\n")
    return tmp_path


def told(*words: str) -> str:
    """What the command says of a mistake, in one line."""
    result = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"}).invoke(app, list(words))
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code in (1, 2, 3), result.output
    assert "Traceback" not in result.output
    assert result.stderr
    return re.sub(r"[\s│]+", " ", result.stderr)


@pytest.mark.parametrize(
    ("words", "named"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES]
)
def test_a_mistake_is_told_by_its_place(here: Path, words: str, named: tuple[str, ...]) -> None:
    said = told(*(each.format(configs=CONFIGS, here=here) for each in shlex.split(words)))
    for each in named:
        assert each.format(here=here).lower() in said.lower(), said


@pytest.mark.parametrize(
    ("file", "key", "value", "named"), [m[1:] for m in IN_A_FILE], ids=[m[0] for m in IN_A_FILE]
)
def test_a_mistake_in_a_file_is_told_at_its_key(
    tmp_path: Path, file: str, key: str, value: object, named: tuple[str, ...]
) -> None:
    text = (CONFIGS / file).read_text(encoding="utf-8")
    content = yaml.safe_load(text.replace(" ../", f" {CONFIGS}/"))
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content | {key: value}, allow_unicode=True), encoding="utf-8")
    said = told("check", str(path))
    for each in ("mine.yaml", *named):
        assert each in said, said


def test_what_would_come_after_the_end_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "late.yaml"
    content = yaml.safe_load((CONFIGS / STORM).read_text().replace(" ../", f" {CONFIGS}/"))
    fault = {"kind": "stuck", "message": "SENSOR_MOTION", "signals": ["roll_rad"], "at_s": 5000}
    content |= {"controllers": {"gpc": str(CONFIGS / GPC)}, "faults": [fault]}
    path.write_text(yaml.safe_dump(content | {"operator": [{"time_s": 4000, "action": "arm"}]}))
    result = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"}).invoke(app, ["check", str(path)])
    for key, value in (("operator.0.time_s", 4000), ("faults.0.at_s", 5000)):
        assert f"{key}: is {value}, after duration_s" in result.stderr


@pytest.mark.parametrize(
    ("key", "value"), [("pressure_pa", 50.0), ("rate_pa_s", 100.0), ("level_m", 0.004)]
)
def test_a_limit_in_another_unit_is_warned_of(tmp_path: Path, key: str, value: float) -> None:
    path = tmp_path / "mine.yaml"
    text = (CONFIGS / GPC).read_text(encoding="utf-8").replace(" ../", f" {CONFIGS}/")
    path.write_text(f"{text}limits: {{{key}: {value}}}\n", encoding="utf-8")
    result = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"}).invoke(app, ["check", str(path)])
    assert f"limits.{key}: is {value:.4g} against" in re.sub(r"\s+", " ", result.stderr)
