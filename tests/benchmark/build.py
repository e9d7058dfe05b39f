"""The table of what a fresh build of the first command takes: `tests/bench build [--update]`.

The build goes into an empty folder with the profile `release`, as README's first command does it. cargo's timing report gives the
seconds of each unit (one call of the compiler or of a build script). Seconds depend on the machine, so the limits hold on what does
not: the count of crates, and the seconds of our own crates as a multiple of those of the libraries in the same build.
"""

import collections
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TABLE = pathlib.Path(__file__).resolve().parent / "build.tsv"
LISTED = 25  # crates in the table
BAND = 1.5  # of the ratio of our own crates to the libraries, either way
MORE_CRATES = 3  # crates that may come or go without a new table


def own_crates():
    command = ["cargo", "metadata", "--no-deps", "--format-version", "1", "--offline"]
    packages = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)["packages"]
    return {package["name"] for package in packages}


def build():
    """Builds in an empty folder. Returns the units of the report, wall seconds and processor seconds."""
    with tempfile.TemporaryDirectory() as folder:
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        command = ["cargo", "build", "--quiet", "--locked", "--release", "--bin", "host-sim", "--timings"]
        if subprocess.run(command, cwd=ROOT, env=os.environ | {"CARGO_TARGET_DIR": folder}).returncode:
            sys.exit("tests/bench build: the build failed")
        wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        reports = sorted(pathlib.Path(folder, "cargo-timings").glob("cargo-timing-*.html"))
        data = re.search(r"const UNIT_DATA = (\[.*?\]);", reports[-1].read_text(), re.S)
    processor = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return json.loads(data[1]), wall, processor


def crates_of(text):
    return int(re.search(r"^(\d+) crates", text, re.M)[1])


def ratio_of(text):
    return float(re.search(r"([\d.]+) times the libraries", text)[1])


def table_text(units, wall, processor):
    seconds = collections.Counter()
    for unit in units:
        seconds[unit["name"]] += unit["duration"]
    own = own_crates()
    ours = sum(value for name, value in seconds.items() if name in own)
    libraries = sum(seconds.values()) - ours
    crates = len({(unit["name"], unit["version"]) for unit in units})
    lines = [
        "# A fresh build of the first command",
        f"{crates} crates in {len(units)} units: {sum(seconds.values()):.0f} unit-seconds, {wall:.0f} s of wall, {processor:.0f} s of processor.",
        f"Our own crates take {ours:.0f} s, {ours / libraries:.2f} times the libraries' {libraries:.0f} s.",
        "crate\tunit-seconds",
    ]
    lines += [f"{name}{' (own)' if name in own else ''}\t{value:.1f}" for name, value in seconds.most_common(LISTED)]
    return "\n".join(lines) + "\n"


def main(update):
    text = table_text(*build())
    print(text)
    if update:
        TABLE.write_text(text)
        print(f"written: {TABLE.relative_to(ROOT)}")
        return 0
    if not TABLE.exists():
        sys.exit("tests/bench build: there is no table to compare with: tests/bench build --update makes it")
    stored = TABLE.read_text()
    wrong = []
    if abs(crates_of(text) - crates_of(stored)) > MORE_CRATES:
        wrong.append(f"{crates_of(text)} crates, in the table {crates_of(stored)}")
    if not 1 / BAND <= ratio_of(text) / ratio_of(stored) <= BAND:
        wrong.append(f"our own crates are {ratio_of(text)} times the libraries, in the table {ratio_of(stored)}")
    for line in wrong:
        print(f"outside the limits: {line}")
    print(f"build: {2 - len(wrong)} passed, {len(wrong)} failed")
    return 1 if wrong else 0
