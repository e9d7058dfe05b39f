#!/bin/sh
# needs: host-sim eds python
# limit: 180
# Python's CAN tools and a joint: python-can and cantools with joint.dbc, canopen with joint.eds.
''':'
exec "$PYTHON" "$0"
'''
import csv
import math
import os
import struct
import time

import can
import canopen
import cantools
from bench import FOLDER, INTERFACE, REPO, Candump, Node, equal, host_sim, passed, program_of_the_book, simulate, test, until

DBC = cantools.database.load_file(REPO / "compensator-core" / "joint.dbc")
EDS = os.environ["JOINT_EDS"]

LOCKED = 0x0601_0000
READ_ONLY, TOO_LONG, TOO_SHORT = 0x0601_0002, 0x0607_0012, 0x0607_0013
VALUE, HIGH, LOW, NOT_GRANTED, NOT_ARMED = 0x0609_0030, 0x0609_0031, 0x0609_0032, 0x0800_0020, 0x0800_0022


unlock = program_of_the_book("explanation/unlock.py")["unlock"]
reasons = program_of_the_book("reference/refusal.py")


def float32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def same(found, expected):
    return found == expected or (math.isnan(found) and math.isnan(expected))


class Joint:
    """A node, and canopen's view of it. It is unlocked, unless asked otherwise."""

    def __init__(self, *arguments, unlocked=True):
        self.unlocked = unlocked
        self.process = Node(*arguments)
        self.network = canopen.Network()
        self.network.connect(interface="socketcan", channel=INTERFACE)
        self.node = self.network.add_node(1, EDS)

    def __enter__(self):
        if self.unlocked:
            unlock(self.node)
        return self.node

    def __exit__(self, *exception):
        self.network.disconnect()
        self.process.__exit__(*exception)


def refused(code, write, *arguments):
    try:
        write(*arguments)
    except canopen.SdoAbortedError as error:
        equal(f"{error.code:08X}", f"{code:08X}", arguments)
        return
    raise AssertionError(f"{arguments} were taken, expected {code:08X}")


def put(variable, value):
    variable.raw = value


def restart(node):
    """Over the bus; over when it says that it is there, which may be before anybody waits for it."""
    begun = []
    node.network.subscribe(0x701, lambda _, data, __: begun.append(data[0]))
    node.nmt.state = "RESET"
    until(lambda: 0 in begun, "the boot-up message")


def commit(node):
    node.sdo["commit"]["commit"].raw = node.sdo["commit"]["staged_crc"].raw


@test
def a_trace_is_decoded_to_the_data_it_was_made_of():
    log = simulate("decoded", "--runs", "1", "--seconds", "1")
    columns = {
        "velocity_rad_s": ("Motion", "Velocity"),
        "position_rad": ("Motion", "Position"),
        "torque_nm": ("Torque", "MeasuredTorque"),
        "radial_force_n": ("Seal", "RadialForce"),
        "pressure_diff_pa": ("Seal", "PressureDiff"),
    }
    with open(log.parent / "data.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    now, place, entries = {}, 0, set()
    for message in can.LogReader(log.rename(log.with_suffix(".log"))):
        found = DBC.decode_message(message.arbitration_id, message.data)
        name = DBC.get_message_by_frame_id(message.arbitration_id).name
        if name == "Entry":
            entries.add(str(found["SubIndex"]))
        now[name] = found
        if name == "Sync":
            equal(found["Counter"], place % 240 + 1)
            row = rows[place]
            for column, (frame, signal) in columns.items():
                if column in row:
                    # The table is rounded to its digits, the frame to those of a float.
                    found, expected = now[frame][signal], float(row[column])
                    most = 0.51 * 10.0 ** -len(row[column].partition(".")[2]) + 1.2e-7 * abs(expected)
                    assert abs(found - expected) <= most, (place, column, found, expected)
            place += 1
    equal(place, len(rows))
    equal(entries, {"run", "next sequence", "joint kind"})


@test
def a_joint_is_fed_and_understood_with_the_database():
    with Joint() as node, can.Bus(INTERFACE, "socketcan") as bus:
        node.nmt.state = "OPERATIONAL"
        node.sdo["state"]["request"].raw = 1

        def send(name, **signals):
            message = DBC.get_message_by_name(name)
            data = message.encode(signals)
            equal(len(data), message.length)
            bus.send(can.Message(arbitration_id=message.frame_id, data=data, is_extended_id=False))

        def answers():
            found, end = {}, time.monotonic() + 5
            while not {"Answer", "Status", "Telemetry"} <= found.keys():
                message = bus.recv(1.0)
                assert message is not None and time.monotonic() < end, found
                if message.arbitration_id in (0x181, 0x281, 0x381):
                    name = DBC.get_message_by_frame_id(message.arbitration_id).name
                    found[name] = DBC.decode_message(message.arbitration_id, message.data)
                    if name != "Status":
                        # As the database has it, and as the bytes are.
                        equal(struct.pack("<ff", *found[name].values()), bytes(message.data))
            return found

        for sample in range(300):
            velocity = 0.5 * math.sin(0.05 * sample)
            send("Motion", Velocity=velocity, Position=math.nan)
            send("Torque", MeasuredTorque=2.0 * velocity, LoadTorque=math.nan)
            send("Seal", RadialForce=30.0, PressureDiff=2.5e5)
            send("Surroundings", Temperature=12.5, Auxiliary=math.nan)
            send("Command", CurrentCommand=0.25, VelocityReference=-0.1234, CommandCounter=sample % 256)
            send("Sync", Counter=sample % 240 + 1)
            found = answers()
            equal(found["Status"]["Sequence"], sample)
            equal(str(found["Status"]["Disabled"]), "no")
            residual = float32(float32(2.0 * velocity) - found["Answer"]["FrictionTorque"])
            equal(found["Telemetry"]["ResidualTorque"], residual)
        inputs = node.sdo["inputs"]
        for name, expected in {
            "velocity_rad_s": float32(velocity),
            "torque_nm": float32(2.0 * velocity),
            "radial_force_n": 30.0,
            "pressure_diff_pa": 2.5e5,
            "temperature_c": 12.5,
            "command_current_a": 0.25,
            "auxiliary": math.nan,
        }.items():
            assert same(inputs[name].raw, expected), (name, inputs[name].raw)
        word = inputs["command_velocity_and_counter"].raw
        equal((word & 0xFF_FFFF, word >> 24), (-1234 & 0xFF_FFFF, 299 % 256))
        node.sdo["state"]["request"].raw = 0
        send("Sync", Counter=300 % 240 + 1)
        found = answers()
        equal(str(found["Status"]["Disabled"]), "yes")
        # A quantity nobody can have is told as a flag.
        node.sdo["state"]["request"].raw = 1
        send("Motion", Velocity=1e9, Position=0.0)
        send("Sync", Counter=301 % 240 + 1)
        equal(str(answers()["Status"]["VelocityInvalid"]), "yes")


# What is another for a joint on its sensors, which is the EDS's, and for one in HIL: the source, who says Motion and
# Torque, and at which SYNC a frame goes.
OF_SOURCE = {(0x2001, 1), (0x1404, 1), (0x1405, 1), (0x1803, 1), (0x1804, 1),
             *((0x1800 + number, 2) for number in range(6))}


@test
def identity_and_state_are_those_of_the_eds():
    with Joint("--seconds", "60") as node:
        equal(node.sdo["device_type"].raw, 0x00020192)
        identity = node.sdo["identity"]
        for name in ("vendor_id", "product_code", "revision_number"):
            equal(identity[name].raw, node.object_dictionary["identity"][name].default, name)
        equal(identity["product_code"].raw, 0x46524943)
        equal(node.sdo["device_name"].raw, "friction-compensated joint driver")
        equal(node.sdo["software_version"].raw, node.object_dictionary["software_version"].default)
        # Every object of the file is there, and its default is what a fresh driver says.
        read = floats = 0
        for object in node.object_dictionary.values():
            variables = [object] if isinstance(object, canopen.objectdictionary.ODVariable) else object.values()
            for variable in variables:
                if not variable.readable or variable.index == 0x1003:
                    continue
                if (variable.index, variable.subindex) in OF_SOURCE:
                    continue
                if variable.data_type == canopen.objectdictionary.datatypes.REAL32 and hasattr(variable, "default_raw"):
                    # A float is its bits there, as Lely's tools want it; python-canopen takes decimal numbers alone.
                    bits = int.from_bytes(node.sdo.upload(variable.index, variable.subindex), "little")
                    equal(bits, int(variable.default_raw, 16), variable.name)
                    floats += 1
                    continue
                if variable.default is None:
                    continue
                value = node.sdo.upload(variable.index, variable.subindex)
                equal(variable.decode_raw(value), variable.default, variable.name)
                read += 1
        assert read > 50 and floats > 100, (read, floats)


@test
def heartbeats_tell_the_state_of_the_network():
    with Joint() as node:
        node.sdo["producer_heartbeat_time_ms"].raw = 50
        equal(node.nmt.wait_for_heartbeat(5), "PRE-OPERATIONAL")
        for state in ("OPERATIONAL", "STOPPED", "PRE-OPERATIONAL", "OPERATIONAL"):
            node.nmt.state = state
            until(lambda: node.nmt.wait_for_heartbeat(5) == state, state)
        with Candump(filters=["701:7FF"]) as seen:
            time.sleep(1.0)
            stamps = [float(line.split()[0].strip("()")) for line in seen.log()]
        period = (stamps[-1] - stamps[0]) / (len(stamps) - 1)
        # A tick late is no error, and a guest may stand still for a while.
        assert 0.049 < period < 0.1, (period, len(stamps))
        restart(node)


@test
def parameters_are_staged_and_committed_by_name():
    with Joint() as node:
        parameters, active = node.sdo["parameters"], node.sdo["commit"]["active_crc"].raw
        equal(parameters["static_torque"].raw, 1.0)
        parameters["static_torque"].raw = 1.25
        node.sdo["compensator"]["scale"].raw = 0.5
        equal((parameters["static_torque"].raw, node.sdo["commit"]["active_crc"].raw), (1.25, active))
        commit(node)
        assert node.sdo["commit"]["active_crc"].raw != active
        # As one block, in segments both ways.
        record = node.sdo.upload(0x2027, 5)
        assert len(record) > 100, len(record)
        node.sdo["compensator"]["scale"].raw = 0.25
        commit(node)
        node.sdo.download(0x2027, 5, record)
        equal(node.sdo["compensator"]["scale"].raw, 0.5)
        commit(node)
        equal(node.sdo.upload(0x2027, 5), record)
        # One tool at a time: a server has one channel, and both would hear its answers.
        node.network.disconnect()
        equal(host_sim("params", "get", "static_torque", "compensator.scale").split(),
              ["static_torque", "=", "1.25", "compensator.scale", "=", "0.5"])


def download_blocks(node, value):
    with node.sdo.open(0x2027, 5, "wb", size=len(value), block_transfer=True) as object:
        object.write(value)


def upload_blocks(node, index, subindex):
    with node.sdo.open(index, subindex, "rb", buffering=0, block_transfer=True) as object:
        return object.read()


@test
def records_travel_in_blocks():
    with Joint() as node:
        record, scale = node.sdo.upload(0x2027, 5), node.sdo["compensator"]["scale"].raw
        equal(upload_blocks(node, 0x2027, 5), record)
        node.sdo["compensator"]["scale"].raw = 0.25
        changed = upload_blocks(node, 0x2027, 5)
        assert changed != record
        download_blocks(node, record)
        equal(node.sdo["compensator"]["scale"].raw, scale)
        # Three blocks arrive, and the record is refused for its content.
        refused(VALUE, download_blocks, node, bytes(1850))
        refused(0x0504_0005, download_blocks, node, bytes(2000))
        refused(0x0602_0000, upload_blocks, node, 0x3000, 0)
        equal(upload_blocks(node, 0x2027, 5), record)


@test
def frames_of_can_fd_on_the_bus_are_ignored():
    with Joint() as node, can.Bus(INTERFACE, "socketcan", fd=True) as bus:
        record = node.sdo.upload(0x2027, 5)
        for identifier in (0x081, 0x201, 0x601, 0x7E5) * 20:
            message = can.Message(arbitration_id=identifier, data=bytes(64), is_extended_id=False, is_fd=True)
            bus.send(message)
            equal(node.sdo["producer_heartbeat_time_ms"].raw, 1000)
        equal(upload_blocks(node, 0x2027, 5), record)
        equal(node.sdo["frame_counters"][6].raw, 0, "of a wrong length")


@test
def a_blank_joint_gets_its_number_by_fastscan():
    with Joint() as node:
        network, lss = node.network, node.network.lss
        begun = []
        network.subscribe(0x721, lambda _, data, __: begun.append(data[0]))
        lss.send_switch_state_global(lss.WAITING_STATE)
        found, identity = lss.fast_scan()
        assert found, "one without a number"
        equal(list(identity[:2]), [0, 0x46524943])
        equal(lss.inquire_node_id(), 255)
        equal(lss.inquire_lss_address(0x5B), 0x46524943)
        lss.configure_node_id(33)
        lss.store_configuration()
        lss.send_switch_state_global(lss.WAITING_STATE)
        until(lambda: 0 in begun, "the boot-up message of node 33")
        other = network.add_node(33, EDS)
        equal(other.sdo["operation"]["node"].raw, 33)
        found, _ = lss.fast_scan()
        assert not found, "none is left"


def last_reason(node):
    texts = reasons["texts"](os.environ["REFUSALS"])
    return reasons["reason"](node.sdo.upload(0x2028, 0), texts)


@test
def what_is_refused_has_the_code_of_its_reason():
    with Joint() as node:
        before = node.sdo["commit"]["active_crc"].raw
        parameters, scale = node.sdo["parameters"], node.sdo["compensator"]["scale"]
        refused(HIGH, put, parameters["coulomb_torque"], 1e9)
        refused(LOW, put, parameters["coulomb_torque"], -1.0)
        refused(VALUE, put, parameters["coulomb_torque"], math.nan)
        refused(VALUE, put, scale, 1.5)
        assert last_reason(node).startswith("scale = 1.5: must be at most 1"), "in words"
        refused(READ_ONLY, node.sdo.download, 0x1000, 0, bytes(4))
        refused(READ_ONLY, node.sdo.download, 0x2005, 1, bytes(4))
        refused(TOO_LONG, node.sdo.download, 0x1017, 0, bytes(4))
        refused(TOO_SHORT, node.sdo.download, 0x2022, 1, bytes(2))
        refused(TOO_SHORT, node.sdo.download, 0x2027, 6, bytes(8))
        # Longer than the longest object, the record of a network: there is no room for it. A shorter one is no record.
        refused(0x0504_0005, node.sdo.download, 0x2027, 5, bytes(2000))
        refused(VALUE, node.sdo.download, 0x2027, 5, bytes(1000))
        refused(0x0602_0000, node.sdo.upload, 0x3000, 0)
        refused(0x0609_0011, node.sdo.upload, 0x1018, 9)
        refused(0x0601_0001, node.sdo.upload, 0x2027, 3)
        record = bytearray(node.sdo.upload(0x2027, 5))
        record[20] ^= 1
        refused(VALUE, node.sdo.download, 0x2027, 5, bytes(record))
        refused(NOT_GRANTED, put, node.sdo["commit"]["commit"], 1)
        refused(NOT_GRANTED, put, node.sdo["store_parameters"]["save_all"], 1)
        # Each by itself is legal, together they are not.
        parameters["coulomb_torque"].raw = 3.0
        refused(VALUE, commit, node)
        assert "static_torque = 1: must be at least 3" in last_reason(node)
        node.sdo["commit"]["discard"].raw = 1
        node.nmt.state = "OPERATIONAL"
        node.sdo["state"]["request"].raw = 1
        equal(node.sdo["state"]["state"].raw, 1)
        for write in [(scale, 0.5), (node.sdo["operation"]["number"], 1), (node.sdo["commit"]["discard"], 1)]:
            refused(NOT_ARMED, put, *write)
        refused(NOT_ARMED, node.store)
        node.sdo["state"]["request"].raw = 0
        equal(node.sdo["commit"]["active_crc"].raw, before)
        # Fourteenth of the counters: requests refused.
        assert node.sdo["frame_counters"][14].raw >= 20


@test
def a_locked_joint_is_unlocked_as_the_book_says():
    with Joint(unlocked=False) as node:
        window = node.sdo["following_error_time_out"]
        refused(LOCKED, put, window, 5)
        refused(LOCKED, node.store)
        assert last_reason(node).startswith("the joint is locked")
        unlock(node)
        equal(node.sdo["access"]["level"].raw, 1)
        window.raw = 5
        node.sdo["access"]["lock"].raw = 1
        refused(LOCKED, put, window, 6)
        equal(window.raw, 5)


@test
def store_and_restore_are_the_packages_own():
    flash = FOLDER / "python.flash"
    with Joint("--flash", flash) as node:
        node.sdo["compensator"]["scale"].raw = 0.5
        commit(node)
        node.store()
        restart(node)
        equal(node.sdo["compensator"]["scale"].raw, 0.5)
    with Joint("--flash", flash) as node:
        equal(node.sdo["compensator"]["scale"].raw, 0.5)
        node.restore()
    with Joint("--flash", flash) as node:
        equal(node.sdo["compensator"]["scale"].raw, float32(0.9))


@test
def emergencies_are_received_and_kept():
    with Joint() as node:
        # It starts on default parameters, and says so.
        node.nmt.state = "RESET"
        until(lambda: node.emcy.log, "an emergency")
        assert node.emcy.log[0].code != 0, node.emcy.log
        # Whoever is awaited and stays away is an error, and disarms.
        node.sdo["consumer_heartbeat_time"]["awaited_heartbeat"].raw = 9 << 16 | 200
        node.nmt.state = "OPERATIONAL"
        heartbeat = can.Message(arbitration_id=0x709, data=[5], is_extended_id=False)
        with can.Bus(INTERFACE, "socketcan") as bus:
            bus.send(heartbeat)
        node.sdo["state"]["request"].raw = 1
        equal(node.sdo["state"]["state"].raw, 1)
        until(lambda: node.emcy.log[-1].code == 0x8130, "the emergency of a lost heartbeat")
        lost = node.emcy.log[-1]
        assert node.sdo["state"]["state"].raw != 1
        assert lost.register & 0x10, lost.register
        errors = node.sdo["predefined_error_field"]
        equal(errors[1].raw & 0xFFFF, 0x8130)


passed("python_tools")
