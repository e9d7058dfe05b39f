"""A proxy on the serial line that changes one parameter of the driver, so that a replay must report a difference.

It forwards all lines. Just before the joint is armed, it changes one parameter through the driver's objects, with the
correct checksum, and hides the answers. The driver then differs from what the replay has written and read back.
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


class TamperingProxy(threading.Thread):
    """Accepts one connection at `path` and forwards it to `board`."""

    def __init__(self, path, board, place, value):
        super().__init__(daemon=True)
        self.board, self.place, self.value = board, place, value
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.has_tampered = False

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
                        if one == ARM and not self.has_tampered:
                            self.tamper(line)
                        line.write(one)

    def tamper(self, line):
        value = struct.pack("<f", self.value)
        staged = line.sdo(write_request(PARAMETERS, self.place, value))
        crc = line.sdo(read_request(COMMIT, 2))
        done = crc and line.sdo(write_request(COMMIT, 3, crc[4:8]))
        self.has_tampered = bool(staged and done and staged[0] == 0x60 and done[0] == 0x60)
        line.text = b""
