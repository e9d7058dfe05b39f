"""What an engineer with scipy would write: LuGre by `least_squares`, on simulators of three kinds.

The step is the one the core takes, backward Euler on the bristle torque, with the exact exponential;
the residual has no prior, the Jacobian is scipy's own (2-point). Methods `trf` and `lm`, each with
`x_scale` and with logarithms of the parameters: the fastest of the four counts. Reading the data and
compiling are not timed.

    loop      Python, a step per sample, as the law is written down
    numpy     all that does not depend on the state in numpy, the recurrence alone in Python
    numba     the loop, compiled
    parallel  the compiled loop, the runs side by side on all cores
"""

import json
import math
import pathlib
import sys
import time

import joint
import numba
import numpy as np
import scipy
from scipy.optimize import least_squares


class Data:
    """The training rows, run after run."""

    def __init__(self, table):
        first = np.flatnonzero(np.diff(table[:, 0], prepend=-1))
        self.bounds = np.append(first, len(table))
        self.dt = table[1, 1] - table[0, 1]
        self.velocity = np.ascontiguousarray(table[:, 2])
        self.torque = np.ascontiguousarray(table[:, 3])
        # What never changes is prepared once.
        self.speed = np.abs(self.velocity)
        self.runs = list(zip(self.bounds[:-1].tolist(), self.bounds[1:].tolist()))
        self.velocity_list = self.velocity.tolist()


def loop(data, f_c, f_s, v_s, sigma0, sigma1, sigma2):
    exp, stiffness, torque = math.exp, sigma0 * data.dt, []
    put, velocities = torque.append, data.velocity_list
    for start, end in data.runs:
        y = math.copysign(f_c, velocities[start])
        for v in velocities[start:end]:
            u, speed = v / v_s, abs(v)
            g = f_c + (f_s - f_c) * exp(-u * u)
            rate = (g * v - speed * y) / (g + stiffness * speed)
            y += stiffness * rate
            put(y + sigma1 * rate + sigma2 * v)
    return np.array(torque)


def numpy_and_loop(data, f_c, f_s, v_s, sigma0, sigma1, sigma2):
    v, stiffness = data.velocity, sigma0 * data.dt
    g = f_c + (f_s - f_c) * np.exp(-((v / v_s) ** 2))
    inverse = 1 / (g + stiffness * data.speed)
    keep = g * inverse
    push = stiffness * v * keep
    bristle, held = [], np.empty_like(v)
    put, keeps, pushes = bristle.append, keep.tolist(), push.tolist()
    for start, end in data.runs:
        y = math.copysign(f_c, data.velocity_list[start])
        held[start] = y
        for a, b in zip(keeps[start:end], pushes[start:end]):
            y = a * y + b
            put(y)
    bristle = np.array(bristle)
    held[1:] = bristle[:-1]
    held[data.bounds[:-1]] = np.copysign(f_c, v[data.bounds[:-1]])
    rate = (g * v - data.speed * held) * inverse
    return bristle + sigma1 * rate + sigma2 * v


def run(start, end, velocity, torque, dt, f_c, f_s, v_s, sigma0, sigma1, sigma2):
    stiffness = sigma0 * dt
    y = math.copysign(f_c, velocity[start])
    for i in range(start, end):
        v = velocity[i]
        u, speed = v / v_s, abs(v)
        g = f_c + (f_s - f_c) * math.exp(-u * u)
        rate = (g * v - speed * y) / (g + stiffness * speed)
        y += stiffness * rate
        torque[i] = y + sigma1 * rate + sigma2 * v


run = numba.njit(fastmath=True, inline="always")(run)


def all_runs(velocity, bounds, dt, p):
    torque = np.empty_like(velocity)
    for r in numba.prange(bounds.size - 1):
        run(bounds[r], bounds[r + 1], velocity, torque, dt, p[0], p[1], p[2], p[3], p[4], p[5])
    return torque


serial_runs = numba.njit(fastmath=True)(all_runs)
parallel_runs = numba.njit(fastmath=True, parallel=True)(all_runs)


def compiled(runs):
    return lambda data, *p: runs(data.velocity, data.bounds, data.dt, np.array(p))


SIMULATORS = {
    "loop": loop,
    "numpy": numpy_and_loop,
    "numba": compiled(serial_runs),
    "parallel": compiled(parallel_runs),
}


def timed(function):
    begin = time.perf_counter()
    result = function()
    return time.perf_counter() - begin, result


def fit(name, data, rounds):
    """The four ways of posing it, in turn, `rounds` times; the best time of each."""
    simulate = SIMULATORS[name]
    start = np.array(joint.START)

    def residual(p):
        return simulate(data, *p) - data.torque

    def residual_of_logarithms(q):
        return simulate(data, *np.exp(q)) - data.torque

    ways = {
        "trf, x_scale": lambda: least_squares(
            residual, start, x_scale=start, bounds=(0, np.inf), method="trf"
        ),
        "trf, logarithms": lambda: least_squares(residual_of_logarithms, np.log(start), method="trf"),
        "lm, x_scale": lambda: least_squares(residual, start, x_scale=start, method="lm"),
        "lm, logarithms": lambda: least_squares(residual_of_logarithms, np.log(start), method="lm"),
    }
    residual(start)  # compiles
    step = min(timed(lambda: residual(start))[0] for _ in range(3 if rounds < 5 else 50))
    results = []
    for way, solve in ways.items():
        seconds, found = min((timed(solve) for _ in range(rounds)), key=lambda pair: pair[0])
        # The law does not see the sign of v_s.
        parameters = np.exp(found.x) if "logarithms" in way else np.abs(found.x)
        results.append(
            {
                "simulator": name,
                "way": way,
                "seconds": seconds,
                "success": bool(found.success),
                "evaluations": int(found.nfev),
                "parameters": parameters.tolist(),
                "rmse": float(np.sqrt(2 * found.cost / data.torque.size)),
                "seconds_per_step": step / data.torque.size,
            }
        )
    return results


def main(path, rounds, names):
    data = Data(np.loadtxt(path, delimiter=",", skiprows=1))
    fits = [
        result
        for name in names or SIMULATORS
        for result in fit(name, data, rounds if name in ("numba", "parallel") else 2)
    ]
    versions = {m.__name__: m.__version__ for m in (np, scipy, numba)}
    versions = {"python": ".".join(map(str, sys.version_info[:3]))} | versions
    json.dump({"versions": versions, "fits": fits}, sys.stdout)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]) / "train.csv", int(sys.argv[2]), sys.argv[3:])
