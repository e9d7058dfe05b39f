"""Diagnoses of many joints over many campaigns, on one machine or a cluster.

>>> import friction
>>> fleet = friction.fleet.diagnose("logs", out="out/fleet")
>>> fleet.rows[0]["cause"], fleet.failed

One task is the log of one joint and campaign: its *files*, each read with its own header. Frames that a cluster groups by joint
are no tasks. Their engines give every group the columns of all files, or those of the first, and a joint then gets a wrong answer
without an error. ``diagnose_group`` for grouped frames states the columns that it needs instead.

A task writes a folder of its own, which appears only when it is complete. A second call computes only what is missing or has
changed. Logs and results may be in an object store: ``diagnose("s3://bucket/logs", out="s3://bucket/out")``.
"""

from __future__ import annotations

import importlib
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from . import _core, _store
from ._data import log as _log
from ._errors import FrictionError

#: A row of the fleet; ``row.json`` and ``fleet.parquet`` have the same values.
Row: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """The log of one joint and campaign.

    Attributes:
        joint: Name of the joint.
        campaign: Name of the campaign; empty if there is only one.
        files: Paths, or addresses that fsspec can open (``s3://bucket/a.csv``).
    """

    joint: str
    campaign: str
    files: tuple[str, ...]


@dataclass(frozen=True)
class Fleet:
    """Result of a fleet.

    Attributes:
        rows: One row for each joint and campaign, also if its diagnosis failed (``error``).
        out: Folder of the results; a str if it is an address.
    """

    rows: tuple[Row, ...]
    out: Path | str

    @property
    def failed(self) -> tuple[Row, ...]:
        """The rows without a result."""
        return tuple(row for row in self.rows if row["error"] is not None)


class Engine(Protocol):
    """What runs the tasks of a fleet. Every task is a call of a function that can be pickled."""

    def run(self, function: Callable[[Task], list[Row]], tasks: Sequence[Task], retries: int) -> Iterator[tuple[Task, Any]]:
        """Yields each task with its rows, or with the exception of its last attempt, in any order."""
        ...

    def close(self) -> None:
        """Releases what the engine started itself."""
        ...


def diagnose(
    data: str | os.PathLike[str] | Iterable[Task],
    *,
    out: str | os.PathLike[str],
    engine: str | Engine | Any = "local",
    workers: int | None = None,
    retries: int = 2,
    model: str | None = None,
    fixed_model: str = "lugre",
    limits: Mapping[str, float] | None = None,
    storage_options: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], object] | None = None,
    **log: Any,
) -> Fleet:
    """Diagnoses the logs of a fleet, one task for each joint and campaign.

    Args:
        data: A folder (``joint=.../campaign=.../*.csv``, ``JOINT/CAMPAIGN/*.csv``, ``JOINT/CAMPAIGN.csv`` or ``JOINT.csv``), its
            address for fsspec (``s3://bucket/logs``), or the tasks.
        out: Folder of the results, or its address: ``fleet.parquet``, ``fleet.html``, and a folder for each joint and campaign.
        engine: ``"local"``: processes of this machine. Or a ``dask.distributed.Client``, or an object with the methods of
            ``Engine`` for another cluster. On a cluster, ``out`` is an address, or a folder that all machines share.
        workers: Number of local processes; by default one for each core.
        retries: Further attempts for a task whose process was killed. A bad log is not tried again.
        model: Base model of the diagnoses; by default selected for each log.
        fixed_model: Model of the levels whose trends are tested, the same for all.
        limits: Levels at which a joint needs service, ``{"coulomb_torque": 3.0}``, Nm or N.
        storage_options: Options of fsspec's file system for addresses, ``{"endpoint_url": "https://store.example"}``. They are
            sent to the processes of the engine, so keep secrets in the environment.
        progress: Called with the number of finished tasks and of all tasks.
        log: How the logs are read, as for ``friction.diagnose``: columns, where, rigid_body, motion, as_logged, skip, decimate,
            rated_torque_nm, torque_constant, torque_from, bad_rows, rate_hz, join, preset, skip_lines, loss, seed.

    Raises:
        FrictionError: If there is no log, or a model or limit is unknown. Failures of single tasks are rows.
    """
    place: Path | str = os.fspath(out) if _store.is_address(out) else Path(out)
    if isinstance(place, Path):
        place.mkdir(parents=True, exist_ok=True)
    options = dict(storage_options or {})
    tasks = list(_tasks(data, str(place), options))
    _log([], **log)  # A wrong option fails here, not in every task.
    work = _Work(str(place), model, fixed_model, tuple(sorted(log.items())), tuple(options.items()))
    runner = _engine(engine, workers)
    rows: dict[Task, list[Row]] = {}
    try:
        for task, found in runner.run(work, tasks, retries):
            rows[task] = found if isinstance(found, list) else [_failure(task, found)]
            if progress is not None:
                progress(len(rows), len(tasks))
    finally:
        runner.close()
    ordered = [row for task in tasks for row in rows.get(task, [])]
    with _store.results(str(place), options) as results:
        folder = results.folder if results else str(place)
        trends = os.fspath(data) if isinstance(data, (str, os.PathLike)) else None
        _core.fleet_write(folder, json.dumps(ordered), list((limits or {}).items()), trends)
    return Fleet(tuple(ordered), place)


def diagnose_group(
    *, joint: str = "joint", required: Iterable[str], **options: Any
) -> Callable[[Any], Any]:
    """Returns a function for the groups of a frame by joint, which gives one row for each group.

    A frame of many joints has nulls in the columns that a joint's file lacks. The function therefore refuses a group in which one of the
    columns ``required`` has no value, instead of diagnosing the joint with the columns of others. Prefer ``diagnose``, where
    each file keeps its own columns.

    Args:
        joint: Column with the name of the joint.
        required: Columns that every joint must have.
        options: As for ``friction.diagnose``.
    """
    needed = tuple(required)

    def function(frame: Any) -> Any:
        from . import diagnose as diagnose_one

        pandas: Any = importlib.import_module("pandas")
        name = str(frame[joint].iloc[0])
        row: dict[str, Any] = {"joint": name, "cause": None, "probability": None, "gain": None, "error": None}
        empty = [column for column in needed if column not in frame or not frame[column].notna().any()]
        if empty:
            row["error"] = f"joint {name}: found no value in {', '.join(empty)}, expected a log with these columns"
            return pandas.DataFrame([row])
        try:
            found = diagnose_one(frame.drop(columns=[joint]).dropna(axis=1, how="all"), name=name, threads=1, **options)
        except FrictionError as error:
            row["error"] = str(error)
        else:
            first = found.to_dict()["findings"][:1]
            probability = first[0]["probability"] if first else None
            row |= {"cause": found.cause, "gain": found.gain, "probability": probability}
        return pandas.DataFrame([row])

    return function


@dataclass(frozen=True)
class _Work:
    """A task as a function that can be sent to another process."""

    out: str
    model: str | None
    fixed_model: str
    log: tuple[tuple[str, Any], ...]
    storage_options: tuple[tuple[str, Any], ...] = ()

    def __call__(self, task: Task) -> list[Row]:
        options = dict(self.storage_options)
        with _store.local_copies(task.files, options) as files, _store.results(self.out, options) as results:
            rows: list[Row] = json.loads(
                _core.fleet_task(
                    _log([], **dict(self.log)).log,
                    task.joint,
                    task.campaign,
                    files,
                    results.folder if results else self.out,
                    model=self.model,
                    fixed_model=self.fixed_model,
                    threads=1,
                    addresses=task.files if list(task.files) != files else (),
                    earlier=results.earlier_row if results else None,
                )
            )
        return rows


def _tasks(data: str | os.PathLike[str] | Iterable[Task], out: str, options: Mapping[str, Any]) -> Iterator[Task]:
    if not isinstance(data, (str, os.PathLike)):
        yield from data
    elif _store.is_address(data):
        for joint, campaign, addresses in _store.find_logs(os.fspath(data), out, options):
            yield Task(joint, campaign, addresses)
    else:
        for joint, campaign, files in _core.fleet_jobs(os.fspath(data), out):
            yield Task(joint, campaign, tuple(os.fspath(file) for file in files))


def _failure(task: Task, reason: object) -> Row:
    """A row without a result, with the keys of the others."""
    levels: list[None] = [None, None, None]
    row: Row = dict.fromkeys(
        ("probability", "size", "size_ci95", "gain", "gain_ci95", "test_rmse", "noise_floor", "rows", "seconds")
    )
    texts = dict.fromkeys(("model", "cause", "leading_fault", "size_unit", "unit", "fixed_model", "report"), "")
    line = " ".join(str(reason).split()) or type(reason).__name__
    return row | texts | {
        "joint": task.joint,
        "campaign": task.campaign,
        "files": list(task.files),
        "columns": [],
        "levels": levels,
        "error": line,
    }


def _engine(engine: Any, workers: int | None) -> Engine:
    if engine == "local":
        return _Local(workers)
    if isinstance(engine, str):
        raise FrictionError(f"engine={engine!r}: expected 'local' or an engine")
    if all(hasattr(engine, method) for method in ("submit", "scheduler_info", "gather")):
        return _Dask(engine)
    if hasattr(engine, "run") and hasattr(engine, "close"):
        found: Engine = engine
        return found
    raise FrictionError(f"engine: found {type(engine).__name__}, expected 'local' or an engine")


#: Time between two looks at the processes of a pool, and time in which they end after their last task, s.
_LOOK_S = 2.0
_END_S = 10.0


class _Local:
    """Spawned processes. A killed one breaks its pool: the tasks that had not ended run again in a new pool.

    A process that is killed while it reads the queue of its pool leaves it locked, and the others wait for ever. The pool does not
    see this while it starts or ends processes. So they are looked at here, too.
    """

    def __init__(self, workers: int | None) -> None:
        self._workers = workers or os.cpu_count() or 1
        self._pool: ProcessPoolExecutor | None = None

    def run(self, function: Callable[[Task], list[Row]], tasks: Sequence[Task], retries: int) -> Iterator[tuple[Task, Any]]:
        waiting = list(tasks)
        attempts = dict.fromkeys(waiting, 0)
        while waiting:
            # The task that kills its process is unknown if several run. After a break, each runs alone.
            at_once = self._workers if not any(attempts.values()) else 1
            context = get_context("spawn")
            self._pool = ProcessPoolExecutor(max_workers=at_once, mp_context=context)
            running: dict[Future[list[Row]], Task] = {}
            queue = iter(waiting)
            ended: set[Task] = set()
            is_broken = False
            while not is_broken:
                for task in queue:
                    try:
                        running[self._pool.submit(function, task)] = task
                    except BrokenProcessPool:
                        is_broken = True
                        break
                    if len(running) >= at_once:
                        break
                if not running:
                    break
                done, _ = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
                if not done and any(process.exitcode is not None for process in self._processes()):
                    # The pool sees the end of the others, and its futures end.
                    self._kill()
                for future in done:
                    task = running.pop(future)
                    failure = future.exception()
                    if isinstance(failure, BrokenProcessPool):
                        is_broken = True
                        attempts[task] += 1
                        if attempts[task] > retries:
                            ended.add(task)
                            yield task, FrictionError(f"the process was killed {attempts[task]} times")
                    else:
                        ended.add(task)
                        yield task, failure if failure is not None else future.result()
            self.close()
            waiting = [task for task in waiting if task not in ended]

    def _processes(self) -> list[Any]:
        return list((self._pool and self._pool._processes or {}).values())

    def _kill(self) -> None:
        for process in self._processes():
            process.kill()

    def close(self) -> None:
        if self._pool is None:
            return
        processes = self._processes()
        self._pool.shutdown(wait=False, cancel_futures=True)
        end = time.monotonic() + _END_S
        for process in processes:
            process.join(max(0.0, end - time.monotonic()))
            process.kill()
            process.join(1.0)
        self._pool = None


class _Dask:
    """A cluster of Dask, which moves the tasks of a killed worker to others."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def run(self, function: Callable[[Task], list[Row]], tasks: Sequence[Task], retries: int) -> Iterator[tuple[Task, Any]]:
        as_completed: Any = importlib.import_module("distributed").as_completed
        futures = {self._client.submit(function, task, retries=retries, pure=False): task for task in tasks}
        for future in as_completed(futures):
            failure = future.exception()
            yield futures[future], future.result() if failure is None else failure

    def close(self) -> None:
        """The cluster belongs to the caller."""
