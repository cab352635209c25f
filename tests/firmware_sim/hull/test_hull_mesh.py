"""Meshes of hulls: what is read of them, and what is refused in words."""

import math
from pathlib import Path

import capytaine as cpt
import numpy as np
import pytest
from bodies import both_sides, box, hemisphere, wigley, written

from firmware_sim.hull.mesh import MeshError, form_mesh, read_mesh
from utank_hil.dynamics.roll_damping import HullForm


@pytest.mark.parametrize("part", ["whole", "port", "starboard"])
def test_whole_hull_and_either_side_are_the_same_closed_port_side(
    part: str, tmp_path: Path
) -> None:
    points, panels = wigley()
    if part == "whole":
        points, panels = both_sides((points, panels))
    elif part == "starboard":
        points, panels = points * [1, -1, 1], panels[:, ::-1]
    side, said = read_mesh(written(tmp_path / "wigley.gdf", (points, panels)))
    assert said == []
    assert side.vertices[:, 1].min() >= 0
    assert 2 * side.volume == pytest.approx(4 / 9 * 60 * 12 * 4, rel=0.005)


def test_normals_that_point_into_the_hull_are_turned_and_that_is_said(tmp_path: Path) -> None:
    points, panels = wigley()
    side, said = read_mesh(written(tmp_path / "in.gdf", (points, panels[:, ::-1])))
    assert side.volume > 0
    assert said == ["normals pointed into the hull: turned"]


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_formats_that_may_be_binary_go_to_meshio_as_files(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As text their bytes would be others: that of a binary .stl was "not a float"."""
    file = tmp_path / f"hull.{kind}"
    file.write_bytes(b"\xff\x00")
    monkeypatch.setattr("firmware_sim.hull.mesh.find_spec", lambda _: None)
    with pytest.raises(MeshError, match=r"needs meshio: pip install 'utank-hil\[hulls\]'"):
        read_mesh(file)
    asked: list[object] = []

    def load_mesh(source: object, file_format: str) -> cpt.Mesh:
        asked.extend((source, file_format))
        return cpt.Mesh(*wigley())

    monkeypatch.setattr("firmware_sim.hull.mesh.find_spec", lambda _: object())
    monkeypatch.setattr(cpt, "load_mesh", load_mesh)
    side, _ = read_mesh(file)
    assert asked == [str(file), f".{kind}"]
    assert 2 * side.volume == pytest.approx(4 / 9 * 60 * 12 * 4, rel=0.005)


def test_draught_trim_and_unit_place_the_hull_in_the_water(tmp_path: Path) -> None:
    points, panels = both_sides(box(90, 20, 10, top=6))
    file = written(tmp_path / "box.gdf", (1e3 * np.add(points, (7, 0, 16)), panels))
    side, _ = read_mesh(file, draught_m=8.0, scale=1e-3)
    assert 2 * side.volume == pytest.approx(90 * 20 * 8, rel=1e-6)
    trimmed, _ = read_mesh(file, draught_m=10.0, trim_deg=2.0, scale=1e-3)
    bow_up_m = 90 * math.tan(math.radians(2))  # less draught at the stern than at the bow
    lowest = trimmed.vertices[trimmed.vertices[:, 2].argmin()]
    assert lowest[0] > 40
    assert lowest[2] == pytest.approx(-10.0, abs=1e-6)
    mean_m = 10.0 / math.cos(math.radians(2)) - bow_up_m / 2
    assert 2 * trimmed.volume == pytest.approx(90 * 20 * mean_m, rel=0.01)


POINTS, PANELS = both_sides(wigley())


@pytest.mark.parametrize(
    ("points", "panels", "reason"),
    [
        (1e3 * POINTS, PANELS, r"is 60000 m long, .* --scale 0\.001 if it is in mm"),
        (POINTS / 0.3048 * 12, PANELS, r"is 2362.2 m long.* --scale 0.0254 if it is in in"),
        (POINTS[:, [1, 0, 2]], PANELS[:, ::-1], "12 m along x and 60 m along y: x points forward"),
        (np.add(POINTS, (0, 0, 4)), PANELS, "lies above the water, from z 0 m up: give --draught"),
        (POINTS - [0, 0, 3], PANELS, "lies wholly below the water, up to z -3 m: give --draught"),
        (np.add(POINTS, (0, 2, 0)), PANELS, "to starboard of 12.*: it must be whole, upright"),
        (POINTS, PANELS[1:300], "is open at .* edges, one near x .*: close it"),
        (POINTS, np.delete(PANELS, (95, 395), 0), "is open at 4 edges, one near x -1[0-9]"),
        (POINTS, np.where(np.isin(np.arange(600), (95, 395))[:, None], PANELS[:, ::-1], PANELS),
         "neighbours with opposite normals at 4 edges, one near x -1[0-9]"),
        (POINTS, np.where(np.arange(600)[:, None] % 2, PANELS, PANELS[:, ::-1]), "opposite norm"),
        (POINTS, np.where(np.arange(600)[:, None] < 300, PANELS, PANELS[:, ::-1]),
         "638.* to starboard of .*e-1.*its normals all outward"),
        (np.concatenate([POINTS, [[0, 0, -1]]]),
         np.concatenate([PANELS, [[*PANELS[455][:2], 682, 682]]]), "more than two panels at 1"),
        (np.where(POINTS == -4, np.nan, POINTS), PANELS, "contains NaN"),
    ],
)  # fmt: skip
def test_what_is_no_hull_in_its_place_is_refused(points, panels, reason, tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=reason):
        read_mesh(written(tmp_path / "body.gdf", (points, panels)))


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("none.gdf", None, "there is no such file"),
        ("text.gdf", "four\nlines\nof\ntext\n", r"as panels: [^(\\]*known are WAMIT .gdf.*IGDEF"),
        ("ship.step", "ISO-10303-21;", "can't be read as panels"),
        ("ship", "1", "can't be read as panels by its name"),
        ("ship.st", "1", "can't be read as panels by its name"),
    ],
)
def test_what_is_no_mesh_is_refused(name, content, reason, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(MeshError, match=reason):
        read_mesh(tmp_path / name)


def test_a_suffix_in_capitals_is_the_same(tmp_path: Path) -> None:
    side, _ = read_mesh(written(tmp_path / "WIGLEY.GDF", wigley()))
    assert 2 * side.volume == pytest.approx(4 / 9 * 60 * 12 * 4, rel=0.005)


def test_a_draught_above_the_deck_is_refused_by_its_value(tmp_path: Path) -> None:
    file = written(tmp_path / "wigley.gdf", wigley())
    with pytest.raises(MeshError, match=r"is 4 m high, and the draught 4000 m: .* in metres"):
        read_mesh(file, draught_m=4000)


def test_too_many_panels_are_refused(tmp_path: Path) -> None:
    file = written(tmp_path / "fine.gdf", hemisphere(panels=(63, 50)))
    with pytest.raises(MeshError, match="has 3150 panels a side, at most 3000: make it coarser"):
        read_mesh(file)


@pytest.mark.parametrize(
    ("length", "beam", "draught", "displacement", "gm"),
    [(24, 7.5, 3.0, 300, 0.7), (63, 9.5, 3.9, 1350, 0.9), (330, 45, 14.5, 150000, 1.5),
     (200, 44, 12, 100400, 4.0)],
)  # fmt: skip
def test_form_of_main_particulars_displaces_what_they_say(
    length, beam, draught, displacement, gm
) -> None:
    form = HullForm.usual(length, beam, draught, displacement, gm)
    side = form_mesh(form)
    assert 2.05 * side.volume == pytest.approx(displacement, rel=0.015)
    assert np.ptp(side.vertices, axis=0) == pytest.approx([length, beam / 2, draught])
    # inertia of the waterline, as Schneekluth and Bertram have it for usual ships
    usual = (0.096 + 0.89 * ((1 + 2 * form.block_coefficient) / 3) ** 2) / 12
    edge = side.vertices[side.vertices[:, 2] == 0]
    found = 2 / 3 * np.trapezoid(edge[:, 1] ** 3, edge[:, 0]) / (length * beam**3)
    assert found == pytest.approx(usual, rel=0.12)
