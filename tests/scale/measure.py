"""The measurements of tests/scale/run. Prints them as JSON."""

import contextlib
import importlib.metadata
import json
import math
import os
import pathlib
import platform
import re
import sys
import tempfile
import time

import chromium
from tasks import MeasuredEngine, trivial

import friction
from friction import fleet

WORKERS = 2
#: Rows of a log, with the duration of its three runs at 100 Hz, s.
LOGS = {600: 2.0, 1800: 6.0}
#: Joints of each length.
JOINTS = 20
#: Joints on the cluster; the diagnosis is the same, so that a few suffice for its memory.
DASK_JOINTS = 6
CAUSES = ("pressure-coulomb", "temperature-viscous", "none", "direction-asymmetry")
OVERHEAD = (40, 200, 2000)
PAGE_ROWS = 10_000


def write_logs(folder):
    """Writes the logs of simulated joints. Returns the number of rows of each joint."""
    rows = {}
    for length, seconds in LOGS.items():
        for number in range(JOINTS):
            joint = f"{length}-rows-{number:02d}"
            cause = CAUSES[number % len(CAUSES)]
            log = friction.simulate("underwater-joint", hide=[cause], seed=number, runs=3, seconds=seconds, rate_hz=100)
            (folder / f"{joint}.csv").write_text(log.csv)
            rows[joint] = len(log.data)
    return rows


def timed(function, *arguments, **options):
    begin = time.monotonic()
    found = function(*arguments, **options)
    return found, time.monotonic() - begin


@contextlib.contextmanager
def dask():
    """Yields a client of a local cluster, and its time to start, s."""
    # Not at the head: the processes of the local engine import this file.
    import distributed

    begin = time.monotonic()
    cluster = {"n_workers": WORKERS, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**cluster) as local, distributed.Client(local) as client:
        yield client, time.monotonic() - begin


def overhead(engine):
    """Returns the time of an engine for tasks without work by their number, s: the best of three."""
    found = {}
    for number in OVERHEAD:
        tasks = [fleet.Task(f"{place}", "", ()) for place in range(number)]
        times = []
        for _ in range(3):
            rows, seconds = timed(lambda: list(engine.run(trivial, tasks, 2)))
            assert len(rows) == number
            times.append(seconds)
        found[number] = min(times)
    engine.close()
    return found


def diagnoses(folder, rows):
    """Diagnoses all joints with the local engine, twice. Returns the figures, the rows, and the bytes of a result."""
    engine = MeasuredEngine(fleet._engine("local", WORKERS))
    out = folder / "out"
    found, wall = timed(fleet.diagnose, folder / "logs", out=out, engine=engine)
    assert not found.failed, found.failed
    again, resumed = timed(fleet.diagnose, folder / "logs", out=out, workers=WORKERS)
    # A row that was computed again would state another time.
    times = zip(again.rows, found.rows, strict=True)
    assert all(math.isclose(new["seconds"], old["seconds"], rel_tol=1e-9) for new, old in times), "computed again"
    by_length = {}
    for joint, seconds in engine.processor_s.items():
        by_length.setdefault(joint.split("-")[0], []).append(seconds)
    results = sum(file.stat().st_size for file in out.glob("joint=*/**/*") if file.is_file())
    figures = {
        "lengths": {length: {"rows": rows[f"{length}-rows-00"], "seconds": each} for length, each in by_length.items()},
        "wall_s": wall,
        "resume_s": resumed,
        "result_bytes": results / len(found.rows),
        "local_peak_mb": engine.peak_mb,
    }
    return figures, found.rows


def on_dask(folder, client):
    """Returns the largest memory of a worker of the cluster, MB."""
    logs = sorted((folder / "logs").iterdir())[-DASK_JOINTS:]
    tasks = [fleet.Task(log.stem, "", (str(log),)) for log in logs]
    engine = MeasuredEngine(fleet._engine(client, None))
    found = fleet.diagnose(tasks, out=folder / "dask", engine=engine)
    assert not found.failed, found.failed
    return engine.peak_mb


def fleet_page(folder, rows):
    """Writes the page of many rows, made of the measured ones. Returns its time and sizes, and the time of a browser."""
    campaigns = 10
    many = [
        row | {"joint": f"joint-{place // campaigns:04d}", "campaign": f"2026-{1 + place % campaigns:02d}-01"}
        for place, row in ((place, rows[place % len(rows)]) for place in range(PAGE_ROWS))
    ]
    out = folder / "page"
    out.mkdir()
    text = json.dumps(many)
    _, seconds = timed(friction._core.fleet_write, str(out), text, [])
    figures = {"rows": PAGE_ROWS, "seconds": seconds}
    for name in ("fleet.html", "fleet.parquet"):
        figures[name] = (out / name).stat().st_size
    figures["browser_s"] = figures["search_s"] = None
    program = chromium.find()
    if program is not None:
        with tempfile.TemporaryDirectory() as profile, chromium.Browser(program, profile) as browser:
            _, figures["browser_s"] = timed(browser.open, out / "fleet.html")
            script = (
                "(() => { const begin = performance.now(), field = document.querySelector('.finder input');"
                " field.value = '0999'; field.dispatchEvent(new Event('input'));"
                " return [performance.now() - begin, document.querySelectorAll('.finder tbody tr').length] })()"
            )
            milliseconds, hits = browser.evaluate(script)
            assert hits == campaigns, hits
            figures["search_s"] = milliseconds / 1000
    return figures


def cpu():
    models = re.findall(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    return models[0] if models else platform.machine()


def main():
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "logs").mkdir()
        rows = write_logs(folder / "logs")
        figures, found = diagnoses(folder, rows)
        engines = {"local": {"start_s": None, "overhead": overhead(fleet._engine("local", WORKERS))}}
        with dask() as (client, start):
            engines["dask"] = {"start_s": start, "overhead": overhead(fleet._engine(client, None))}
            figures["dask_peak_mb"] = on_dask(folder, client)
        figures["page"] = fleet_page(folder, found)
    figures |= {
        "joints": len(found),
        "workers": WORKERS,
        "engines": engines,
        "machine": cpu(),
        "cores": os.cpu_count(),
        "load": load,
        "versions": {"python": platform.python_version(), "friction": friction.__version__, "distributed": importlib.metadata.version("distributed")},
    }
    json.dump(figures, sys.stdout)


if __name__ == "__main__":
    main()
