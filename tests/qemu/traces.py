"""Traces for the emulated board: simulated by host-sim and reduced to the frames that a driver needs.

A byte sent to the board costs more time than a step. Of a simulated trace every motion and SYNC frame is kept, but only
every tenth frame of side load, pressure and measured torque; the driver holds these values. The simulation has no
temperature, so one is added at the same rate. It rises and falls, so that terms that depend on it are exercised.
"""

import math
import struct
import subprocess

EVERY = 10
# Identifiers of node 1 (joint.dbc).
MOTION, TORQUE, SEAL, SURROUNDINGS, SYNC, ENTRY = b"481#", b"681#", b"401#", b"501#", b"080#", b"601#"

PARAMETERS = """schema = 1
joint = "revolute"
model = "improved-lugre+position-ripple+temperature-viscous+direction-asymmetry"

[parameters]
coulomb_torque = {coulomb!r}
static_torque = 1.7
stribeck_velocity = 0.08
bristle_stiffness = 4000.0
bristle_damping = 0.8
viscous_friction = 0.6
radial_force_coulomb = 0.004
radial_force_static_excess = 0.001
pressure_coulomb = 2.0e-6
pressure_static_excess = 5.0e-7
radial_force_rate = 1.0e-6
ripple_sine = 0.04
ripple_cosine = -0.02
ripple_order = 3.0
temperature_viscosity = 0.02
temperature_reference = 15.0
coulomb_asymmetry = 0.05
viscous_asymmetry = -0.03

[envelope]
position_max_rad = 500.0  # times the ripple's order, it must fit the fixed-point number
"""


def simulate(host_sim, folder, runs, seconds, seed):
    """Simulates a complete trace and returns its path."""
    subprocess.run([host_sim, "simulate", "underwater-joint", "--runs", str(runs), "--seconds", str(seconds),
                    "--seed", str(seed), "--out", folder, "--force"], check=True, stdout=subprocess.DEVNULL)
    return folder / "trace.log"


def reduce(whole, path):
    """Writes the reduced trace; returns its number of samples."""
    samples, kept = 0, bytearray()
    with open(whole, "rb") as source, open(path, "wb") as sink:
        for line in source:
            stamp, interface, frame = line.split(b" ", 2)
            kind = frame[:4]
            if kind in (TORQUE, SEAL) and samples % EVERY:
                continue
            if kind not in (MOTION, TORQUE, SEAL, SYNC, ENTRY):
                continue
            if kind == SYNC:
                if samples % EVERY == 0:
                    temperature = 12 + 10 * math.sin(samples * 2e-4)
                    data = struct.pack("<ff", temperature, math.nan).hex().upper().encode()
                    kept += stamp + b" " + interface + b" " + SURROUNDINGS + data + b"\n"
                samples += 1
            kept += line
            if len(kept) > 1 << 20:
                sink.write(kept)
                kept.clear()
        sink.write(kept)
    return samples
