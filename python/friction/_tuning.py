"""Tuning of a joint on a bus, and its result."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from . import _core
from ._data import log
from ._errors import DataError, FrictionError
from ._frames import pandas
from ._progress import Progress, shown as _shown
from ._results import Diagnosis, _Result

#: A CSV file with ``time_s`` and ``position_rad``, or both as sequences of equal length.
Motion: TypeAlias = str | os.PathLike[str] | tuple[Sequence[float], Sequence[float]]


@dataclass(frozen=True)
class Gain:
    """Change of one quantity of the tried motion. A value that was not measured is NaN.

    Attributes:
        quantity: ``reversal-error``, ``tracking-rms``, ``current-rms`` or ``stuck-time``; smaller is better.
        unit: Unit of ``before`` and ``after``: rad, A or s.
        before: Geometric mean with the former parameters.
        after: Geometric mean with the new parameters.
        gain: ``1 - after / before``; below 0 if it is worse.
        ci95: 95 % confidence interval of the gain.
    """

    quantity: str
    unit: str
    before: float
    after: float
    gain: float
    ci95: tuple[float, float]


class Tuning(_Result):
    """What a tuning session did with a joint, what it gained, and what it did not learn."""

    def __init__(self, own: _core.Tuning) -> None:
        super().__init__(own, 0)
        self._own = own

    @property
    def saved(self) -> bool:
        """True if a gain was proven and the new parameters are saved in the joint."""
        return bool(self._document["saved"])

    @property
    def why_not(self) -> str | None:
        """Why the former parameters are active; None if the new ones are saved."""
        why: str | None = self._document.get("why_not")
        return why

    @property
    def gains(self) -> tuple[Gain, ...]:
        """The gains of the trial; empty if nothing was tried. ``pandas.DataFrame(tuning.gains)`` is a table of them."""
        return tuple(
            Gain(
                quantity=gain["quantity"],
                unit=gain["unit"],
                before=_number(gain["before"]),
                after=_number(gain["after"]),
                gain=_number(gain["gain"]),
                ci95=(_number(gain["ci95"][0]), _number(gain["ci95"][1])),
            )
            for gain in self._document["gains"]
        )

    @property
    def cause(self) -> str:
        """Name of the strongest cause, or ``none``."""
        return str(self._document["cause"])

    @property
    def probability(self) -> float:
        """Probability of the cause, 0 to 1."""
        return float(self._document["probability"])

    @property
    def not_learnt(self) -> tuple[str, ...]:
        """What this joint and this session could not show, one sentence each."""
        return tuple(self._document["not_learnt"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings, one sentence each."""
        return tuple(self._document["warnings"])

    @cached_property
    def diagnosis(self) -> Diagnosis | None:
        """The diagnosis of the recorded runs, as ``diagnose`` returns it; None if nothing was learnt."""
        found = self._own.diagnosis
        return None if found is None else Diagnosis(found, 0, log(self.runs(), name="runs"))

    def to_pandas(self) -> Any:
        """Returns the gains of the trial as a ``pandas.DataFrame``: unit, before, after, gain and its interval by quantity.

        Raises:
            ImportError: If pandas is missing.
        """
        names = [field.name for field in fields(Gain)]
        return pandas("to_pandas").DataFrame([vars(gain) for gain in self.gains], columns=names).set_index("quantity")

    def runs(self) -> _core.Table:
        """Returns the recorded rows at 1 kHz, a row per report of the joint: the content of ``runs.parquet``.

        Columns are ``run``, ``time_s`` (s), ``velocity_rad_s``, ``torque_nm``, ``position_rad``, ``demand_rad``, ``current_a``
        (A), and ``pressure_diff_pa``, ``temperature_c`` and ``radial_force_n`` where they are measured. The table has
        ``__arrow_c_stream__``: ``pandas.DataFrame.from_arrow(table)``, ``polars.DataFrame(table)``.
        """
        return self._own.runs()

    def write(self, folder: str | os.PathLike[str]) -> Path:
        """Writes the files of the command line into a folder, as ``save`` does, and returns it."""
        return self.save(folder)

    def _repr_html_(self) -> str:
        return self._own.first_screen()

    def __repr__(self) -> str:
        outcome = "saved" if self.saved else f"not saved: {self.why_not}"
        return f"<Tuning {outcome}; cause {self.cause}, probability {self.probability:.2f}>"


def tune(
    bus: str,
    *,
    range_rad: float = 0.4,
    speed_rad_s: float = 1.5,
    minutes: float = 5.0,
    motion: Motion | None = None,
    allow_active: bool = False,
    confirm: bool | Callable[[str], bool] | None = None,
    key: str | os.PathLike[str] | None = None,
    node: int = 1,
    hide: Iterable[str] = (),
    seed: int | None = None,
    bit_rate: int = 1_000_000,
    progress: Progress | bool | None = None,
) -> Tuning:
    """Tunes a joint: measures, diagnoses, tries new parameters against the former ones, and saves them on a proven gain.

    **The joint moves.** Without a proven gain, after Ctrl-C and after a fault, its former parameters are active.

    Args:
        bus: ``"loop"`` for a simulated joint in virtual time, a SocketCAN interface as ``"can0"``, ``"slcan:/dev/ttyACM0"`` or
            ``"slcan:HOST:PORT"``.
        range_rad: Largest distance from the present position to either side, rad, above 0.
        speed_rad_s: Largest speed, rad/s, above 0.
        minutes: Time on the bus, minutes, 1 to 60.
        motion: Motion of the trial: a CSV file with ``time_s`` and ``position_rad``, or a pair of these columns (s, rad; one
            dimension, equal length). By default sines and a slow triangle through reversals.
        allow_active: Also tries laws that can supply energy, and so keep a joint moving.
        confirm: Whether the joint may move: True, or a function that is called with the question and returns a bool. A
            simulated joint needs none.
        key: File with the key of the joint, 32 hexadecimal digits; by default the file that the environment variable
            FRICTION_JOINT_KEY names, or the public default key.
        node: Node number of the joint, 1 to 127.
        hide: Effects to hide in the simulated joint, ``"CAUSE"`` or ``"CAUSE:SIZE"``.
        seed: Seed of the simulated joint and of all random choices; 1 by default.
        bit_rate: Bit rate of an slcan adapter, bit/s.
        progress: Called with each line of progress and None. None shows the line in notebooks if tqdm is installed, True shows
            it everywhere, False nowhere. An exception in it ends the session, as Ctrl-C does.

    Raises:
        FrictionError: If the joint is refused or ``confirm`` is missing or declines; then nothing was changed.
        DataError: If the motion cannot be read.
        KeyboardInterrupt: After Ctrl-C, when the joint has stopped and its former parameters are active.
    """
    joint = _joint(bus, node=node, key=key, hide=hide, seed=seed, bit_rate=bit_rate)
    answer = confirm if confirm is None or callable(confirm) else lambda _question: bool(confirm)
    with _shown(progress) as report:
        own = _core.tune(
            joint,
            range_rad=range_rad,
            speed_rad_s=speed_rad_s,
            minutes=minutes,
            motion=None if motion is None else _motion(motion),
            allow_active=allow_active,
            confirm=answer,
            progress=report,
        )
    return Tuning(own)


def undo_tuning(
    bus: str,
    *,
    key: str | os.PathLike[str] | None = None,
    node: int = 1,
    bit_rate: int = 1_000_000,
) -> str:
    """Makes the parameters from before the last tuning active, and saves them. The joint does not move.

    Args:
        bus, key, node, bit_rate: As for ``tune``.

    Returns:
        The CRC of the parameters that are active now, eight hexadecimal digits.

    Raises:
        FrictionError: If the joint was not tuned, is armed, or does not answer.
    """
    return _core.undo_tuning(_joint(bus, node=node, key=key, bit_rate=bit_rate))


def _joint(
    bus: str,
    *,
    node: int,
    key: str | os.PathLike[str] | None,
    hide: Iterable[str] = (),
    seed: int | None = None,
    bit_rate: int,
) -> _core.Joint:
    if not hasattr(_core, "Joint"):
        raise FrictionError("tune: this build of the package has no feature tune")
    own_key = None if key is None else os.fspath(key)
    return _core.Joint(bus, node=node, key=own_key, hide=list(hide), seed=seed, bit_rate=bit_rate)


def _motion(motion: Motion) -> tuple[str, str]:
    """Returns name and text of a motion as a CSV file."""
    if isinstance(motion, (str, os.PathLike)):
        name = os.fspath(motion)
        try:
            return name, Path(name).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise DataError(f"{name}: {getattr(error, 'strerror', None) or error}", file=name) from error
    times, positions = ([float(value) for value in column] for column in motion)
    if len(times) != len(positions):
        raise DataError(f"motion: found {len(times)} times and {len(positions)} positions, expected equal numbers", file="motion")
    rows = "".join(f"{time!r},{position!r}\n" for time, position in zip(times, positions))
    return "motion", "time_s,position_rad\n" + rows


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
