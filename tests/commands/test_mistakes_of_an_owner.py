"""Mistakes of an owner with three ships of her own: each is told by its place, with a remedy."""

import re
import shlex
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from utank_hil.cli import app


def _ship(displacement_t, gm_m, roll_s, damping, tank, pump):
    keys = ("width_m", "height_m", "reservoir_area_m2", "duct_area_m2", "lz_m", "quadratic_loss")
    return {
        "ship": {
            "displacement_t": displacement_t,
            "gm_m": gm_m,
            "roll_period_s": roll_s,
            "damping_ratio": damping,
        },
        "tank": dict(zip(keys, tank, strict=True)) | {"damping_ratio": 0.02, "headroom_m": tank[1]},
        "pump": dict(zip(("max_pressure_pa", "max_power_w"), pump, strict=True)),
        "emulated": True,
    }


#: As `init` makes them of the main particulars of an OPV, a yacht and a container ship.
SHIPS = {
    "opv": _ship(1900.0, 1.1, 10.5, 0.01965, (10.08, 2.538, 6.171, 1.281, 1.4, 2.624),
                 (12230.0, 74530.0)),
    "yacht": _ship(380.0, 1.05, 7.245, 0.02101, (6.192, 1.507, 3.121, 0.8593, 0.86, 3.406),
                   (7215.0, 19790.0)),
    "box": _ship(150000.0, 1.6, 23.44, 0.04325, (34.7, 9.049, 59.78, 8.215, 4.82, 1.85),
                 (45990.0, 4196000.0)),
}  # fmt: skip
SEA = {"kind": "jonswap", "hs_m": 2.0, "tp_s": 10.5, "effective_slope": {"coefficient": 0.7}}
SCENARIO = {
    "name": "opv in a beam sea",
    "vessel": "opv.yaml",
    "sea": SEA,
    "controllers": {"self_tuned": "law.yaml"},
    "operator": [{"time_s": 5.0, "action": "arm"}],
    "duration_s": 900,
    "settle_s": 60,
}
LAW = {
    "name": "opv, self-tuned",
    "vessel": "opv.yaml",
    "law": {"kind": "self_tuned", "sea": SEA | {"effective_slope": 0.7}},
}
YACHT = "--length 40 --beam 8.6 --displacement 380 --gm 1.05"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder of her own, with a blank and an umlaut in its name."""
    folder = tmp_path / "Schiff Nr 1 Größe"
    (folder / "out").mkdir(parents=True)
    for name, content in SHIPS.items():
        _write(folder / f"{name}.yaml", {"name": name} | content)
    _write(folder / "law.yaml", LAW)
    _write(folder / "scenario.yaml", SCENARIO)
    grid = {"hs_m": [1.0, 2.0]}
    study = {"name": "seas", "scenario": "scenario.yaml", "simulation": "linear", "grid": grid}
    _write(folder / "hours.yaml", study)
    _write(folder / "study.yaml", {"name": "seas", "scenario": "scenario.yaml", "grid": {}})
    (folder / "swan.spec").write_text("SWAN   1    Swan standard spectral file\n$   of a model\n")
    (folder / "out" / "bench.rrd").write_bytes(b"RRF2\0\0\0\x00\xff\xfe\xff" * 9)
    (folder / "out" / "bench.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\xff")
    return folder


def _write(path: Path, content: object) -> None:
    path.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")


def said_of(*words: str) -> tuple[int, str]:
    """Exit code and what is said of a mistake, in one line."""
    result = CliRunner(env={"COLUMNS": "200", "TERM": "dumb"}).invoke(app, list(words))
    assert isinstance(result.exception, SystemExit | None), result.exception
    assert "Traceback" not in result.output
    return result.exit_code, re.sub(r"[\s│]+", " ", result.stderr)


#: Words of the command with {own}, then what the message must name.
MISTAKES: list[tuple[str, str, tuple[str, ...]]] = [
    ("a bench's folder to identify", "identify '{own}/out' '{own}/gpc.yaml'",
     ("out: is a folder", "name a file in it")),
    ("a recording to the bench", "bench '{own}/out/bench.rrd'",
     ("bench.rrd", "is no text in UTF-8 but a recording")),
    ("log and law swapped", "identify '{own}/law.yaml' '{own}/out/bench.rrd'",
     ("bench.rrd", "is no text in UTF-8 but a recording")),
    ("a picture to check", "check '{own}/out/bench.png'", ("bench.png", "picture")),
    ("a scenario to the viewer", "monitor '{own}/scenario.yaml'",
     ("scenario.yaml", "is no recording (.rrd)")),
    ("a scenario to report", "report '{own}/scenario.yaml'",
     ("scenario.yaml", "a folder of `bench` or `campaign`")),
    ("two scenarios to compare", "compare '{own}/scenario.yaml' '{own}/scenario.yaml'",
     ("scenario.yaml", "a recording is .rrd or .frames, a table .csv or .parquet")),
    ("a study without its simulation", "campaign '{own}/study.yaml'",
     ("simulation: is required but missing: one of bus, linear, nonlinear",)),
    ("a ship as a mesh", "hull '{own}/opv.yaml' --draught 4 --gm 1 --roll-period 10 --out x.nc",
     ("opv.yaml", "can't be read as panels by its name; known are WAMIT .gdf")),
    ("a self-tuned law to trade", "design controller '{own}/law.yaml'",
     ("law.yaml", "has no weight to trade", "kind: gpc")),
    ("a scenario to the panel", "panel '{own}/scenario.yaml' --bus vcan7",
     ("scenario.yaml", "a ship is wanted, such as its", "opv.yaml")),
    ("a project below a file", f"init '{{own}}/opv.yaml/new' {YACHT} --roll-period 7",
     ("opv.yaml/new", "name another folder")),
    ("a draught in decimetres", f"init '{{own}}/new' {YACHT} --draught 26",
     ("--draught", "block coefficient of 0.041", "in metres")),
    ("a draught in kilometres", f"init '{{own}}/new' {YACHT} --draught 0.0026", ("--draught",)),
    ("a duct below the cellar", f"init '{{own}}/new' {YACHT} --draught 2.6 --duct-below-cg 900",
     ("--duct-below-cg", "900 m", "in metres")),
    ("a roll damping in per cent", f"init '{{own}}/new' {YACHT} --draught 2.6 --roll-damping 5",
     ("--roll-damping",)),
    ("a scenario for the device's ship",
     "conform motion --bus vcan7 --ship '{own}/scenario.yaml'",
     ("scenario.yaml: is a scenario, and a ship is wanted",)),
    ("a scenario for the sea's ship",
     "identify sea '{own}/out/bench.rrd' --ship '{own}/scenario.yaml'",
     ("is a scenario, and a ship is wanted",)),
    ("a scenario as the fault table", "faults '{own}/scenario.yaml'",
     ("is a scenario, and a fault campaign is wanted",)),
    ("a sea from its end to its beginning",
     "identify sea '{own}/out/bench.rrd' --ship '{own}/opv.yaml' --from 100 --to 50",
     ("--from 100 is not before --to 50",)),
    ("a decay from no time", "identify decay '{own}/out/bench.rrd' --from nan",
     ("--from must be a number of seconds",)),
    ("signals as frames", "export '{own}/out/bench.rrd' --to '{own}/out/bench.log'",
     ("holds signals and no frames", "bench --frames")),
    ("a folder as a mesh", "hull '{own}/out' --draught 4 --gm 1 --roll-period 10",
     ("is a folder",)),
    ("a hull below a file",
     "hull '{own}/out' --draught 4 --gm 1 --roll-period 10 --out '{own}/opv.yaml/hull.nc'",
     ("opv.yaml: is not a folder", "--out")),
    ("a GM in centimetres",
     "design filling '{own}/opv.yaml' --gm 110 --scenario '{own}/gpc_sea.yaml'",
     ("--gm 110", "the file has 1.1", "in metres")),
    ("a load in kilograms",
     "design filling '{own}/opv.yaml' --displacement 1900000 --scenario '{own}/gpc_sea.yaml'",
     ("--displacement 1.9e+06", "the file has 1.9e+03", "in tonnes")),
    ("a wave's height without its section", "campaign '{own}/hours.yaml' --out '{own}/hours'",
     ("grid.hs_m: is not a known key; did you mean sea.hs_m?",)),
    ("a bracket that is never closed", "check '{own}/open.yaml'",
     ("open.yaml", "line 3, column 6: the bracket or quote that opens in line 2, column 6 is not")),
    ("a quote that is never closed", "check '{own}/quote.yaml'",
     ("quote.yaml", "the bracket or quote that opens in line 1, column 7 is not closed")),
    ("two files in one", "check '{own}/two.yaml'",
     ("two.yaml", "line 2", "a second document (---) begins", "take that line out")),
    ("a star before a name", "check '{own}/star.yaml'",
     ("star.yaml", "line 1, column 7", "put a text that begins with * in quotes")),
    ("a folder for a law", "check '{own}/folder.yaml'",
     ("controllers.mine: must be a mapping", "'out'", "the name of a file that ends with .yaml")),
    ("a mesh as hull data", "check '{own}/mesh.yaml'",
     ("ship.hull", "hull.stl is of no known kind", "of a mesh `utank-hil hull` computes a .nc")),
    ("a frame log as a bus", "bus '{own}/run.frames'",
     ("run.frames", "it is a frame log: utank-hil export makes a .log of it")),
    ("a spreadsheet as a decay", "identify decay '{own}/decay.xlsx'",
     ("decay.xlsx", "it is a spreadsheet: save it as .csv")),
    ("a controller's word of the trade", "bench '{own}/scenario.yaml' --controller gpc",
     ("No such option", "--controller")),
]  # fmt: skip


HALF_WRITTEN = {
    "open.yaml": "name: mine\nsea: {kind: jonswap, hs_m: 3\nplant: roll\n",
    "quote.yaml": 'name: "mine\nship: {gm_m: 1}\n',
    "two.yaml": "name: mine\n---\nname: other\n",
    "star.yaml": "name: *mine\n",
    "mesh.yaml": "name: mine\nship: {hull: ./hull.stl}\ntank: {}\n",
    "decay.xlsx": "PK\x03\x04",
    "run.frames": "UTANKHIL frames 1",
}


@pytest.mark.parametrize(
    ("words", "named"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES]
)
def test_a_mistake_at_the_command_is_told(own: Path, words: str, named: tuple[str, ...]) -> None:
    law = {"kind": "gpc", "tuning": "auto"}
    _write(own / "gpc.yaml", LAW | {"law": law})
    _write(own / "folder.yaml", SCENARIO | {"controllers": {"mine": "out"}})
    for name, text in HALF_WRITTEN.items():
        (own / name).write_text(text, encoding="utf-8")
    _write(own / "gpc_sea.yaml", SCENARIO | {"controllers": {"gpc": "gpc.yaml"}})
    code, said = said_of(*(each.format(own=own) for each in shlex.split(words)))
    assert code in (1, 2), said
    for each in named:
        assert each in said, said


#: A ship or file, key (dotted), what is done to its value, and what the message must name.
SLIPS: list[tuple[str, str, object, tuple[str, ...]]] = [
    ("opv", "ship.displacement_t", 1000, ("in tonnes",)),
    ("opv", "ship.gm_m", 10, ("radius of gyration", "in metres")),
    ("opv", "ship.damping_ratio", 10, ("0.005 to 0.15",)),
    ("opv", "ship.damping_ratio", 0.1, ("0.005 to 0.15", "all other damping")),
    ("yacht", "ship.roll_period_s", 1 / 60, ("in seconds",)),
    ("box", "ship.roll_period_s", 10, ("ship.",)),
    ("opv", "tank.quadratic_loss", 10, ("damping ratio of 3", "coefficient of loss")),
    ("yacht", "tank.quadratic_loss", 60, ("coefficient of loss",)),
    ("box", "tank.quadratic_loss", 1000, ("coefficient of loss",)),
    ("box", "tank.quadratic_loss", 0.1, ("any inlet and outlet",)),
    ("box", "tank.width_m", 10, ("tank.width_m", "metres")),
    ("yacht", "tank.duct_area_m2", 10, ("in m2",)),
    ("opv", "pump.max_pressure_pa", 1e-3, ("25 kPa is 25e3",)),
    ("box", "pump.max_power_w", 1e-3, ("225 kW is 225e3",)),
    ("scenario", "sea.tp_s", 1 / 60, ("such waves break", "tp_s")),
    ("scenario", "duration_s", 1 / 60, ("settle_s: is 60", "duration_s, 15", "in seconds")),
    (
        "scenario",
        "sea",
        {"kind": "tabulated", "file": "swan.spec"},
        ("sea.file", "swan.spec", "columns frequency_hz and density_m2_hz", "is kind: measured"),
    ),
    ("law", "law.sea.effective_slope", {"coefficient": 0.7}, ("write 0.7 alone",)),
    ("scenario", "operator.0.action", "Arm", ("did you mean arm?",)),
]


@pytest.mark.parametrize(
    ("file", "key", "slip", "named"), SLIPS, ids=[f"{s[0]}, {s[1]}, {s[2]}" for s in SLIPS]
)
def test_a_slip_in_a_file_of_ones_own_is_told(
    own: Path, file: str, key: str, slip: object, named: tuple[str, ...]
) -> None:
    path = own / f"{file}.yaml"
    content = place = yaml.safe_load(path.read_text(encoding="utf-8"))
    *parts, last = (int(part) if part.isdecimal() else part for part in key.split("."))
    for part in parts:
        place = place[part]
    place[last] = place[last] * slip if isinstance(slip, int | float) else slip
    _write(path, content)
    _, said = said_of("check", str(path))
    for each in (str(own), key.split(".")[-1], *named):
        assert each in said, said
