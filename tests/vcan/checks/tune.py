#!/usr/bin/env python3
# needs: host-sim
# limit: 420
"""tune and move in real time, against a drawn joint that runs as a process of its own.

Both share the processor of the guest. A SYNC or a target that comes late is the normal case here: the joint interpolates
over the targets, and the session must neither stop nor find a gain that is none. How late frames were is measured by
candump's stamps, which are the kernel's. The whole session runs with LONG_TESTS.
"""
import json
import os
import signal
import subprocess
import time

from bench import FOLDER, HOST_SIM, INTERFACE, Candump, Node, equal, host_sim, passed, test, until

SYNC, TARGET = "080", "201"
SYNC_US, TARGET_US = 1_000, 5_000
JOINT = ("--motor", "--hide", "direction-asymmetry", "--seed", "3")


def gaps(seen, identifier):
    """Times between frames of an identifier within a motion, us."""
    stamps = []
    for line in seen.log():
        stamp, _, frame = line.split()[:3]
        if frame.startswith(identifier + "#"):
            seconds, fraction = stamp.strip("()").split(".")
            stamps.append(int(seconds) * 1_000_000 + int(fraction))
    return [after - before for before, after in zip(stamps, stamps[1:])]


def report(name, found, period_us):
    late = sorted(found)
    at = [late[int(share * (len(late) - 1))] for share in (0.5, 0.99, 1.0)]
    more = sum(gap > 2 * period_us for gap in late)
    print(
        f"measured: {name}: {len(late)} gaps of {period_us} us: p50 {at[0]}, p99 {at[1]}, longest {at[2]} us;"
        f" {more} longer than two periods"
    )


def active():
    return host_sim("params", "get", "drive.position_gain"), host_sim("params", "get")


def is_disarmed():
    return "safe" in host_sim("params", "status")


@test
def a_joint_follows_a_sine_in_real_time():
    with Node(*JOINT), Candump(filters=[f"{name}:7FF" for name in (SYNC, TARGET)]) as seen:
        out = FOLDER / "moved"
        document = json.loads(host_sim("move", "--sine", "0.2,0.5,3", "--yes", "--json", "--out", out))
        assert document["tracking-rms"] < 0.1, document
        rows = (out / "move.csv").read_text().splitlines()
        names, cells = rows[0].split(","), [[float(cell) for cell in row.split(",")] for row in rows[1:]]
        position = [row[names.index("position_rad")] for row in cells]
        assert 0.3 < max(position) - min(position) < 0.5, f"{min(position)} to {max(position)} rad"
        report("SYNC", gaps(seen, SYNC), SYNC_US)
        report("targets", gaps(seen, TARGET), TARGET_US)
        print(f"measured: {len(cells)} rows recorded")
        assert is_disarmed()


@test
def ctrl_c_brings_the_joint_to_rest_with_its_parameters():
    with Node(*JOINT):
        before = active()
        command = [HOST_SIM, "tune", "--bus", INTERFACE, "--minutes", "2", "--yes", "--out", str(FOLDER / "interrupted")]
        said = FOLDER / "interrupted.out"
        with open(said, "w") as out:
            process = subprocess.Popen(command, stdout=out, stderr=out, cwd=FOLDER)
        until(lambda: "baseline" in said.read_text() or process.poll() is not None, "the baseline", 30)
        time.sleep(3)
        process.send_signal(signal.SIGINT)
        equal(process.wait(30), 1, said.read_text())
        assert "interrupted" in said.read_text(), said.read_text()
        assert is_disarmed()
        equal(active(), before)


@test
def a_whole_session_decides_in_real_time():
    if not os.environ.get("LONG_TESTS"):
        print("skipped: tune for two minutes in real time: tests/run --all")
        return
    with Node(*JOINT):
        before = active()
        command = [HOST_SIM, "tune", "--bus", INTERFACE, "--minutes", "2", "--yes", "--json", "--out", str(FOLDER / "tuned")]
        result = subprocess.run(command, capture_output=True, text=True, timeout=330, cwd=FOLDER)
        assert result.returncode in (0, 1), f"exit {result.returncode}: {result.stderr}"
        document = json.loads(result.stdout)
        print(f"measured: tune: saved {document['saved']}, {document.get('why_not')}, {document['seconds']:.0f} s")
        for gain in document["gains"]:
            print(f"measured: {gain['quantity']}: {gain['gain']:.2f} {gain['ci95']}")
        # A session that is broken off by a late frame has no trial.
        assert document["saved"] or document["trial"]["blocks"] or "better" in document["why_not"], document["why_not"]
        assert is_disarmed()
        if document["saved"]:
            assert active() != before
            host_sim("tune", "--undo")
        equal(active(), before)


passed("tune")
