"""`friction.tune` on the simulated joint: equal to the command line, refusals, Ctrl-C, files."""

import json
import math
import subprocess
import sys
import textwrap

import conftest
import pandas
import pytest

import friction

SEED = 3
CAUSE = "pressure-coulomb"
#: The shortest session that the command accepts.
MINUTES = 1.0


@pytest.fixture(scope="module")
def lines():
    return []


@pytest.fixture(scope="module")
def tuning(lines):
    def progress(line, share):
        assert share is None
        lines.append(line)

    return friction.tune("loop", hide=[CAUSE], seed=SEED, minutes=MINUTES, progress=progress)


def test_to_dict_equals_command_line(tuning, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tune")
    command = ["tune", "--bus", "loop", "--motor", "--hide", CAUSE, "--seed", SEED, "--minutes", MINUTES, "--yes", "--json"]
    result = conftest.host_sim(folder, *command)
    assert result.returncode == (0 if tuning.saved else 1), result.stderr
    assert tuning.to_dict() == json.loads(result.stdout)


def test_properties_equal_the_document(tuning, lines):
    document = tuning.to_dict()
    assert (tuning.why_not is None) == tuning.saved == document["saved"]
    assert (tuning.cause, tuning.probability) == (document["cause"], document["probability"])
    assert list(tuning.not_learnt) == document["not_learnt"]
    assert [gain.quantity for gain in tuning.gains] == [gain["quantity"] for gain in document["gains"]]
    assert all(math.isnan(gain.gain) or gain.ci95[0] <= gain.gain <= gain.ci95[1] for gain in tuning.gains)
    assert tuning.diagnosis.cause == tuning.cause or tuning.cause in ("none", "unknown")
    assert lines[0].startswith("baseline") and len(lines) > 3
    assert all(one != other for one, other in zip(lines, lines[1:])), "a line was passed twice"
    assert tuning.cause in tuning._repr_html_() and "<script" not in tuning._repr_html_()


def test_write_gives_the_files_of_the_command(tuning, tmp_path):
    folder = tuning.write(tmp_path / "out")
    names = {file.name for file in folder.iterdir()}
    assert {"tune.html", "tune.json", "runs.parquet", "before.toml", "diagnosis.json"} <= names
    assert json.loads((folder / "tune.json").read_text()) == tuning.to_dict()
    written, rows = pandas.read_parquet(folder / "runs.parquet"), pandas.DataFrame(tuning.runs().to_dict())
    assert len(rows) > 20_000 and list(rows.columns) == list(written.columns)
    assert (rows["position_rad"] == written["position_rad"]).all()


def test_refused_joint_and_declined_question_are_errors_of_one_line(tmp_path):
    questions = []

    def decline(question):
        questions.append(question)
        return False

    with pytest.raises(friction.FrictionError, match="cancelled; nothing was changed"):
        friction.tune("loop", confirm=decline)
    assert "The joint will move by up to 0.4 rad" in questions[0]
    text = tmp_path / "motion.csv"
    text.write_text("time_s,position_rad\n0,0\n1,0.9\n")
    wrong = [
        (dict(bus="loop", range_rad=9.0, speed_rad_s=1.0), "range_rad=9 rad: the joint stands at"),
        (dict(bus="loop", minutes=0.5), "minutes=0.5: expected 1 to 60"),
        (dict(bus="loop", node=2), "node=2: expected 1"),
        (dict(bus="loop", hide=["gremlins"]), "hide: "),
        (dict(bus="no-such-bus0"), "bus no-such-bus0: "),
        (dict(bus="slcan:"), "expected loop"),
        (dict(bus="can0", hide=[CAUSE]), "hide: needs bus"),
        (dict(bus="loop", motion=text), r"expected at most 0.4 rad \(range_rad\)"),
        (dict(bus="loop", motion=([0, 1, 1], [0, 0.1, 0])), "motion: row 4, column time_s: found 1"),
        (dict(bus="loop", motion=([0, 1], [0])), "motion: found 2 times and 1 positions"),
        (dict(bus="loop", motion=tmp_path / "none.csv"), "none.csv: No such file"),
        (dict(bus="loop", key=tmp_path / "none.key"), "key .*none.key: "),
    ]
    for arguments, message in wrong:
        with pytest.raises(friction.FrictionError, match=message) as caught:
            friction.tune(**arguments)
        assert len(str(caught.value).splitlines()) == 1 and "--" not in str(caught.value)
    with pytest.raises(friction.FrictionError, match="nothing to undo"):
        friction.undo_tuning("loop")


def test_exception_in_progress_ends_the_session():
    def progress(line, share):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        friction.tune("loop", seed=SEED, progress=progress)


# Ctrl-C while the joint performs the baseline: the session's last line is that of the former parameters.
INTERRUPTED = """
    import os, signal
    import friction
    lines = []
    def progress(line, share):
        lines.append(line)
        if len(lines) == 1:
            os.kill(os.getpid(), signal.SIGINT)
    try:
        friction.tune("loop", minutes=60, progress=progress)
    except KeyboardInterrupt:
        print(lines[-1])
"""


def test_interrupt_raises_keyboard_interrupt():
    code = textwrap.dedent(INTERRUPTED)
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0 and result.stdout.strip() == "the former parameters are active", result.stderr
