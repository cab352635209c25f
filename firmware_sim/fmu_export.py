"""The ship, tank and pump of a scenario as an FMU for other programs: C source, compiled."""

import hashlib
import io
import os
import subprocess
import tempfile
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.sax.saxutils import quoteattr

import numpy as np

from firmware_sim import plant_kernel as kernel
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import plant_of
from utank_hil.base.arrays import FloatArray
from utank_hil.base.provenance import version
from utank_hil.base.tick import TICK_S
from utank_hil.dynamics.nonlinear import INSIDE_M, REST_M_S, RollCoefficients
from utank_hil.dynamics.pump_curve import PumpCoefficients
from utank_hil.dynamics.tank import GRAVITY_M_S2

IDENTIFIER: Final = "utank_hil_ship"
SOURCE: Final = Path(__file__).with_name("exported_plant.c")
CC: Final = os.environ.get("CC", "cc")
FLAGS: Final = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
"""Fused multiplication and addition would change the last digit."""
UNITS: Final = {
    "rad": 'rad="1"',
    "rad/s": 'rad="1" s="-1"',
    "m": 'm="1"',
    "m/s2": 'm="1" s="-2"',
    "m3/s": 'm="3" s="-1"',
    "Pa": 'kg="1" m="-1" s="-2"',
    "Pa.s2/m2": 'kg="1" m="-3"',
    "N.m": 'kg="1" m="2" s="-2"',
    "W": 'kg="1" m="2" s="-3"',
}  #: Units with their exponents of SI base units.
INPUTS: Final = {
    "setpoint_pa": ("Pa", "Pressure commanded; positive raises the starboard level"),
    "valve_loss_pa_s2_m2": ("Pa.s2/m2", "Loss of the valve per square of the level's rate"),
    "external_moment_nm": ("N.m", "Roll moment besides that of the scenario's waves"),
}
OUTPUTS: Final = {
    "roll_rad": ("rad", "Roll angle, positive to starboard"),
    "roll_rate_rad_s": ("rad/s", "Roll rate"),
    "level_m": ("m", "Starboard level above still water; port's is its negative"),
    "flow_m3_s": ("m3/s", "Flow through the duct to starboard"),
    "pressure_pa": ("Pa", "Pressure rise across the pump"),
    "pump_speed_rad_s": ("rad/s", "Speed of the pump's rotor"),
    "pump_power_w": ("W", "Shaft power; negative when the water drives the motor"),
    "wave_moment_nm": ("N.m", "Roll moment of the scenario's waves"),
    "lateral_m_s2": ("m/s2", "Lateral acceleration of the centre of gravity"),
}


def write_fmu(scenario: Scenario, path: Path, seed: int) -> None:
    """Write the ship, tank and pump of a scenario in the waves of a seed as an FMU.

    FMI 2, co-simulation, with the binary of this machine and the source of all others. ValueError
    is raised for a scenario whose ship changes or moves in other degrees than roll, and where the C
    compiler fails; OSError if the file can't be written.
    """
    from utank_hil.base.whole_file import write_whole

    if scenario.plant != "roll":
        raise ValueError(f"plant: is {scenario.plant}; an FMU is made of plant: roll")
    if scenario.voyage or scenario.actual_from_s or len(scenario.sea.spectra) > 1:
        raise ValueError("voyage, actual_from_s, sea: a ship or sea that changes makes no FMU yet")
    if scenario.righting_in_waves is not None:
        raise ValueError("righting_in_waves: a righting moment that changes makes no FMU yet")
    plant = plant_of(scenario, seed)
    source = SOURCE.read_text(encoding="utf-8")
    data = _data(plant, has_pump=scenario.vessel.pump is not None)
    guid = hashlib.sha256((source + data).encode()).hexdigest()
    sources = {SOURCE.name: source, "plant_data.h": f'#define GUID "{guid}"\n{data}'}
    parts: dict[str, bytes] = {
        "modelDescription.xml": _description(scenario, seed, guid).encode(),
        f"binaries/linux64/{IDENTIFIER}.so": _compiled(sources),
        **{f"sources/{name}": text.encode() for name, text in sources.items()},
    }
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    write_whole(path, made.getvalue())


def _compiled(sources: dict[str, str]) -> bytes:
    with tempfile.TemporaryDirectory(prefix="utank-hil-fmu-") as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        library = folder / f"{IDENTIFIER}.so"
        command = [CC, *FLAGS, "-o", str(library), str(folder / SOURCE.name), "-lm"]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except OSError as error:
            raise ValueError(f"no C compiler {CC!r}: apt-get install gcc, or set CC") from error
        except subprocess.CalledProcessError as error:
            raise ValueError(f"{CC} failed: {error.stderr.strip()}") from error
        return library.read_bytes()


def _data(plant: Plant, *, has_pump: bool) -> str:
    equations = plant.equations
    *coefficients, pieces_per_rad = equations.row.tolist()
    phasors, rotations = (
        np.stack([each.real, each.imag], axis=-1)
        for each in (equations.phasors, equations.rotations)
    )
    numbers = {
        "FORCES": len(phasors),
        "WAVES": phasors.shape[1],
        "PIECES": len(equations.restoring),
        "POWERS": equations.restoring.shape[1],
        "STEPS": kernel.STEPS,
        "HAS_PUMP": int(has_pump),
        "PIECES_PER_RAD": _c(pieces_per_rad),
        "REST_M_S": _c(REST_M_S),
        "INSIDE_M": _c(INSIDE_M),
        "GRAVITY_M_S2": _c(GRAVITY_M_S2),
    }
    lines = [f"#define {name} {value}" for name, value in numbers.items()]
    lines.append(f"enum {{ {', '.join((*INPUTS, *OUTPUTS, 'REALS'))} }};")
    for name, fields, values in (
        ("C", RollCoefficients._fields, coefficients),
        ("P", PumpCoefficients._fields, equations.pump),
    ):
        listed = ", ".join(map(_c, values))
        lines.append(
            f"static const struct {{ double {', '.join(fields)}; }} {name} = {{{listed}}};"
        )
    for name, array in (
        ("WEIGHTS", kernel.interpolation_weights()),
        ("RIGHTING", equations.restoring),
        ("AHEAD", equations.ahead),
        ("PHASORS", phasors),
        ("ROTATIONS", rotations[0]),
    ):
        shape = "".join(f"[{size}]" for size in array.shape)
        lines.append(f"static const double {name}{shape} = {_initialiser(array)};")
    return "\n".join(lines) + "\n"


def _c(value: float) -> str:
    return float(value).hex() if np.isfinite(value) else "INFINITY"


def _initialiser(array: FloatArray) -> str:
    parts: Iterable[str] = map(_c, array) if array.ndim == 1 else map(_initialiser, array)
    return "{" + ",\n ".join(parts) + "}"


def _description(scenario: Scenario, seed: int, guid: str) -> str:
    vessel = scenario.vessel
    left_out = {"setpoint_pa"} if vessel.pump is None else set()
    left_out |= {"valve_loss_pa_s2_m2"} if vessel.valve is None else set()
    told = f"Ship, tank and pump of the scenario {scenario.name}, waves of seed {seed}"
    units = [
        f"<Unit name={quoteattr(name)}><BaseUnit {base}/></Unit>" for name, base in UNITS.items()
    ]
    variables, outputs = [], []
    for reference, (name, (unit, words)) in enumerate((INPUTS | OUTPUTS).items()):
        if name in left_out:
            continue
        causality, start = ("input", ' start="0"') if name in INPUTS else ("output", "")
        variables.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f"description={quoteattr(words)}><Real unit={quoteattr(unit)}{start}/></ScalarVariable>"
        )
        outputs += [len(variables)] if name in OUTPUTS else []
    if vessel.pump is not None:
        variables.append(
            '<ScalarVariable name="pump_enabled" valueReference="0" causality="input" '
            'variability="discrete" description="False: the rotor turns freely in the water">'
            '<Boolean start="true"/></ScalarVariable>'
        )
    unknowns = "".join(f'<Unknown index="{index}" dependencies=""/>' for index in outputs)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(scenario.name)} '
        f'guid="{guid}" description={quoteattr(told)} generationTool="utank-hil {version()}">',
        f'<CoSimulation modelIdentifier="{IDENTIFIER}" canHandleVariableCommunicationStepSize='
        '"true" canGetAndSetFMUstate="true" canSerializeFMUstate="true">',
        f'<SourceFiles><File name="{SOURCE.name}"/></SourceFiles></CoSimulation>',
        f"<UnitDefinitions>{''.join(units)}</UnitDefinitions>",
        f'<DefaultExperiment startTime="0" stopTime="{scenario.duration_s}" stepSize="{TICK_S}"/>',
        "<ModelVariables>",
        *variables,
        "</ModelVariables>",
        f"<ModelStructure><Outputs>{unknowns}</Outputs>"
        f"<InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>",
        "</fmiModelDescription>",
    ]
    return "\n".join(lines)
