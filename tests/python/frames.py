"""The five kinds of input: a path, three kinds of data frames, and a dict of arrays."""

import csv

import numpy
import pandas
import polars
import pyarrow

KINDS = ("path", "pandas", "polars", "pyarrow", "dict")


def as_pandas(log):
    """Reads a log with pandas, with time zones and categories where it has them."""
    frame = pandas.read_csv(log.path)
    if "stamp" in frame:
        frame["stamp"] = pandas.to_datetime(frame["stamp"]).dt.tz_convert("Europe/Berlin")
        frame["run"] = frame["run"].astype("category")
        frame["gear"] = frame["gear"].astype("category")
    return frame


def as_polars(log):
    frame = polars.from_pandas(as_pandas(log).astype({"run": str}))
    nulls = [polars.col(name).fill_nan(None) for name, kind in frame.schema.items() if kind.is_float()]
    return frame.with_columns(nulls).with_columns(polars.col("run").cast(polars.Categorical))


def as_pyarrow(log):
    return pyarrow.Table.from_pandas(as_pandas(log), preserve_index=False)


def as_dict(log):
    """Reads a log as numpy arrays, with points in time as datetime64."""
    with log.path.open() as file:
        rows = list(csv.DictReader(file))
    columns = {}
    for name in rows[0]:
        cells = [row[name] for row in rows]
        if name == "stamp":
            columns[name] = numpy.array([cell.rstrip("Z") for cell in cells], dtype="datetime64[us]")
        elif name in ("run", "gear"):
            columns[name] = numpy.array(cells)
        else:
            columns[name] = numpy.array([float(cell) if cell else numpy.nan for cell in cells])
    return columns


def of_kind(log, kind):
    """Returns a log as one of KINDS."""
    if kind == "path":
        return log.path
    return {"pandas": as_pandas, "polars": as_polars, "pyarrow": as_pyarrow, "dict": as_dict}[kind](log)


def comparable(document):
    """Returns a document without what differs between two runs (times), and between a file and a table (the hash)."""
    document = {key: value for key, value in document.items() if key != "seconds"}
    document["data"] = {key: value for key, value in document["data"].items() if key != "sha256"}
    if "models" in document:
        document["models"] = [{key: value for key, value in model.items() if key != "seconds"} for model in document["models"]]
    return document
