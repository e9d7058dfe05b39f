//! Arguments that commands share which move a joint: the simulated joint on the bus `loop`, and the bounds of motions.

use super::bus::BusArguments;
use super::error::{Result, unfit};
use clap::Args;
use compensator_core::quantity::{JointKind, Quantity};
use joint_bus::bus::Hub;
use joint_rig::{MotorNode, service};
use joint_tuning::MotionLimits;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;

/// The simulated joint.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Simulated joint")]
pub struct JointArguments {
    /// With --bus loop: simulate a motor and a joint, in service and without compensation
    #[arg(long)]
    motor: bool,
    /// Hide this effect in the simulated joint; may be repeated
    #[arg(long, value_name = "CAUSE[:SIZE]", requires = "motor", value_parser = Hide::parse)]
    hide: Vec<Hide>,
    /// Seed of the simulated joint and of what is drawn at random [default: 1]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl JointArguments {
    /// Returns the seed.
    pub fn seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }
}

/// Bounds of motions.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Motion")]
pub struct MotionArguments {
    /// Largest distance from the present position: a number with rad or deg, such as ±0.4rad; with m or mm for a file
    #[arg(long, value_name = "RANGE", default_value = "0.4rad", value_parser = range)]
    range: Bound,
    /// Largest speed: a number with rad/s or deg/s; with m/s or mm/s for the file of a linear axis
    #[arg(long, value_name = "SPEED", default_value = "1.5rad/s", value_parser = speed)]
    speed: Bound,
}

/// A bound of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bound {
    /// In rad or rad/s, or in m or m/s.
    size: f64,
    /// Kind of joint that has this unit.
    joint: JointKind,
}

impl MotionArguments {
    /// Returns the bounds, and the column of the position. Only a file may be that of a linear axis.
    ///
    /// # Errors
    /// Returns one line if the units are of two kinds of joint, or of a linear axis on the bus.
    pub fn limits(&self, is_file: bool) -> Result<(MotionLimits, &'static str)> {
        let (range, speed) = (self.range, self.speed);
        let is_linear = range.joint == JointKind::Prismatic;
        if range.joint != speed.joint || is_linear && !is_file {
            return Err(unfit(
                "--range, --speed",
                "expected rad or deg in both; with --standard --dry-run also m or mm in both",
            ));
        }
        let limits = MotionLimits::new(range.size, speed.size);
        Ok((limits, Quantity::Position.name(range.joint)))
    }
}

const RAD: Bound = Bound { size: 1.0, joint: JointKind::Revolute };
const METRE: Bound = Bound { size: 1.0, joint: JointKind::Prismatic };

/// Units of a bound without the end of a speed. `mm` is before `m`, which ends it.
const UNITS: [(&str, Bound); 4] = [
    ("rad", RAD),
    ("deg", Bound { size: std::f64::consts::PI / 180.0, ..RAD }),
    ("mm", Bound { size: 1e-3, ..METRE }),
    ("m", METRE),
];

/// Largest bound, in rad or rad/s, or in m or m/s.
const MAX_BOUND: f64 = 100.0;

/// Error of a bound.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error(
    "found {found:?}, expected a number above 0 and up to {MAX_BOUND} rad{end}, such as 0.4rad{end}"
)]
struct UnfitBound {
    found: String,
    /// End of the unit.
    end: String,
}

/// Parses a number with a unit, which `end` follows; a bare number is in rad. A sign of both directions may stand before.
fn bound(text: &str, end: &str) -> Result<Bound, UnfitBound> {
    let trimmed = text.trim();
    let unsigned = ["±", "+-"].iter().find_map(|sign| trimmed.strip_prefix(sign));
    let number = unsigned.unwrap_or(trimmed).trim();
    let with_unit = |(symbol, unit)| Some((number.strip_suffix(end)?.strip_suffix(symbol)?, unit));
    let (digits, unit) = UNITS.into_iter().find_map(with_unit).unwrap_or((number, RAD));
    let size = digits.trim().parse::<f64>().ok().map(|number| number * unit.size);
    let size = size.filter(|size| *size > 0.0 && *size <= MAX_BOUND);
    let failed = || UnfitBound { found: text.to_owned(), end: end.to_owned() };
    size.map(|size| Bound { size, ..unit }).ok_or_else(failed)
}

fn range(text: &str) -> Result<Bound, UnfitBound> {
    bound(text, "")
}

fn speed(text: &str) -> Result<Bound, UnfitBound> {
    bound(text, "/s")
}

/// Returns the hub of the bus `loop`, with a simulated joint attached to it. For any other bus, the hub stays empty.
///
/// # Errors
/// Returns one line if the arguments do not fit together or the joint does not start.
pub fn start_hub(bus: &BusArguments, joint: &JointArguments) -> Result<Hub> {
    let hub = Hub::new();
    if joint.motor {
        bus.check_motor("--motor")?;
        let drawn = DrawnJoint::draw(joint.seed(), &joint.hide, None)?;
        hub.attach(MotorNode::drawn(&drawn, &service::starting_set(&drawn))?);
    } else if bus.is_loop() {
        return Err(unfit(
            "--bus loop",
            "needs --motor, a simulated joint; for a real one give --bus can0, or slcan:PATH",
        ));
    }
    Ok(hub)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_and_speed_have_units() {
        assert_eq!(range("±0.4rad"), Ok(Bound { size: 0.4, ..RAD }));
        assert_eq!(range("+-0.4"), Ok(Bound { size: 0.4, ..RAD }));
        assert_eq!(range("±50mm"), Ok(Bound { size: 0.05, ..METRE }));
        assert_eq!(speed("1.5rad/s"), Ok(Bound { size: 1.5, ..RAD }));
        assert_eq!(speed("0.2m/s"), Ok(Bound { size: 0.2, ..METRE }));
        assert!((range("90deg").unwrap().size - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        for wrong in ["", "x", "0", "1e9", "nan", "0.4rad/s", "0.4km", "-0.4rad", "±-0.4"] {
            let error = range(wrong).unwrap_err().to_string();
            assert!(error.contains(&format!("{wrong:?}")) && error.contains("rad"), "{error}");
        }
    }
}
