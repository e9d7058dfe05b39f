"""Tables for ``print`` and for notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, TypeAlias

#: Name, value, unit, standard error and state, as of a compiled model.
ParameterRow: TypeAlias = tuple[str, float, str, float | None, str | None]

_HEAD = ("parameter", "value", "unit", "std. error", "state")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def _cells(parameters: Sequence[ParameterRow]) -> list[tuple[str, ...]]:
    return [
        (name, _number(value), unit, _number(error), state or "")
        for name, value, unit, error, state in parameters
    ]


def aligned(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Returns a table whose columns have equal widths."""
    lines = [head, *rows]
    widths = [max(len(line[place]) for line in lines) for place in range(len(head))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines)


def parameter_table(parameters: Sequence[ParameterRow]) -> str:
    """Returns the parameters of a model as a table for ``print``."""
    return aligned(_HEAD, _cells(parameters))


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Returns a table as HTML."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def parameter_html(parameters: Sequence[ParameterRow]) -> str:
    """Returns the parameters of a model as HTML."""
    return html_table(_HEAD, _cells(parameters))


def model_errors(models: Sequence[Mapping[str, Any]]) -> list[tuple[str, float, float]]:
    """Returns the name and the held-out and training error of each model, best on held-out rows first."""
    rows = [(str(model["model"]), float(model["test"]["rmse"]), float(model["train"]["rmse"])) for model in models]
    return sorted(rows, key=lambda row: row[1])


def model_rows(models: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Returns ``model_errors`` as cells."""
    return [(name, _number(test), _number(train)) for name, test, train in model_errors(models)]


def model_head(unit: str) -> tuple[str, str, str]:
    return "model", f"held out, {unit}", f"train, {unit}"
