"""How the module behaves while it works: Ctrl-C, progress, threads, fork."""

import multiprocessing
import os
import pathlib
import re
import subprocess
import sys
import textwrap
import threading
import time

import pytest

import friction
from conftest import wait_until

#: Longest processor time from Ctrl-C to the exception, s. A wall time would depend on what else the machine does.
INTERRUPT_LIMIT_S = 0.2
#: Attempts to end in time: other programs may keep the thread that receives the signal from running during one of them.
ATTEMPTS = 3


@pytest.fixture(scope="module")
def long_log():
    """A log whose diagnosis takes much longer than the tests wait."""
    return friction.simulate("underwater-joint", hide=["pressure-coulomb"], seed=3, runs=12, seconds=10).data


def threads():
    return len(os.listdir("/proc/self/task"))


def test_progress_reports_stages_and_ends_work_by_an_exception(long_log):
    stages = []

    def progress(stage, share):
        stages.append(stage)
        assert share is None or 0 <= share <= 1
        if stage == "fitting the best hypotheses":
            raise RuntimeError("enough")

    begin = threads()
    with pytest.raises(RuntimeError, match="enough"):
        friction.diagnose(long_log, progress=progress)
    assert "checking the log" in stages
    # The kernel lists a thread for some microseconds after its end.
    wait_until(lambda: threads() <= begin, "end of the threads")


def test_progress_that_is_asked_for_needs_tqdm(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(ImportError, match="pip install tqdm"):
        friction.simulate("underwater-joint", runs=1, seconds=1, progress=True)
    assert friction.simulate("underwater-joint", runs=1, seconds=1).csv


# Sends Ctrl-C to itself from a second thread, so that both ends of the time are on the same clock: its processor's.
INTERRUPTED = """
    import os, signal, sys, threading, time
    import friction
    log = friction.simulate("underwater-joint", hide=["pressure-coulomb"], seed=3, runs=12, seconds=10).data
    threads = len(os.listdir("/proc/self/task"))
    sent = []
    def interrupt():
        time.sleep(AFTER_S)
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)
    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    try:
        friction.diagnose(log, threads=1)
    except KeyboardInterrupt:
        used = time.process_time()
        interrupter.join()
        end = time.monotonic() + 60
        while len(os.listdir("/proc/self/task")) > threads and time.monotonic() < end:
            time.sleep(0.01)
        more = len(os.listdir("/proc/self/task")) - threads
        before = time.process_time()
        time.sleep(0.3)
        print(used - sent[0], time.process_time() - before, more, flush=True)
"""


def interrupted(after_s):
    """Interrupts a diagnosis. Returns the processor time until it ended, that of the 0.3 s afterwards, both s, and the
    threads that remain."""
    code = textwrap.dedent(INTERRUPTED).replace("AFTER_S", str(after_s))
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0 and result.stdout, f"no KeyboardInterrupt: {result.stderr}"
    return map(float, result.stdout.split())


def test_interrupt_ends_a_diagnosis_in_time():
    for after_s in (0.05, 0.4, 1.5, 2.4):
        times = []
        while not times or times[-1] > INTERRUPT_LIMIT_S:
            assert len(times) < ATTEMPTS, (after_s, times)
            took, used, more = interrupted(after_s)
            assert used < 0.1 and more <= 0, "work goes on after the interrupt"
            times.append(took)


def test_lock_is_released_during_work(plain):
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.002)

    counter = threading.Thread(target=count)
    counter.start()
    friction.diagnose(plain.path, threads=1)
    stop.set()
    counter.join()
    assert counted[0] > 20, counted


def test_threads_in_parallel_give_equal_results(plain, diagnosis):
    results = {}

    def work(number):
        found = friction.diagnose(plain.path, threads=1)
        results[number] = (found.cause, found.gain)

    workers = [threading.Thread(target=work, args=(number,)) for number in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(results) == 2 and len(set(results.values())) == 1


def _cause_and_page(path):
    """Returns the cause and the page without the duration, which also depends on what else the machine does."""
    found = friction.diagnose(path, threads=1)
    page, count = re.subn(r"(with seed \d+) in [\d.]+ s", r"\1", found.html())
    assert count == 1, count
    return found.cause, page


def _in_child(path, queue):
    queue.put(_cause_and_page(path))


def test_fork_after_work_computes_and_writes_pages(plain):
    expected = _cause_and_page(plain.path)
    assert expected[0] == "pressure-coulomb"
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(plain.path, queue))
    child.start()
    assert queue.get(timeout=120) == expected
    child.join(timeout=30)
    assert child.exitcode == 0


def test_module_imports_without_other_packages():
    code = "import sys; sys.path.insert(0, PATH); import friction; assert 'numpy' not in sys.modules; print(friction.__version__)"
    place = repr(str(pathlib.Path(friction.__file__).parent.parent))
    command = [sys.executable, "-I", "-S", "-c", code.replace("PATH", place)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
