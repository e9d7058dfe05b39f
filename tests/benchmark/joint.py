"""The measured joint of the benchmark: motions, and a fine LuGre integration of its own.

Six runs of 10 s at 1 kHz: presliding, slow reversals, Stribeck ramps, fast sliding, a mixture of
sines, stop and go; both directions everywhere. Each begins by sliding to a stop, so that nobody has
to guess what the bristles held at its start. The friction is LuGre in z with the exact exponential,
Runge-Kutta of fourth order at 10 us: neither the core's state nor its step, so the data are not of
the kind a fit's own simulator makes.
"""

import numpy as np
from numba import njit

RATE_HZ = 1000
SECONDS = 10
FINE = 100  # integration steps per sample
NOISE_NM = 0.05

# F_C Nm, F_S Nm, v_s rad/s, sigma0 Nm/rad, sigma1 Nm s/rad, sigma2 Nm s/rad
NAMES = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "bristle_stiffness",
    "bristle_damping",
    "viscous_friction",
)
UNITS = ("Nm", "Nm", "rad/s", "Nm/rad", "Nm s/rad", "Nm s/rad")
TRUTH = (1.5, 2.1, 0.1, 1e4, 20.0, 0.05)
START = (1.1, 1.4, 0.25, 3e3, 6.0, 0.2)


STOP_S = 0.25  # how long the slide at the beginning of a run takes to its stop
SLIDE = 0.4  # and how fast it begins, rad/s


def velocity(run, t):
    """Velocity of a run at times `t`, rad/s."""
    slide = np.where(t < STOP_S, SLIDE * np.cos(np.pi / 2 * t / STOP_S) ** 2, 0.0)
    return slide + np.where(t < STOP_S, 0.0, motion(run, np.maximum(t - STOP_S, 0.0)))


def motion(run, t):
    """What a run is made for; begins at rest."""
    turn = 2 * np.pi
    if run == 0:  # presliding, growing to the edge of breakaway: F_C/sigma0 is 1.5e-4 rad
        return 2.5e-3 * (0.1 + 0.9 * t / SECONDS) * np.sin(turn * 2 * t)
    if run == 1:  # slow reversals
        return 0.3 * np.sin(turn * 0.5 * t)
    if run == 2:  # ramps through the Stribeck range
        phase = t / SECONDS * 4
        return 0.5 * (np.abs((phase + 3) % 4 - 2) - 1)
    if run == 3:  # fast sliding
        return 2.0 * np.sin(turn * 0.7 * t)
    if run == 4:  # a mixture of sines, most of it slow
        hertz = np.array([0.3, 0.7, 1.3, 2.9, 5.3])
        size = np.array([0.25, 0.15, 0.1, 0.05, 0.03])
        return (size * np.sin(turn * hertz * t[:, None])).sum(axis=1)
    # stop and go, either way in turn, a second each
    phase = np.floor(t) % 4
    push = np.where(phase == 0, 1.0, np.where(phase == 2, -1.0, 0.0))
    return 0.4 * push * np.sin(np.pi * (t % 1.0)) ** 2


@njit
def friction(v, dt, f_c, f_s, v_s, sigma0, sigma1, sigma2, fine):
    """Torque at every `fine`-th step; `v` is given at every half step of length `dt / 2`."""
    torque = np.empty((v.size - 1) // (2 * fine) + 1)
    z = np.sign(v[0]) * (f_c + (f_s - f_c) * np.exp(-((v[0] / v_s) ** 2))) / sigma0
    for step in range((v.size - 1) // 2 + 1):
        now = v[2 * step]
        g = f_c + (f_s - f_c) * np.exp(-((now / v_s) ** 2))
        if step % fine == 0:
            rate = now - sigma0 * abs(now) / g * z
            torque[step // fine] = sigma0 * z + sigma1 * rate + sigma2 * now
        if 2 * step + 2 >= v.size:
            break
        middle, end = v[2 * step + 1], v[2 * step + 2]
        g_middle = f_c + (f_s - f_c) * np.exp(-((middle / v_s) ** 2))
        g_end = f_c + (f_s - f_c) * np.exp(-((end / v_s) ** 2))
        k1 = now - sigma0 * abs(now) / g * z
        k2 = middle - sigma0 * abs(middle) / g_middle * (z + 0.5 * dt * k1)
        k3 = middle - sigma0 * abs(middle) / g_middle * (z + 0.5 * dt * k2)
        k4 = end - sigma0 * abs(end) / g_end * (z + dt * k3)
        z += dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return torque


def runs(seed=1):
    """Times, velocities and noisy torques of the six runs, then of a seventh to judge by."""
    noise = np.random.default_rng(seed)
    for run in (0, 1, 2, 3, 4, 5, 4):
        samples = RATE_HZ * SECONDS
        dt = 1 / (RATE_HZ * FINE)
        fine_time = np.arange((samples - 1) * FINE * 2 + 1) * (dt / 2)
        torque = friction(velocity(run, fine_time), dt, *TRUTH, FINE)
        time = np.arange(samples) / RATE_HZ
        yield time, velocity(run, time), torque + NOISE_NM * noise.standard_normal(samples)


def write(directory):
    """Writes train.csv, test.csv and start.toml."""
    header = "run,time_s,velocity_rad_s,torque_nm\n"
    with open(directory / "train.csv", "w") as train, open(directory / "test.csv", "w") as test:
        train.write(header)
        test.write(header)
        for run, columns in enumerate(runs()):
            file = train if run < 6 else test
            file.writelines(f"{run + 1},{t!r},{v!r},{f!r}\n" for t, v, f in zip(*(c.tolist() for c in columns)))
    values = zip(NAMES, START, UNITS)
    lines = [f'{name} = {{ value = {value!r}, unit = "{unit}" }}\n' for name, value, unit in values]
    head = 'schema = 1\njoint = "revolute"\nmodel = "lugre"\n\n[parameters]\n'
    # More bristle damping than passivity allows: a fit may want it, so the file has to say so.
    choices = "\n[choices]\nallow_active = true\n"
    (directory / "start.toml").write_text(head + "".join(lines) + choices)


if __name__ == "__main__":
    import pathlib
    import sys

    write(pathlib.Path(sys.argv[1]))
