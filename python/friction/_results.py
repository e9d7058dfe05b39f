"""Results of diagnoses, fits and simulations."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from . import _core, _frames, _plot, _text
from ._data import Data, Reading
from ._errors import FrictionError

if TYPE_CHECKING:
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


def _model(own: _core.Model, reading: Reading | None) -> Model:
    # Late, since it imports scikit-learn.
    from ._model import Model

    return Model._of(own, reading)


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

    def __reduce__(self) -> Any:
        name = type(self).__name__
        raise TypeError(f"{name}: cannot be pickled with its log; pickle a model of it, or keep to_dict() or save(folder)")


class _OfLog(_Result):
    """A result with the log that it was made of."""

    def __init__(self, own: _core.Diagnosis | _core.Fits, threads: int, reading: Reading | None) -> None:
        super().__init__(own, threads)
        self._reading = reading

    @property
    def _unit(self) -> str:
        """Unit of the torque, Nm or N."""
        return str(self._document["data"]["unit"])

    def _residuals(self, models: Mapping[str, _core.Model], data: Data | None, others: Iterable[str] = ()) -> Any:
        """Returns the residuals of the log, or of other data that are read as it was."""
        if self._reading is None:
            raise FrictionError("residuals: found a result without its log, expected model.residuals(log)")
        data = self._reading.data if data is None else data
        labels = data if _frames.is_labelled(data) else None
        options = self._reading.options
        return _frames.residual_frame(models, data, options, threads=self._threads, others=list(others), labels=labels)


class Diagnosis(_OfLog):
    """What a friction model gets wrong on a log, why, and what the extended model gains."""

    def __init__(self, own: _core.Diagnosis, threads: int, reading: Reading | None) -> None:
        super().__init__(own, threads, reading)
        self._own = own

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
        return _model(self._own.model, self._reading)

    @cached_property
    def baseline(self) -> Model:
        """The base model, whose error is diagnosed."""
        return _model(self._own.baseline, self._reading)

    @cached_property
    def extended(self) -> Model:
        """The driver's law with the causes found, as it was evaluated on this log.

        ``model`` may be another one, which errs less or needs no phase of a ripple.
        """
        return _model(self._own.extended, self._reading)

    def to_pandas(self) -> Any:
        """Returns the causes that were examined as a ``pandas.DataFrame``, with their names as index: columns, gain, probability,
        and why they were rejected.

        Raises:
            ImportError: If pandas is missing.
        """
        rows = [vars(candidate) for candidate in self.candidates]
        names = [field.name for field in fields(Candidate)]
        return _frames.pandas("to_pandas").DataFrame(rows, columns=names).set_index("cause")

    def residuals(self, data: Data | None = None, *, of: Literal["model", "baseline", "extended"] = "model") -> Any:
        """Returns run, time, torque, prediction and residual of each row that can be read, as ``Model.residuals`` does.

        Args:
            data: Another log with the same columns; the log of the diagnosis by default.
            of: The model that predicts.
        """
        return self._residuals({"": getattr(self._own, of)}, data)

    def plot(self, ax: Any = None) -> Any:
        """Draws the mean residual of the base model and of the extended one over the column of the strongest cause, or over the
        velocity, and returns the ``Axes``. The title states the held-out errors.

        Args:
            ax: Axes of matplotlib to draw on; new ones by default.

        Raises:
            ImportError: If matplotlib or pandas is missing.
        """
        known = [column["name"] for column in self._document["data"]["columns"]]
        wanted = [column for finding in self.findings for column in finding.columns]
        velocity = next(name for name in ("velocity_rad_s", "velocity_m_s") if name in known)
        column = next((name for name in wanted if name in known), velocity)
        before, after = self._own.baseline, self._own.extended
        residuals = self._residuals({"before_": before, "after_": after}, None, [velocity, column])
        labels = {"before_": before.name, "after_": f"extended: {after.name}"}
        ax = _plot.error_over(residuals, column, before.torque_column, labels, ax)
        errors = [self._document[name]["test_rmse"] for name in ("baseline", "extended")]
        ax.set_title(f"Cause: {self.cause}. Held-out error {errors[0]:.4g} to {errors[1]:.4g} {self._unit}")
        return ax

    def _repr_html_(self) -> str:
        return self._own.first_screen()

    def __str__(self) -> str:
        model = self._own.model
        return "\n".join(
            [f"Diagnosis: {repr(self)[len('<Diagnosis ') : -1]}", "", *self.story, "", f"Model {model.name}", ""]
            + [_text.parameter_table(model.parameters)]
        )

    def __repr__(self) -> str:
        fault = f"{self.leading_fault}, " if self.leading_fault else ""
        return f"<Diagnosis {fault}{self.cause}, gain {100 * self.gain:.1f} %>"


class Fit(_OfLog):
    """One model fitted to a log and evaluated on held-out rows."""

    def __init__(self, own: _core.Fits, threads: int, reading: Reading | None) -> None:
        super().__init__(own, threads, reading)
        self._own = own.models[0]

    @cached_property
    def model(self) -> Model:
        """The fitted model."""
        return _model(self._own, self._reading)

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

    def to_pandas(self) -> Any:
        """Returns the parameters as a ``pandas.DataFrame``: value, unit, standard error and state by name.

        Raises:
            ImportError: If pandas is missing.
        """
        return _frames.parameter_frame(self._own.parameters)

    def residuals(self, data: Data | None = None) -> Any:
        """Returns run, time, torque, prediction and residual of each row that can be read, as ``Model.residuals`` does.

        Args:
            data: Another log with the same columns; the log of the fit by default.
        """
        return self._residuals({"": self._own}, data)

    def plot(self, ax: Any = None, *, run: object | None = None) -> Any:
        """Draws measured torque, predicted torque and residual of a run over time, and returns the ``Axes``.

        Args:
            ax: Axes of matplotlib to draw on; new ones by default.
            run: Name of the run; by default the first held-out one.

        Raises:
            ImportError: If matplotlib or pandas is missing.
        """
        residuals = self._residuals({"": self._own}, None)
        data = self._document["data"]
        # Of a single run, blocks are held out.
        held_out = [one for one in data["test_runs"] if one not in data["train_runs"] and (residuals["run"] == one).any()]
        name = str(run) if run is not None else next(iter(held_out), residuals["run"].iloc[0])
        ax = _plot.run_of_log(residuals, self._own.torque_column, self._own.name, name, ax)
        part = ", held out" if name in held_out else ""
        ax.set_title(f"Run {name}{part}. Held-out error {self.test['rmse']:.4g} {self._unit}")
        return ax

    def _repr_html_(self) -> str:
        return _error_table(self._document["models"], self._unit) + _text.parameter_html(self._own.parameters)

    def __str__(self) -> str:
        errors = f"Error (RMS): {self.test['rmse']:.4g} {self._unit} held out, {self.train['rmse']:.4g} {self._unit} train"
        remarks = [f"- {verdict}" for verdict in self.verdicts]
        table = _text.parameter_table(self._own.parameters)
        return "\n".join([f"Fit of {self._own.name}", errors, "", table] + (["", *remarks] if remarks else []))

    def __repr__(self) -> str:
        return f"<Fit {self._own.name}: held-out error {self.test['rmse']:.4g} {self._unit}>"


class Comparison(_OfLog):
    """Several models fitted to one log, side by side on held-out rows."""

    def __init__(self, own: _core.Fits, threads: int, reading: Reading | None) -> None:
        super().__init__(own, threads, reading)
        self._own = own.models
        self._chosen = own.chosen
        #: The result in sentences.
        self.summary = tuple(own.summary)

    @cached_property
    def models(self) -> tuple[Model, ...]:
        """The fitted models, in the order of the request."""
        return tuple(_model(own, self._reading) for own in self._own)

    @property
    def best(self) -> Model:
        """The recommended model: that with the smallest held-out error, or a smaller one that is not significantly worse."""
        return self.models[self._chosen]

    def to_pandas(self) -> Any:
        """Returns a ``pandas.DataFrame`` with a row per model, smallest held-out error first, and the model's name as index.

        Columns are ``test_rmse`` and ``train_rmse``, Nm or N, and ``is_recommended``.

        Raises:
            ImportError: If pandas is missing.
        """
        chosen = self._own[self._chosen].name
        rows = [
            (name, test, train, name == chosen) for name, test, train in _text.model_errors(self._document["models"])
        ]
        frame = _frames.pandas("to_pandas").DataFrame(rows, columns=["model", "test_rmse", "train_rmse", "is_recommended"])
        return frame.set_index("model")

    def residuals(self, data: Data | None = None) -> Any:
        """Returns run, time, torque, prediction and residual of ``best`` for each row that can be read, as ``Fit.residuals``."""
        return self._residuals({"": self._own[self._chosen]}, data)

    def plot(self, ax: Any = None) -> Any:
        """Draws the held-out error of each model as a bar, and returns the ``Axes``.

        Args:
            ax: Axes of matplotlib to draw on; new ones by default.

        Raises:
            ImportError: If matplotlib is missing.
        """
        errors = [(name, test) for name, test, _ in _text.model_errors(self._document["models"])]
        return _plot.model_errors(errors, str(self._document["chosen"]), self._unit, ax)

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.summary)
        return _error_table(self._document["models"], self._unit) + f"<ul>{lines}</ul>"

    def __str__(self) -> str:
        rows = _text.model_rows(self._document["models"])
        best = self._own[self._chosen]
        lines = [repr(self)[1:-1], "", _text.aligned(_text.model_head(self._unit), rows), "", *self.summary, ""]
        return "\n".join([*lines, f"Model {best.name}", "", _text.parameter_table(best.parameters)])

    def __repr__(self) -> str:
        return f"<Comparison of {len(self._own)} models, recommended: {self._own[self._chosen].name}>"


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

    def to_pandas(self) -> Any:
        """Returns the log as a ``pandas.DataFrame``, which ``diagnose`` and ``Model.fit`` read.

        Raises:
            ImportError: If pandas is missing.
        """
        return _frames.pandas("to_pandas").DataFrame(self.data.to_dict())

    def __repr__(self) -> str:
        return f"<Simulation {self.data.name}: {len(self.data)} rows>"


def _error_table(models: list[dict[str, Any]], unit: str) -> str:
    """Returns the models with their errors as HTML, best on held-out rows first."""
    return _text.html_table(_text.model_head(unit), _text.model_rows(models))
