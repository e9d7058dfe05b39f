"""Identification of joint friction models from measured logs, and diagnosis of what a model misses.

>>> import friction
>>> log = friction.simulate("underwater-joint", hide=["pressure-coulomb"], seed=5)
>>> found = friction.diagnose(log.data)
>>> found.cause, found.gain
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from . import _core, fleet
from ._core import Table, __version__
from ._data import Data, log as _log
from ._errors import DataError, FrictionError, ModelError
from ._joints import each_joint
from ._export import Export, Parameter
from ._progress import Progress, shown as _shown
from ._results import Candidate, Comparison, Diagnosis, Finding, Fit, Simulation, Size
from ._tuning import Gain, Tuning, tune, undo_tuning

if TYPE_CHECKING:
    from ._model import Model
else:

    def __getattr__(name: str) -> Any:
        """Returns ``Model``, which imports scikit-learn and so is imported at its first use."""
        if name == "Model":
            return importlib.import_module("friction._model").Model
        raise AttributeError(f"module 'friction' has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), "Model"})


__all__ = [
    "Candidate",
    "Comparison",
    "DataError",
    "Diagnosis",
    "Export",
    "Finding",
    "Fit",
    "FrictionError",
    "Gain",
    "Model",
    "ModelError",
    "Parameter",
    "Simulation",
    "Size",
    "Table",
    "Tuning",
    "__version__",
    "compare",
    "diagnose",
    "each_joint",
    "fleet",
    "identify",
    "read_trace",
    "simulate",
    "tune",
    "undo_tuning",
]


def diagnose(
    data: Data,
    *,
    model: str | Model | None = None,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, object] | None = None,
    rigid_body: str | Iterable[str] = (),
    test: Data | None = None,
    hold_out: Mapping[str, object] | None = None,
    tail: float | None = None,
    motion: Literal["smoothed", "logged"] | None = None,
    as_logged: Iterable[str] = (),
    skip: int = 0,
    decimate: int = 1,
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
    threads: int = 0,
    progress: Progress | bool | None = None,
    name: str = "data",
) -> Diagnosis:
    """Finds the physical effects that a friction model misses, and the gain of an extended model.

    Args:
        data: A path or several (CSV, Parquet, MCAP, CAN traces); a data frame of pandas 2.2 or later, polars or pyarrow; a
            dict of equally long arrays or lists; or a list of tables, which are joined as files are. Columns are
            ``time_s`` (s, or points in time), ``velocity_rad_s`` or ``velocity_m_s``, ``torque_nm`` or ``force_n``, ``run``,
            and covariates. Nulls, NaN and empty texts are missing values.
        model: Base law, as ``"lugre"``; by default the simplest of linear, stribeck and lugre that the log supports. A
            fitted ``Model`` is evaluated as it is before its law is extended.
        columns: Names and units of the columns, ``{"torque_nm": "tau_3:mNm"}``.
        where: Columns and the values that select rows, ``{"joint": 2}`` or ``{"run": ["a", "b"]}``.
        rigid_body: Parts that the torque contains besides friction: inertia, gravity, load, offset, delay, gain.
        test: Data to hold out, of the same kind as ``data``. By default each run is held out once.
        hold_out: A column with values that selects the held-out runs.
        tail: Share of each run's end to hold out, between 0 and 1.
        motion: ``"smoothed"`` reconstructs the motion from position and velocity, ``"logged"`` uses the velocity unchanged;
            ``None`` takes the one that the torque follows more closely.
        as_logged: Kinds of log problems to report without correction.
        skip: Samples to drop at the start of each run.
        decimate: Use every N-th sample of the residual, after an anti-aliasing filter.
        rated_torque_nm: Torque of 100 %, Nm, for columns in percent.
        torque_constant: Torque of one ampere, ``"0.105Nm/A"`` or a number in Nm (N), for columns in amperes:
            ``{"torque_nm": "i_q:A"}``.
        torque_from: Control law of a servo that gives the torque of a log without one, ``"pd,kp=40,kd=1.5,target=q_des"``.
        bad_rows: Maximum share of bad rows, which are left out; 0.05 by default.
        rate_hz: Rate of the rows, Hz, of a log without a time column.
        join: Whether to join files or tables that hold one channel each by their times.
        preset: Tool that wrote the log: plotjuggler, moteus, odrive, dynamixel, ethercat or twincat-scope. It supplies names
            and units of columns that ``columns`` does not name.
        skip_lines: Lines of text above the header of each file to skip.
        loss: ``"squares"`` or ``"huber"``; by default huber if the torque has many spikes.
        seed: Seed of all random choices; the same seed gives the same result.
        threads: Number of threads; 0 uses all cores.
        progress: Called with the stage and its share, 0 to 1 or None. None shows a bar in notebooks if tqdm is installed,
            True shows it everywhere, False nowhere. An exception in it ends the computation, as Ctrl-C does.
        name: Name of a data frame in messages and results.

    Raises:
        DataError: If the data cannot be read, checked or split.
        ModelError: If the model is unknown.
        ImportError: If ``progress`` is True and tqdm is missing.
        KeyboardInterrupt: After Ctrl-C; no work goes on.
    """
    request = _log(
        data,
        test=test,
        columns=columns,
        where=where,
        rigid_body=rigid_body,
        skip=skip,
        decimate=decimate,
        motion=motion,
        as_logged=as_logged,
        hold_out=hold_out,
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
        seed=seed,
        name=name,
    )
    law = model if isinstance(model, str) else None
    if not (model is None or law is not None or hasattr(model, "_fitted")):
        raise TypeError(f"model: found {type(model).__name__}, expected a name or a friction.Model")
    given = None if model is None or isinstance(model, str) else model._fitted()
    with _shown(progress) as report:
        own = _core.diagnose(request.log, model=law, given=given, threads=threads, progress=report)
    return Diagnosis(own, threads, request)


def identify(
    data: Data,
    model: str,
    *,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, object] | None = None,
    rigid_body: str | Iterable[str] = (),
    test: Data | None = None,
    hold_out: Mapping[str, object] | None = None,
    tail: float | None = None,
    motion: Literal["smoothed", "logged"] | None = None,
    as_logged: Iterable[str] = (),
    skip: int = 0,
    decimate: int = 1,
    rated_torque_nm: float | None = None,
    torque_constant: str | float | None = None,
    torque_from: str | None = None,
    bad_rows: float | None = None,
    rate_hz: float | None = None,
    join: bool = False,
    preset: str | None = None,
    skip_lines: int = 0,
    loss: Literal["squares", "huber"] | None = None,
    starts: int = 3,
    keep: Iterable[str] = (),
    free: Iterable[str] = (),
    choices: Iterable[str] = (),
    seed: int = 0,
    threads: int = 0,
    progress: Progress | bool | None = None,
    name: str = "data",
) -> Fit:
    """Fits one friction model to the training rows of a log and evaluates it on the held-out rows.

    Args:
        model: Law and terms, ``"lugre+pressure-coulomb"``.
        starts: Number of starting points that are optimised to convergence, at least 1.
        keep: Parameters to keep at their start values.
        free: Parameters to fit that are otherwise constant.
        choices: Options of the law: damping_fades, printed_extended, allow_active.
        data, columns, where, rigid_body, test, hold_out, tail, motion, as_logged, skip, decimate, rated_torque_nm,
            torque_constant, torque_from, bad_rows, rate_hz, join, preset, skip_lines, loss, seed, threads, progress, name: As for
            ``diagnose``. By default whole runs are held out, or time blocks of a single run.

    Raises:
        DataError: If the data cannot be read, checked or split.
        ModelError: If the model or a parameter is unknown.
    """
    request = _log(
        data,
        test=test,
        columns=columns,
        where=where,
        rigid_body=rigid_body,
        skip=skip,
        decimate=decimate,
        motion=motion,
        as_logged=as_logged,
        hold_out=hold_out,
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
        seed=seed,
        name=name,
    )
    with _shown(progress) as report:
        own = _core.fit(
            request.log,
            [model],
            starts=starts,
            keep=list(keep),
            free=list(free),
            choices=list(choices),
            threads=threads,
            progress=report,
        )
    return Fit(own, threads, request)


def compare(
    data: Data,
    models: Sequence[str] | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, object] | None = None,
    rigid_body: str | Iterable[str] = (),
    test: Data | None = None,
    hold_out: Mapping[str, object] | None = None,
    tail: float | None = None,
    motion: Literal["smoothed", "logged"] | None = None,
    as_logged: Iterable[str] = (),
    skip: int = 0,
    decimate: int = 1,
    rated_torque_nm: float | None = None,
    torque_constant: str | float | None = None,
    torque_from: str | None = None,
    bad_rows: float | None = None,
    rate_hz: float | None = None,
    join: bool = False,
    preset: str | None = None,
    skip_lines: int = 0,
    loss: Literal["squares", "huber"] | None = None,
    choices: Iterable[str] = (),
    seed: int = 0,
    threads: int = 0,
    progress: Progress | bool | None = None,
    name: str = "data",
) -> Comparison:
    """Fits several friction models to one log and compares them on held-out rows.

    Args:
        models: Models to compare; all laws by default.
        choices: Options of the laws: damping_fades, printed_extended, allow_active.
        data, columns, where, rigid_body, test, hold_out, tail, motion, as_logged, skip, decimate, rated_torque_nm,
            torque_constant, torque_from, bad_rows, rate_hz, join, preset, skip_lines, loss, seed, threads, progress, name: As for
            ``identify``.

    Raises:
        DataError: If the data cannot be read, checked or split.
        ModelError: If a model is unknown.
    """
    request = _log(
        data,
        test=test,
        columns=columns,
        where=where,
        rigid_body=rigid_body,
        skip=skip,
        decimate=decimate,
        motion=motion,
        as_logged=as_logged,
        hold_out=hold_out,
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
        seed=seed,
        name=name,
    )
    names = _core.laws() if models is None else list(models)
    with _shown(progress) as report:
        own = _core.fit(
            request.log, names, compares=True, choices=list(choices), threads=threads, progress=report
        )
    return Comparison(own, threads, request)


def simulate(
    scenario: str,
    *,
    hide: Iterable[str] = (),
    seed: int = 0,
    runs: int | None = None,
    seconds: float | None = None,
    rate_hz: float | None = None,
    noise_nm: float | None = None,
    unloaded: bool = False,
    steady: bool = False,
    threads: int = 0,
    progress: Progress | bool | None = None,
) -> Simulation:
    """Simulates a machine with its own equations, independent of the models here.

    Args:
        scenario: ``"underwater-joint"``, ``"velocity-tracking"``, ``"low-speed"``, ``"impact"``, ``"damper"`` or
            ``"manipulator"``.
        hide: Effects to hide, ``"CAUSE"`` or ``"CAUSE:SIZE"``; at most two.
        seed: Seed of the machine; the same seed gives the same log.
        runs: Number of runs, 1 to 1000.
        seconds: Duration of a run, s.
        rate_hz: Sample rate, Hz.
        noise_nm: Standard deviation of the torque sensor's noise, Nm.
        unloaded: Simulate without side load and pressure.
        steady: Simulate steady sliding only.
        threads, progress: As for ``diagnose``. A simulation ends after Ctrl-C only when it is complete.

    Raises:
        FrictionError: If the scenario or an effect is unknown, or a number is out of its range.
    """
    with _shown(progress) as report:
        data, truth, csv = _core.simulate(
            scenario,
            hide=list(hide),
            seed=seed,
            runs=runs,
            seconds=seconds,
            rate_hz=rate_hz,
            noise_nm=noise_nm,
            unloaded=unloaded,
            steady=steady,
            threads=threads,
            progress=report,
        )
    parsed: dict[str, Any] = json.loads(truth)
    return Simulation(data, parsed, csv)


def read_trace(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, object] | None = None,
    threads: int = 0,
    progress: Progress | bool | None = None,
) -> Table:
    """Reads a recording into a table: candump, ASC and TRC traces, MCAP, and the other log formats.

    The table has the columns of the contract in SI units: ``run``, ``time_s`` (s), velocity, torque, and the covariates. It
    offers the Arrow PyCapsule interface: ``pyarrow.table(t)``, ``polars.DataFrame(t)``.

    Args:
        path: The recording.
        columns, where, threads, progress: As for ``diagnose``.

    Raises:
        DataError: If the recording cannot be read.
    """
    name = os.path.splitext(os.path.basename(os.fspath(path)))[0]
    with _shown(progress) as report:
        return _core.read(_log(os.fspath(path), columns=columns, where=where).log, name, threads, report)
