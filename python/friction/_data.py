"""Conversion of what users have (paths, data frames, dicts of arrays) to logs."""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from . import _core

#: A path, several paths or tables, a data frame with ``__arrow_c_stream__`` (pandas 2.2 or later, polars, pyarrow), or a
#: dict of columns.
Data: TypeAlias = Any

#: Names that pyarrow gives to an index without a name. It is no column of the log.
_INDEX = re.compile(r"__index_level_\d+__$")


@dataclass(frozen=True)
class Reading:
    """A log as the user gave it, and with the options of its reading.

    Attributes:
        log: What the computations read.
        data: The path or table.
        options: The options that select, name and scale rows and columns, as keywords of ``log``.
    """

    log: _core.Log
    data: Data
    options: Mapping[str, Any]


def log(
    data: Data,
    *,
    test: Data | None = None,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, object] | None = None,
    rigid_body: str | Iterable[str] = (),
    skip: int = 0,
    decimate: int = 1,
    motion: Literal["smoothed", "logged"] | None = None,
    as_logged: Iterable[str] = (),
    hold_out: Mapping[str, object] | None = None,
    tail: float | None = None,
    rated_torque_nm: float | None = None,
    torque_constant: str | float | None = None,
    torque_from: str | None = None,
    bad_rows: float | None = None,
    rate_hz: float | None = None,
    join: bool = False,
    preset: str | None = None,
    skip_lines: int = 0,
    loss: Literal["squares", "huber"] | None = None,
    seed: int = 0,
    name: str = "data",
) -> Reading:
    """Returns a log with the options of its reading; see ``diagnose`` for the arguments."""
    if torque_constant is not None and not isinstance(torque_constant, str):
        unit = "N/A" if "force_n" in (columns or {}) else "Nm/A"
        torque_constant = f"{float(torque_constant)!r}{unit}"
    options = {
        "columns": columns,
        "where": where,
        "skip": skip,
        "rated_torque_nm": rated_torque_nm,
        "torque_constant": torque_constant,
        "torque_from": torque_from,
        "bad_rows": bad_rows,
        "rate_hz": rate_hz,
        "join": join,
        "preset": preset,
        "skip_lines": skip_lines,
        "as_logged": list(as_logged),
        "name": name,
    }
    if hold_out is not None and len(hold_out) != 1:
        raise ValueError("hold_out: expected one column with its values")
    held_out = next(iter(_selection(hold_out)), None)
    own = _core.Log(
        sources(data, name),
        test=[] if test is None else sources(test, "test"),
        columns=[(str(ours), str(theirs)) for ours, theirs in (columns or {}).items()],
        only=_selection(where),
        skip=skip,
        decimate=decimate,
        rigid_body=rigid_body if isinstance(rigid_body, str) else ",".join(rigid_body),
        motion=motion,
        as_logged=list(as_logged),
        seed=seed,
        hold_out=held_out,
        tail=tail,
        rated_torque_nm=rated_torque_nm,
        torque_constant=torque_constant,
        torque_from=torque_from,
        bad_rows=bad_rows,
        rate_hz=rate_hz,
        join=join,
        preset=preset,
        skip_lines=skip_lines,
        loss=loss,
    )
    return Reading(own, data, options)


def sources(data: Data, name: str) -> list[str | _core.Table]:
    """Returns paths or tables."""
    if isinstance(data, (str, os.PathLike)):
        return [os.fspath(data)]
    if isinstance(data, Sequence) and not hasattr(data, "__arrow_c_stream__"):
        parts = list(data)
        names = [name] if len(parts) == 1 else [f"{name}-{place}" for place, _ in enumerate(parts, 1)]
        return [one for part, own in zip(parts, names) for one in sources(part, own)]
    return [table(data, name)]


def table(data: Data, name: str) -> _core.Table:
    """Returns a data frame or a dict of columns as a table.

    Raises:
        TypeError: If the data are neither.
    """
    if isinstance(data, _core.Table):
        return data
    if isinstance(data, Mapping):
        return _of_columns(data, name)
    fields = getattr(getattr(data, "dtype", None), "names", None)
    if fields and not hasattr(data, "columns"):
        # A structured numpy array.
        return _of_columns({str(field): data[field] for field in fields}, name)
    if hasattr(data, "__arrow_c_stream__"):
        try:
            found = _core.Table.from_arrow(data, name)
        except (ImportError, TypeError, ValueError):
            # pandas needs pyarrow for this interface, and pyarrow refuses columns of mixed types.
            if not hasattr(data, "columns"):
                raise
            return _of_columns({str(column): data[column] for column in data.columns}, name)
        if any(_INDEX.match(column) for column in found.column_names):
            return _core.Table.from_arrow(data.reset_index(drop=True), name)
        return found
    raise TypeError(
        f"data: found {type(data).__name__}, expected a path, a data frame with __arrow_c_stream__, or a dict of columns"
    )


def _of_columns(columns: Mapping[str, Any], name: str) -> _core.Table:
    return _core.Table.from_columns([(column, *_cells(values)) for column, values in columns.items()], name)


def _cells(values: Any) -> tuple[str, bytes | list[str]]:
    """Returns the kind of a column and its cells as bytes, or as texts."""
    kind = getattr(getattr(values, "dtype", None), "kind", None)
    if kind is not None and hasattr(values, "astype") and type(values).__module__.split(".")[0] != "numpy":
        values = values.to_numpy() if hasattr(values, "to_numpy") else values
        kind = getattr(getattr(values, "dtype", None), "kind", None)
    if kind == "f":
        return "numbers", values.astype("float64").tobytes()
    if kind in ("i", "u"):
        exact = kind == "i" or values.dtype.itemsize < 8
        return ("integers", values.astype("int64").tobytes()) if exact else ("numbers", values.astype("float64").tobytes())
    if kind == "M":
        return "stamps", values.astype("datetime64[ns]").astype("int64").tobytes()
    for convert in ("to_pylist", "tolist"):
        if hasattr(values, convert):
            return _listed(getattr(values, convert)())
    return _listed(list(values))


def _listed(values: list[Any]) -> tuple[str, bytes | list[str]]:
    """Returns the cells of a list: numbers if all are, else texts."""
    values = [None if _is_missing(value) else value for value in values]
    if all(value is None or isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        if values and all(isinstance(value, int) and abs(value) < 2**63 for value in values):
            return "integers", array("q", values).tobytes()
        return "numbers", array("d", (float("nan") if value is None else value for value in values)).tobytes()
    return "texts", [_text(value) for value in values]


def _is_missing(value: object) -> bool:
    """Returns True for None, and for the missing values of pandas, which cannot be compared."""
    return value is None or type(value).__name__ in ("NAType", "NaTType")


def _text(value: object) -> str:
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    isoformat = getattr(value, "isoformat", None)
    return str(isoformat()) if isoformat is not None else str(value)


def _selection(where: Mapping[str, object] | None) -> list[tuple[str, list[str]]]:
    """Returns columns with their accepted values as texts."""

    def values(value: object) -> list[str]:
        if isinstance(value, Iterable) and not isinstance(value, (str, bytes)):
            return [str(one) for one in value]
        return [str(value)]

    return [(column, values(value)) for column, value in (where or {}).items()]
