"""What the checks here share: programs on the interface, and a count of tests. No check itself.

A node is `host-sim node` as a process of its own; what goes over the bus is seen by candump, which is no part
of this project. Whatever is started is ended with its `with` block.
"""
import os
import pathlib
import signal
import subprocess
import time
import traceback

INTERFACE = os.environ["VCAN"]
HOST_SIM = os.environ.get("HOST_SIM", "host-sim")
FOLDER = pathlib.Path(os.environ["TMPDIR"])
REPO = pathlib.Path(os.environ["REPO"])

# Sent where nothing else is: to know that somebody listens, and that all before it has come.
MARK = "7F1#"

tests = []


def test(function):
    """Makes a function a test; it has passed if it returns."""
    tests.append(function)
    return function


def passed(name):
    """Passes all tests and counts them; ends the program."""
    failed = 0
    for function in tests:
        begin = time.monotonic()
        try:
            function()
            print(f"{function.__name__} ok, {time.monotonic() - begin:.1f} s", flush=True)
        except Exception:  # a check that breaks has failed, whatever it broke with
            failed += 1
            print(f"{function.__name__} FAILED\n{traceback.format_exc()}", flush=True)
    print(f"{name}: {len(tests) - failed} passed, {failed} failed")
    raise SystemExit(failed > 0)


def equal(found, expected, about=""):
    assert found == expected, f"{about} found {found!r}, expected {expected!r}"


def host_sim(*arguments, code=0, bus=True):
    """Runs host-sim to its end; gives what it says (exit 2: its line of error)."""
    command = [HOST_SIM, *map(str, arguments), *(["--bus", INTERFACE] if bus else [])]
    result = subprocess.run(command, capture_output=True, text=True, timeout=90, cwd=FOLDER)
    said = f"{' '.join(command)}: exit {result.returncode}, expected {code}\n{result.stdout}\n{result.stderr}"
    assert result.returncode == code, said
    if code == 2:
        equal(len(result.stderr.strip().splitlines()), 1, f"an error is one line, {said}")
        return result.stderr
    return result.stdout


def simulate(name, *arguments):
    """A trace of the joint on its test stand: the path of its log."""
    folder = FOLDER / name
    if not (folder / "trace.log").exists():
        host_sim("simulate", "underwater-joint", "--out", folder, *arguments, bus=False)
    return folder / "trace.log"


def program_of_the_book(path):
    """The names of a program that the book gives for python-canopen."""
    names = {}
    exec((REPO / "docs" / "src" / path).read_text(), names)
    return names


def cansend(*frames):
    for frame in frames:
        subprocess.run(["cansend", INTERFACE, frame], check=True, timeout=10)


def until(condition, what, limit_s=10.0):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, f"{what}: not within {limit_s} s"
        time.sleep(0.01)


class Program:
    """A process that is ended with its block, by the signal of Ctrl-C."""

    def __init__(self, command, output):
        self.output = output
        with open(output, "wb") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, cwd=FOLDER)

    def text(self):
        return self.output.read_text(errors="replace")

    def end(self):
        """Ends it, if it has not ended; gives its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise

    def sleeps(self):
        """Whether it waits for something, as a reader does that has read all there is."""
        return pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "S"

    def cpu_s(self):
        """Processor time it has taken so far, s."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()


class Node(Program):
    """`host-sim node`, up and ready."""

    def __init__(self, *arguments):
        command = [HOST_SIM, "node", "--bus", INTERFACE, *map(str, arguments)]
        super().__init__(command, FOLDER / "node.out")
        until(lambda: "pre-operational" in self.text() or self.process.poll() is not None, "node up")
        assert self.process.poll() is None, self.text()

    def __exit__(self, *_):
        equal(self.end(), 0, f"a node ends well; it says {self.text()}")


class Candump(Program):
    """candump, listening; its log is whole once `log` is asked for it."""

    def __init__(self, *options, filters=(), name="candump.log"):
        """Of identifiers as in ["201:7FF"], or of all."""
        if filters:
            filters = [*filters, MARK.replace("#", ":7FF")]
        # Room for all of a session: what candump is late for is not lost.
        command = ["candump", "-L", "-r", "8000000", *options, ",".join([INTERFACE, *filters])]
        super().__init__(command, FOLDER / name)
        self.marked(1)

    def marked(self, least):
        def seen():
            if self.text().count(MARK) >= least:
                return True
            cansend(MARK)
            return False

        until(seen, f"candump: {self.text()[:200]}")

    def log(self):
        """Every line so far, without the marks, each as `(stamp) interface frame`."""
        self.marked(self.text().count(MARK) + 1)
        return [line for line in self.text().splitlines() if MARK not in line]


def frames(lines, *identifiers):
    """Data of frames of these identifiers in lines of a log, in their order, as (identifier, data)."""
    words = (line.split()[2].split("#", 1) for line in lines)
    return [(identifier, data) for identifier, data in words if identifier in identifiers]
