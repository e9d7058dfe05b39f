"""Logs for the tests of the Python module, and the command line's documents about them."""

import csv
import datetime
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import fixture  # noqa: E402
from frames import as_pandas  # noqa: E402

import friction  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
HOST_SIM = os.environ["HOST_SIM"]
#: Runs of the log of tests/fixture.py.
RUNS = int(fixture.SCENARIO[fixture.SCENARIO.index("--runs") + 1])
#: Limit of one command of the command line, s.
LIMIT_S = 300


def host_sim(folder, *arguments):
    """Runs the command line and returns its result."""
    command = [HOST_SIM, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LIMIT_S)


def document(folder, *arguments):
    """Runs the command line with --json and returns its document."""
    result = host_sim(folder, *arguments, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def wait_until(condition, what, limit_s=60):
    """Waits until the condition holds. Fails after the limit, which is far longer than any machine takes."""
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, f"no {what} within {limit_s} s"
        time.sleep(0.01)


class Log:
    """A log as a file, with the columns that it maps."""

    def __init__(self, path, columns):
        self.path, self.columns = path, columns
        mapping = ",".join(f"{ours}={theirs}" for ours, theirs in columns.items())
        self.options = ["--columns", mapping] if mapping else []


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A folder with the log of tests/fixture.py, `joint.csv`, and `simulated`, which host-sim wrote with it."""
    folder = tmp_path_factory.mktemp("logs")
    made = fixture.folder(HOST_SIM)
    shutil.copy(made / "joint.csv", folder)
    shutil.copytree(made / "simulated", folder / "simulated")
    return folder


@pytest.fixture(scope="session")
def plain(folder):
    """A log with the names of the contract."""
    return Log(folder / "joint.csv", {})


@pytest.fixture(scope="session")
def frame(plain):
    """The same log as a frame whose rows have names."""
    return as_pandas(plain).rename(index=lambda row: f"row {row}")


@pytest.fixture(scope="session")
def found(frame):
    """The diagnosis of that frame."""
    return friction.diagnose(frame)


@pytest.fixture(scope="session")
def foreign(folder):
    """The same joint as another logger writes it: points in time, other names and units, categories, missing cells."""
    with (folder / "joint.csv").open() as file:
        rows = list(csv.DictReader(file))
    begin = datetime.datetime(2024, 5, 1, 12, tzinfo=datetime.timezone.utc)
    fields = ["stamp", "run", "dq", "tau", "pressure_diff_pa", "gear", "temperature_c"]
    path = folder / "foreign.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fields)
        writer.writeheader()
        for number, row in enumerate(rows):
            at = begin + datetime.timedelta(seconds=float(row["time_s"]) + 60 * int(row["run"]))
            # Every 50th pressure and one torque in 200 are missing.
            writer.writerow(
                {
                    "stamp": at.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
                    "run": f"trial {row['run']}",
                    "dq": row["velocity_rad_s"],
                    "tau": "" if number % 200 == 7 else repr(1000 * float(row["torque_nm"])),
                    "pressure_diff_pa": "" if number % 50 == 3 else row["pressure_diff_pa"],
                    "gear": "low" if int(row["run"]) % 2 else "high",
                    "temperature_c": row.get("temperature_c", "20.0"),
                }
            )
    return Log(path, {"time_s": "stamp", "velocity_rad_s": "dq", "torque_nm": "tau:mNm"})


@pytest.fixture(scope="session", params=["plain", "foreign"])
def log(request):
    """Each of the two logs."""
    return request.getfixturevalue(request.param)


_DIAGNOSES = {}


@pytest.fixture
def diagnosis(log):
    """The command line's diagnosis of a log."""
    if not log.columns:
        known = json.loads((fixture.folder(HOST_SIM) / "diagnose.json").read_text())
        known["data"]["files"] = [str(log.path)]
        return known
    if log.path not in _DIAGNOSES:
        _DIAGNOSES[log.path] = document(log.path.parent, "diagnose", log.path, *log.options)
    return _DIAGNOSES[log.path]
