//! `feed_forward.py`: the table as a function for the host program, and the call that sends its torque.
//!
//! The script needs no package beside that of the drive.

use super::FeedForward;
use super::drive::Drive;
use std::fmt::Write;

/// Functions of every drive. `SPEED_UNIT`, `TORQUE_UNIT` and `SUFFIX` are replaced.
const FUNCTIONS: &str = include_str!("functions.py.in");

/// The call of a host program, for each drive.
const MOTEUS: &str = include_str!("moteus.py.in");
const ODRIVE: &str = include_str!("odrive.py.in");

/// Returns the text of the script.
pub fn script(of: &FeedForward) -> String {
    let units = &of.units;
    let judged = &of.judged;
    let (torque, speed) = (units.torque, units.speed);
    let mut text = format!(
        "\"\"\"Friction feed-forward for {}, by host-sim {} from {}.\n\n",
        of.drive.title(),
        env!("CARGO_PKG_VERSION"),
        of.files.join(", ")
    );
    // Writing to a string does not fail.
    let _ = write!(
        text,
        "Model {}. RMSE on held-out rows: {:.4} {torque} without feed-forward, {:.4} {torque} with this table.\n\
         Speed and torque are {}.\n\
         Positive torque drives positive speed, as in the log{}.\n\
         To switch it off, set SCALE to 0. Begin a trial with a small SCALE.\n\"\"\"\n\n",
        of.model,
        judged.nothing.rmse,
        judged.table.rmse,
        of.drive.shaft(),
        if of.is_reversed { " after its sign was reversed by --columns" } else { "" },
    );
    text += "import bisect\nimport math\n";
    if of.drive == Drive::ODrive {
        text += "import struct\n";
    }
    text += "\n# Share of the torque that is sent, 0 to 1.\nSCALE = 1.0\n\n";
    let _ =
        writeln!(text, "# Speed in {speed}, torque and its standard error in {torque}.\nTABLE = [");
    for point in of.rows() {
        let [speed, torque, std_error] = [point.velocity, point.torque, point.std_error];
        let _ = writeln!(text, "    ({speed:.9}, {torque:.6}, {std_error:.6}),");
    }
    let position_scale = if of.drive == Drive::Joint { "1.0" } else { "2 * math.pi" };
    let _ = write!(
        text,
        "]\nSPEEDS = [row[0] for row in TABLE]\nTORQUES = [row[1] for row in TABLE]\n\n\
         # Torque per acceleration, {torque}/({speed}^2); 0 if the log does not determine it.\n\
         INERTIA = {:.9}\n\
         # Torque of gravity, {torque}: factors of sine and cosine of the position, whose zero must be that of the log.\n\
         GRAVITY = ({:.6}, {:.6})\nPOSITION_SCALE = {position_scale}  # radians\n\n\n",
        of.inertia_in_units().unwrap_or(0.0),
        of.rigid_body.gravity_sine,
        of.rigid_body.gravity_cosine,
    );
    text += &FUNCTIONS
        .replace("SUFFIX", units.suffix)
        .replace("TORQUE_UNIT", torque)
        .replace("SPEED_UNIT", speed);
    text += match of.drive {
        Drive::Moteus => MOTEUS,
        Drive::ODrive => ODRIVE,
        Drive::Joint => "",
    };
    text
}
