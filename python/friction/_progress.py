"""Progress of long computations: a callable, or a bar in notebooks."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

#: Called with the stage in words and the share of it that is done, 0 to 1, or None if that is unknown.
Progress: TypeAlias = Callable[[str, float | None], object]


def _is_notebook() -> bool:
    shell = sys.modules.get("IPython")
    if shell is None:
        return False
    current: Any = getattr(shell, "get_ipython", lambda: None)()
    return type(current).__name__ == "ZMQInteractiveShell"


@contextmanager
def shown(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Yields the callable to report to. None shows a bar in notebooks if tqdm is installed; True shows it everywhere.

    Raises:
        ImportError: For True, if tqdm is missing.
    """
    if callable(progress):
        yield progress
        return
    if progress is False or progress is None and not _is_notebook():
        yield None
        return
    try:
        tqdm: Any = importlib.import_module("tqdm.auto").tqdm
    except ImportError as error:
        if progress is True:
            raise ImportError("progress=True: tqdm is missing: pip install tqdm") from error
        yield None
        return
    with tqdm(total=None, bar_format="{desc} {elapsed}", leave=False) as bar:

        def report(stage: str, share: float | None) -> None:
            bar.set_description_str(stage if share is None else f"{stage} {100 * share:.0f} %")

        yield report
