#!/usr/bin/env python3
"""Makes the excerpts of the measured logs, measured/*.parquet, from the full files.

    tests/data/make.py FOLDER [NAME...]     FOLDER holds the full files, such as worm-drive.csv

Needs pyarrow in the version of requirements.txt:

    python3 -m venv target/data-venv
    target/data-venv/bin/pip install -r tests/data/requirements.txt
    target/data-venv/bin/python tests/data/make.py ../shared/data

NOTICE states the source and the licence of each file, and what was changed. The decimation keeps every n-th row of each run
without a filter, as a slower logger does. Every effect for which a file is known must remain visible: the tests that read the
excerpts diagnose them.
"""

import csv
import pathlib
import sys

import pyarrow as pa
import pyarrow.parquet as pq

HERE = pathlib.Path(__file__).resolve().parent
# All excerpts together, bytes.
LIMIT = 3_000_000
TEXT = ("run", "trajectory")
TIME = ("time_s", "t_s")
EMPS = ("t_s", "q_m", "motor_force_N", "vel_m_per_s", "acc_m_per_s2")


def every(step, first=0):
    """Keeps every step-th row of each run."""
    return lambda run, at, time: at >= first and (at - first) % step == 0


def early(step, seconds):
    """Keeps every step-th row of the first seconds of each run."""
    return lambda run, at, time: time <= seconds and at % step == 0


def of_runs(chosen, rule):
    """Keeps rows of runs whose name satisfies a condition."""
    return lambda run, at, time: chosen(run) and rule(run, at, time)


# What is kept of each file: rows and, where not all, columns.
EXCERPTS = {
    "bldc-cogging": (every(4), None),
    "bus-servo": (every(1), None),
    "damper-1": (every(16), None),
    "damper-1-actuators": (every(4), None),
    "damper-2": (early(4, 21), None),
    "damper-3": (of_runs(lambda run: "0.5Hz" in run, early(4, 14)), None),
    "damper-4": (early(16, 14), None),
    "damper-5": (every(8), None),
    "damper-quakes": (every(16), None),
    # The published protocol drops 49 samples and keeps every tenth.
    "emps-pulses": (every(10, 49), EMPS),
    "emps-train": (every(10, 49), EMPS),
    "mr-damper": (of_runs(lambda run: run.endswith((".1", "1.2.2", "5.1", "5.2.2", ".5", "A.3")), early(1, 10)), None),
    "pendulum": (every(4), None),
    "robot-axis1": (every(1), None),
    "robot-axis2": (every(2), None),
    "robot-axis3": (every(2), None),
    "robot-current": (every(2), None),
    "robot-current-j3": (every(2), None),
    "rolling-motor": (every(1), None),
    "screw-antibacklash": (every(4), None),
    "seal-kdn": (early(1, 30), None),
    "seal-oring": (early(1, 30), None),
    "seal-xring": (early(1, 30), None),
    "seal-xring-7bar": (every(1), None),
    "servo-pendulum": (every(1), None),
    "worm-drive": (every(4), None),
}


def excerpt(source, rule, columns):
    """Returns the kept rows of a file as a table."""
    counts, kept = {}, []
    with open(source, newline="") as file:
        reader = csv.DictReader(file)
        names = columns or reader.fieldnames
        time = next(name for name in TIME if name in names)
        for row in reader:
            run = row.get("run", "")
            at = counts[run] = counts.get(run, -1) + 1
            if rule(run, at, float(row[time])):
                kept.append([row[name] for name in names])
    arrays = {}
    for name, cells in zip(names, zip(*kept)):
        if name in TEXT:
            arrays[name] = pa.array(cells)
        else:
            number = pa.float64() if name in TIME else pa.float32()
            arrays[name] = pa.array([float(cell) if cell else None for cell in cells], number)
    return pa.table(arrays)


def main():
    folder, total = pathlib.Path(sys.argv[1]), 0
    for name, (rule, columns) in EXCERPTS.items():
        target = HERE / "measured" / f"{name}.parquet"
        if not sys.argv[2:] or name in sys.argv[2:]:
            table = excerpt(folder / f"{name}.csv", rule, columns)
            whole = [column for column in table.column_names if column in (*TEXT, *TIME)]
            split = [column for column in table.column_names if column not in whole]
            # Seven digits of the source fit into 32 bits, whose bytes are stored apart. Runs share their times.
            pq.write_table(table, target, compression="zstd", compression_level=19, use_dictionary=whole, use_byte_stream_split=split)
            print(f"{name}: {table.num_rows} rows, {target.stat().st_size} bytes")
        total += target.stat().st_size
    print(f"{total} bytes in all")
    return 1 if total > LIMIT else 0


if __name__ == "__main__":
    sys.exit(main())
