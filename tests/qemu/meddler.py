"""A man in the middle of a serial line who makes one side wrong, so that a replay has something to find.

Lines pass as they are, until the joint is armed. Just before, it changes one parameter in the driver, by the driver's own
objects and with the right checksum, and keeps the answers to itself: the driver then differs from what
the replay has just written and read back.
"""

import contextlib
import re
import select
import socket
import struct
import threading

from board import Line, read_request, sdo_line, write_request

STATE, PARAMETERS, COMMIT = 0x2002, 0x2023, 0x2027
ARM = sdo_line(write_request(STATE, 1, b"\x01"))


class Meddler(threading.Thread):
    """Listens at `path`, for one connection, and passes it on to `board`."""

    def __init__(self, path, board, place, value):
        super().__init__(daemon=True)
        self.board, self.place, self.value = board, place, value
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.has_meddled = False

    def run(self):
        host, _ = self.server.accept()
        with host, Line(self.board) as line, contextlib.suppress(ConnectionError):
            text = b""
            while True:
                ready, _, _ = select.select([host, line.link], [], [])
                if line.link in ready:
                    if not line.read(1):
                        return
                    host.sendall(line.text)
                    line.text = b""
                if host in ready:
                    found = host.recv(65536)
                    if not found:
                        return
                    *lines, text = re.split(rb"(?<=\r)", text + found)
                    for one in lines:
                        if one == ARM and not self.has_meddled:
                            self.meddle(line)
                        line.write(one)

    def meddle(self, line):
        value = struct.pack("<f", self.value)
        staged = line.sdo(write_request(PARAMETERS, self.place, value))
        crc = line.sdo(read_request(COMMIT, 2))
        done = crc and line.sdo(write_request(COMMIT, 3, crc[4:8]))
        self.has_meddled = bool(staged and done and staged[0] == 0x60 and done[0] == 0x60)
        line.text = b""
