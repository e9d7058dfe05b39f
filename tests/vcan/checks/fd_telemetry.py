#!/bin/sh
# needs: host-sim eds python
# limit: 60
# Telemetry in one frame of CAN FD: on the bus, in host-sim, in logs of three formats, and by joint-fd.dbc.
''':'
exec "$PYTHON" "$0"
'''
import json
import logging
import math
import os
import socket
import struct

import can
import canopen
import cantools
from bench import FOLDER, HOST_SIM, INTERFACE, REPO, Candump, Node, Program, equal, frames, host_sim
from bench import passed, program_of_the_book, simulate, test, until

CLASSIC = cantools.database.load_file(REPO / "compensator-core" / "joint.dbc")
FLEXIBLE = cantools.database.load_file(REPO / "compensator-core" / "joint-fd.dbc")
FIXTURES = REPO / "host-sim" / "trace" / "fixtures"

SAMPLES = 300
# Of asm-generic/socket.h; Python has no name for it.
SO_RCVBUFFORCE = 33
PARTS = ("Answer", "Status", "Telemetry", "Motion", "Torque")


def replay(log, *arguments, bus=False):
    out = FOLDER / "fd-replay"
    host_sim("replay", log, "--out", out, "--period", "0.001", *arguments, bus=bus)
    return json.loads((out / "replay.json").read_text())


def switch_on():
    """Writes 2001h:9 to node 1, as a master does."""
    network = canopen.Network()
    network.connect(interface="socketcan", channel=INTERFACE)
    node = network.add_node(1, os.environ["JOINT_EDS"])
    program_of_the_book("explanation/unlock.py")["unlock"](node)
    node.sdo["operation"]["fd_telemetry"].raw = 1
    network.disconnect()


def check_decoded(data):
    """The whole frame by joint-fd.dbc, and each part by joint.dbc."""
    found = FLEXIBLE.decode_message(0x381, data, decode_choices=False)
    equal((found["Format"], found["SyncTime"]), (1, struct.unpack_from("<I", data, 4)[0]))
    for place, name in enumerate(PARTS):
        part = data[8 + 8 * place : 16 + 8 * place]
        equal(found[f"Has{name}"], data[1] >> place & 1, name)
        for signal, value in CLASSIC.get_message_by_name(name).decode(part, decode_choices=False).items():
            assert found[signal] == value or math.isnan(found[signal]) and math.isnan(value), (signal, found, value)
    return found


@test
def the_database_marks_the_frame_as_one_of_can_fd():
    message = FLEXIBLE.get_message_by_frame_id(0x381)
    equal((message.name, message.length, message.is_fd), ("FdTelemetry", 64, True))
    equal(FLEXIBLE.get_message_by_frame_id(0x181).is_fd, False)
    equal([message.frame_id for message in FLEXIBLE.messages], [message.frame_id for message in CLASSIC.messages])


@test
def telemetry_of_a_node_is_decoded_by_host_sim_and_cantools_beside_a_classic_reader():
    log = simulate("fd-telemetry", "--runs", "1", "--seconds", str(SAMPLES / 1000))
    watcher = [HOST_SIM, "monitor", "--bus", INTERFACE, "--json", "--seconds", "30"]
    with Node(), can.Bus(INTERFACE, "socketcan") as classic:
        switch_on()
        # Room for the whole session, as for candump.
        classic.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 8_000_000)
        with Candump() as seen, Program(watcher, FOLDER / "fd-monitor.out") as monitor:
            until(lambda: "{" in monitor.text(), "the monitor's first second", 20)
            recorded = FOLDER / "fd-recorded.log"
            report = replay(log, "--record", recorded, bus=True)
            told = lambda: [json.loads(line) for line in monitor.text().splitlines() if line.endswith("}")]
            until(lambda: any(line["samples_per_s"] for line in told()), "the monitor's next second", 20)
            lines = seen.log()
            received = list(iter(lambda: classic.recv(0), None))
    answers = report["answers"]
    equal((answers["equal"], answers["samples"], answers["telemetry_equal"]), (SAMPLES, SAMPLES, SAMPLES), report)
    telemetry = [data for _, data in frames(lines, "381")]
    equal(len(telemetry), SAMPLES)
    # A switched bit rate; newer kernels also flag that it is CAN FD.
    assert all(data[1] in "15" and len(data) == 2 + 128 for data in telemetry), telemetry[0]
    equal(frames(lines, "181", "281"), [], "no classic answers")
    # A reader without CAN FD has the classic frames of the bus, all of them, and no others.
    assert not any(message.is_fd or message.is_error_frame for message in received)
    identifiers = [message.arbitration_id for message in received]
    equal([identifiers.count(of) for of in (0x080, 0x481, 0x681, 0x181, 0x381)], [SAMPLES, SAMPLES, SAMPLES, 0, 0])
    found = [check_decoded(bytes.fromhex(data[2:])) for data in telemetry]
    equal([of["Sequence"] for of in found], list(range(SAMPLES)))
    # host-sim reads the same from candump's log, from its own record, and from these frames in ASC by python-can.
    own = FOLDER / "fd-candump.log"
    own.write_text("\n".join(lines) + "\n")
    vector = FOLDER / "fd-python-can.asc"
    with can.ASCWriter(vector) as writer:
        for message in can.CanutilsLogReader(own):
            message.channel = None
            writer.on_message_received(message)
    for log in (own, recorded, vector):
        answers = replay(log, "--rate", "max")["answers"]
        equal((answers["recorded"], answers["recorded_equal"]), (SAMPLES, SAMPLES), log)


@test
def logs_with_can_fd_are_the_same_to_python_can():
    def told(name):
        for message in can.LogReader(FIXTURES / name):
            flags = (message.is_extended_id, message.is_fd)
            yield round(1e6 * message.timestamp), message.arbitration_id, *flags, bytes(message.data)

    expected = list(told("telemetry.log"))
    equal(len(expected), 13)
    equal(list(told("telemetry.asc")), expected)
    # Its times count from the header's date.
    found = list(told("telemetry.trc"))
    equal([frame[1:] for frame in found], [frame[1:] for frame in expected])


logging.disable(logging.WARNING)
passed("fd_telemetry")
