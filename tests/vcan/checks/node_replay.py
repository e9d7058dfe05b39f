#!/usr/bin/env python3
# needs: host-sim
# limit: 240
"""host-sim node and host-sim replay, two processes that have nothing in common but the interface."""
import json
import subprocess
import time

from bench import FOLDER, HOST_SIM, INTERFACE, Candump, Node, Program, cansend, equal, frames, host_sim, passed
from bench import simulate, test, until

ARMED = "the joint is armed, and nothing is written then: disarm first"

PARAMETERS = """
schema = 1
joint = "revolute"
model = "lugre+pressure-coulomb"

[parameters]
coulomb_torque = { value = 1.5, unit = "Nm" }
static_torque = 2.25
pressure_coulomb = 2.4e-6
[compensator]
scale = 0.75
"""


def trace():
    return simulate("node-replay", "--runs", "1", "--seconds", "2")


def parameters():
    path = FOLDER / "other.toml"
    path.write_text(PARAMETERS)
    return path


def replay(*arguments, code=0, log=None):
    """Replays the trace; gives the report."""
    out = FOLDER / "replay"
    host_sim("replay", log or trace(), "--out", out, *arguments, code=code)
    return json.loads((out / "replay.json").read_text())


def holds(report, samples=2000):
    answers = report["answers"]
    assert report["holds"], answers
    equal((answers["equal"], answers["samples"]), (samples, samples))
    equal((answers["mismatches"], answers["lost"], answers["unexpected"]), (0, 0, 0))
    equal(answers["telemetry_equal"], samples)
    return report


def answers(log):
    return frames(log.read_text().splitlines(), "181")


@test
def every_answer_is_the_cores_in_either_number_and_with_any_parameters():
    with Node():
        logs = {}
        for name, arguments in {
            "f32": ("--number", "f32"),
            "fixed": ("--number", "fixed"),
            "fast": ("--number", "f32", "--rate", "max"),
            "other": ("--number", "f32", "--params", parameters()),
            "other fixed": ("--number", "fixed", "--rate", "3", "--params", parameters()),
        }.items():
            log = FOLDER / f"{name}.log"
            report = holds(replay("--record", log, *arguments))
            equal(report["number"], "fixed" if "fixed" in name else "f32")
            logs[name] = answers(log)
            equal(len(logs[name]), 2000, name)
        # What is equal is not the same everywhere: number and parameters do reach the driver.
        pairs = enumerate(zip(logs["f32"], logs["fast"]))
        equal([(place, *pair) for place, pair in pairs if pair[0] != pair[1]][:3], [])
        for one, other in [("f32", "fixed"), ("f32", "other"), ("other", "other fixed")]:
            assert logs[one] != logs[other], (one, other)


@test
def a_joint_of_any_number_takes_the_log_of_another():
    with Node("--node-id", "17"), Candump() as seen:
        holds(replay("--node-id", "17", "--rate", "max"))
        log = seen.log()
        equal(len(frames(log, "191")), 2000)
        equal(len(frames(log, "181", "481")), 0)
        assert "does not answer" in host_sim("replay", trace(), code=2)


@test
def damaged_frames_do_not_pass():
    with Node():
        for faults, what in [("corrupt=0.01", "mismatches"), ("drop=0.01", "lost")]:
            report = replay("--rate", "max", "--faults", faults, code=1)
            assert not report["holds"] and report["answers"][what] > 0, report["answers"]
        # The node is whole: without faults it is right again.
        holds(replay("--rate", "max"))


def disturbed(disturb):
    """A replay that somebody steps into half a second after it began to feed; gives its report."""
    with Node(), Candump(filters=["481:7FF"]) as seen:
        out = FOLDER / "disturbed"
        # Without the objects a trace writes on its way: somebody else is to use the server meanwhile.
        lines = trace().read_text().splitlines(keepends=True)
        log = FOLDER / "disturbed.log"
        log.write_text("".join(line for line in lines if " 601#" not in line))
        # Slowly enough that a guest gets it done meanwhile.
        command = [HOST_SIM, "replay", log, "--out", out, "--bus", INTERFACE, "--rate", "0.4"]
        player = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        until(lambda: "481#" in seen.text(), "the replay has begun")
        time.sleep(0.5)
        disturb()
        said = player.communicate(timeout=30)[1].decode()
        equal(player.returncode, 1, said)
        return json.loads((out / "replay.json").read_text())["answers"]


@test
def another_parameter_in_the_driver_is_found():
    def change():
        host_sim("params", "disarm")
        host_sim("params", "set", "compensator.scale=0.45")
        host_sim("params", "arm")

    found = disturbed(change)
    assert found["equal"] > 200 and found["mismatches"] > 200, found


@test
def a_foreign_input_is_found():
    # A command, once, from somebody else; the trace has none, so it stays.
    found = disturbed(lambda: cansend("301#0000803F00000001"))
    assert 200 < found["mismatches"] and found["lost"] == 0, found
    assert found["shown"][0]["what"] in ("flags", "feed-forward current, A", "friction torque, Nm", "current, A"), found


@test
def a_driver_that_falls_silent_is_found():
    found = disturbed(lambda: cansend("000#0201"))
    assert found["lost"] > 200 and found["equal"] > 200, found


@test
def nobody_there_is_said_in_a_line():
    assert "node 1 does not answer" in host_sim("replay", trace(), code=2)
    assert "node 1 does not answer" in host_sim("params", "get", code=2)


@test
def parameters_are_read_set_and_compared():
    with Node():
        defaults = FOLDER / "defaults.toml"
        defaults.write_text(host_sim("params", "get"))
        equal(host_sim("params", "get", "static_torque", "compensator.scale").splitlines(),
              ["static_torque = 1.0", "compensator.scale = 0.9"])
        assert "no difference" in host_sim("params", "diff", defaults)
        host_sim("params", "set", "static_torque=1.25", "compensator.scale=0.5")
        said = host_sim("params", "diff", defaults, code=1)
        equal([line.split(":")[0] for line in said.splitlines()], ["static_torque", "compensator.scale"])
        values = json.loads(host_sim("params", "get", "--json"))
        equal((values["static_torque"], values["compensator.scale"]), (1.25, 0.5))
        # A file is taken whole, and what is read back is taken again.
        host_sim("params", "set", parameters())
        equal(host_sim("params", "diff", parameters()).split()[0], "no")
        again = FOLDER / "again.toml"
        again.write_text(host_sim("params", "get"))
        host_sim("params", "set", defaults)
        host_sim("params", "diff", again, code=1)
        host_sim("params", "set", again)
        equal(host_sim("params", "get"), again.read_text())


@test
def what_is_saved_outlives_the_process_and_what_is_not_does_not():
    flash = FOLDER / "joint.flash"

    def scale():
        return host_sim("params", "get", "compensator.scale").strip()

    with Node("--flash", flash):
        host_sim("params", "set", "compensator.scale=0.5")
    with Node("--flash", flash):
        equal(scale(), "compensator.scale = 0.9")
        host_sim("params", "set", "compensator.scale=0.5", "--save")
        host_sim("params", "set", "compensator.scale=0.25")
    with Node("--flash", flash):
        equal(scale(), "compensator.scale = 0.5")
        host_sim("params", "set", "compensator.scale=0.75")
        host_sim("params", "save")
        # A restart over the bus is one, too.
        host_sim("params", "set", "compensator.scale=0.3")
        with Candump(filters=["701:7FF"]) as seen:
            host_sim("params", "reset")
            until(lambda: "701#00" in seen.text(), "the node says that it is there")
        equal(scale(), "compensator.scale = 0.75")
        holds(replay("--rate", "max"))
    with Node("--flash", flash):
        equal(scale(), "compensator.scale = 0.75")
        host_sim("params", "restore")
        equal(scale(), "compensator.scale = 0.75")
    with Node("--flash", flash):
        equal(scale(), "compensator.scale = 0.9")
    (FOLDER / "no.flash").write_bytes(b"no flash")
    said = host_sim("node", "--flash", FOLDER / "no.flash", code=2)
    assert "8 bytes, expected" in said, said


@test
def a_monitor_beside_a_replay_sees_what_goes_on():
    with Node():
        watcher = [HOST_SIM, "monitor", "--bus", INTERFACE, "--json", "--seconds", "60"]
        with Program(watcher, FOLDER / "monitor.out") as monitor:
            until(lambda: "{" in monitor.text(), "the monitor's first second", 20)
            # 8 s at 250 Hz. Its queries pause for 1 s after another master's, and longer after an answer that a busy
            # machine delayed; such a machine cannot keep up 8 s at 1 kHz.
            holds(replay("--rate", "0.25"))
            until(lambda: '"state":"armed"' in monitor.text(), "a line during the replay", 20)
            until(lambda: '"state":"safe"' in monitor.text().splitlines()[-1], "the end of the replay", 20)
        told = [json.loads(line) for line in monitor.text().splitlines() if line.endswith("}")]
    armed = [one for one in told if one["state"] == "armed"]
    busy = max(armed, key=lambda one: one["samples_per_s"])
    equal((busy["input_source"], busy["nmt"]), ("the bus", "operational"))
    # 250, of which a second of a busy machine may hold a third more or less.
    assert 167 < busy["samples_per_s"] < 333 and 167 < busy["answers_per_s"] < 333, busy
    assert busy["frames_per_s"] > 750 and 0 < busy["bus_load"] < 1, busy
    moved = busy["quantities"]["velocity_rad_s"]
    assert moved["min"] < moved["max"], busy
    equal((busy["sync_lost"], busy["error_frames"], busy["faults"]), (0, 0, []))


@test
def what_is_refused_is_named():
    with Node():
        before = host_sim("params", "get")
        for item, words in {
            "compensator.scale=1.5": ["scale = 1.5", "at most 1"],
            "static_torque=0.5": ["static_torque = 0.5", "at least"],
            "coulomb_torque=-1": ["coulomb_torque = -1", "at least"],
            "motor.pole_pairs=0": ["pole_pairs"],
            "static_torque=much": ["static_torque", "much", "number"],
            "static_tork=1": ["static_tork", "no such parameter"],
            "missing.toml": ["missing.toml"],
        }.items():
            said = host_sim("params", "set", item, code=2)
            assert all(word in said for word in words), (item, said)
        equal(host_sim("params", "get"), before)
        cansend("000#0101")
        host_sim("params", "arm")
        for action in [("set", "compensator.scale=0.5"), ("save",), ("restore",)]:
            said = host_sim("params", *action, code=2)
            assert ARMED in said, said
        assert "state       armed" in host_sim("params", "status")
        host_sim("params", "disarm")
        equal(host_sim("params", "get"), before)
        host_sim("params", "set", "compensator.scale=0.5")


passed("node_replay")
