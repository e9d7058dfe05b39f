"""The emulated board: started, killed, its log, its serial line raw, and what a debugger can do to it."""

import os
import pathlib
import re
import socket
import struct
import subprocess
import time

MACHINE = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-monitor", "none"]
SDO_REQUEST, SDO_ANSWER, NODE = 0x600, 0x580, 1


class Board:
    """A QEMU process. Its UART is a socket, its flash a file (or none), its log another."""

    def __init__(self, elf, folder, name, flash=True):
        self.elf, self.name = elf, name
        self.socket, self.debug = folder / f"{name}.sock", folder / f"{name}.gdb"
        self.log, self.errors = folder / f"{name}.defmt", folder / f"{name}.err"
        self.flash = folder / f"{name}.flash" if flash else None
        self.process = None

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self):
        self.socket.unlink(missing_ok=True)
        arguments = "enable=on,target=native,arg=joint"
        if self.flash:
            arguments += f",arg=flash={self.flash}"
        # mux lays a queue of 32 bytes before the UART's one, which halves what a byte costs. Its
        # escape byte is one that does not exist.
        # Its own words go to the standard error, the log's bytes to the standard output.
        with open(self.log, "ab") as log, open(self.errors, "wb") as errors:
            self.process = subprocess.Popen([
                *MACHINE, "-echr", "256",
                "-chardev", f"socket,id=can,path={self.socket},server=on,wait=off,mux=on", "-serial", "chardev:can",
                "-semihosting-config", arguments, "-gdb", f"unix:path={self.debug},server=on,wait=off",
                "-kernel", str(self.elf),
            ], stdin=subprocess.DEVNULL, stdout=log, stderr=errors)
        self.await_answer()

    def await_answer(self, limit_s=30):
        """Waits until the board answers on its line."""
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            if self.process.poll() is not None:
                raise RuntimeError(f"QEMU ended: {self.errors.read_text(errors='replace')}")
            try:
                with Line(self.socket) as line:
                    if line.ask(b"\r\rV\r", b"V", 0.5):
                        return
            except OSError:
                pass
            time.sleep(0.1)
        raise RuntimeError(f"the board {self.name} does not answer in {limit_s} s")

    def kill(self):
        """As a power cut: nothing is asked."""
        self.process.kill()
        self.process.wait()

    def is_alive(self):
        return self.process.poll() is None

    def cpu_s(self):
        """Processor time it took, s."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def jump(self, address):
        """Sets the program counter, as a debugger does, and lets it run."""
        self.debugged(
            # QEMU writes single registers for debuggers that have asked which there are.
            (b"qXfer:features:read:target.xml:0,400", b""),
            (b"Pf=" + struct.pack("<I", address).hex().encode(), b"OK"),
        )

    def poke(self, address, data):
        """Writes memory, as a debugger does, and lets it run."""
        self.debugged((b"M%x,%x:" % (address, len(data)) + data.hex().encode(), b"OK"))

    def symbol(self, name):
        """Address of a symbol of the image."""
        table = subprocess.run(["arm-none-eabi-nm", str(self.elf)], stdout=subprocess.PIPE, text=True, check=True).stdout
        return next(int(words[0], 16) for line in table.splitlines() if (words := line.split())[-1] == name)

    def debugged(self, *commands):
        """Stops it, gives a debugger's commands, each with what its answer must hold, and lets it run."""
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(10)
            link.connect(str(self.debug))

            def packet(text):
                link.sendall(b"+$" + text + b"#%02x" % (sum(text) & 0xFF))

            def answer():
                found = b""
                while True:
                    found += link.recv(4096)
                    # That it has stopped it says when it is asked and also by itself.
                    for body in re.findall(rb"\$([^#]*)#..", found):
                        if not re.match(rb"[ST]\d", body):
                            return body

            packet(b"?")
            try:
                for command, expected in commands:
                    packet(command)
                    if expected not in answer():
                        raise RuntimeError(f"the debugger's {command.decode()} is refused")
            finally:
                packet(b"D")
                answer()


class Line:
    """The serial line, raw: text in, text out."""

    def __init__(self, path):
        self.link = socket.socket(socket.AF_UNIX)
        self.link.connect(str(path))
        self.text = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.close()

    def write(self, text, limit_s=60):
        """Writes all of it, and reads meanwhile what comes."""
        self.link.settimeout(0)
        end = time.monotonic() + limit_s
        while text:
            try:
                text = text[self.link.send(text):]
            except BlockingIOError:
                if time.monotonic() > end:
                    raise RuntimeError("the board takes no more bytes") from None
                self.read(0.01)

    def read(self, wait_s):
        """Reads what comes in this time; `False` once nothing did."""
        self.link.settimeout(wait_s)
        try:
            found = self.link.recv(65536)
        except (TimeoutError, BlockingIOError):
            return False
        self.text += found
        return bool(found)

    def ask(self, text, answer, limit_s=2):
        """Writes, and waits until a line that begins with `answer` comes; gives it, or None."""
        self.text = b""
        self.write(text)
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            found = re.search(rb"(?:^|[\r\x07])(" + answer + rb"[^\r\x07]*)\r", self.text)
            if found:
                return found[1]
            self.read(0.05)
        return None

    def open(self):
        """Opens the bus, whatever was before."""
        self.write(b"\r\rC\r")
        while self.read(0.2):
            pass
        return self.ask(b"S8\rO\r", b"", 1) is not None

    def sdo(self, request):
        """One object request of eight bytes; gives the answer's eight, or None."""
        text = self.ask(sdo_line(request), b"t%03X8" % (SDO_ANSWER + NODE))
        return bytes.fromhex(text[5:21].decode()) if text else None


def sdo_line(request):
    return b"t%03X8%s\r" % (SDO_REQUEST + NODE, request.hex().upper().encode())


def write_request(index, place, value):
    """An expedited download of up to four bytes."""
    return struct.pack("<BHB", 0x23 | (4 - len(value)) << 2, index, place) + value.ljust(4, b"\0")


def read_request(index, place):
    return struct.pack("<BHBI", 0x40, index, place, 0)
