"""Parts of a model: its parameters, and its other forms."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

#: Forms of an export: the driver's flash record, Rust constants, a C header, the network's record, ONNX graphs, MuJoCo and URDF
#: elements.
Form = Literal["record", "rust", "c", "network", "onnx", "mujoco", "urdf"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model.

    Attributes:
        value: Its value, in ``unit``.
        unit: Its unit; ``1`` for a plain number.
        std_error: Its standard error, in ``unit``; None if it was not fitted.
        state: ``determined``, ``not-determined``, ``at-start`` or ``at-bound``; None if a file does not state it.
    """

    value: float
    unit: str
    std_error: float | None
    state: str | None


class Export(bytes):
    """A model in another form: the content of its file, and what belongs to it.

    Attributes:
        name: Name of the file, as the command line names it.
        further_files: Further files by name, for example the graph of the start beside that of one step.
        notes: What the file omits and how it is used, one sentence each.
    """

    name: str
    further_files: dict[str, bytes]
    notes: tuple[str, ...]

    @classmethod
    def _of(cls, files: Sequence[tuple[str, bytes]], notes: Iterable[str]) -> Export:
        (name, content), *further = files
        export = cls(content)
        export.name, export.further_files, export.notes = name, dict(further), tuple(notes)
        return export

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Writes all files into a folder, which is created if missing, and returns it. Files of the same names are replaced."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in {self.name: self, **self.further_files}.items():
            (folder / name).write_bytes(content)
        return folder
