"""One simulated log and what host-sim writes about it, made once and read by several stages.

`folder(host_sim)` returns `target/fixture`, which contains:

    simulated/                      what `simulate` writes
    joint.csv                       its log: a joint whose friction grows with pressure: 8 runs of 4 s at 250 Hz
    diagnosis/ compare/ identify/   what `diagnose`, `compare` and `identify --model linear` write about it
    diagnose.json                   what `diagnose --json` prints

The folder is made again if the program is another one. Stages that run at the same time wait for the first.
"""

import fcntl
import hashlib
import os
import pathlib
import shutil
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
SCENARIO = "--hide pressure-coulomb --runs 8 --seconds 4 --rate 250 --seed 5".split()
LIMIT_S = 600


def _make(host_sim, place):
    def run(*arguments):
        result = subprocess.run([host_sim, *arguments], cwd=place, capture_output=True, text=True, timeout=LIMIT_S)
        assert result.returncode == 0, f"{arguments}: exit code {result.returncode}: {result.stderr[-800:]}"
        return result.stdout

    run("simulate", "underwater-joint", *SCENARIO, "--out", "simulated")
    shutil.copy(place / "simulated" / "data.csv", place / "joint.csv")
    (place / "diagnose.json").write_text(run("diagnose", "joint.csv", "--out", "diagnosis", "--json"))
    run("compare", "joint.csv", "--out", "compare")
    run("identify", "joint.csv", "--model", "linear", "--out", "identify")


def folder(host_sim):
    """Returns the folder, made by this program."""
    host_sim = str(pathlib.Path(host_sim).resolve())
    # This file decides the content too.
    parts = [pathlib.Path(host_sim).read_bytes(), pathlib.Path(__file__).read_bytes()]
    stamp = hashlib.sha256(b"".join(parts)).hexdigest()
    place = TARGET / "fixture"
    TARGET.mkdir(parents=True, exist_ok=True)
    with open(TARGET / "fixture.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (place / "stamp").exists() or (place / "stamp").read_text() != stamp:
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            _make(host_sim, place)
            (place / "stamp").write_text(stamp)
    return place
