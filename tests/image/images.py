"""The images of the firmware: each is built once, into target/images/NAME/, and all tests read them there."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TARGET_FOLDER = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
IMAGES_FOLDER = TARGET_FOLDER / "images"
TARGET = "thumbv7em-none-eabihf"

# Name of each image or set of images: its package, its programs and its features.
IMAGES = {
    # What ships: the images of both slots. The boot program belongs to them and is built for size.
    "stm32g474": ("firmware", ["firmware", "firmware-b", "boot"], "board-stm32g474,terms"),
    # For the second wiring of that board.
    "stm32g474-second": ("firmware", ["firmware"], "board-stm32g474,terms,wiring-second"),
    # The compact node on a chip with a quarter of the flash and of the RAM.
    "esc1": ("firmware", ["firmware-esc1"], "board-b-g431b-esc1"),
    # As it ships, but with networks.
    "stm32g474-network": ("firmware", ["firmware"], "board-stm32g474,network,terms"),
    # The core alone, in each number type and with networks.
    "core": ("core-image", ["core-image"], ""),
}


def remapped_paths(root=ROOT, target_folder=TARGET_FOLDER):
    """Returns cargo's arguments by which an image does not depend on the folders of its build: its panics and its debug
    information contain the paths of its sources."""
    home = pathlib.Path(os.environ.get("CARGO_HOME", pathlib.Path.home() / ".cargo")).resolve()
    # Cargo names the folder of crates.io by a hash that is equal everywhere. Of several prefixes, rustc uses the last.
    folders = {home: "/cargo", home / "registry/src/index.crates.io-1949cf8c6b5b557f": "", root: "/source",
               target_folder: "/target"}
    flags = [f"--remap-path-prefix={folder}={name}" for folder, name in folders.items()]
    return ["--config", f"target.{TARGET}.rustflags={json.dumps(flags)}"]


def selection(features):
    """Returns cargo's arguments for an image with these features."""
    return ["--profile", "firmware", "--target", TARGET, "--no-default-features", "--features", features, *remapped_paths()]


def cargo(*arguments, root=ROOT):
    """Runs a build of cargo; returns the paths of its programs by their names, and ends this program if it fails."""
    # The image does not contain log lines below this level.
    # The boot program of the tests accepts packages of the published test key.
    environment = {"DEFMT_LOG": "info", "JOINT_UPDATE_KEY": "test", **os.environ}
    if TARGET in arguments:
        # What ships is compiled by rustc itself, not by clippy, with which tests/run compiles for the PC.
        environment.pop("RUSTC_WORKSPACE_WRAPPER", None)
    command, *rest = arguments
    result = subprocess.run(["cargo", command, "-q", "--message-format=json-render-diagnostics", *rest], cwd=root,
                            env=environment, stdout=subprocess.PIPE, text=True)
    if result.returncode != 0:
        sys.exit(f"cargo {' '.join(arguments)} failed")
    executables = (json.loads(line).get("executable") for line in result.stdout.splitlines())
    return {path.name: path for path in map(pathlib.Path, filter(None, executables))}


def build(name):
    """Builds the images of this name; returns the folder with their programs."""
    package, programs, features = IMAGES[name]
    folder = IMAGES_FOLDER / name
    folder.mkdir(parents=True, exist_ok=True)
    binaries = [word for program in programs if program != "boot" for word in ("--bin", program)]
    built = cargo("build", "--locked", "-p", package, *binaries, *selection(features))
    if "boot" in programs:
        built |= cargo("rustc", "--locked", "-p", package, "--bin", "boot", *selection(features), "--", "-C", "opt-level=z")
    for program in programs:
        place, built_at = folder / program, built[program].stat().st_mtime
        if not (place.exists() and place.stat().st_mtime == built_at):
            shutil.copy2(built[program], place)
    return folder


def write_figures(name, text):
    """Writes what a test measured to a file of target/figures/, from which the book is built."""
    folder = TARGET_FOLDER / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)


def build_driver(name):
    """Builds the images of this name; returns the path of the driver's."""
    return build(name) / IMAGES[name][1][0]
