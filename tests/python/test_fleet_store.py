"""`friction.fleet` with logs and results in an object store: an S3 server in this process, and fsspec."""

import io
import json

import fsspec
import pandas
import pytest
import s3fs
from moto.server import ThreadedMotoServer
from test_fleet import EXPECTED, causes, write_log

import friction
from friction.fleet import Task

KEYS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}


@pytest.fixture(scope="module")
def server():
    """The address of an empty object store."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def bucket(server, tmp_path, monkeypatch):
    """A bucket with the logs of four joints, of which one is bad, and the options to open it."""
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    options = {"endpoint_url": server}
    name = tmp_path.name.replace("_", "-")[:60].strip("-")
    store = s3fs.S3FileSystem(**options)
    store.mkdir(name)
    for number, joint in enumerate(("hip", "knee", "wrist")):
        write_log(tmp_path / "a.csv", 1.2 + 0.1 * number)
        store.put_file(tmp_path / "a.csv", f"{name}/logs/joint={joint}/campaign=2026-03-01/a.csv")
    store.pipe_file(f"{name}/logs/joint=elbow/campaign=2026-03-01/a.csv", b"time_s,torque_nm\n0,1\n")
    store.pipe_file(f"{name}/logs/joint=elbow/notes.md", b"no log")
    return store, f"s3://{name}", options


def diagnose(bucket, **options):
    _, address, storage = bucket
    arguments = {"workers": 2, "fixed_model": "linear", "storage_options": storage, **options}
    return friction.fleet.diagnose(f"{address}/logs", out=f"{address}/out", **arguments)


def test_diagnose_with_addresses_writes_the_files_of_a_folder(bucket):
    store, address, _ = bucket
    fleet = diagnose(bucket)
    assert causes(fleet) == EXPECTED and fleet.out == f"{address}/out"
    (failed,) = fleet.failed
    assert failed["error"].startswith(f"{address}/logs/joint=elbow/campaign=2026-03-01/a.csv"), failed["error"]
    place = "joint=hip/campaign=2026-03-01"
    names = {name.split("/out/")[1] for name in store.find(f"{address}/out")}
    files = {"diagnosis.json", "params.toml", "report.html", "row.json"}
    assert {f"{place}/{name}" for name in files} | {"fleet.html", "fleet.parquet"} <= names
    assert not [name for name in names if "elbow" in name or ".unfinished" in name]
    document = json.loads(store.cat_file(f"{address}/out/{place}/diagnosis.json"))
    assert document["data"]["files"] == [f"{address}/logs/{place}/a.csv"]
    table = pandas.read_parquet(io.BytesIO(store.cat_file(f"{address}/out/fleet.parquet")))
    assert sorted(table["status"]) == ["error", "ok", "ok", "ok"]


def test_diagnose_with_addresses_resumes_and_recomputes_what_is_incomplete(bucket):
    store, address, _ = bucket
    first = diagnose(bucket)
    # A result without its row was not completed; a changed log has another hash.
    store.rm_file(f"{address}/out/joint=knee/campaign=2026-03-01/row.json")
    with store.open(f"{address}/logs/joint=wrist/campaign=2026-03-01/a.csv", "ab") as log:
        log.write(b"1,3.00,0.1,1.5\n")
    written = store.modified(f"{address}/out/joint=hip/campaign=2026-03-01/row.json")
    second = diagnose(bucket)
    seconds = [{row["joint"]: row["seconds"] for row in fleet.rows if row["error"] is None} for fleet in (first, second)]
    assert {joint for joint in seconds[0] if seconds[0][joint] == seconds[1][joint]} == {"hip"}
    store.invalidate_cache()
    assert store.modified(f"{address}/out/joint=hip/campaign=2026-03-01/row.json") == written, "written again"


def test_diagnose_with_addresses_on_dask_equals_local(bucket):
    distributed = pytest.importorskip("distributed")
    cluster = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**cluster) as local, distributed.Client(local) as client:
        fleet = diagnose(bucket, engine=client)
    assert causes(fleet) == EXPECTED


def test_diagnose_with_address_without_logs_raises(bucket):
    _, address, storage = bucket
    with pytest.raises(friction.FrictionError, match="found no log"):
        friction.fleet.diagnose(f"{address}/nothing", out=f"{address}/out", storage_options=storage)


def test_diagnose_with_results_below_the_logs_ignores_them(tmp_path):
    write_log(tmp_path / "a.csv", 1.3)
    with fsspec.open("memory://below/hip/1.csv", "wb") as target:
        target.write((tmp_path / "a.csv").read_bytes())
    engine = _Inline()
    for _ in range(2):
        fleet = friction.fleet.diagnose("memory://below", out="memory://below/out", engine=engine, fixed_model="linear")
        assert [(row["joint"], row["campaign"]) for row in fleet.rows] == [("hip", "1")]


def test_task_with_several_joints_in_a_store_resumes(tmp_path):
    write_log(tmp_path / "a.csv", 1.3)
    frame = pandas.read_csv(tmp_path / "a.csv")
    both = pandas.concat([frame.assign(joint="left"), frame.assign(joint="right", torque_nm=1.1 * frame["torque_nm"])])
    with fsspec.open("memory://several/robot.csv", "wb") as target:
        target.write(both.to_csv(index=False).encode())
    task = Task("robot", "", ("memory://several/robot.csv",))
    seconds = []
    for _ in range(2):
        fleet = friction.fleet.diagnose([task], out="memory://several/out", engine=_Inline(), fixed_model="linear")
        assert [row["joint"] for row in fleet.rows] == ["robot/left", "robot/right"]
        seconds.append([row["seconds"] for row in fleet.rows])
    assert seconds[0] == seconds[1], "computed again"


class _Inline:
    """An engine in this process, which a store in memory needs."""

    def run(self, function, tasks, retries):
        for task in tasks:
            yield task, function(task)

    def close(self):
        pass
