"""The features of libraries that the packages host-sim and friction-python select.

Where they differ, `pip install ./python` after the first command compiles libraries again. host-sim/features says more.
"""

import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def features_of(package):
    """Returns the sets of features by package and version, without those for tests."""
    command = ["cargo", "tree", "--locked", "-q", "-e", "no-dev", "-p", package, "--prefix", "none", "--no-dedupe", "-f", "{p}|{f}"]
    output = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    features = {}
    for line in output.splitlines():
        name, chosen = line.removesuffix(" (*)").rsplit("|", 1)
        features.setdefault(name, set()).add(chosen)
    return features


def differences(one, other):
    """Returns a line for each library of both whose features differ."""
    return [f"{name}: {sorted(one[name])} and {sorted(other[name])}" for name in sorted(one.keys() & other.keys()) if one[name] != other[name]]


def different_features():
    assert differences({"a": {"x"}, "b": {""}}, {"a": {"x,y"}, "b": {""}, "c": {""}}) == ["a: ['x'] and ['x,y']"]
    return differences(features_of("host-sim"), features_of("friction-python"))
