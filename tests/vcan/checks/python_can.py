#!/bin/sh
# needs: python
# limit: 60
# The interface as python-can sees it, against can-utils; the packages that other checks build on are there.
''':'
exec "$PYTHON" "$0"
'''
import os
import subprocess

import can
import canopen
import cantools

interface = os.environ["VCAN"]
tests = []


def fields(message):
    kind = (message.is_extended_id, message.is_remote_frame, message.is_error_frame, message.is_fd)
    return message.arbitration_id, *kind, message.bitrate_switch, message.dlc, bytes(message.data)


def test(function):
    tests.append(function)
    return function


@test
def every_kind_of_frame_from_cansend():
    with can.Bus(interface, "socketcan", fd=True) as bus:
        flexible = {"is_fd": True, "bitrate_switch": True}
        for text, identifier, extended, about in [
            ("123#DEADBEEF", 0x123, False, {"data": b"\xde\xad\xbe\xef"}),
            ("1FFFFFFF#", 0x1FFFFFFF, True, {}),
            ("123#R3", 0x123, False, {"is_remote_frame": True, "dlc": 3}),
            ("123##1" + "5A" * 64, 0x123, False, {"data": b"\x5a" * 64, "dlc": 64, **flexible}),
        ]:
            expected = can.Message(arbitration_id=identifier, is_extended_id=extended, **about)
            subprocess.run(["cansend", interface, text], check=True)
            heard = bus.recv(2.0)
            assert heard is not None, text
            assert fields(heard) == fields(expected), f"{text}: {fields(heard)}"


@test
def a_frame_sent_is_heard_by_another():
    with can.Bus(interface, "socketcan") as one, can.Bus(interface, "socketcan") as other:
        sent = can.Message(arbitration_id=0x201, is_extended_id=False, data=range(8))
        one.send(sent)
        heard = other.recv(2.0)
        assert heard is not None and heard.data == sent.data
        assert one.recv(0.05) is None, "own frames"


@test
def the_joints_database_is_read():
    path = os.path.join(os.environ["REPO"], "compensator-core", "joint.dbc")
    database = cantools.database.load_file(path)
    assert database.messages


@test
def canopen_opens_the_interface():
    network = canopen.Network()
    network.connect(interface, "socketcan")
    network.disconnect()


failed = 0
for function in tests:
    try:
        function()
        print(f"{function.__name__} ok")
    except Exception as error:  # a check that breaks has failed, whatever it broke with
        failed += 1
        print(f"{function.__name__} FAILED: {type(error).__name__}: {error}")
print(f"python_can: {len(tests) - failed} passed, {failed} failed")
raise SystemExit(failed > 0)
