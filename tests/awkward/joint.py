"""The joint of the awkward logs, and functions that write its rows.

It oscillates against 0.5 Nm of Coulomb friction and 0.2 Nm s/rad of viscous friction, in three runs at three speeds,
with 100 rows a second and a ripple of 10 mNm that no law explains. Every variant of the log must give these two
parameters, or an error with the option to use.
"""

import math

COULOMB_NM, VISCOUS = 0.5, 0.2
RATE_HZ, ROWS, RUNS = 100, 400, 3


def rows(count=ROWS, runs=RUNS):
    """Rows as dictionaries, in SI units."""
    table = []
    for run in range(runs):
        for i in range(count):
            t = i / RATE_HZ
            v = (1 + run) * math.sin(3 * t + 0.1)
            table.append({
                "run": run,
                "t": t,
                "v": v,
                "q": -(1 + run) / 3 * math.cos(3 * t + 0.1),
                "tau": COULOMB_NM * math.copysign(1, v) + VISCOUS * v + 0.01 * math.sin(40 * t),
                "i": i,
            })
    return table


def number(value):
    """Formats a value as a logger does: all digits of a float, other values unchanged."""
    return repr(value) if isinstance(value, float) else str(value)


def table(columns, of=None, by=",", end="\n"):
    """Formats a CSV file. `columns` maps names to functions of a row; `of` replaces the default rows."""
    lines = [by.join(columns)]
    for row in rows() if of is None else of:
        lines.append(by.join(number(column(row)) for column in columns.values()))
    return end.join(lines) + end


def joint(**other):
    """Returns the columns of the contract. `other` replaces one (run, time, velocity, torque) or adds one.

    A replacement is a pair: name and function of a row. None leaves the column out.
    """
    columns = {
        "run": ("run", lambda row: row["run"]),
        "time": ("time_s", lambda row: row["t"]),
        "velocity": ("velocity_rad_s", lambda row: row["v"]),
        "torque": ("torque_nm", lambda row: row["tau"]),
    }
    columns.update(other)
    return dict(pair for pair in columns.values() if pair is not None)


def on_one_clock(row):
    """Returns the time, s, with the runs in sequence and five seconds between them."""
    return row["t"] + row["run"] * (ROWS / RATE_HZ + 5)
