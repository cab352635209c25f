"""The ring of rows: a record is one telemetry row of float64, in the order of its columns."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.telemetry.ring import RingError, RingKind, RingReader, RingWriter


class RowWriter(RingWriter):
    """Writing end of a ring of rows; by default seven minutes at 20 Hz, some 2 MB.

    The columns are one or more different names. `about` is the origin of the rows
    (`utank_hil.base.provenance`).
    """

    def __init__(
        self, columns: Sequence[str], slots: int = 8192, about: Mapping[str, Any] | None = None
    ) -> None:
        if not columns or len(set(columns)) != len(columns):
            raise ValueError(f"a ring needs columns with different names, got {tuple(columns)}")
        content = {"columns": tuple(columns), "about": about}
        super().__init__(RingKind.ROWS, 8 * len(columns), 1, slots, content)


class RowReader(RingReader):
    """Reading end of a ring of rows; `about` is their origin, None if unknown."""

    def __init__(self, name: str, place: int | None = None) -> None:
        super().__init__(name, place, RingKind.ROWS)
        columns, about = self.content.get("columns"), self.content.get("about")
        if not isinstance(columns, list) or self._stride != 8 * len(columns) + 8:
            raise RingError(f"{name!r} is a damaged telemetry ring: {columns} are its columns")
        self.columns: tuple[str, ...] = tuple(map(str, columns))
        self.about: Mapping[str, Any] | None = about if isinstance(about, dict) else None

    def read_rows(self) -> FloatArray:
        """Return the rows written since the last call, shape (n, width), n may be zero."""
        values: FloatArray = np.frombuffer(b"".join(self.read()))
        return values.reshape(-1, len(self.columns))
