"""Builds what the emulated board needs: the image, host-sim, and a decoder for the log."""

import os
import pathlib
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "image"))

import images
from images import ROOT, TARGET_FOLDER

# The version that matches the defmt of the image.
DECODER = "defmt-print@1.2.0"


def build_firmware(name="qemu"):
    """Returns the image of this board, or the one that FIRMWARE_QEMU names."""
    given = os.environ.get("FIRMWARE_QEMU") if name == "qemu" else None
    return pathlib.Path(given).resolve() if given else images.build_driver(name)


def build_host_sim():
    """Returns host-sim, or the program that HOST_SIM names."""
    given = os.environ.get("HOST_SIM")
    return pathlib.Path(given).resolve() if given else images.cargo("build", "--workspace", "--bin", "host-sim")["host-sim"]


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
