"""What the processes of an engine run: a task without work, and a diagnosis with its processor time and memory."""

import time


def trivial(task):
    """A task without work, for the time that an engine takes itself."""
    return [{"joint": task.joint, "error": None}]


def peak_mb():
    """Returns the largest resident memory of this process, MB. It is that of the program since its start."""
    with open("/proc/self/status") as status:
        (line,) = [line for line in status if line.startswith("VmHWM:")]
    return int(line.split()[1]) * 1024 / 1e6


class Measured:
    """A task with its processor time and the memory of its process."""

    def __init__(self, function):
        self.function = function

    def __call__(self, task):
        begin = time.process_time()
        rows = self.function(task)
        return rows, time.process_time() - begin, peak_mb()


class MeasuredEngine:
    """An engine that keeps the processor time of each task, s, and the largest memory of a worker, MB."""

    def __init__(self, engine):
        self.engine = engine
        self.processor_s, self.peak_mb = {}, 0.0

    def run(self, function, tasks, retries):
        for task, found in self.engine.run(Measured(function), tasks, retries):
            if isinstance(found, BaseException):
                raise found
            rows, self.processor_s[task.joint], peak = found
            self.peak_mb = max(self.peak_mb, peak)
            yield task, rows

    def close(self):
        self.engine.close()
