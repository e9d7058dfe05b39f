from collections.abc import Callable, Sequence
from typing import Any, final

from ._progress import Progress

__all__ = [
    "Diagnosis",
    "Fits",
    "Joint",
    "Log",
    "Model",
    "Table",
    "Tuning",
    "__version__",
    "diagnose",
    "fit",
    "fleet_jobs",
    "fleet_jobs_of",
    "fleet_task",
    "fleet_write",
    "laws",
    "read",
    "simulate",
    "tune",
    "undo_tuning",
    "with_numbers",
    "with_row_numbers",
]

__version__: str

@final
class Table:
    @staticmethod
    def from_arrow(data: Any, name: str) -> Table: ...
    @staticmethod
    def from_columns(columns: Sequence[tuple[str, str, Any]], name: str) -> Table: ...
    @property
    def name(self) -> str: ...
    @property
    def column_names(self) -> list[str]: ...
    def to_dict(self) -> dict[str, list[Any]]: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def __len__(self) -> int: ...

@final
class Log:
    def __new__(
        cls,
        sources: Sequence[str | Table],
        *,
        test: Sequence[str | Table] = ...,
        columns: Sequence[tuple[str, str]] = ...,
        only: Sequence[tuple[str, Sequence[str]]] = ...,
        skip: int = 0,
        decimate: int = 1,
        rigid_body: str = "",
        motion: str | None = None,
        as_logged: Sequence[str] = ...,
        seed: int = 0,
        hold_out: tuple[str, Sequence[str]] | None = None,
        tail: float | None = None,
        rated_torque_nm: float | None = None,
        torque_constant: str | None = None,
        torque_from: str | None = None,
        bad_rows: float | None = None,
        rate_hz: float | None = None,
        join: bool = False,
        preset: str | None = None,
        skip_lines: int = 0,
        loss: str | None = None,
    ) -> Log: ...

@final
class Diagnosis:
    def json(self) -> str: ...
    def html(self, threads: int = 0) -> str: ...
    def first_screen(self) -> str: ...
    def write(self, folder: str, threads: int = 0) -> None: ...
    @property
    def model(self) -> Model: ...
    @property
    def extended(self) -> Model: ...
    @property
    def baseline(self) -> Model: ...

@final
class Fits:
    def json(self) -> str: ...
    def html(self, threads: int = 0) -> str: ...
    def write(self, folder: str, threads: int = 0) -> None: ...
    @property
    def models(self) -> list[Model]: ...
    @property
    def chosen(self) -> int: ...
    @property
    def summary(self) -> list[str]: ...

@final
class Model:
    @staticmethod
    def from_toml(text: str) -> Model: ...
    @property
    def name(self) -> str: ...
    @property
    def toml(self) -> str: ...
    @property
    def torque_column(self) -> str: ...
    @property
    def parameters(self) -> list[tuple[str, float, str, float | None, str | None]]: ...
    @property
    def needs(self) -> list[str]: ...
    def export(
        self, to: str, gravity: bool = False, compensator: dict[str, float] | None = None
    ) -> tuple[list[tuple[str, bytes]], list[str]]: ...
    def predict_log(
        self, log: Log, rows: int, has_torque: bool, threads: int = 0, progress: Progress | None = None
    ) -> tuple[list[float], list[float]]: ...
    def predict_adapted_log(
        self,
        log: Log,
        rows: int,
        memory: float | None = None,
        range: tuple[float, float] | None = None,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> list[float]: ...
    def score_log(self, log: Log, threads: int = 0, progress: Progress | None = None) -> float: ...
    def predict_table(self, table: Table) -> list[float]: ...

@final
class Joint:
    def __new__(
        cls,
        bus: str,
        *,
        node: int,
        key: str | None = None,
        hide: Sequence[str] = ...,
        seed: int | None = None,
        bit_rate: int,
    ) -> Joint: ...

@final
class Tuning:
    def json(self) -> str: ...
    def html(self, threads: int = 0) -> str: ...
    def first_screen(self) -> str: ...
    def write(self, folder: str, threads: int = 0) -> None: ...
    def runs(self) -> Table: ...
    @property
    def diagnosis(self) -> Diagnosis | None: ...

def diagnose(
    log: Log,
    *,
    model: str | None = None,
    given: Model | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> Diagnosis: ...
def fit(
    log: Log,
    models: Sequence[str],
    *,
    compares: bool = False,
    uses_all_rows: bool = False,
    starts: int = 3,
    keep: Sequence[str] = ...,
    free: Sequence[str] = ...,
    choices: Sequence[str] = ...,
    threads: int = 0,
    progress: Progress | None = None,
) -> Fits: ...
def fleet_jobs(root: str, out: str) -> list[tuple[str, str, list[str]]]: ...
def fleet_jobs_of(root: str, files: Sequence[str]) -> list[tuple[str, str, list[str]]]: ...
def fleet_task(
    log: Log,
    joint: str,
    campaign: str,
    files: Sequence[str],
    out: str,
    *,
    model: str | None = None,
    fixed_model: str = "lugre",
    threads: int = 1,
    addresses: Sequence[str] = ...,
    earlier: Callable[[str], bytes | None] | None = None,
    progress: Progress | None = None,
) -> str: ...
def fleet_write(out: str, rows: str, limits: Sequence[tuple[str, float]], data: str | None = None) -> None: ...
def laws() -> list[str]: ...
def read(log: Log, name: str, threads: int = 0, progress: Progress | None = None) -> Table: ...
def simulate(
    scenario: str,
    *,
    hide: Sequence[str] = ...,
    seed: int = 0,
    runs: int | None = None,
    seconds: float | None = None,
    rate_hz: float | None = None,
    noise_nm: float | None = None,
    unloaded: bool = False,
    steady: bool = False,
    threads: int = 0,
    progress: Progress | None = None,
) -> tuple[Table, str, str]: ...
def tune(
    joint: Joint,
    *,
    range_rad: float,
    speed_rad_s: float,
    minutes: float,
    motion: tuple[str, str] | None = None,
    allow_active: bool = False,
    confirm: Callable[[str], bool] | None = None,
    progress: Progress | None = None,
) -> Tuning: ...
def undo_tuning(joint: Joint) -> str: ...
def with_row_numbers(table: Table) -> Table: ...
def with_numbers(table: Table, name: str, values: Sequence[float]) -> Table: ...
