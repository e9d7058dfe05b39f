"""Inputs whose rows have labels or whose columns have no names, and results as pandas frames."""

from __future__ import annotations

import importlib
import os
import sys
from array import array
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from . import _core
from ._data import Data, log, table
from ._text import ParameterRow

#: The column that ``_core.with_row_numbers`` adds.
_ROW = "friction row number"


def pandas(purpose: str) -> Any:
    """Returns the module pandas.

    Raises:
        ImportError: If it is missing; the message says how to install it.
    """
    try:
        return importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError(f"{purpose}: pandas is missing: pip install pandas") from error


def is_labelled(data: Data) -> bool:
    """Returns True for a data frame or a column of pandas."""
    module = sys.modules.get("pandas")
    return module is not None and isinstance(data, (module.DataFrame, module.Series))


def with_names(data: Data, names: Sequence[str] | None) -> Data:
    """Returns an array of numbers as a dict of columns, and other data unchanged.

    Raises:
        TypeError: If the names are missing.
        ValueError: If their number is not that of the columns.
    """
    if getattr(data, "ndim", None) != 2 or hasattr(data, "columns") or hasattr(data, "__arrow_c_stream__"):
        return data
    count = int(data.shape[1])
    if names is None:
        raise TypeError(
            f"data: found an array of {count} columns without names, expected a data frame, or names for an array: "
            'Model(feature_names=["time_s", "velocity_rad_s", ...])'
        )
    if len(names) != count:
        raise ValueError(f"data: found an array of {count} columns, expected {len(names)}: {', '.join(names)}")
    columns = {name: data[:, place] for place, name in enumerate(names)}
    run = columns.get("run")
    if run is not None and run.dtype.kind == "f" and bool((run == run.round()).all()):
        # An array has one type of numbers, but runs are counted.
        columns["run"] = run.astype("int64")
    return columns


def feature_names(data: Data) -> list[str] | None:
    """Returns the names of a table's columns; None for a path or several tables."""
    if isinstance(data, (str, os.PathLike)) or isinstance(data, Sequence) and not hasattr(data, "columns"):
        return None
    if isinstance(data, Mapping):
        return [str(name) for name in data]
    names = getattr(data, "column_names", None) or getattr(data, "columns", None)
    if names is None:
        names = getattr(getattr(data, "dtype", None), "names", None)
    return None if names is None else [str(name) for name in names]


def objects(names: Sequence[str]) -> Any:
    """Returns names as the array that scikit-learn expects, or as a list without numpy."""
    try:
        import numpy
    except ImportError:
        return list(names)
    return numpy.array(names, dtype=object)


def numbers(values: list[float]) -> Any:
    """Returns numbers as a numpy array if numpy is installed, else as ``array.array``."""
    try:
        import numpy
    except ImportError:
        return array("d", values)
    return numpy.asarray(values)


def labelled(values: list[float], data: Data, name: str) -> Any:
    """Returns the numbers of all rows: as a Series with the index of a pandas frame, else as ``numbers``."""
    if is_labelled(data):
        return pandas("predict").Series(values, index=data.index, name=name)
    return numbers(values)


def parameter_frame(parameters: Sequence[ParameterRow]) -> Any:
    """Returns the parameters of a model as a frame with their names as index."""
    frame = pandas("to_pandas").DataFrame(parameters, columns=["parameter", "value", "unit", "std_error", "state"])
    return frame.set_index("parameter")


def contract_columns(data: Data, options: Mapping[str, Any]) -> tuple[_core.Table, dict[str, list[Any]], list[int]]:
    """Returns a log with the names and units of the contract, as a table and as columns, and the numbers of its rows."""
    name = str(options.get("name", "data"))
    if isinstance(data, (str, os.PathLike)) or isinstance(data, Sequence) and not hasattr(data, "__arrow_c_stream__"):
        whole = _core.read(log(data, **options).log, name)
        return whole, whole.to_dict(), list(range(len(whole)))
    numbered = _core.with_row_numbers(table(data, name))
    whole = _core.read(log(numbered, **options).log, name)
    columns = whole.to_dict()
    return whole, columns, [int(row) for row in columns.pop(_ROW)]


def residual_frame(
    models: Mapping[str, _core.Model],
    data: Data,
    options: Mapping[str, Any],
    *,
    motion: Literal["smoothed", "logged"] | None = None,
    threads: int = 0,
    others: Sequence[str] = (),
    labels: Any = None,
) -> Any:
    """Returns run, time, torque, and the predicted torque and the residual of each model, whose keys are prefixes.

    Args:
        data, options: A log and how it is read.
        motion: As for ``diagnose``.
        others: Further columns of the contract to return, of those that the log has.
        labels: The pandas frame whose index the rows get.
    """
    frames = pandas("residuals")
    whole, columns, rows = contract_columns(data, options)
    numbered = log(_core.with_row_numbers(whole), motion=motion, as_logged=options.get("as_logged", ())).log
    torque = next(iter(models.values())).torque_column
    kept = list(dict.fromkeys(["run", "time_s", *(name for name in others if name in columns), torque]))
    found = frames.DataFrame({name: columns[name] for name in kept}, index=rows)
    for prefix, model in models.items():
        # A fit turns a torque that was logged with the other sign, and so does this.
        found[torque], found[f"{prefix}predicted_{torque}"] = model.predict_log(numbered, len(whole), True, threads)
        found[f"{prefix}residual_{torque}"] = found[torque] - found[f"{prefix}predicted_{torque}"]
    found = found.sort_index()
    if labels is not None:
        found.index = labels.index[found.index]
    return found
