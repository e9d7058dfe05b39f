"""The emulated board: start, kill, log, raw serial line, and debugger access."""

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
    """A QEMU process. Its UART is a socket; its flash (optional) and its log are files."""

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
        # mux adds a queue of 32 bytes before the one-byte UART, which halves the cost of a byte. The escape
        # byte is one that does not exist. QEMU's messages go to stderr, the bytes of the log to stdout.
        with open(self.log, "ab") as log, open(self.errors, "wb") as errors:
            self.process = subprocess.Popen([
                *MACHINE, "-echr", "256",
                "-chardev", f"socket,id=can,path={self.socket},server=on,wait=off,mux=on", "-serial", "chardev:can",
                "-semihosting-config", arguments, "-gdb", f"unix:path={self.debug},server=on,wait=off",
                "-kernel", str(self.elf),
            ], stdin=subprocess.DEVNULL, stdout=log, stderr=errors)
        self.wait_for_answer()

    def wait_for_answer(self, limit_s=30):
        """Waits until the board answers on its serial line."""
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
        """Kills the process, like a power cut."""
        self.process.kill()
        self.process.wait()

    def is_alive(self):
        return self.process.poll() is None

    def cpu_s(self):
        """Returns the processor time used so far, s."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def jump(self, address):
        """Sets the program counter through the debugger and continues."""
        self.set_register(15, address)

    def set_register(self, number, value):
        """Sets a register of the core through the debugger and continues."""
        self.debug_commands(
            # QEMU writes single registers only for debuggers that have read the register list.
            (b"qXfer:features:read:target.xml:0,400", b""),
            (b"P%x=" % number + struct.pack("<I", value).hex().encode(), b"OK"),
        )

    def poke(self, address, data):
        """Writes memory through the debugger and continues."""
        self.debug_commands((b"M%x,%x:" % (address, len(data)) + data.hex().encode(), b"OK"))

    def symbol(self, name):
        """Returns the address of a symbol of the image."""
        table = subprocess.run(["arm-none-eabi-nm", str(self.elf)], stdout=subprocess.PIPE, text=True, check=True).stdout
        return next(int(words[0], 16) for line in table.splitlines() if (words := line.split())[-1] == name)

    def debug_commands(self, *commands):
        """Stops the core, sends debugger commands with their expected answers, and continues."""
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(10)
            link.connect(str(self.debug))

            def packet(text):
                link.sendall(b"+$" + text + b"#%02x" % (sum(text) & 0xFF))

            def answer():
                found = b""
                while True:
                    found += link.recv(4096)
                    # Stop replies arrive on request and also unsolicited.
                    for body in re.findall(rb"\$([^#]*)#..", found):
                        if not re.match(rb"[ST]\d", body):
                            return body

            packet(b"?")
            try:
                for command, expected in commands:
                    packet(command)
                    if expected not in answer():
                        raise RuntimeError(f"debugger command {command.decode()} is refused")
            finally:
                packet(b"D")
                answer()


class Line:
    """The raw serial line: text in, text out."""

    def __init__(self, path):
        self.link = socket.socket(socket.AF_UNIX)
        self.link.connect(str(path))
        self.text = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.close()

    def write(self, text, limit_s=60):
        """Writes the whole text and reads received text meanwhile."""
        self.link.settimeout(0)
        end = time.monotonic() + limit_s
        while text:
            try:
                text = text[self.link.send(text):]
            except BlockingIOError:
                if time.monotonic() > end:
                    raise RuntimeError("the board accepts no more bytes") from None
                self.read(0.01)

    def read(self, wait_s):
        """Reads for this time; returns False if nothing was received."""
        self.link.settimeout(wait_s)
        try:
            found = self.link.recv(65536)
        except (TimeoutError, BlockingIOError):
            return False
        self.text += found
        return bool(found)

    def ask(self, text, answer, limit_s=2):
        """Writes text and waits for a line that begins with `answer`; returns it, or None."""
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
        """Opens the bus from any state."""
        self.write(b"\r\rC\r")
        while self.read(0.2):
            pass
        return self.ask(b"S8\rO\r", b"", 1) is not None

    def sdo(self, request):
        """Sends an SDO request of eight bytes; returns the eight bytes of the answer, or None."""
        text = self.ask(sdo_line(request), b"t%03X8" % (SDO_ANSWER + NODE))
        return bytes.fromhex(text[5:21].decode()) if text else None


def sdo_line(request):
    return b"t%03X8%s\r" % (SDO_REQUEST + NODE, request.hex().upper().encode())


def write_request(index, place, value):
    """Returns an expedited download of up to four bytes."""
    return struct.pack("<BHB", 0x23 | (4 - len(value)) << 2, index, place) + value.ljust(4, b"\0")


def read_request(index, place):
    return struct.pack("<BHBI", 0x40, index, place, 0)
