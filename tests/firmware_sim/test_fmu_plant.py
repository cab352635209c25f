"""A ship of another program on the bench as FMU, against the linear plant.

One of FMI 2 is made by pythonfmu, one of FMI 3 in C with the standard's headers, which FMPy has.
"""

import hashlib
import re
import subprocess
import zipfile
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import yaml
from fmpy.validation import validate_fmu
from one_process import in_one_process
from pythonfmu.builder import FmuBuilder
from typer.testing import CliRunner

from firmware_sim.bench import run_in_turn
from firmware_sim.cli import app as ship_app
from firmware_sim.fmu_file import FmuFile
from firmware_sim.fmu_plant import FmuPlant
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.waves import SteadyWaves
from utank_hil.base.provenance import describe
from utank_hil.base.tick import TICK_NS
from utank_hil.cli import app
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.configuration.files import ALLOW_CODE
from utank_hil.dynamics.linear import state_matrices
from utank_hil.runners.node import ModelError
from utank_hil.sea import Harmonics

VESSEL = load_config(Path("configs/ships/patti_b.yaml"), Vessel)
MOMENT = Harmonics(np.array([2e4]), np.array([0.72]), np.array([0.3]))
SLAVE = """
import numpy as np
from pathlib import Path
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class Ship(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.heel_deg, self.p, self.h, self.q = np.zeros(4), 0.0, 0.0, 0.0, 0.0
        self.kilopascal = self.moment = self.fail_at = 0.0
        for name in ("kilopascal", "moment"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("heel_deg", "p", "h", "q"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(Real("fail_at", causality=Fmi2Causality.parameter,
                                    variability=Fmi2Variability.tunable))
        Path("SENTINEL").write_text("it ran")

    def do_step(self, time, step):
        if self.fail_at < 0 and time > 0.5:
            raise ValueError("no such moment")
        if 0 < self.fail_at <= time:
            self.q = float("nan")
            return True
        u = np.array([1e3 * self.kilopascal, self.moment])
        f = lambda x: A @ x + B @ u
        x = self.x
        k1 = f(x); k2 = f(x + step / 2 * k1); k3 = f(x + step / 2 * k2); k4 = f(x + step * k3)
        self.x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.heel_deg, self.p, self.h = -np.degrees(self.x[0]), self.x[1], self.x[2]
        self.q = AREA * self.x[3]
        return True
"""
VARIABLES = {
    "roll_rad": {"name": "heel_deg", "scale": -np.pi / 180},
    "roll_rate_rad_s": "p",
    "level_m": "h",
    "flow_m3_s": "q",
    "pressure_pa": {"name": "kilopascal", "scale": 1000.0},
    "wave_moment_nm": "moment",
}


SHIP_3 = """
#include "fmi3Functions.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static const double A[4][4] = MATRIX_A, B[4][2] = MATRIX_B;
typedef struct { double value[7], x[4]; } Ship; /* kilopascal, moment, heel_deg, p, h, q, fail_at */
const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
    const fmi3ValueReference wanted[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    fclose(fopen("SENTINEL", "w"));
    return strcmp(token, "ship-of-3") ? NULL : calloc(1, sizeof(Ship));
}
void fmi3FreeInstance(fmi3Instance ship) { free(ship); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance ship, fmi3Boolean defined, double tolerance,
    double start, fmi3Boolean ends, double stop) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance ship) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance ship) { return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance ship, const fmi3ValueReference at[], size_t count,
    const double values[], size_t size) {
    for (size_t i = 0; i < size; i++) ((Ship *)ship)->value[at[i]] = values[i];
    return size == count ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetFloat64(fmi3Instance ship, const fmi3ValueReference at[], size_t count,
    double values[], size_t size) {
    for (size_t i = 0; i < size; i++) values[i] = ((Ship *)ship)->value[at[i]];
    return size == count ? fmi3OK : fmi3Error;
}
static void rate(const Ship *s, const double *x, double *to) {
    for (int i = 0; i < 4; i++) {
        to[i] = 1e3 * B[i][0] * s->value[0] + B[i][1] * s->value[1];
        for (int j = 0; j < 4; j++) to[i] += A[i][j] * x[j];
    }
}
fmi3Status fmi3DoStep(fmi3Instance instance, double time, double step, fmi3Boolean kept,
    fmi3Boolean *event, fmi3Boolean *ends, fmi3Boolean *early, double *last) {
    Ship *s = instance;
    double k[4][4], y[4], part[4] = {0, 0.5, 0.5, 1}, weight[4] = {1, 2, 2, 1};
    if (s->value[6] < 0 && time > 0.5) return fmi3Error;
    *event = *early = false;
    *ends = s->value[6] > 1000 && time > 0.5;
    *last = time + step;
    for (int n = 0; n < 4; n++) {
        for (int i = 0; i < 4; i++) y[i] = s->x[i] + (n ? step * part[n] * k[n - 1][i] : 0);
        rate(s, y, k[n]);
    }
    for (int n = 0; n < 4; n++)
        for (int i = 0; i < 4; i++) s->x[i] += step / 6 * weight[n] * k[n][i];
    s->value[2] = -s->x[0] * 180 / acos(-1);
    s->value[3] = s->x[1];
    s->value[4] = s->x[2];
    s->value[5] = AREA * s->x[3];
    if (0 < s->value[6] && s->value[6] <= time && s->value[6] < 1000) s->value[5] = NAN;
    return fmi3OK;
}
"""


def made_of_fmi_3(folder: Path) -> Path:
    """Write the same ship in C, with the headers and by the rules of FMI 3."""
    a, b = state_matrices(VESSEL.ship, VESSEL.tank)
    text = SHIP_3.replace("SENTINEL", str(folder / "ran"))
    text = text.replace("AREA", repr(VESSEL.tank.reservoir_area_m2))
    for name, matrix in (("MATRIX_A", a), ("MATRIX_B", b)):
        text = text.replace(name, str(matrix.tolist()).replace("[", "{").replace("]", "}"))
    source, library = folder / "ship.c", folder / "ship.so"
    source.write_text(text)
    headers = Path(fmpy.__file__).parent / "c-code"
    rest = folder / "rest.c"  # By the standard the functions that it lacks are there and fail.
    names = re.findall(r"FMI3_Export \w+ +(\w+);", (headers / "fmi3Functions.h").read_text())
    lacking = [f"int {name}(void) {{ return 3; }}\n" for name in names if f"{name}(" not in text]
    rest.write_text("".join(lacking))
    words = ["gcc", "-shared", "-fPIC", "-O1", f"-I{headers}", source, rest, "-o", library, "-lm"]
    subprocess.run(words, check=True)
    kinds = {"kilopascal": "input", "moment": "input", "fail_at": "parameter"}
    names = ("kilopascal", "moment", "heel_deg", "p", "h", "q", "fail_at")
    variables = "".join(
        f'<Float64 name="{name}" valueReference="{number}" '
        + (f'causality="{kinds[name]}" start="0"' if name in kinds else 'causality="output"')
        + (' variability="tunable"/>' if name == "fail_at" else "/>")
        for number, name in enumerate(names)
    )
    outputs = "".join(
        f'<{kind} valueReference="{number}"/>'
        for kind in ("Output", "InitialUnknown")
        for number in range(2, 6)
    )
    description = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" '
        'modelName="Ship" instantiationToken="ship-of-3"><CoSimulation modelIdentifier="ship"/>'
        '<ModelVariables><Float64 name="time" valueReference="9" causality="independent"/>'
        f"{variables}</ModelVariables><ModelStructure>{outputs}</ModelStructure>"
        "</fmiModelDescription>"
    )
    file = folder / "Ship.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{fmpy.platform_tuple}/ship.so")
    return file


@pytest.fixture(scope="module", params=["FMI 2", "FMI 3"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Patti-B's linear equations as an FMU; its heel is in degrees to port."""
    folder = tmp_path_factory.mktemp("fmu")
    if request.param == "FMI 3":
        return made_of_fmi_3(folder)
    a, b = state_matrices(VESSEL.ship, VESSEL.tank)
    constants = f"""
A, B = np.array({a.tolist()}), np.array({b.tolist()})
AREA = {VESSEL.tank.reservoir_area_m2}
"""
    text = SLAVE.replace("SENTINEL", str(folder / "ran")) + constants
    script = folder / "ship.py"
    script.write_text(text)
    return Path(FmuBuilder.build_FMU(script, dest=folder))


def section(file: Path, **changes: Any) -> FmuFile:
    content = {"file": file, "variables": VARIABLES, **changes}
    return FmuFile.model_validate(content, context={ALLOW_CODE: True})


def plant_of(file: Path, **changes: Any) -> FmuPlant:
    waves = SteadyWaves(MOMENT)
    return FmuPlant(section(file, **changes), VESSEL.ship, VESSEL.tank, VESSEL.pump, waves)


def test_ship_moves_as_the_linear_plant(fmu: Path) -> None:
    ours = Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, MOMENT)
    plants = plant_of(fmu), ours
    rows = []
    for tick in range(1200):
        for plant in plants:
            plant.drive_pump(3e3 * np.sin(0.007 * tick), enabled=tick > 300)
            plant.advance(tick * TICK_NS)
        rows.append(
            [
                (plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, plant.pressure_pa)
                for plant in plants
            ]
        )
    theirs, linear = np.array(rows).transpose(1, 0, 2)
    # The flow is held for a tick: half a tick of lag at 0.72 rad/s is 0.4 % of the pressure.
    assert (np.abs(theirs - linear).max(0) < 0.01 * np.abs(linear).max(0)).all()
    assert np.abs(linear[:, 0]).max() > 0.01
    assert plants[0].pump_work_j == pytest.approx(ours.pump_work_j, rel=0.02)
    assert plants[0].wave_work_j == pytest.approx(ours.wave_work_j, rel=0.02)


def test_folder_is_removed(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    plant = plant_of(fmu)
    assert len(list(tmp_path.iterdir())) == 1
    del plant
    assert not list(tmp_path.iterdir())


def test_what_is_not_finite_ends_the_run_with_its_name(fmu: Path) -> None:
    plant = plant_of(fmu, parameters={"fail_at": 0.5})
    plant.advance(0)
    with pytest.raises(ModelError, match=r"at 0\.5\d s, reading: flow_m3_s is nan"):
        plant.advance(100 * TICK_NS)


def test_a_unit_of_fmi_3_may_end_the_run(tmp_path: Path) -> None:
    file = made_of_fmi_3(tmp_path)
    assert validate_fmu(str(file)) == []
    plant = plant_of(file, parameters={"fail_at": 2000.0})
    plant.advance(0)
    with pytest.raises(ModelError, match=r"at 0\.5\d s, its step: it ended by itself"):
        plant.advance(100 * TICK_NS)


def scenario(folder: Path, fmu: Path, **changes: Any) -> Path:
    """A scenario of Patti-B whose ship is the FMU."""
    configs = Path("configs").resolve()
    content = yaml.safe_load((configs / "scenarios/patti_b.yaml").read_text())
    content["vessel"] = str(configs / "ships/patti_b.yaml")
    law = str(configs / "controllers/patti_b_constrained_gpc.yaml")
    content |= {"controllers": {"gpc": law}, "duration_s": 4, "settle_s": 1, "plant": "fmu"}
    content["fmu"] = {"file": f"./{fmu.name}", "variables": VARIABLES} | changes
    (folder / fmu.name).write_bytes(fmu.read_bytes())
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_bench_sails_it_and_keeps_its_hash(fmu: Path, tmp_path: Path) -> None:
    path = scenario(tmp_path, fmu)
    ran = fmu.parent / "ran"
    ran.unlink(missing_ok=True)
    refused = CliRunner().invoke(app, ["check", str(path)])
    assert refused.exit_code == 2
    assert "fmu.file: runs native code" in " ".join(refused.stderr.split())
    assert CliRunner().invoke(app, ["check", str(path), "--allow-code"]).exit_code == 0
    assert not ran.exists()  # its description is read, and nothing of it runs
    refused = CliRunner().invoke(ship_app, [str(path), "--bus", "none0"])
    assert refused.exit_code == 2
    assert "fmu.file: runs native code" in " ".join(refused.stderr.split())
    assert not ran.exists()
    sailed = load_config(path, Scenario, allow_code=True)
    result = run_in_turn(sailed, 1)
    assert ran.exists()
    assert [len(run.rows) for run in result.runs] == [80, 80]
    assert all(np.abs(run.column("true_roll_rad")).max() > 1e-3 for run in result.runs)
    about = describe("bench", sailed, tmp_path, options={})
    assert about["data"]["./Ship.fmu"] == hashlib.sha256(fmu.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"fail_at": 0.5}, "0.51 s, reading: flow_m3_s is nan"),
        ({"fail_at": -1}, "its step: fmi[23]DoStep failed"),
    ],
)
def test_failure_under_way_ends_the_bench_in_plain_words(
    fmu: Path, tmp_path: Path, parameters: dict[str, float], words: str
) -> None:
    path = scenario(tmp_path, fmu, parameters=parameters)
    arguments = ["bench", str(path), "--allow-code", "--json", "--out", str(tmp_path / "out")]
    # one that pythonfmu made and that fails damages its process: it is one of the bench's own
    damages = (fmu.parent / "ship.py").exists() and "DoStep" in words
    with nullcontext() if damages else in_one_process():
        ran = CliRunner().invoke(app, arguments)
    said = " ".join(ran.stderr.split())
    assert ran.exit_code == 2, said
    assert "Ship.fmu" in said
    assert re.search(words, said)
    assert "Traceback" not in said
    assert not ran.stdout


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"variables": VARIABLES | {"level_m": "levle"}}, "variables.level_m: is 'levle', which"),
        ({"variables": VARIABLES | {"level_m": "moment"}}, "which is input and no output"),
        ({"variables": VARIABLES | {"level_m": {"name": "h", "scale": 0}}}, "a scale of 0"),
        ({"parameters": {"mass": 1}}, "parameters.mass: is 'mass', which the FMU has not"),
        ({"variables": VARIABLES | {"pressure_pa": None}}, "is required: the vessel has a pump"),
        ({"variables": VARIABLES | {"valve_loss_pa_s2_m2": "moment"}}, "vessel has no valve"),
        ({"parameters": {"h": 1}}, "'h' is an output, no parameter"),
    ],
)
def test_wrong_table_is_told_at_its_key(
    fmu: Path, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    path = scenario(tmp_path, fmu, **changes)
    with pytest.raises(ConfigError) as error:
        load_config(path, Scenario, allow_code=True)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("../escaped", b"", "would leave the folder"),
        ("/etc/escaped", b"", "would leave the folder"),
        ("a\\..\\b", b"", "would leave the folder"),
        ("modelDescription.xml", b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
        ("modelDescription.xml", b"<a", "no element found|unclosed"),
        ("modelDescription.xml", b" " * ((1 << 24) + 1), "larger than 16 MB"),
        ("other.xml", b"", "it has no modelDescription.xml"),
    ],
)
def test_hostile_archive_is_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / "ship.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    with pytest.raises(ValueError, match=words):
        section(path)
    path.write_bytes(b"no archive")
    with pytest.raises(ValueError, match="not a zip file"):
        section(path)
