#!/usr/bin/env python3
# needs: host-sim
# limit: 300
"""can-utils and a joint: candump's logs are read, canplayer feeds a driver, cansend reads its objects."""
import functools
import json
import pathlib
import subprocess

from bench import FOLDER, INTERFACE, Candump, Node, Program, cansend, equal, frames, host_sim, passed
from bench import simulate, test, until

SAMPLES = 1000
ANSWERS = ("181", "281", "381")

# CAN FD of both kinds, a remote request, 29 bits, an error frame of the controller.
ODD = ["123##1" + "5A" * 12, "201##011223344", "201#R", "1FFFFFFF#DEADBEEF", "20000004#000C000000000000"]


def trace():
    return simulate("can-utils", "--runs", "1", "--seconds", str(SAMPLES / 1000))


def replay(log, *arguments, code=0, bus=False):
    """Replays in this process, or on the interface; gives the report."""
    out = FOLDER / "report"
    # Stamps of a log are when frames came; the period was 1 ms.
    host_sim("replay", log, "--out", out, "--period", "0.001", *arguments, code=code, bus=bus)
    return json.loads((out / "replay.json").read_text())


def receivers():
    path = pathlib.Path("/proc/net/can/rcvlist_all")
    return path.read_text().count(f" {INTERFACE} ")


def offers(option):
    usage = subprocess.run(["candump", "-h"], capture_output=True, text=True)
    return f"\n         {option} " in usage.stdout + usage.stderr


@functools.cache
def session():
    """A replay with odd frames in its midst, logged in every way candump has; the logs by name."""
    logs = {}
    with Node():
        before = receivers()
        all_of_it = ["0:0", "#FFFFFFFF"]
        extra = [option for option in ["-x", "-N"] if offers(option)]
        with (
            Program(["candump", "-l", "-r", "8000000", f"{INTERFACE},0:0,#FFFFFFFF"], FOLDER / "l.out") as to_file,
            Candump(filters=all_of_it) as plain,
            Candump(*extra, filters=all_of_it, name="extra.log") as with_extra,
        ):
            until(lambda: receivers() >= before + 3, "candump -l listens")
            cansend(*ODD)
            replay(trace(), bus=True)
            cansend(*ODD)
            logs["-L"] = plain.log()
            logs[" ".join(["-L", *extra])] = with_extra.log()
            # Its file is written when it ends: what it has not read by then, on a busy machine, is lost.
            until(to_file.sleeps, "candump -l has read all there is")
        (file,) = FOLDER.glob("candump-*.log")
        logs["-l"] = [line for line in file.read_text().splitlines() if "7F1#" not in line]
    # What this candump does not write, newer ones do: the way a frame went, and nanoseconds.
    logs["ways"] = [line + (" T" if "#" in line and " 0" in line[20:] else " R") for line in logs["-L"]]
    logs["nanoseconds"] = [line.replace(")", "789)", 1) for line in logs["-L"]]
    logs["lower case, blanks, CR"] = [f"  {line.lower()}\r" for line in logs["-L"]]
    return logs


def told(lines):
    """The frames of a log, without heartbeats: candump -l listens a little longer, and may hear one more."""
    return [frame for frame in (line.split()[2] for line in lines) if not frame.startswith("701#")]


@test
def logs_of_candump_in_all_their_forms_are_read():
    logs = session()
    equal(*(told(logs[form]) for form in ["-l", "-L"]), "-l and -L tell the same")
    for name, lines in logs.items():
        path = FOLDER / "form.log"
        path.write_text("\n".join(lines) + "\n")
        for number, differ in [("f32", 0), ("fixed", 1)]:
            report = replay(path, "--rate", "max", "--number", number)
            answers = report["answers"]
            assert report["holds"], (name, answers)
            equal((answers["samples"], answers["recorded"]), (SAMPLES, SAMPLES), name)
            # The log has the bits of the joint it was made with, which computed in f32.
            equal(answers["recorded_equal"] < SAMPLES, bool(differ), f"{name} {number}")
        _, damaged, flexible, remote, error, bad = report["passed_over"]
        equal((flexible, remote, error, damaged, bad), (4, 2, 2, 0, 0), name)


@test
def a_log_of_a_joint_is_replayed_to_a_joint():
    logs = session()
    with Node():
        path = FOLDER / "joint.log"
        path.write_text("\n".join(logs["-L"]) + "\n")
        report = replay(path, "--rate", "max", bus=True)
        equal(report["answers"]["recorded_equal"], SAMPLES)


@test
def what_is_no_log_is_refused():
    path = FOLDER / "no.log"
    for text, words in [
        ("vcan0  123   [8]  11 22 33 44 55 66 77 88\n" * 20, "no time stamps"),
        ("(1.000000) vcan0 123#11\n" * 20, "0 SYNCs"),
        ("", "0 SYNCs"),
    ]:
        path.write_text(text)
        said = host_sim("replay", path, code=2, bus=False)
        assert words in said and "no.log" in said, said


@test
def a_joint_fed_by_canplayer_gives_the_bits_of_the_core():
    for number, code in [("f32", 0), ("fixed", 1)]:
        expected_log = FOLDER / "expected.log"
        replay(trace(), "--rate", "max", "--number", number, "--record", expected_log)
        expected = frames(expected_log.read_text().splitlines(), *ANSWERS)
        equal(len(expected), 3 * SAMPLES)
        with Node(), Candump(filters=[f"{identifier}:7FF" for identifier in ANSWERS]) as seen:
            cansend(f"601#2F0120020{code}000000", "000#0101", "601#2F02200101000000")
            subprocess.run(["canplayer", "-I", str(trace())], check=True, timeout=60)
            # The joint may be behind: canplayer does not wait for it. Looked at without asking for more
            # frames, which on a busy machine would hold it up further.
            heard = lambda: sum(seen.text().count(f" {identifier}#") for identifier in ANSWERS)
            until(lambda: heard() >= len(expected), "every answer", 60)
            found = frames(seen.log(), *ANSWERS)
        equal(len(found), len(expected))
        differ = [place for place, pair in enumerate(zip(found, expected)) if pair[0] != pair[1]]
        assert not differ, (number, len(differ), found[differ[0]], expected[differ[0]])


@test
def objects_are_read_by_hand():
    with Node(), Candump(filters=["581:7FF"]) as seen:
        for request, answer in [
            ("4000100000000000", "4300100092010200"),  # device type: servo drive of CiA 402
            ("4018100200000000", "4318100243495246"),  # product code, "FRIC"
            ("4017100000000000", "4B171000E8030000"),  # heartbeat every 1000 ms
            ("40FF2F0000000000", "80FF2F0000000206"),  # no such object
            ("4018100900000000", "8018100911000906"),  # no such sub-index
            ("4002200100000000", "8002200101000106"),  # write only
            ("2300100000000000", "8000100002000106"),  # read only
            ("2317100000000000", "8017100012000706"),  # too long
            ("2B17100064000000", "6017100000000000"),  # written
            ("4017100000000000", "4B17100064000000"),  # and read
            ("6000000000000000", "8000000001000405"),  # a segment of nothing
        ]:
            before = len(frames(seen.log(), "581"))
            cansend(f"601#{request}")
            found = frames(seen.log(), "581")[before:]
            equal(found, [("581", answer)], request)
        # Neither too short, nor to somebody else, nor once it is stopped: no answer.
        before = len(seen.log())
        cansend("601#400010", "602#4000100000000000", "000#0201", "601#4000100000000000")
        equal(len(seen.log()), before)
        cansend("000#8001", "601#4000100000000000")
        equal(len(seen.log()), before + 1)


passed("can_utils")
