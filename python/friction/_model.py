"""Friction models: their parameters, their torque, and their use as estimators."""

from __future__ import annotations

import importlib
import os
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from . import _core
from ._data import Data, log, table
from ._errors import FrictionError
from ._progress import Progress, shown

#: Forms of an export: the driver's flash record, Rust constants, a C header, the network's record, ONNX graphs, MuJoCo and URDF
#: elements.
Form = Literal["record", "rust", "c", "network", "onnx", "mujoco", "urdf"]

_TORQUES = ("torque_nm", "force_n")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model.

    Attributes:
        value: Its value, in ``unit``.
        unit: Its unit; ``1`` for a plain number.
        std_error: Its standard error, in ``unit``; None if it was not fitted.
        state: ``determined``, ``not-determined``, ``at-start`` or ``at-bound``; None for a model from a file.
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


class Model:
    """A friction model: a law with terms, and its values once it is fitted or loaded.

    It has the habits of a scikit-learn estimator: ``fit``, ``predict``, ``score``, ``get_params``, ``set_params``. Runs must
    stay whole, so cross-validation needs groups, for example ``GroupKFold`` over the column ``run``.

    Args:
        name: Law and terms, as ``"lugre"`` or ``"lugre+pressure-coulomb"``.
        columns, rigid_body, motion: As for ``diagnose``.
        starts: Number of starting points that are optimised to convergence, at least 1.
        threads: Number of threads; 0 uses all cores.

    Raises:
        ModelError: In ``fit``, if the model is unknown.
    """

    #: For scikit-learn before 1.6.
    _estimator_type = "regressor"

    def __init__(
        self,
        name: str = "lugre",
        *,
        columns: Mapping[str, str] | None = None,
        rigid_body: str | Sequence[str] = (),
        motion: Literal["smoothed", "logged"] | None = None,
        starts: int = 3,
        threads: int = 0,
    ) -> None:
        self.name = name
        self.columns = columns
        self.rigid_body = rigid_body
        self.motion: Literal["smoothed", "logged"] | None = motion
        self.starts = starts
        self.threads = threads
        self._own: _core.Model | None = None

    @classmethod
    def _of(cls, own: _core.Model, columns: Mapping[str, str] | None = None) -> Model:
        model = cls(own.name, columns=columns)
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
        rows = self._fitted().parameters
        return {name: Parameter(value, unit, error, state) for name, value, unit, error, state in rows}

    def export(self, to: Form) -> Export:
        """Returns the model in another form: the bytes of a file, with ``notes`` on what it omits and how it is used.

        Args:
            to: ``"record"``, ``"rust"``, ``"c"``, ``"network"``, ``"onnx"``, ``"mujoco"`` or ``"urdf"``.

        Raises:
            FrictionError: If the form does not support a term of the model, or the model has no network for ``"network"``.
        """
        return Export._of(*self._fitted().export(to))

    def fit(self, data: Data, y: Any = None, *, progress: Progress | bool | None = None) -> Model:
        """Fits the model to all rows of a log and returns itself.

        Args:
            data: See ``diagnose``. It must be a single table or path.
            y: Torque of each row, Nm or N; None if ``data`` contains it.
            progress: See ``diagnose``.

        Raises:
            DataError: If the log cannot be read.
            ModelError: If the model is unknown.
        """
        prepared, _ = self._log(data, y)
        with shown(progress) as report:
            fits = _core.fit(
                prepared,
                [self.name],
                uses_all_rows=True,
                starts=self.starts,
                threads=self.threads,
                progress=report,
            )
        self._own = fits.models[0]
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
        """Returns the torque of each row, Nm or N, as a numpy array if numpy is installed, else as ``array.array``.

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
            return _numbers(own.predict_table(self._samples(data, dt, covariates)))
        if covariates:
            raise TypeError("predict: columns as keywords need dt; otherwise they are columns of the data")
        prepared, numbered = self._log(data, None, may_lack_torque=True, numbers_rows=True)
        rows, has_torque = numbered
        if adapt and not has_torque:
            raise TypeError("predict: adapt needs a log with its torque")
        with shown(progress) as report:
            if adapt:
                found = own.predict_adapted_log(prepared, rows, adapt_memory, adapt_range, self.threads, report)
                return _numbers(found)
            return _numbers(own.predict_log(prepared, rows, has_torque, self.threads, report))

    def score(self, data: Data, y: Any = None) -> float:
        """Returns the coefficient of determination R² of the torque on all usable rows, at most 1.

        Args:
            data: See ``fit``.
            y: Torque of each row, Nm or N; None if ``data`` contains it.
        """
        prepared, _ = self._log(data, y)
        return self._fitted().score_log(prepared, self.threads)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Returns the arguments of the constructor, as scikit-learn asks."""
        del deep
        names = ("name", "columns", "rigid_body", "motion", "starts", "threads")
        return {name: getattr(self, name) for name in names}

    def set_params(self, **params: Any) -> Model:
        """Sets arguments of the constructor and returns itself. The model must then be fitted again."""
        for name, value in params.items():
            if name not in self.get_params():
                raise ValueError(f"unknown parameter {name}")
            setattr(self, name, value)
        self._own = None
        return self

    def __sklearn_tags__(self) -> Any:
        # Asked by scikit-learn alone, so it is installed.
        utils = importlib.import_module("sklearn.utils")
        return utils.Tags(
            estimator_type="regressor",
            target_tags=utils.TargetTags(required=False),
            transformer_tags=None,
            classifier_tags=None,
            regressor_tags=utils.RegressorTags(),
        )

    def __sklearn_is_fitted__(self) -> bool:
        return self._own is not None

    def __repr__(self) -> str:
        return f"<Model {self.name}{'' if self._own else ', not fitted'}>"

    def _fitted(self) -> _core.Model:
        if self._own is None:
            raise FrictionError(f"model {self.name}: not fitted yet, expected fit(data) before")
        return self._own

    def _torque_name(self, whole: _core.Table) -> str:
        """Returns the torque column's own name in a table."""
        mapped = {ours: _without_unit(theirs) for ours, theirs in (self.columns or {}).items()}
        names = [mapped.get(name, name) for name in _TORQUES]
        if self._own is not None:
            names.insert(0, mapped.get(self._own.torque_column, self._own.torque_column))
        return next((name for name in names if name in whole.column_names), names[0])

    def _log(
        self, data: Data, y: Any, *, may_lack_torque: bool = False, numbers_rows: bool = False
    ) -> tuple[_core.Log, tuple[int, bool]]:
        """Returns the log, its number of rows, and whether it has a torque."""
        rows, has_torque, columns = 0, True, self.columns
        if y is not None or may_lack_torque:
            if isinstance(data, (str, os.PathLike)):
                # The table has the names and units of the contract.
                whole, columns = _core.read(log(data, columns=columns), Path(data).stem), None
            else:
                whole = table(data, "data")
            name = self._torque_name(whole) if columns else next(
                (known for known in _TORQUES if known in whole.column_names), self._torque_name(whole)
            )
            rows, has_torque = len(whole), y is not None or name in whole.column_names
            if y is not None or not has_torque:
                whole = _core.with_numbers(whole, name, [0.0] * rows if y is None else _floats(y))
            data = _core.with_row_numbers(whole) if numbers_rows else whole
        prepared = log(data, columns=columns, rigid_body=self.rigid_body, motion=self.motion)
        return prepared, (rows, has_torque)

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
    values = values.tolist() if hasattr(values, "tolist") else list(values)
    return [float("nan") if value is None else float(value) for value in values]


def _numbers(values: list[float]) -> Any:
    try:
        import numpy
    except ImportError:
        return array("d", values)
    return numpy.asarray(values)
