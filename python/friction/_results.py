"""Results of diagnoses, fits and simulations."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from . import _core
from ._model import Model


@dataclass(frozen=True)
class Size:
    """Size of an effect.

    Attributes:
        value: Its value, in ``unit``.
        unit: Its unit, for example ``Nm/Pa``.
        ci95: Its 95 % confidence interval, in ``unit``.
    """

    value: float
    unit: str
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Finding:
    """A cause of the model's error.

    Attributes:
        cause: Its name, for example ``pressure-coulomb``.
        remedy: ``compensate`` if the driver's model can take it, ``correct-column`` if it lies in the sensor or the logger,
            ``rigid-body`` if it is a part of the rigid body.
        columns: The columns that it follows.
        size: Its size.
        probability: Calibrated probability that it is present, 0 to 1.
        p_value: Its significance, 0 to 1.
        stability: Share of resampled logs in which it is found, 0 to 1.
        share_of_residual: Share of the squared error that it explains, 0 to 1.
        confusable_with: Causes that this log cannot tell from it.
        in_words: The finding in one sentence.
    """

    cause: str
    remedy: str
    columns: tuple[str, ...]
    size: Size
    probability: float
    p_value: float
    stability: float
    share_of_residual: float
    confusable_with: tuple[str, ...]
    in_words: str

    @classmethod
    def _of(cls, finding: Mapping[str, Any]) -> Finding:
        size = finding["size"]
        return cls(
            cause=finding["cause"],
            remedy=finding["remedy"],
            columns=tuple(finding["columns"]),
            size=Size(size["value"], size["unit"], (size["ci95"][0], size["ci95"][1])),
            probability=finding["probability"],
            p_value=finding["p_value"],
            stability=finding["stability"],
            share_of_residual=finding["share_of_residual"],
            confusable_with=tuple(finding["confusable_with"]),
            in_words=finding["in_words"],
        )


@dataclass(frozen=True)
class Candidate:
    """A cause that the diagnosis examined.

    Attributes:
        cause: Its name.
        columns: The columns that it follows.
        gain: Reduction of the squared error on held-out rows by this cause alone, as a share; below 0 if it makes the error larger.
        probability: Calibrated probability that it is present, 0 to 1.
        rejected_because: Why it is not among the findings; empty if it is.
    """

    cause: str
    columns: tuple[str, ...]
    gain: float
    probability: float
    rejected_because: str

    @classmethod
    def _of(cls, candidate: Mapping[str, Any]) -> Candidate:
        return cls(
            cause=candidate["cause"],
            columns=tuple(candidate["columns"]),
            gain=candidate["gain"],
            probability=candidate["probability"],
            rejected_because=candidate.get("rejected_because", ""),
        )


class _Result:
    """A result with the files of the command line."""

    def __init__(self, own: _core.Diagnosis | _core.Fits | _core.Tuning, threads: int) -> None:
        self._result = own
        self._threads = threads

    @cached_property
    def _document(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self._result.json())
        return document

    def to_dict(self) -> dict[str, Any]:
        """Returns the command line's JSON document as a dict: a copy that the caller may change."""
        document: dict[str, Any] = json.loads(self._result.json())
        return document

    def html(self) -> str:
        """Returns the report, a page that needs no network."""
        return self._result.html(self._threads)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Writes the files of the command line into a folder, which is created if missing, and returns it.

        Each file is written completely or not at all, and replaces one of the same name.

        Raises:
            OSError: If the folder or a file cannot be written.
        """
        self._result.write(os.fspath(folder), self._threads)
        return Path(folder)


class Diagnosis(_Result):
    """What a friction model gets wrong on a log, why, and what the extended model gains."""

    def __init__(self, own: _core.Diagnosis, threads: int, columns: Mapping[str, str] | None) -> None:
        super().__init__(own, threads)
        self._own = own
        self._columns = columns

    @property
    def cause(self) -> str:
        """Name of the strongest cause, or ``none``."""
        return str(self._document["cause"])

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All causes, strongest first; empty if there is none."""
        return tuple(Finding._of(finding) for finding in self._document["findings"])

    @property
    def gain(self) -> float:
        """Reduction of the error on held-out rows by the extension, 0 to 1; 0 if nothing is extended."""
        return float(self._document["extended"]["gain"])

    @property
    def gain_ci95(self) -> tuple[float, float]:
        """95 % confidence interval of the gain."""
        low, high = self._document["extended"]["gain_ci95"]
        return float(low), float(high)

    @property
    def story(self) -> tuple[str, ...]:
        """The result in five sentences."""
        return tuple(self._document["story"])

    @property
    def next_experiment(self) -> str:
        """The measurement that would show more, in words."""
        return str(self._document["next_experiment"])

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All causes that were examined, each with its gain and the reason why it was rejected."""
        return tuple(Candidate._of(candidate) for candidate in self._document["candidates"])

    @property
    def leading_fault(self) -> str | None:
        """The kind of the log's fault that explains most of the error, such as ``sign-suspect``; ``log`` describes it."""
        fault: str | None = self._document["leading_fault"]
        return fault

    @property
    def log(self) -> tuple[str, ...]:
        """Problems of the log itself, one sentence each."""
        return tuple(str(finding["in_words"]) for finding in self._document["log"])

    @cached_property
    def model(self) -> Model:
        """The model to use elsewhere, as ``params.toml`` has it. ``to_dict()["handed_over"]`` says which one."""
        return Model._of(self._own.model, self._columns)

    @cached_property
    def baseline(self) -> Model:
        """The base model, whose error is diagnosed."""
        return Model._of(self._own.baseline, self._columns)

    @cached_property
    def extended(self) -> Model:
        """The driver's law with the causes found, as it was evaluated on this log.

        ``model`` may be another one, which errs less or needs no phase of a ripple.
        """
        return Model._of(self._own.extended, self._columns)

    def _repr_html_(self) -> str:
        return self._own.first_screen()

    def __repr__(self) -> str:
        fault = f"{self.leading_fault}, " if self.leading_fault else ""
        return f"<Diagnosis {fault}{self.cause}, gain {100 * self.gain:.1f} %>"


class Fit(_Result):
    """One model fitted to a log and evaluated on held-out rows."""

    def __init__(self, own: _core.Fits, threads: int, columns: Mapping[str, str] | None) -> None:
        super().__init__(own, threads)
        self.model = Model._of(own.models[0], columns)

    @property
    def train(self) -> dict[str, float]:
        """Errors on the training rows by name: ``rmse``, Nm or N, and others."""
        return dict(self._document["models"][0]["train"])

    @property
    def test(self) -> dict[str, float]:
        """Errors on the held-out rows by name: ``rmse``, Nm or N, and others."""
        return dict(self._document["models"][0]["test"])

    @property
    def handed_over(self) -> str:
        """What ``params.toml`` holds: ``baseline``, the fitted model, or ``plain`` if plain friction errs clearly less."""
        return str(self._document["handed_over"])

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Remarks on the fit, for example parameters that the log does not determine."""
        return tuple(self._document["models"][0]["verdicts"])

    def _repr_html_(self) -> str:
        return _table(self._document["models"], self._document["data"]["unit"])

    def __repr__(self) -> str:
        unit = self._document["data"]["unit"]
        return f"<Fit {self.model.name}: held-out error {self.test['rmse']:.4g} {unit}>"


class Comparison(_Result):
    """Several models fitted to one log, side by side on held-out rows."""

    def __init__(self, own: _core.Fits, threads: int, columns: Mapping[str, str] | None) -> None:
        super().__init__(own, threads)
        self.models = tuple(Model._of(model, columns) for model in own.models)
        self._chosen = own.chosen
        #: The result in sentences.
        self.summary = tuple(own.summary)

    @property
    def best(self) -> Model:
        """The recommended model: that with the smallest held-out error, or a smaller one that is not significantly worse."""
        return self.models[self._chosen]

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.summary)
        return _table(self._document["models"], self._document["data"]["unit"]) + f"<ul>{lines}</ul>"

    def __repr__(self) -> str:
        return f"<Comparison of {len(self.models)} models, recommended: {self.best.name}>"


class Simulation:
    """The log of a simulated machine, and the truth about it.

    Attributes:
        data: The log as a table with ``__arrow_c_stream__``; columns as in the file ``data.csv``.
        truth: The true parameters and the hidden effects.
        csv: The text of ``data.csv``, rounded to the resolution of the sensors.
    """

    def __init__(self, data: _core.Table, truth: dict[str, Any], csv: str) -> None:
        self.data = data
        self.truth = truth
        self.csv = csv

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Writes ``data.csv`` and ``truth.json`` into a folder, which is created if missing, and returns it.

        Files of these names are replaced.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "data.csv").write_text(self.csv, encoding="utf-8")
        (folder / "truth.json").write_text(json.dumps(self.truth, indent=2) + "\n", encoding="utf-8")
        return folder

    def __repr__(self) -> str:
        return f"<Simulation {self.data.name}: {len(self.data)} rows>"


def _table(models: list[dict[str, Any]], unit: str) -> str:
    """Returns the models with their errors as HTML, best on held-out rows first."""
    rows = "".join(
        f"<tr><td>{escape(model['model'])}</td><td>{model['test']['rmse']:.4g}</td><td>{model['train']['rmse']:.4g}</td></tr>"
        for model in sorted(models, key=lambda model: float(model["test"]["rmse"]))
    )
    head = f"<tr><th>model</th><th>held out, {escape(unit)}</th><th>train, {escape(unit)}</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"
