"""The file with the cost of a fleet: its form, its goals, and what is cheap to measure of it."""

import resource
import sys

import conftest
import pytest

import friction
from friction.fleet import Task

SCALE = conftest.ROOT / "tests" / "scale"
sys.path.insert(0, str(SCALE))

import page  # noqa: E402
import tasks  # noqa: E402

#: Processor time of the local engine for a few tasks without work, s: the start of two processes.
START_LIMIT_S = 30


@pytest.fixture(scope="module")
def figures():
    return page.cells(page.FILE.read_text())


def lengths(figures):
    """Returns the rows of the file that stand for a length of the log."""
    return {row for row, column in figures if column == "mean (s)"}


def test_file_has_every_table_and_meets_the_goals(figures):
    text = page.FILE.read_text()
    assert page.violations(text) == [] and page.differences(text, text) == []
    assert len(lengths(figures)) == 2
    for engine in ("local", "Dask"):
        times = [figures[engine, f"{number:,} joints (s)"] for number in page.NUMBERS]
        assert all(time > 0 for time in times)
        assert figures[engine, "one joint of 2,000 (ms)"] == pytest.approx(times[-1] / 2, rel=0.02)
    assert "Extrapolated, not measured" in (conftest.ROOT / "docs/src/reference/fleet-scale.md").read_text()


def test_file_extrapolates_the_mean_cost(figures):
    for row in lengths(figures):
        hours = page.FLEET * figures[row, "mean (s)"] / 3600
        assert figures[row, "cores × time (h)"] == pytest.approx(hours, rel=0.02)
        assert figures[row, "on 64 cores (h)"] == pytest.approx(hours / 64, rel=0.02)


def test_violations_with_too_large_figures_name_them():
    text = page.FILE.read_text()
    lines = text.splitlines()
    (at,) = [at for at, line in enumerate(lines) if line.startswith("local\t")]
    lines[at] = lines[at].rsplit("\t", 1)[0] + "\t9,000"
    changed = "\n".join(lines)
    assert page.violations(changed) == ["memory (MB): 9000, goal at most 500"]
    assert any("local memory (MB)" in line for line in page.differences(changed, text))


def processor_s():
    """Processor time of this process and of those that it started and that have ended, s. It does not depend on other programs."""
    usages = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def test_local_engine_runs_tasks_without_work_in_time():
    engine = friction.fleet._engine("local", 2)
    begin = processor_s()
    found = list(engine.run(tasks.trivial, [Task(str(number), "", ()) for number in range(page.NUMBERS[0])], 2))
    assert len(found) == page.NUMBERS[0]
    assert processor_s() - begin < START_LIMIT_S
