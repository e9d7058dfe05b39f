"""Logs of several joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ._data import Data
from ._errors import DataError

_R = TypeVar("_R")


def each_joint(
    function: Callable[..., _R], data: Data, *arguments: Any, where: Mapping[str, object] | None = None, **options: Any
) -> dict[str, _R]:
    """Applies ``diagnose``, ``identify`` or ``compare`` to each joint of a log, as the command line does.

    The joints are the values of a column such as ``joint``, or columns with a number or a name, as ``torque_nm_1``. A log of one
    joint gives one result with an empty name.

    >>> found = friction.each_joint(friction.diagnose, "robot.csv")
    >>> {joint: one.cause for joint, one in found.items()}

    Args:
        function: ``friction.diagnose``, ``friction.identify`` or ``friction.compare``.
        data: The log, as for the function.
        arguments, options: Further arguments of the function.
        where: Columns and the values that select rows.

    Raises:
        DataError: If the log of a joint cannot be read, checked or split; the message names the joint.
    """
    try:
        return {"": function(data, *arguments, where=where, **options)}
    except DataError as error:
        if not error.joints or error.column is None:
            raise
        column, joints = error.column, error.joints
    others = {name: values for name, values in (where or {}).items() if name != column}
    found: dict[str, _R] = {}
    for joint in joints:
        try:
            found[joint] = function(data, *arguments, where={**others, column: joint}, **options)
        except DataError as error:
            error.args = (f"joint {joint}: {error}",)
            raise
    return found
