"""Compares the programs of the image with those that a build in another folder gives, byte by byte."""

import os
import pathlib
import shutil
import subprocess
import tempfile

import images


def programs_of_another_folder_have_the_same_bytes(folder):
    """Builds the tracked files in a folder of another name, with another target folder, and compares all programs."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=images.ROOT, check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory(prefix="joint-in-another-folder-") as other:
        source, target = pathlib.Path(other, "source"), pathlib.Path(other, "artefacts")
        for name in filter(None, names.split("\0")):
            if (images.ROOT / name).is_file():
                (source / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(images.ROOT / name, source / name)
        subprocess.run([source / "tests/image/build", folder.name], check=True, stdout=subprocess.DEVNULL,
                       env={**os.environ, "CARGO_TARGET_DIR": str(target)})
        for name in images.IMAGES[folder.name][1]:
            here, there = (folder / name).read_bytes(), (target / "images" / folder.name / name).read_bytes()
            assert str(images.ROOT).encode() not in here, f"{name} contains the folder of its build"
            places = [at for at, pair in enumerate(zip(here, there)) if pair[0] != pair[1]]
            assert here == there, f"{name}: {len(here)} and {len(there)} bytes, which differ at {places[:3]}"
            print(f"  measured: {name}: {len(here)} bytes, equal in both folders")
