"""Where scripts find the logs of real machines. tests/data/src/lib.rs does the same for the tests of the crates."""

import os
import pathlib

HERE = pathlib.Path(__file__).resolve().parent
EXCERPTS = HERE / "data" / "measured"


def file(name):
    """Returns the path of a log by the name of its full file, such as worm-drive.csv.

    With LONG_TESTS it is the full file if that exists in the folder MEASURED_DATA, by default ../shared/data; else the excerpt.
    """
    full = pathlib.Path(os.environ.get("MEASURED_DATA", HERE.parent.parent / "shared" / "data")) / name
    if os.environ.get("LONG_TESTS") and full.is_file():
        return full
    return (EXCERPTS / name).with_suffix(".parquet")
