"""Friction models: their parameters, their torque, and their use as estimators."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Literal

from . import _core, _frames, _plot, _text
from ._core import __version__
from ._data import Data, Reading, log, table
from ._errors import FrictionError, ModelError
from ._estimator import NotFittedError, Regressor
from ._export import Export, Form, Parameter
from ._progress import Progress, shown

_TORQUES = ("torque_nm", "force_n")
#: Arguments of the constructor that say how a table is read.
_READING = ("columns", "torque_constant", "rated_torque_nm")


class Model(Regressor):
    """A friction model: a law with terms, and its values once it is fitted or loaded.

    It is an estimator of scikit-learn, if that is installed: ``clone``, ``Pipeline``, ``GridSearchCV`` and
    ``cross_val_score`` work. Runs must stay whole, so cross-validation needs groups, for example ``GroupKFold`` over the column
    ``run``. ``pickle`` and ``copy`` keep the values; ``save`` writes the format that lasts.

    Args:
        name: Law and terms, as ``"lugre"`` or ``"lugre+pressure-coulomb"``.
        columns, rigid_body, motion, rated_torque_nm: As for ``diagnose``.
        torque_constant: As for ``diagnose``. ``y`` without a column of its own is a current then, in A.
        feature_names: Names of the columns of an array, ``["time_s", "run", "velocity_rad_s"]``. A data frame, a dict and a
            structured array have names.
        starts: Number of starting points that are optimised to convergence, at least 1.
        threads: Number of threads; 0 uses all cores.

    Attributes:
        feature_names_in_: Names of the columns of the table of ``fit``; missing before, and for a path.
        n_features_in_: Their number.

    Raises:
        ModelError: In ``fit``, if the model is unknown.
    """

    feature_names_in_: Any
    n_features_in_: int

    def __init__(
        self,
        name: str = "lugre",
        *,
        columns: Mapping[str, str] | None = None,
        rigid_body: str | Sequence[str] = (),
        motion: Literal["smoothed", "logged"] | None = None,
        torque_constant: str | float | None = None,
        rated_torque_nm: float | None = None,
        feature_names: Sequence[str] | None = None,
        starts: int = 3,
        threads: int = 0,
    ) -> None:
        self.name = name
        self.columns = columns
        self.rigid_body = rigid_body
        self.motion: Literal["smoothed", "logged"] | None = motion
        self.torque_constant = torque_constant
        self.rated_torque_nm = rated_torque_nm
        self.feature_names = feature_names
        self.starts = starts
        self.threads = threads

    #: The compiled model, once it is fitted or loaded.
    _own: _core.Model | None = None
    #: Its parameters with what a file does not state, after ``pickle``.
    _rows: list[_text.ParameterRow] | None = None

    @classmethod
    def _of(cls, own: _core.Model, reading: Reading | None = None) -> Model:
        options = {} if reading is None else {name: reading.options[name] for name in _READING}
        model = cls(own.name, **options)
        model._own = own
        return model

    @classmethod
    def from_toml(cls, text: str) -> Model:
        """Returns the model of a parameter file's text.

        Raises:
            ModelError: If the text is no valid parameter file; the message names the key.
        """
        return cls._of(_core.Model.from_toml(text))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Model:
        """Returns the model of a file ``params.toml``.

        Raises:
            OSError: If the file cannot be read.
            ModelError: See ``from_toml``.
        """
        return cls.from_toml(Path(path).read_text(encoding="utf-8"))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model as ``params.toml``, for the command line and the driver."""
        Path(path).write_text(self.toml, encoding="utf-8")

    @property
    def toml(self) -> str:
        """Text of ``params.toml``, with the origin of the parameters as comments."""
        return self._fitted().toml

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The parameters by name."""
        return {name: Parameter(value, unit, error, state) for name, value, unit, error, state in self._parameter_rows()}

    def _parameter_rows(self) -> list[_text.ParameterRow]:
        return self._fitted().parameters if self._rows is None else self._rows

    def to_pandas(self) -> Any:
        """Returns the parameters as a ``pandas.DataFrame``: value, unit, standard error and state by name.

        Raises:
            ImportError: If pandas is missing.
        """
        return _frames.parameter_frame(self._parameter_rows())

    def plot(self, ax: Any = None, *, speed: float | None = None, **covariates: float) -> Any:
        """Draws the friction of steady motion over the velocity, in both directions, and returns the ``Axes``.

        The legend states the parameters with their units and states.

        Args:
            ax: Axes of matplotlib to draw on; new ones by default.
            speed: Largest speed, rad/s or m/s; by default the largest that the model is valid for.
            covariates: Values of the columns that the model reads, as ``temperature_c=20.0``; by default their means in the
                log of the fit.

        Raises:
            FrictionError: If the model states no mean of a column that it reads, and ``covariates`` no value.
            ImportError: If matplotlib is missing.
        """
        return _plot.friction_curve(self._fitted(), self._parameter_rows(), ax, speed, covariates)

    def export(self, to: Form, *, gravity: bool = False, compensator: Mapping[str, float] | None = None) -> Export:
        """Returns the model in another form: the bytes of a file, with ``notes`` on what it omits and how it is used.

        Args:
            to: ``"record"``, ``"rust"``, ``"c"``, ``"network"``, ``"onnx"``, ``"mujoco"`` or ``"urdf"``. The first three and the
                ONNX graph of a law hold friction only.
            gravity: Also compensate the gravity of the model, which is wrong as soon as the joint is mounted or tilted otherwise.
            compensator: Settings for ``"record"`` and ``"rust"`` that the model lacks: ``torque_constant_nm_per_a``,
                ``torque_limit_nm``, ``current_limit_a`` and ``scale``.

        Raises:
            FrictionError: If the form does not support a term of the model, or the model has no network for ``"network"``.
        """
        settings = None if compensator is None else dict(compensator)
        return Export._of(*self._fitted().export(to, gravity, settings))

    def fit(self, data: Data, y: Any = None, *, progress: Progress | bool | None = None) -> Model:
        """Fits the model to all rows of a log and returns itself.

        Args:
            data: See ``diagnose``; with ``y``, a single table or path. An array needs ``feature_names``.
            y: Torque of each row, in the unit of the torque column: Nm or N, unless ``columns`` states another; None if ``data``
                contains it.
            progress: See ``diagnose``.

        Raises:
            DataError: If the log cannot be read.
            ModelError: If the model is unknown.
        """
        named = _frames.with_names(data, self.feature_names)
        whole, options, _ = self._reading(named, y)
        prepared = log(whole, **options, rigid_body=self.rigid_body, motion=self.motion).log
        with shown(progress) as report:
            fits = _core.fit(
                prepared,
                [self.name],
                uses_all_rows=True,
                starts=self.starts,
                threads=self.threads,
                progress=report,
            )
        self._forget()
        self._own = fits.models[0]
        names = _frames.feature_names(named)
        if names is not None:
            self.feature_names_in_, self.n_features_in_ = _frames.objects(names), len(names)
        return self

    def predict(
        self,
        data: Data,
        dt: float | None = None,
        *,
        adapt: bool = False,
        adapt_memory: float | None = None,
        adapt_range: tuple[float, float] | None = None,
        progress: Progress | bool | None = None,
        **covariates: Any,
    ) -> Any:
        """Returns the torque of each row, Nm or N.

        It is a ``pandas.Series`` with the index of a pandas frame. Of other data, polars and pyarrow too, it is a numpy array in
        the order of the rows, or ``array.array`` without numpy.

        Without ``dt``, ``data`` is a table as for ``diagnose``, or a path, of which each row that can be read is
        predicted. The state at the start of a run follows from its logged
        torque, if there is one; otherwise the bristles start relaxed. Rows that cannot be used give NaN.

        With ``dt``, ``data`` is the velocity of one run, rad/s or m/s, evenly spaced by ``dt`` seconds, and further columns
        are keywords with the names of the contract: ``predict(velocity, 1e-3, pressure_diff_pa=pressure)``.

        With ``adapt``, gains on the levels, the viscous friction and the terms follow the logged torque, as
        ``host-sim predict --adapt`` does: a row's prediction uses what was learnt from earlier rows. ``adapt_memory`` is in s
        of sliding, ``adapt_range`` the least and the largest gain.

        Raises:
            DataError: If the data cannot be read.
            FrictionError: If the model is not fitted.
        """
        own = self._fitted()
        if not adapt and (adapt_memory is not None or adapt_range is not None):
            raise TypeError("predict: adapt_memory and adapt_range need adapt=True")
        if adapt and dt is not None:
            raise TypeError("predict: adapt needs a log with its torque, not samples")
        if dt is not None:
            return _frames.labelled(own.predict_table(self._samples(data, dt, covariates)), data, own.torque_column)
        if covariates:
            raise TypeError("predict: columns as keywords need dt; otherwise they are columns of the data")
        named = _frames.with_names(data, self.feature_names)
        whole, options, has_torque = self._reading(named, None, may_lack_torque=True)
        if adapt and not has_torque:
            raise TypeError("predict: adapt needs a log with its torque")
        rows = len(whole)
        prepared = log(_core.with_row_numbers(whole), **options, rigid_body=self.rigid_body, motion=self.motion).log
        with shown(progress) as report:
            if adapt:
                found = own.predict_adapted_log(prepared, rows, adapt_memory, adapt_range, self.threads, report)
            else:
                _, found = own.predict_log(prepared, rows, has_torque, self.threads, report)
        return _frames.labelled(found, data, own.torque_column)

    def residuals(self, data: Data, y: Any = None) -> Any:
        """Returns a ``pandas.DataFrame`` with a row for each row that can be read, and the index of a pandas frame.

        Columns are ``run``, ``time_s`` (s), ``torque_nm``, ``predicted_torque_nm`` and ``residual_torque_nm``, measured minus
        predicted, or the same with ``force_n``.

        Args:
            data, y: See ``fit``.

        Raises:
            DataError: If the data cannot be read.
            ImportError: If pandas is missing.
        """
        named = _frames.with_names(data, self.feature_names)
        whole, options, _ = self._reading(named, y)
        labels = data if _frames.is_labelled(data) else None
        models = {"": self._fitted()}
        return _frames.residual_frame(models, whole, options, motion=self.motion, threads=self.threads, labels=labels)

    def score(self, data: Data, y: Any = None) -> float:
        """Returns the coefficient of determination R² of the torque on all usable rows, at most 1.

        Args:
            data, y: See ``fit``.
        """
        whole, options, _ = self._reading(_frames.with_names(data, self.feature_names), y)
        prepared = log(whole, **options, rigid_body=self.rigid_body, motion=self.motion).log
        return self._fitted().score_log(prepared, self.threads)

    def set_params(self, **params: Any) -> Model:
        """Sets arguments of the constructor and returns itself. The model must then be fitted again."""
        super().set_params(**params)
        self._forget()
        return self

    def _forget(self) -> None:
        """Removes the results of a fit."""
        for name in ("_own", "_rows", "feature_names_in_", "n_features_in_"):
            vars(self).pop(name, None)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        # The torque may be a column of the data, and rows without a number are left out.
        tags.target_tags.required = False
        tags.input_tags.allow_nan = True
        tags.input_tags.string = True
        return tags

    def __sklearn_is_fitted__(self) -> bool:
        return self._own is not None

    def __getstate__(self) -> dict[str, Any]:
        """Returns the values for ``pickle`` and ``copy``: the compiled model as its parameter file."""
        state = {name: value for name, value in vars(self).items() if name not in ("_own", "_rows")}
        if self._own is not None:
            state["_fitted"] = (self._own.toml, self._parameter_rows())
        return {**state, "_version": __version__}

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        made_by, fitted = state.pop("_version"), state.pop("_fitted", None)
        # An argument that a later version has is missing in the pickle of an earlier one.
        Model.__init__(self)
        vars(self).update(state)
        lasting = 'load a file of model.save("params.toml") instead'
        if made_by != __version__:
            line = f"model {self.name}: pickled by friction {made_by}, read by {__version__}, may predict another torque: {lasting}"
            warnings.warn(line, UserWarning, stacklevel=2)
        if fitted is not None:
            try:
                self._own = _core.Model.from_toml(fitted[0])
            except ModelError as error:
                line = f"model {self.name}: pickled by friction {made_by}, cannot be read by {__version__}: {error}: {lasting}"
                raise ModelError(line) from error
            self._rows = fitted[1]

    def __repr__(self) -> str:
        return f"<Model {self.name}{'' if self._own else ', not fitted'}>"

    def __str__(self) -> str:
        if self._own is None:
            return repr(self)
        return f"Model {self.name}\n\n{_text.parameter_table(self._parameter_rows())}"

    def _repr_html_(self) -> str:
        return _text.parameter_html(self._parameter_rows()) if self._own else f"<code>Model {escape(self.name)}, not fitted</code>"

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        """Returns the forms for notebooks, in place of scikit-learn's diagram of an estimator."""
        return {"text/plain": repr(self), "text/html": self._repr_html_()}

    def _fitted(self) -> _core.Model:
        if self._own is None:
            raise NotFittedError(f"model {self.name}: not fitted yet, expected fit(data) before")
        return self._own

    def _torque_name(self, whole: _core.Table, options: Mapping[str, Any]) -> str:
        """Returns the torque column's own name in a table."""
        mapped = {ours: _without_unit(theirs) for ours, theirs in (options.get("columns") or {}).items()}
        names = [mapped.get(name, name) for name in _TORQUES]
        if self._own is not None:
            names.insert(0, mapped.get(self._own.torque_column, self._own.torque_column))
        return next((name for name in names if name in whole.column_names), names[0])

    def _reading(self, data: Data, y: Any, *, may_lack_torque: bool = False) -> tuple[Any, dict[str, Any], bool]:
        """Returns the log with the torque ``y``, the options of its reading, and whether it has a torque."""
        options = {name: getattr(self, name) for name in _READING}
        if y is None and not may_lack_torque:
            return data, options, True
        if isinstance(data, (str, os.PathLike)):
            # The table has the names and units of the contract.
            whole, options = _core.read(log(data, **options).log, Path(data).stem), {}
        else:
            whole = table(data, "data")
        name = self._torque_name(whole, options)
        has_torque = y is not None or name in whole.column_names
        if y is not None or not has_torque:
            whole = _core.with_numbers(whole, name, [0.0] * len(whole) if y is None else _floats(y))
            columns = options.get("columns") or {}
            if options.get("torque_constant") is not None and not any(torque in columns for torque in _TORQUES):
                # A torque in Nm needs no torque constant, so y is a current.
                options["columns"] = {**columns, name: f"{name}:A"}
        return whole, options, has_torque

    def _samples(self, velocity: Any, dt: float, covariates: Mapping[str, Any]) -> _core.Table:
        if not dt > 0.0:
            raise ValueError(f"dt: found {dt}, expected a positive number of seconds")
        own = self._fitted()
        values = _floats(velocity)
        torque = own.torque_column
        columns: dict[str, Any] = {
            "time_s": [row * dt for row in range(len(values))],
            "velocity_rad_s" if torque == "torque_nm" else "velocity_m_s": values,
            torque: [0.0] * len(values),
        }
        columns.update({name: _floats(column) for name, column in covariates.items()})
        missing = [name for name in own.needs if name not in columns]
        if missing:
            raise FrictionError(f"predict: the model {self.name} needs the columns {', '.join(missing)}")
        return table(columns, "samples")


def _without_unit(column: str) -> str:
    return column.rsplit(":", 1)[0]


def _floats(values: Any) -> list[float]:
    if getattr(values, "ndim", 1) == 2 and values.shape[1] == 1:
        # A frame or an array of one column.
        values = (values.to_numpy() if hasattr(values, "to_numpy") else values)[:, 0]
    values = values.tolist() if hasattr(values, "tolist") else list(values)
    return [float("nan") if value is None else float(value) for value in values]
