"""Logs and results of a fleet in an object store, or wherever else fsspec can read and write.

An object store has no folders that could be renamed as a whole. A result there is complete when its ``row.json`` exists, which is
written last and removed first.
"""

from __future__ import annotations

import importlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from . import _core

#: File that makes a result complete.
_ROW_FILE = "row.json"


def is_address(path: str | os.PathLike[str]) -> bool:
    """Returns True for an address that fsspec opens, as ``s3://bucket/fleet``."""
    return "://" in os.fspath(path)


def _opened(address: str, options: Mapping[str, Any]) -> tuple[Any, str]:
    """Returns the file system of an address and the path in it."""
    core: Any = importlib.import_module("fsspec.core")
    filesystem, path = core.url_to_fs(address, **options)
    return filesystem, str(path).rstrip("/")


def find_logs(root: str, out: str, options: Mapping[str, Any]) -> list[tuple[str, str, tuple[str, ...]]]:
    """Returns joint, campaign and addresses of every log below ``root``, without those below ``out``."""
    filesystem, path = _opened(root, options)
    filesystem.invalidate_cache()
    names: list[str] = [str(name) for name in filesystem.find(path)]
    if is_address(out):
        results = _opened(out, options)[1] + "/"
        names = [name for name in names if not name.startswith(results)]
    return [
        (joint, campaign, tuple(str(filesystem.unstrip_protocol(os.fspath(file))) for file in files))
        for joint, campaign, files in _core.fleet_jobs_of(path, names)
    ]


@contextmanager
def local_copies(files: Sequence[str], options: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yields paths of the files on this machine. Those with an address are copied, and removed at the end."""
    if not any(is_address(file) for file in files):
        yield list(files)
        return
    fsspec: Any = importlib.import_module("fsspec")
    with tempfile.TemporaryDirectory(prefix="friction-") as folder:
        copies = []
        for place, file in enumerate(files):
            if not is_address(file):
                copies.append(file)
                continue
            # Files of several folders may have one name, which names their runs.
            copy = os.path.join(folder, str(place), file.rsplit("/", 1)[-1])
            os.mkdir(os.path.dirname(copy))
            with fsspec.open(file, "rb", **options) as source, open(copy, "wb") as target:
                shutil.copyfileobj(source, target)
            copies.append(copy)
        yield copies


class Results:
    """The folder of a fleet's results at an address, with a folder on this machine for those that a task writes."""

    def __init__(self, address: str, options: Mapping[str, Any], folder: str) -> None:
        self.folder = folder
        self._filesystem, self._path = _opened(address, options)

    def earlier_row(self, folder: str) -> bytes | None:
        """Returns ``row.json`` of an earlier result; None if there is none."""
        try:
            found: bytes = self._filesystem.cat_file(f"{self._path}/{folder}/{_ROW_FILE}")
        except FileNotFoundError:
            return None
        return found

    def publish(self) -> None:
        """Copies everything that was written. The row of each result is removed first and written last."""
        for row in Path(self.folder).rglob(_ROW_FILE):
            earlier = self._target(row)
            if self._filesystem.exists(earlier):
                self._filesystem.rm_file(earlier)
        files = [path for path in Path(self.folder).rglob("*") if path.is_file()]
        for file in sorted(files, key=lambda file: file.name == _ROW_FILE):
            self._filesystem.put_file(os.fspath(file), self._target(file))

    def _target(self, file: Path) -> str:
        return f"{self._path}/{file.relative_to(self.folder).as_posix()}"


@contextmanager
def results(out: str, options: Mapping[str, Any]) -> Iterator[Results | None]:
    """Yields the results at an address, which are published if the block ends without an exception; None for a path."""
    if not is_address(out):
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="friction-") as folder:
        found = Results(out, options, folder)
        yield found
        found.publish()
