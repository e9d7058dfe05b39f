"""Logs in Arrow IPC, as a file (Feather) and as a stream, written by the two formats' specifications."""

import struct

from cases import CASES, EPOCH_NS, case, error
from joint import ROWS, RUNS, on_one_clock, rows

WHOLE = {"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0}


class Flatbuffer:
    """A flatbuffer whose objects follow the objects that refer to them."""

    def __init__(self, root):
        self.data = bytearray(4)
        self.patch(0, root(self))

    def align(self, size, offset=0):
        self.data += bytes(-(len(self.data) + offset) % size)

    def patch(self, place, target):
        struct.pack_into("<I", self.data, place, target - place)

    def table(self, *fields):
        """Fields are None, (format, value), or a function that writes an object and returns its place."""
        sizes = [4 if callable(field) else struct.calcsize(field[0]) if field else 0 for field in fields]
        places, end = [], 4
        for size in sizes:
            end += -end % size if size else 0
            places.append(end if size else 0)
            end += size
        vtable = struct.pack(f"<{2 + len(fields)}H", 4 + 2 * len(fields), end, *places)
        self.align(8, len(vtable))
        self.data += vtable
        start = len(self.data)
        self.data += struct.pack("<i", len(vtable)) + bytes(end - 4)
        for field, place in zip(fields, places):
            if callable(field):
                self.patch(start + place, field(self))
            elif field:
                struct.pack_into("<" + field[0], self.data, start + place, field[1])
        return start

    def string(self, text):
        self.align(4)
        start = len(self.data)
        self.data += struct.pack("<I", len(text)) + text.encode() + b"\0"
        return start

    def structs(self, form, values):
        self.align(8, 4)
        start = len(self.data)
        self.data += struct.pack("<I", len(values)) + b"".join(struct.pack("<" + form, *value) for value in values)
        return start

    def tables(self, writers):
        self.align(4)
        start = len(self.data)
        self.data += struct.pack("<I", len(writers)) + bytes(4 * len(writers))
        for at, write in enumerate(writers):
            self.patch(start + 4 + 4 * at, write(self))
        return start


# Type's number, its table's fields.
DOUBLE = (3, [("h", 2)])
TEXT = (5, [])
NANOSECONDS = (10, [("h", 3)])


def schema(columns):
    def field(name, kind):
        number, parameters = kind
        return lambda to: to.table(
            lambda to: to.string(name), ("?", True), ("B", number), lambda to: to.table(*parameters), None, lambda to: to.tables([])
        )
    fields = [field(name, kind) for name, (kind, _) in columns.items()]
    return lambda to: to.table(("h", 0), lambda to: to.tables(fields))


def padded(data):
    return data + bytes(-len(data) % 8)


def message(kind, header, body=b""):
    """Returns a message with its length, and the length of its metadata."""
    metadata = padded(bytes(Flatbuffer(lambda to: to.table(("h", 4), ("B", kind), header, ("q", len(body)))).data))
    return struct.pack("<Ii", 0xFFFFFFFF, len(metadata)) + metadata + body, 8 + len(metadata)


def batch(columns, of):
    body, buffers, nodes = b"", [], []

    def add(data):
        nonlocal body
        buffers.append((len(body), len(data)))
        body += padded(data)

    for kind, value in columns.values():
        cells = [value(row) for row in of]
        present = [cell is not None for cell in cells]
        nodes.append((len(cells), present.count(False)))
        bits = bytearray((len(cells) + 7) // 8)
        for at, is_present in enumerate(present):
            bits[at // 8] |= is_present << at % 8
        add(bytes(bits))
        if kind == TEXT:
            texts = [(cell or "").encode() for cell in cells]
            ends = [0]
            for text in texts:
                ends.append(ends[-1] + len(text))
            add(struct.pack(f"<{len(ends)}i", *ends))
            add(b"".join(texts))
        else:
            form = "d" if kind == DOUBLE else "q"
            add(struct.pack(f"<{len(cells)}{form}", *[cell or 0 for cell in cells]))
    header = lambda to: to.table(("q", len(of)), lambda to: to.structs("qq", nodes), lambda to: to.structs("qq", buffers))
    return (*message(3, header, body), len(body))


def stream(columns, sizes=(500, 700)):
    out, blocks, start = message(1, schema(columns))[0], [], 0
    for size in sizes:
        data, metadata_bytes, body_bytes = batch(columns, rows()[start : start + size])
        blocks.append((len(out), metadata_bytes, body_bytes))
        out += data
        start += size
    return out + struct.pack("<Ii", 0xFFFFFFFF, 0), blocks


def feather(columns):
    messages, blocks = stream(columns)
    mark = b"ARROW1\0\0"
    places = [(len(mark) + start, metadata, body) for start, metadata, body in blocks]
    footer = Flatbuffer(lambda to: to.table(
        ("h", 4), schema(columns), lambda to: to.structs("qi4xq", []), lambda to: to.structs("qi4xq", places)
    )).data
    return mark + messages + bytes(footer) + struct.pack("<i", len(footer)) + mark[:6]


JOINT = {
    "run": (TEXT, lambda r: f"trial {r['run']}"),
    "time_s": (DOUBLE, lambda r: r["t"]),
    "velocity_rad_s": (DOUBLE, lambda r: r["v"]),
    "torque_nm": (DOUBLE, lambda r: r["tau"]),
    "temperature_c": (DOUBLE, lambda r: 20.0 + r["run"] if r["i"] % 100 == 0 else None),
}
FILLED = "temperature_c is in 12 of 1200 rows"
case("a Feather file", {"log.feather": feather(JOINT)}, data=WHOLE, ranges={"temperature_c": [20, 22]}, expected_lines=[FILLED])
case("a stream of Arrow", {"log.arrows": stream(JOINT)[0]}, data=WHOLE, ranges={"temperature_c": [20, 22]}, expected_lines=[FILLED])
case(
    "a Feather file with time stamps",
    {"log.feather": feather({
        "stamp": (NANOSECONDS, lambda r: EPOCH_NS + round(1e9 * on_one_clock(r))),
        "velocity_rad_s": JOINT["velocity_rad_s"],
        "torque_nm": JOINT["torque_nm"],
    })},
    "--columns time_s=stamp",
    data=WHOLE,
    expected_lines=["times count from 2024-05-01 12:00:00 UTC"],
)
error(
    "a Feather file with other names",
    {"log.feather": feather({"t": JOINT["time_s"], "dq": JOINT["velocity_rad_s"], "tau": JOINT["torque_nm"]})},
    "log.feather: found only the columns t, dq, tau, expected time_s and velocity_rad_s (or velocity_m_s) and torque_nm (or "
    "force_n) in the header, or --columns time_s=t,velocity_rad_s=dq,torque_nm=tau",
)
error(
    "a Feather file with words for velocities",
    {"log.feather": feather(JOINT | {"velocity_rad_s": (TEXT, lambda r: "off" if r["i"] % 5 == 3 else repr(r["v"]))})},
    'log.feather: row 5, column velocity_rad_s: found "off", expected a finite number (240 of 1200 rows are bad, this is the '
    "first; at most 5 % may be; --bad-rows 20% leaves them out)",
)
error(
    "a Feather file that was cut off",
    {"log.feather": feather(JOINT)[:5000]},
    "log.feather: found an Arrow file without its end, expected an intact Arrow file, uncompressed or compressed with lz4 or zstd",
)

__all__ = ["CASES"]
