"""`friction.fleet`: one bad log fails alone, killed processes are survived, a second call resumes, wear is a trend."""

import json
import math
import os
import signal
import threading
import time

import pandas
import pyarrow.parquet
import pytest

import friction
from conftest import wait_until
from friction.fleet import Task


def write_log(path, coulomb_nm, seed=0, rows_per_run=300):
    """A joint with Coulomb and viscous friction, which is no model of this project with bristles."""
    rows = ["run,time_s,velocity_rad_s,torque_nm"]
    for run in range(2):
        for row in range(rows_per_run):
            t = 0.01 * row
            v = (1 + run) * math.sin(4 * t)
            noise = 0.01 * (((row * 7919 + 104729 * seed + run * 31) % 1000) / 1000 - 0.5)
            rows.append(f"{run},{t:.2f},{v:.6f},{coulomb_nm * math.copysign(1, v) + 0.3 * v + noise:.6f}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(rows) + "\n")


@pytest.fixture
def logs(tmp_path):
    for number, joint in enumerate(("hip", "knee", "wrist")):
        write_log(tmp_path / f"logs/joint={joint}/campaign=2026-03-01/a.csv", 1.2 + 0.1 * number)
    bad = tmp_path / "logs/joint=elbow/campaign=2026-03-01/a.csv"
    bad.parent.mkdir(parents=True)
    bad.write_text("time_s,torque_nm\n0,1\n")
    return tmp_path / "logs"


def causes(fleet):
    return {row["joint"]: row["error"] is None for row in fleet.rows}


EXPECTED = {"elbow": False, "hip": True, "knee": True, "wrist": True}


def test_diagnose_with_bad_log_keeps_the_others_and_resumes(logs, tmp_path):
    out = tmp_path / "out"
    first = friction.fleet.diagnose(logs, out=out, fixed_model="linear", workers=2)
    assert causes(first) == EXPECTED
    (failed,) = first.failed
    assert "expected velocity_rad_s" in failed["error"] and "--columns" not in failed["error"]
    table = pyarrow.parquet.read_table(out / "fleet.parquet").to_pandas()
    assert sorted(table["status"]) == ["error", "ok", "ok", "ok"]
    hip = table[table["joint"] == "hip"].iloc[0]
    assert abs(hip["fixed_coulomb_torque"] / 1.2 - 1) < 0.05
    document = json.loads((out / "joint=hip/campaign=2026-03-01/diagnosis.json").read_text())
    assert document["cause"] == hip["cause"]
    second = friction.fleet.diagnose(logs, out=out, fixed_model="linear", workers=1)
    seconds = [[row["seconds"] for row in fleet.rows if row["error"] is None] for fleet in (first, second)]
    assert seconds[0] == seconds[1], "computed again"


def kill_a_worker(killed):
    """Kills the first process that works on a fleet and adds it to ``killed``."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        for entry in os.listdir("/proc"):
            try:
                if entry.isdigit() and int(entry) != os.getpid():
                    command = open(f"/proc/{entry}/cmdline", "rb").read()
                    parent = int(open(f"/proc/{entry}/stat").read().rsplit(")", 1)[1].split()[1])
                    if parent == os.getpid() and b"spawn_main" in command and b"resource_tracker" not in command:
                        time.sleep(0.5)
                        os.kill(int(entry), signal.SIGKILL)
                        killed.append(int(entry))
                        return
            except (OSError, ValueError):
                continue
        time.sleep(0.05)


def test_diagnose_with_killed_process_ends_with_all_rows(logs, tmp_path):
    # Long enough that the process still works when it is killed.
    for joint in ("hip", "knee", "wrist"):
        write_log(logs / f"joint={joint}/campaign=2026-03-01/a.csv", 1.2, rows_per_run=20_000)
    killed = []
    killer = threading.Thread(target=kill_a_worker, args=(killed,))
    killer.start()
    fleet = friction.fleet.diagnose(logs, out=tmp_path / "out", fixed_model="linear", workers=2)
    killer.join()
    assert killed and causes(fleet) == EXPECTED
    assert not [name for name in os.listdir(tmp_path / "out") if name.startswith(".")]


def test_run_with_a_process_that_no_longer_reads_its_queue_ends(logs, tmp_path, monkeypatch):
    """It stands for processes that wait for a queue, which a killed one left locked."""
    monkeypatch.setattr(friction.fleet, "_END_S", 1.0)
    tasks = [Task(joint, "1", (str(logs / f"joint={joint}/campaign=2026-03-01/a.csv"),)) for joint in ("hip", "knee")]
    local = friction.fleet._Local(2)
    run = local.run(friction.fleet._Work(str(tmp_path / "out"), None, "linear", ()), tasks, retries=1)
    assert {task.joint for task, _ in (next(run), next(run))} == {"hip", "knee"}
    processes = local._processes()
    os.kill(processes[0].pid, signal.SIGSTOP)
    assert list(run) == []
    # Two threads wait for the end of a process. One of them knows of it a little later.
    wait_until(lambda: not any(process.is_alive() for process in processes), "the end of the processes")


def test_diagnose_on_dask_survives_a_killed_worker(logs, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            victim = next(iter(client.run(os.getpid).values()))
            threading.Timer(1.0, os.kill, (victim, signal.SIGKILL)).start()
            fleet = friction.fleet.diagnose(logs, out=tmp_path / "out", fixed_model="linear", engine=client)
    assert causes(fleet) == EXPECTED


def test_wear_of_one_percent_is_the_only_trend(tmp_path):
    for campaign in range(6):
        for joint, wear in (("worn", 0.01), ("new", 0.0)):
            scatter = 1 + 0.002 * math.sin(7.3 * campaign)
            path = tmp_path / f"logs/{joint}/2026-03-{1 + campaign:02d}.csv"
            write_log(path, 1.5 * scatter * (1 + wear * campaign), seed=campaign)
    fleet = friction.fleet.diagnose(
        tmp_path / "logs", out=tmp_path / "out", fixed_model="linear", limits={"coulomb_torque": 1.8}
    )
    assert not fleet.failed
    page = (tmp_path / "out/fleet.html").read_text()
    assert "worn: coulomb_torque" in page and "new: coulomb_torque" not in page
    assert "days until the limit" in page


def test_task_with_addresses_reads_them_through_fsspec(tmp_path):
    fsspec = pytest.importorskip("fsspec")
    write_log(tmp_path / "a.csv", 1.3)
    with fsspec.open("memory://bucket/a.csv", "wb") as target:
        target.write((tmp_path / "a.csv").read_bytes())
    work = friction.fleet._Work(str(tmp_path / "out"), None, "linear", ())
    (row,) = work(Task("hip", "1", ("memory://bucket/a.csv",)))
    assert row["error"] is None and row["files"] == ["memory://bucket/a.csv"]


def test_diagnose_group_with_missing_column_refuses_it(tmp_path):
    write_log(tmp_path / "a.csv", 1.3)
    frame = pandas.read_csv(tmp_path / "a.csv").assign(joint="hip", pressure_diff_pa=float("nan"))
    function = friction.fleet.diagnose_group(required=["torque_nm", "pressure_diff_pa"])
    row = function(frame).iloc[0]
    assert "found no value in pressure_diff_pa" in row["error"]
    row = friction.fleet.diagnose_group(required=["torque_nm"])(frame).iloc[0]
    assert row["error"] is None and row["cause"] is not None


def test_diagnose_with_wrong_option_raises_before_any_task(logs, tmp_path):
    with pytest.raises(TypeError):
        friction.fleet.diagnose(logs, out=tmp_path / "out", colums={})
    with pytest.raises(friction.FrictionError, match="engine"):
        friction.fleet.diagnose(logs, out=tmp_path / "out", engine="cloud")
