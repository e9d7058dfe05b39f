"""Exceptions of the package. Each message is one line."""

from __future__ import annotations

from collections.abc import Sequence


class FrictionError(Exception):
    """A request that cannot be met. Base class of all errors of this package."""


class ModelError(FrictionError, ValueError):
    """An unknown model, term or parameter, or a damaged parameter file."""


class DataError(FrictionError, ValueError):
    """A log that cannot be read, checked or split.

    Attributes:
        file: The path, or the name of the data frame; None if the error concerns no single one.
        row: The row, counted from 1 with the header as row 1, as for a CSV file of the same table; None if the error
            concerns no single row.
        column: The column's name in the file; None if the error concerns no single column.
        found: What was found.
        expected: What was expected.
        joints: The joints of a log with several, of which ``where`` selects one; empty otherwise.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
        found: str | None = None,
        expected: str | None = None,
        joints: Sequence[str] = (),
    ) -> None:
        super().__init__(message)
        self.file = file
        self.row = row
        self.column = column
        self.found = found
        self.expected = expected
        self.joints = tuple(joints)
