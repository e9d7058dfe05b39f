"""Figures of models and results, with matplotlib."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from . import _core
from ._errors import FrictionError
from ._data import table
from ._text import ParameterRow

#: Names of axes by the column of the contract.
_TORQUE_LABELS = {"torque_nm": ("torque", "Nm"), "force_n": ("force", "N")}
_VELOCITY_LABELS = {"torque_nm": ("velocity_rad_s", "rad/s"), "force_n": ("velocity_m_s", "m/s")}
#: Speeds of each direction of a friction curve, as shares of the largest: evenly spaced logarithms.
_SPEEDS = 80
_LEAST_SPEED = 1e-3
#: Rows at each speed, and the travel in them, rad or m. It is long beside the deflection of the bristles. The mean is over the
#: second half, one revolution, which a ripple over the position leaves unchanged.
_ROWS = 128
_TRAVEL = 4.0 * math.pi
#: Columns that follow from steady motion.
_MOTION = ("position_rad", "acceleration_rad_s2")
#: Intervals of a column over which a residual is averaged, and the least speed of its rows as a share of the largest.
_BINS = 10
_LEAST_SLIDING = 0.02


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    try:
        pyplot = importlib.import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ImportError("plot: matplotlib is missing: pip install matplotlib") from error
    return pyplot.subplots(figsize=(7, 4.5), layout="constrained")[1]


def _section(toml: str, name: str) -> dict[str, float]:
    """Returns the numbers of a section of a parameter file."""
    found = re.search(rf"^\[{name}\]\n(.*?)(?=^\[|\Z)", toml, re.MULTILINE | re.DOTALL)
    lines = re.findall(r"^(\w+) = ([-+.\deE]+)$", found.group(1) if found else "", re.MULTILINE)
    return {key: float(value) for key, value in lines}


def _steady_torques(model: _core.Model, speeds: Sequence[float], covariates: Mapping[str, float]) -> list[float]:
    """Returns the torque of steady motion at each velocity, each as a run of its own."""
    runs = [str(run) for run, _ in enumerate(speeds) for _ in range(_ROWS)]
    travel = [_TRAVEL * row / _ROWS for row in range(_ROWS)]
    columns: dict[str, Any] = {
        "run": runs,
        "time_s": [at / abs(speed) for speed in speeds for at in travel],
        _VELOCITY_LABELS[model.torque_column][0]: [speed for speed in speeds for _ in travel],
        model.torque_column: [0.0] * len(runs),
    }
    own = dict(zip(_MOTION, ([math.copysign(at, speed) for speed in speeds for at in travel], [0.0] * len(runs))))
    for name in model.needs:
        columns[name] = [covariates[name]] * len(runs) if name in covariates else own[name]
    torque = model.predict_table(_core.with_row_numbers(table(columns, "steady motion")))
    sliding = [torque[run * _ROWS + _ROWS // 2 : (run + 1) * _ROWS] for run, _ in enumerate(speeds)]
    return [sum(rows) / len(rows) for rows in sliding]


def friction_curve(
    model: _core.Model, parameters: Sequence[ParameterRow], ax: Any, speed: float | None, covariates: Mapping[str, float]
) -> Any:
    """Draws the torque of steady motion over the velocity; see ``Model.plot``."""
    unknown = [name for name in covariates if name not in model.needs]
    if unknown:
        needs = ", ".join(model.needs) or "none"
        raise FrictionError(f"plot: found the columns {', '.join(unknown)}, the model {model.name} reads {needs}")
    limits = _section(model.toml, "envelope")
    largest = speed if speed is not None else limits.get(_VELOCITY_LABELS[model.torque_column][0].replace("_", "_max_", 1), 1.0)
    if not 0.0 < largest < math.inf:
        raise ValueError(f"speed: found {largest}, expected a positive number")
    known = _section(model.toml, "log_means") | dict(covariates)
    given = {name: float(known[name]) for name in model.needs if name in known}
    missing = [name for name in model.needs if name not in given and name not in _MOTION]
    if missing:
        raise FrictionError(f"plot: the model {model.name} states no mean of {', '.join(missing)}, expected {missing[0]}=...")
    ax = _axes(ax)
    shares = [_LEAST_SPEED ** (1 - step / (_SPEEDS - 1)) for step in range(_SPEEDS)]
    for sign, label in ((1.0, model.name), (-1.0, None)):
        speeds = [sign * largest * share for share in shares]
        ax.plot(speeds, _steady_torques(model, speeds, given), color="C0", label=label)
    for name, value, unit, error, state in parameters:
        text = f"{name} {value:.4g}" + (f" ± {error:.2g}" if error is not None else "") + (f" {unit}" if unit != "1" else "")
        ax.plot([], [], " ", label=text + (f", {state}" if state else ""))
    quantity, unit = _TORQUE_LABELS[model.torque_column]
    ax.axhline(0, color="0.7", linewidth=0.8)
    ax.axvline(0, color="0.7", linewidth=0.8)
    at = ", ".join(f"{name} = {value:.4g}" for name, value in given.items())
    ax.set(xlabel=f"velocity ({_VELOCITY_LABELS[model.torque_column][1]})", ylabel=f"friction {quantity} ({unit})")
    ax.set_title("Friction of steady motion" + (f" at {at}" if at else ""))
    ax.legend(loc="best", fontsize="small")
    return ax


def run_of_log(residuals: Any, torque: str, model: str, run: str, ax: Any) -> Any:
    """Draws measured torque, predicted torque and residual of one run over time."""
    rows = residuals[residuals["run"] == run]
    if rows.empty:
        known = ", ".join(residuals["run"].unique())
        raise FrictionError(f"run={run!r}: found no such run, expected one of {known}")
    ax = _axes(ax)
    time = rows["time_s"] - rows["time_s"].min()
    quantity, unit = _TORQUE_LABELS[torque]
    ax.plot(time, rows[torque], color="0.6", linewidth=1.0, label=f"measured {quantity}")
    ax.plot(time, rows[f"predicted_{torque}"], color="C0", linewidth=1.2, label=f"predicted by {model}")
    ax.plot(time, rows[f"residual_{torque}"], color="C3", linewidth=0.8, label="residual")
    ax.axhline(0, color="0.7", linewidth=0.8)
    ax.set(xlabel="time (s)", ylabel=f"{quantity} ({unit})")
    ax.legend(loc="best", fontsize="small")
    return ax


def error_over(residuals: Any, column: str, torque: str, labels: Mapping[str, str], ax: Any) -> Any:
    """Draws the mean residual of each model, whose keys are prefixes, over intervals of a column with equal counts of rows.

    Each direction of sliding has its own line: a missing friction has opposite signs in them, a missing load the same.
    """
    ax = _axes(ax)
    quantity, unit = _TORQUE_LABELS[torque]
    velocity = residuals[_VELOCITY_LABELS[torque][0]]
    least = _LEAST_SLIDING * velocity.abs().max()
    for sign, marker, direction in ((1, ">", "forward"), (-1, "<", "backward")):
        rows = residuals[sign * velocity > least].dropna(subset=[column]).sort_values(column, kind="stable")
        edges = [len(rows) * part // _BINS for part in range(_BINS + 1)]
        bins = [rows.iloc[low:high] for low, high in zip(edges, edges[1:]) if high > low]
        places = [part[column].mean() for part in bins]
        for (prefix, label), colour in zip(labels.items(), ("C3", "C0")):
            means = [part[f"{prefix}residual_{torque}"].mean() for part in bins]
            ax.plot(places, means, color=colour, marker=marker, markersize=5, linewidth=0.8, label=f"{label}, {direction}")
    ax.axhline(0, color="0.7", linewidth=0.8)
    ax.set(xlabel=column, ylabel=f"mean residual {quantity} ({unit})")
    ax.legend(loc="best", fontsize="small")
    return ax


def model_errors(models: Sequence[tuple[str, float]], best: str, unit: str, ax: Any) -> Any:
    """Draws the held-out error of each model as a bar, smallest first."""
    ax = _axes(ax)
    names = [f"{name} (recommended)" if name == best else name for name, _ in models]
    bars = ax.barh(names, [error for _, error in models], color=["C0" if name == best else "0.7" for name, _ in models])
    ax.bar_label(bars, fmt="%.4g", padding=3)
    ax.invert_yaxis()
    ax.margins(x=0.12)
    ax.set(xlabel=f"RMS error on held-out rows ({unit})")
    return ax
