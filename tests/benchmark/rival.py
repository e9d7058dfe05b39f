"""What an analyst writes for one log: pandas and `lstsq` for the linear law, numba and `least_squares` for LuGre.

Reads the file, fits, and prints the processor time of both, s. Imports and compiling are not timed; reading the file is.
The runs that `host-sim` holds out are not fitted.

    rival.py TRAIN.CSV ROUNDS RUN,..
"""

import json
import sys
import time

import competitor
import joint
import numpy as np
import pandas
from scipy.optimize import least_squares


def fitted_rows(path, runs):
    table = pandas.read_csv(path)
    return table[table["run"].isin(runs)]


def linear(path, runs):
    """Coulomb and viscous friction by least squares."""
    table = fitted_rows(path, runs)
    velocity = table["velocity_rad_s"].to_numpy()
    columns = np.column_stack([np.sign(velocity), velocity])
    return np.linalg.lstsq(columns, table["torque_nm"].to_numpy(), rcond=None)[0]


def lugre(path, runs):
    """LuGre from a start that is given to it; `host-sim` has to find its own."""
    data = competitor.Data(fitted_rows(path, runs).to_numpy(float))
    simulate = competitor.SIMULATORS["numba"]
    start = np.array(joint.START)
    found = least_squares(
        lambda p: simulate(data, *p) - data.torque, start, x_scale=start, method="lm"
    )
    return np.abs(found.x)  # the law does not see the sign of v_s


def processor_seconds(function, path, rounds, runs):
    """The least processor time of some runs, and the parameters."""
    function(path, runs)  # compiles
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        parameters = function(path, runs)
        times.append(time.process_time() - begin)
    return {"seconds": min(times), "parameters": parameters.tolist()}


if __name__ == "__main__":
    path, rounds, runs = sys.argv[1], int(sys.argv[2]), [int(run) for run in sys.argv[3].split(",")]
    fits = {fit.__name__: processor_seconds(fit, path, rounds, runs) for fit in (linear, lugre)}
    json.dump({"versions": {"pandas": pandas.__version__}, "fits": fits}, sys.stdout)
