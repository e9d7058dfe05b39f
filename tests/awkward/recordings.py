"""Logs that are not tables: MCAP recordings of ROS 2, and CAN traces of other tools without a joint."""

import json
import struct

from cases import CASES, EPOCH_NS, case, error
from joint import ROWS, RUNS, on_one_clock, rows

MAGIC = b"\x89MCAP0\r\n"


def text(value):
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def mcap(channels, messages):
    """Returns a file without chunks: channels as (topic, encoding, schema's name, encoding, text), messages as
    (channel, time in ns, bytes)."""
    out = MAGIC + record(1, text("ros2") + text("awkward"))
    for number, (topic, encoding, name, schema_encoding, schema) in enumerate(channels, 1):
        out += record(3, struct.pack("<H", number) + text(name) + text(schema_encoding) + text(schema))
        out += record(4, struct.pack("<HH", number, number) + text(topic) + text(encoding) + text(""))
    for sequence, (channel, time_ns, data) in enumerate(messages):
        out += record(5, struct.pack("<HIQQ", channel, sequence, time_ns, time_ns) + data)
    return out + record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def lz4_frame(data):
    """Returns an lz4 frame without compression: blocks of one sequence of literals."""
    out = bytes.fromhex("04224d18607073")
    for at in range(0, len(data), 1 << 20):
        literals = data[at : at + (1 << 20)]
        beyond = len(literals) - 15
        length = b"\xff" * (beyond // 255) + bytes([beyond % 255])
        block = b"\xf0" + length + literals
        out += struct.pack("<I", len(block)) + block
    return out + bytes(4)


def in_chunks(recording, compression="lz4", pack=lz4_frame):
    """Returns the recording with all its records in one compressed chunk."""
    records = recording[len(MAGIC) : -len(MAGIC)]
    # After the record of the header, before those of the end.
    begin, end = 9 + len(text("ros2") + text("awkward")), -(9 + 4 + 9 + 20)
    header, inside = records[:begin], records[begin:end]
    packed = pack(inside)
    chunk = struct.pack("<QQQI", 0, 1 << 63, len(inside), 0) + text(compression) + struct.pack("<Q", len(packed)) + packed
    return MAGIC + header + record(6, chunk) + record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


JOINT_STATE = """# This is a message that holds data to describe the state of a set of torque controlled joints.
std_msgs/Header header

string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
# Standard metadata.
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

TEMPERATURE = """float64 temperature
float64 variance
"""


class Cdr:
    """Little-endian CDR."""

    def __init__(self):
        self.data = b""

    def number(self, form, value):
        size = struct.calcsize(form)
        self.data += bytes(-len(self.data) % size) + struct.pack("<" + form, value)
        return self

    def string(self, value):
        data = value.encode() + b"\0"
        self.number("I", len(data))
        self.data += data
        return self

    def numbers(self, values):
        self.number("I", len(values))
        for value in values:
            self.number("d", value)
        return self

    def message(self):
        return b"\x00\x01\x00\x00" + self.data


def joint_state(row):
    stamp = EPOCH_NS + round(1e9 * on_one_clock(row))
    cdr = Cdr().number("i", stamp // 10**9).number("I", stamp % 10**9).string("base")
    cdr.number("I", 2).string("shoulder").string("elbow")
    cdr.numbers([0.0, row["q"]]).numbers([9.0, row["v"]]).numbers([9.0, row["tau"]])
    # Logged a jittering while after it was measured.
    return stamp + 3_000_000 + row["i"] * 7919 % 1_000_000, cdr.message()


def recording():
    messages = []
    for row in rows():
        time_ns, data = joint_state(row)
        messages.append((1, time_ns, data))
        if row["i"] % 20 == 0:
            warm = Cdr().number("d", 20 + row["i"] / ROWS).number("d", 0.0).message()
            messages.append((2, time_ns + 1_000_000, warm))
    return mcap(
        [
            ("/joint_states", "cdr", "sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE),
            ("/oil", "cdr", "demo/msg/Temperature", "ros2msg", TEMPERATURE),
        ],
        messages,
    )


STATES = "velocity_rad_s=/joint_states.velocity[elbow],torque_nm=/joint_states.effort[elbow]"
case(
    "joint states of ROS 2, and a thermometer beside",
    {"log.mcap": recording()},
    f"--columns {STATES},position_rad=/joint_states.position[elbow],temperature_c=/oil.temperature",
    expected_lines=[
        "times count from 2024-05-01 12:00:00 UTC",
        "temperature_c is in 60 of 1260 rows and is interpolated in time between its values",
        "60 rows hold neither velocity nor torque, only columns with separate time stamps",
    ],
    data={"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0},
    ranges={"position_rad": [-1, 1], "velocity_rad_s": [-2.9999, 3.0], "time_s": [0, 21.99]},
)
case(
    "joint states of ROS 2 in chunks packed by lz4",
    {"log.mcap": in_chunks(recording())},
    f"--columns {STATES},position_rad=/joint_states.position[elbow],temperature_c=/oil.temperature",
    expected_lines=["temperature_c is in 60 of 1260 rows and is interpolated in time between its values"],
    data={"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0},
    ranges={"position_rad": [-1, 1], "velocity_rad_s": [-2.9999, 3.0], "time_s": [0, 21.99]},
)
error(
    "joint states of ROS 2 without a word which",
    {"log.mcap": mcap([("/js", "cdr", "JointState", "ros2msg", JOINT_STATE)], [(1, *joint_state(rows(2, 1)[0]))])},
    "log.mcap: found only the columns %time, /js.header.stamp.sec, /js.header.stamp.nanosec, /js.position[shoulder], "
    "/js.position[elbow], /js.velocity[shoulder], /js.velocity[elbow], /js.effort[shoulder], /js.effort[elbow], expected "
    "velocity_rad_s (or velocity_m_s) and torque_nm (or force_n) in the header, or, for 2 joints (shoulder, elbow), --columns "
    "'velocity_rad_s=/js.velocity[#],torque_nm=/js.effort[#],position_rad=/js.position[#]'",
)


def as_json(row):
    fields = {"velocity_rad_s": row["v"], "torque_nm": row["tau"], "run": row["run"]}
    return 1, round(1e9 * on_one_clock(row)), json.dumps(fields).encode()


case(
    "JSON with the names of the contract in MCAP",
    {"log.mcap": mcap([("/joint", "json", "joint", "jsonschema", "{}")], [as_json(row) for row in rows()])},
    data={"runs": RUNS, "rows": RUNS * ROWS},
)
error(
    "an MCAP file that was cut off",
    {"log.mcap": recording()[:40]},
    "log.mcap: found MCAP file ended in the middle of a record, expected an intact MCAP file, uncompressed or compressed with zstd or lz4",
)

ASC = """date Wed May 1 12:00:00.000 pm 2024
base hex  timestamps absolute
Begin Triggerblock
   0.001234 1  244             Rx   d 8 00 00 80 3F 00 00 00 40
   0.002234 1  244             Rx   d 8 00 00 80 3F 00 00 00 40
End TriggerBlock
"""
error(
    "a Vector trace of something else",
    {"log.asc": ASC},
    "log.asc: found frames 244 (2) and no joint's velocity and torque, expected Motion (480 + node), Torque (680 + node) and "
    "the SYNC (080) of joint.dbc",
)
TRC = """;$FILEVERSION=2.1
;$COLUMNS=N,O,T,B,I,d,R,L,D
      1         1.234 DT 1      0244 Rx -  8    00 00 80 3F 00 00 00 40
      2         2.234 DT 1      0244 Rx -  8    00 00 80 3F 00 00
"""
error(
    "a PEAK trace with a line cut off",
    {"log.trc": TRC},
    'log.trc: row 4, column (all): found "2         2.234 DT 1      0244 Rx -  8  ..", expected a word for each '
    "byte of the stated length (1 of 2 rows are bad, this is the first; at most 5 % may be)",
)
# Events of CAN FD, of which the second has the length of no frame.
FD_ASC = """date Wed May 1 12:00:00.000 pm 2024
base hex  timestamps absolute
   0.001234 CANFD   1 Rx        381  Telemetry   1 0 9 12 01 02 03 04 05 06 07 08 09 0A 0B 0C  104812  132   323000
   0.002234 CANFD   1 Rx        381  Telemetry   1 0 9 13 01 02 03 04 05 06 07 08 09 0A 0B 0C  104812  132   323000
"""
FD_LENGTHS = "a length up to 8; of CAN FD also 12, 16, 20, 24, 32, 48 or 64 (TRC, column L: its code up to 15)"
error(
    "a Vector trace with a CAN FD frame of 13 bytes",
    {"log.asc": FD_ASC},
    f'log.asc: row 4, column (all): found "0.002234 CANFD   1 Rx        381  Teleme..", expected {FD_LENGTHS} (1 of 2 rows are bad, '
    "this is the first; at most 5 % may be)",
)
FD_TRC = """;$FILEVERSION=2.1
;$COLUMNS=N,O,T,B,I,d,R,L,D
      1         1.234 FB 1      0381 Rx -  9    01 02 03 04 05 06 07 08 09 0A 0B 0C
      2         2.234 FB 1      0381 Rx -  9    01 02 03 04 05 06 07 08 09 0A 0B
"""
error(
    "a PEAK trace with a CAN FD frame cut off",
    {"log.trc": FD_TRC},
    'log.trc: row 4, column (all): found "2         2.234 FB 1      0381 Rx -  9  ..", expected a word for each byte of the '
    "stated length (1 of 2 rows are bad, this is the first; at most 5 % may be)",
)

__all__ = ["CASES"]
