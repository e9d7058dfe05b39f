"""Builds what the emulated board needs: the image, host-sim, and a decoder for the log."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TARGET_FOLDER = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
TARGET = "thumbv7em-none-eabihf"
# The version that matches the defmt of the image.
DECODER = "defmt-print@1.2.0"


def cargo_build(*arguments):
    """Builds a program and returns its path."""
    # The image does not contain lines below this level.
    os.environ.setdefault("DEFMT_LOG", "info")
    result = subprocess.run(["cargo", "build", "-q", "--message-format=json-render-diagnostics", *arguments], cwd=ROOT,
                            stdout=subprocess.PIPE, text=True)
    if result.returncode:
        sys.exit(f"tests/qemu: cargo build {' '.join(arguments)} failed")
    built = [json.loads(line).get("executable") for line in result.stdout.splitlines()]
    return pathlib.Path([path for path in built if path][-1]).resolve()


def build_firmware():
    """Returns the image for the emulated board, or the one that FIRMWARE_QEMU names."""
    given = os.environ.get("FIRMWARE_QEMU")
    return pathlib.Path(given).resolve() if given else cargo_build(
        "-p", "firmware", "--bin", "firmware", "--profile", "firmware", "--target", TARGET, "--no-default-features",
        "--features", "board-qemu,terms")


def build_host_sim():
    """Returns host-sim, or the program that HOST_SIM names."""
    given = os.environ.get("HOST_SIM")
    return pathlib.Path(given).resolve() if given else cargo_build("--workspace", "--bin", "host-sim")


def decoder(tools):
    """Returns the path of defmt-print, installed into `tools` if needed; None if it cannot be installed."""
    found = shutil.which("defmt-print") or shutil.which("defmt-print", path=str(tools / "bin"))
    if not found:
        # Only some hundred lines are decoded, so an optimised build is not worth its time.
        print("installing defmt-print (once)")
        subprocess.run(["cargo", "install", "-q", "--debug", "--locked", "--root", str(tools), DECODER], check=False)
        found = shutil.which("defmt-print", path=str(tools / "bin"))
    return found


def decode(program, elf, log):
    """Returns the decoded lines of the log."""
    with open(log, "rb") as file:
        result = subprocess.run([program, "-e", str(elf)], stdin=file, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                text=True, timeout=60)
    if result.returncode != 0:
        raise RuntimeError(f"defmt-print: {result.stdout[-400:]}")
    return result.stdout.splitlines()
