"""The EDS of the joint and the texts of its refusals: examples of the firmware print them, and this module keeps them in target/."""

import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
# The selection of tests/run, so that nothing is built again.
SELECTED = os.environ.get("SELECTED", "-p firmware").split()


def printed(example, name):
    """Builds an example, writes what it prints to a file of target/, and returns its path. Ends this program if it cannot be built."""
    command = ["cargo", "build", "-q", "--locked", *SELECTED, "--example", example]
    if subprocess.run(command, cwd=ROOT).returncode != 0:
        raise SystemExit(f"{' '.join(command)} failed")
    program = TARGET / "debug" / "examples" / example
    text = subprocess.run([program], stdout=subprocess.PIPE, text=True, check=True).stdout
    path = TARGET / name
    # Another test may read it at this moment.
    new = TARGET / f"{name}.{os.getpid()}"
    new.write_text(text)
    new.replace(path)
    return path


def write():
    return printed("joint_eds", "joint.eds")


def write_refusals():
    return printed("refusals", "refusals.tsv")
