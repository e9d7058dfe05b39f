"""Made-up logs after further public reports, each with its command and a check of the answer.

The logs are in tests/data/reported. A case that is open is answered wrongly; its check must fail until the program is
mended, and then the mark must go.
"""

import dataclasses
import json
import typing


@dataclasses.dataclass
class Answer:
    """What the program answered."""

    exit: int
    # Both outputs, in lower case, without the path of the log.
    text: str
    # diagnosis.json; None if there is none.
    found: dict | None

    def causes(self):
        return [one["cause"] for one in self.found["findings"] if one["cause"] != "none"] if self.found else []

    def value(self, parameter):
        return (self.found["baseline"]["params"].get(parameter) or {}).get("value") or 0

    def is_determined(self, parameter):
        return (self.found["baseline"]["params"].get(parameter) or {}).get("state") == "determined"

    def near(self, parameter, right, tolerance):
        """Returns whether a parameter has this value, within a relative tolerance."""
        return self.found is not None and abs(self.value(parameter) - right) <= tolerance * abs(right)

    def kinds(self):
        return {one["kind"] for one in self.found["log"]} if self.found else set()

    def words(self):
        parts = [json.dumps(self.found["findings"]), json.dumps(self.found["log"]), self.found.get("next_experiment", "")]
        return " ".join([*parts, *map(str, self.found.get("story", []))]).lower()

    def says(self, *words):
        return any(word in self.text for word in words)

    def refuses(self, *words):
        return self.exit == 2 and self.says(*words)


@dataclasses.dataclass
class Case:
    log: str
    # Without the path of the log, which follows the first word.
    command: str
    check: typing.Callable[[Answer], bool]
    is_open: bool = False


def load_from_gravity(answer):
    """The friction is 0.6 + 0.12 |gravity torque|, and no column holds the load."""
    not_these = {"position-ripple", "torque-ripple", "quadratic-drag", "gravity-imbalance"}
    return answer.found and not not_these & set(answer.causes()) and "load" in answer.words()


def two_publishers(answer):
    """Every second row comes from another sender: position 0, no velocity, no effort."""
    is_left_out = answer.exit == 0 and answer.near("coulomb_torque", 1.1, 0.03)
    return is_left_out or answer.refuses("--bad-rows", "other source", "two sources")


def motion_of_two_sides(answer):
    """The position is behind a belt of 1.5, the velocity before it. One of both must be used alone."""
    if answer.refuses("1.5", "ratio", "gear"):
        return True
    is_one_side = answer.near("viscous_friction", 0.9, 0.05) or answer.near("viscous_friction", 0.6, 0.05)
    return answer.found and answer.found.get("leading_fault") == "unit-suspect" and is_one_side


def quantised_speed(answer):
    """The speed is 0 or one count a row."""
    is_near = answer.near("coulomb_torque", 0.4, 0.03) and answer.near("viscous_friction", 0.11, 0.06)
    return is_near and "quantised" in answer.kinds()


def zero_of_each_run(answer):
    """The torque sensor is zeroed anew before each of five runs."""
    is_near = answer.near("coulomb_torque", 2.4, 0.05) and answer.near("viscous_friction", 1.5, 0.1)
    return is_near and "run" in answer.words() and any(word in answer.words() for word in ("offset", "zero"))


def drive_that_is_off(answer):
    """The drive is off in half of the rows, and the torque is exactly 0 while the joint moves."""
    sizes = [(one.get("size") or {}).get("value") for one in answer.found["findings"]] if answer.found else []
    return answer.says("exactly 0", "drive is off", "reads 0", "switched off") and 0 not in sizes


def filtered_torque(answer):
    """The torque passed a low-pass of 2.5 Hz. No negative inertia may be called determined."""
    is_near = answer.near("coulomb_torque", 2.5, 0.05) and answer.near("viscous_friction", 4.5, 0.05)
    return is_near and (answer.value("inertia") > 0 or not answer.is_determined("inertia"))


def moves_one_way(answer):
    """Twelve short moves in one direction: friction, gravity and offset cannot be distinguished."""
    findings = answer.found["findings"] if answer.found else []
    weak = [one for one in findings if (one.get("p_value") or 0) > 0.05 or one.get("stability", 1) < 0.5]
    is_honest = answer.found and (answer.near("inertia", 1.2, 0.25) or not answer.is_determined("inertia"))
    return is_honest and not weak and "saturated" not in answer.kinds()


def missing_blocks(answer):
    """Blocks of ten rows are missing at sixty places, and there is no clock."""
    is_reported = any("jump" in kind or "lost" in kind for kind in answer.kinds())
    return is_reported and answer.near("viscous_friction", 600, 0.1)


def own_demand(answer):
    """The axis's own set-point is a column."""
    return answer.found and "joint-coupling" not in answer.causes() and answer.near("coulomb_torque", 35, 0.03)


def two_drives(answer):
    """The other drive's speed is this one's with a minus."""
    return answer.causes()[:1] == ["torque-ripple"] and "joint-coupling" not in answer.causes()


def second_header(answer):
    """A second recording was appended with its header."""
    return answer.near("coulomb_torque", 1.2, 0.02) and answer.found["data"].get("runs") in (2, None)


# Bit 10 of the load register is its sign. The error must name the words to type, as for a speed register.
SERVO = "position_rad=pos:4096counts,velocity_rad_s=speed:sign15 0.0879deg/s,torque_nm=load:0.1%"
SLIDE = "position_m=pos [mm]:mm,velocity_m_s=vel [mm/s]:mm/s,force_n=force [N]:N"
AXIS = "time_s=t,position_m=X_ActPos [mm]:mm,velocity_m_s=X_ActVel [mm/s]:mm/s,force_n=X_Force [N]:N"
TOPIC = "time_s=time,position_rad=position,velocity_rad_s=velocity,torque_nm=effort"

CASES = (
    Case("gravity-loads-the-gear.csv", "diagnose --rigid-body inertia,gravity,offset", load_from_gravity),
    Case("two-publishers.csv", f"diagnose --columns '{TOPIC}'", two_publishers, is_open=False),
    Case("velocity-before-the-belt.csv", "diagnose --rigid-body inertia", motion_of_two_sides),
    Case("pulses-in-each-period.csv", "diagnose --rigid-body inertia", quantised_speed),
    Case("sensor-zeroed-in-each-run.csv", "diagnose --rigid-body inertia,offset", zero_of_each_run),
    Case("drive-off-while-moved.csv", "diagnose --rigid-body inertia", drive_that_is_off),
    Case("torque-behind-a-low-pass.csv", "diagnose --rigid-body inertia,gravity,offset", filtered_torque),
    Case("short-moves-one-way.csv", "diagnose --rigid-body inertia,gravity,offset", moves_one_way),
    Case("blocks-of-rows-missing.csv", f"diagnose --rate 50Hz --columns '{SLIDE}' --rigid-body inertia", missing_blocks),
    Case("own-demand-beside-it.csv", f"diagnose --columns '{AXIS}' --rigid-body inertia", own_demand),
    Case("two-drives-on-one-shaft.csv", "diagnose --rigid-body inertia,offset", two_drives),
    Case(
        "load-register-with-a-sign-bit.csv",
        f"diagnose --columns '{SERVO}' --rated-torque 1.9Nm",
        lambda answer: answer.refuses("sign10"),
    ),
    Case("header-in-the-middle.csv", "diagnose --rigid-body inertia", second_header),
    # Time, name, value. Reading it is right, or the command that makes columns of it.
    Case(
        "one-line-for-each-value.csv",
        "diagnose",
        lambda answer: answer.exit == 0 or answer.says("pivot", "long table", "one value a line", "one line"),
    ),
    # Eight legs, of which four are mounted as mirror images. The friction of leg 6 is 60 % higher.
    Case(
        "mirrored-fleet",
        "fleet --rigid-body inertia,offset",
        lambda answer: answer.says("leg-6") and answer.says("1 of 8"),
        is_open=False,
    ),
    # candump without -L. The error must name the option that writes a log.
    Case(
        "candump-default-view.log",
        "diagnose",
        lambda answer: answer.exit == 0 or answer.says("candump -l"),
    ),
    Case(
        "candump-with-errors-and-direction.log",
        "diagnose",
        lambda answer: answer.exit == 0 and answer.says("error frames"),
    ),
)
