"""Drawn joints with known friction whose logs are spoiled in one way each: clocks, held rows, lost rows, failed readings.

The simulation is Coulomb and viscous friction with inertia, and shares no code with the program. Each answer must hold both
parameters within a tenth, and the inertia within 15 %, or call them not determined; a refusal must say what to type.
"""

import math
import random

COULOMB_NM, VISCOUS_NM_S, INERTIA_KG_M2 = 0.8, 0.4, 0.05
TOLERANCE = 0.1
# The acceleration is the second derivative of a position with steps.
TOLERANCE_OF_INERTIA = 0.15
ENCODER_RAD = 2 * math.pi / 4096
SEEDS = (11, 12)


class Joint:
    """A drawn joint that moves for 40 s."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        drawn = self.random.uniform
        self.waves = [(drawn(0.2, 0.9), drawn(0.6, 3.1), drawn(0, 6.28)) for _ in range(3)]

    def rows(self, rate_hz=100):
        """Returns time, position in steps of the encoder, velocity and torque of each row."""
        rows = []
        for number in range(40 * rate_hz):
            t = number / rate_hz
            q = sum(a * math.sin(w * t + p) for a, w, p in self.waves)
            v = sum(a * w * math.cos(w * t + p) for a, w, p in self.waves)
            acceleration = -sum(a * w * w * math.sin(w * t + p) for a, w, p in self.waves)
            torque = INERTIA_KG_M2 * acceleration + COULOMB_NM * math.tanh(v / 0.005) + VISCOUS_NM_S * v
            noise = self.random.gauss
            q = round(q / ENCODER_RAD) * ENCODER_RAD
            rows.append((t, q, v + noise(0, 0.01), torque + noise(0, 0.02)))
        return rows

    def held(self, rows, channels, share):
        """Repeats the last value of some channels in rows that are drawn, or in all but every fourth row if `share` is None."""
        kept, last = [], None
        for number, row in enumerate(rows):
            is_read = number % 4 == 0 if share is None else self.random.random() < share
            if last is None or is_read:
                last = row
            kept.append(tuple(last[at] if at in channels else value for at, value in enumerate(row)))
        return kept

    def halted(self, rows, share, longest):
        """Lets the clock stand still now and then, and go on where it should be."""
        found, stamp, halt = [], 0.0, 0
        for t, *others in rows:
            if halt > 0:
                halt -= 1
            else:
                stamp = t
                halt = self.random.randint(1, longest) if self.random.random() < share else 0
            found.append((stamp, *others))
        return found


def micros(rows):
    return [(round(t * 1e6) % 65536, *others) for t, *others in rows]


def spiked(joint, rows):
    def spike():
        return joint.random.uniform(-3, 3) if joint.random.random() < 0.01 else 0
    return [(t, q + spike(), v, torque) for t, q, v, torque in rows]


def lost(joint, rows):
    return [row for row in rows if joint.random.random() > 0.08]


ALL, NO_VELOCITY = (0, 1, 2, 3), (0, 1, 3)
COUNTED, COUNTED_POSITION = (1, 2, 3), (1, 3)
IN_MICROS = ["--columns", "time_s=time_s:us"]
AT_100_HZ = ["--rate", "100Hz"]

# Name, columns, options, and what is done to the rows.
WAYS = [
    ("position only", NO_VELOCITY, [], lambda joint: joint.rows()),
    ("position read every fourth row", NO_VELOCITY, [], lambda joint: joint.held(joint.rows(), (1,), None)),
    ("position and torque held now and then", NO_VELOCITY, [], lambda joint: joint.held(joint.rows(), (1, 3), 0.4)),
    ("all channels held now and then", ALL, [], lambda joint: joint.held(joint.rows(), (1, 2, 3), 0.4)),
    ("motion held now and then", ALL, [], lambda joint: joint.held(joint.rows(), (1, 2), 0.3)),
    ("spikes of a position alone", NO_VELOCITY, [], lambda joint: spiked(joint, joint.rows())),
    ("8 % of the rows lost", COUNTED, AT_100_HZ, lambda joint: lost(joint, joint.rows())),
    ("8 % of the rows of a position lost", COUNTED_POSITION, AT_100_HZ, lambda joint: lost(joint, joint.rows())),
    ("clock that halts for a row", ALL, [], lambda joint: joint.halted(joint.rows(), 0.03, 1)),
    ("clock that halts for twenty rows", ALL, [], lambda joint: joint.halted(joint.rows(), 0.003, 20)),
    ("clock of a position that halts", NO_VELOCITY, [], lambda joint: joint.halted(joint.rows(), 0.03, 1)),
    ("clock of 16 bits in us", ALL, IN_MICROS, lambda joint: micros(joint.rows())),
    ("clock of 16 bits in us, position only", NO_VELOCITY, IN_MICROS, lambda joint: micros(joint.rows(500))),
]
NAMES = ["time_s", "position_rad", "velocity_rad_s", "torque_nm"]


def logs():
    """Yields the name, the text and the options of each log."""
    for name, columns, options, spoil in WAYS:
        for seed in SEEDS:
            lines = [",".join(NAMES[at] for at in columns)]
            lines += [",".join(f"{row[at]:.9g}" for at in columns) for row in spoil(Joint(seed))]
            yield f"{name}, joint {seed}", "\n".join(lines) + "\n", options


def complaints(parameters):
    """Returns what is wrong with the parameters of an answer."""
    right = {"coulomb_torque": COULOMB_NM, "viscous_friction": VISCOUS_NM_S, "inertia": INERTIA_KG_M2}
    wrong = []
    for name, value in right.items():
        found = parameters.get(name)
        tolerance = TOLERANCE_OF_INERTIA if name == "inertia" else TOLERANCE
        is_right = found is None or found["state"] != "determined" or abs(found["value"] - value) <= tolerance * value
        if not is_right:
            wrong.append(f"{name} is {found['value']:.3g}, determined; it is {value}")
    return wrong
