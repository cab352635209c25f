"""Port sides of bodies in closed form, and their files."""

from pathlib import Path

import numpy as np

Side = tuple[np.ndarray, np.ndarray]


def _grid(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Side:
    rows, columns = x.shape
    first = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    panels = np.column_stack([first, first + columns, first + columns + 1, first + 1])
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), panels


def _together(*parts: Side) -> Side:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    panels = [panels + start for (_, panels), start in zip(parts, starts, strict=False)]
    return np.concatenate([points for points, _ in parts]), np.concatenate(panels)


def wigley(length=60.0, breadth=12.0, draught=4.0, panels=(30, 10)) -> Side:
    along, down = np.linspace(-0.5, 0.5, panels[0] + 1), np.linspace(0.0, 1.0, panels[1] + 1)
    x, z = np.meshgrid(along, down, indexing="ij")
    return _grid(length * x, breadth / 2 * (1 - (2 * x) ** 2) * (1 - z**2), -draught * z)


def box(length=90.0, breadth=20.0, draught=10.0, top=0.0, panels=(30, 6, 6)) -> Side:
    """Panels along, from side to middle, and down; the outer ones smaller."""
    x = length / 2 * np.sin(np.linspace(-np.pi / 2, np.pi / 2, panels[0] + 1))
    y = breadth / 2 * np.sin(np.linspace(0, np.pi / 2, panels[1] + 1))
    z = top - (draught + top) * np.sin(np.linspace(0, np.pi / 2, panels[2] + 1))

    def plane(a, b):
        return np.meshgrid(a, b, indexing="ij")

    sides = plane(x, z)
    port = _grid(sides[0], np.full_like(sides[0], breadth / 2), sides[1])
    below = plane(x, y[::-1])
    bottom = _grid(below[0], below[1], np.full_like(below[0], -draught))
    end = plane(y, z)
    bow = _grid(np.full_like(end[0], length / 2), end[0], end[1])
    stern = bow[0] * [-1, 1, 1], bow[1][:, ::-1]
    return _together(port, bottom, (bow[0], bow[1][:, ::-1]), (stern[0], stern[1][:, ::-1]))


def hemisphere(radius=5.0, panels=(24, 12)) -> Side:
    turn, down = np.meshgrid(
        np.linspace(np.pi, 0, panels[0] + 1), np.linspace(0, np.pi / 2, panels[1] + 1),
        indexing="ij",
    )  # fmt: skip
    flat = radius * np.cos(down)
    return _grid(flat * np.cos(turn), np.abs(flat * np.sin(turn)), -radius * np.sin(down))


def both_sides(side: Side) -> Side:
    points, panels = side
    return _together(side, (points * [1, -1, 1], panels[:, ::-1]))


def written(file: Path, side: Side) -> Path:
    """Write WAMIT's format."""
    points, panels = side
    rows = "\n".join("{:.9g} {:.9g} {:.9g}".format(*each) for each in points[panels].reshape(-1, 3))
    file.write_text(f"a body\n1.0 9.80665\n0 0\n{len(panels)}\n{rows}\n")
    return file
