//! `move`: moves a joint by hand of the command line, and reports how well it followed.

use super::bus::BusArguments;
use super::error::{Result, found, unfit};
use super::joint_on_bus::{JointArguments, MotionArguments, start_hub};
use super::output::{OutputArguments, print_text};
use super::tune::{Terminal, read_motion};
use super::values::{Expected, expected};
use clap::Args;
use friction_results::tune::TuneQuantity;
use joint_tuning::motion::{Motion, MotionBuilder, TARGET_PERIOD_S, standard};
use joint_tuning::recording::emit_csv;
use joint_tuning::{MotionLimits, MoveOptions, perform};
use std::path::PathBuf;

/// Arguments of `move`.
#[derive(Args)]
pub struct MoveArguments {
    #[command(flatten)]
    what: RequestedMotion,
    /// Write the motion without moving anything: motion.csv with time_s and position_rad, or position_m
    #[arg(long)]
    dry_run: bool,
    /// Do not ask before the joint moves
    #[arg(long)]
    yes: bool,
    #[command(flatten)]
    joint: JointArguments,
    #[command(flatten)]
    limits: MotionArguments,
    #[command(flatten)]
    bus: BusArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// What the joint does.
#[derive(Args)]
#[group(required = true, multiple = false)]
pub struct RequestedMotion {
    /// Move to this position, rad
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Sine around the present position: amplitude, rad, and frequency, Hz, such as 0.2,0.5; ten periods, or a third number
    #[arg(long, value_name = "RAD,HZ[,PERIODS]", value_parser = sine)]
    sine: Option<Sine>,
    /// Motion of a CSV file with time_s and position_rad, from the present position on
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// The standard motion of `tune`: sines and a slow triangle through reversals, rests
    #[arg(long)]
    standard: bool,
}

/// A sine.
#[derive(Clone, Copy, Debug)]
struct Sine {
    amplitude_rad: f64,
    hz: f64,
    periods: usize,
}

fn sine(text: &str) -> Result<Sine, Expected> {
    let expected = || {
        expected(
            "an amplitude in rad and a frequency in Hz, such as 0.2,0.5, and at most 1000 periods",
        )
    };
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| *number > 0.0));
    match numbers.ok_or_else(expected)?[..] {
        [amplitude_rad, hz] => Ok(Sine { amplitude_rad, hz, periods: 10 }),
        [amplitude_rad, hz, periods] if periods <= 1000.0 && periods.fract() == 0.0 => {
            Ok(Sine { amplitude_rad, hz, periods: periods as usize })
        }
        _ => Err(expected()),
    }
}

impl MoveArguments {
    /// Returns the motion relative to the present position.
    fn motion(&self, limits: &MotionLimits) -> Result<Motion> {
        if let Some(path) = &self.what.file {
            return read_motion(path, limits);
        }
        let Some(sine) = self.what.sine else { return Ok(standard(limits)) };
        let Sine { amplitude_rad, hz, periods } = sine;
        let peak_rad_s = std::f64::consts::TAU * hz * amplitude_rad;
        if peak_rad_s > limits.speed_rad_s {
            let speed = format!("a speed of {peak_rad_s:.3} rad/s");
            let most = limits.speed_rad_s;
            return Err(found("--sine", speed, format!("at most {most} rad/s (--speed)")));
        }
        let builder = MotionBuilder::new(*limits).rest(0.2);
        let motion = builder
            .stroke(-amplitude_rad, 0.5 * limits.speed_rad_s)
            .sine(amplitude_rad, peak_rad_s, periods)
            .finish("sine");
        motion.validate(limits)?;
        Ok(motion)
    }
}

/// Runs the command.
pub fn run(arguments: &MoveArguments) -> Result {
    let is_file = arguments.dry_run && arguments.what.standard;
    let (limits, column) = arguments.limits.limits(is_file)?;
    if arguments.dry_run {
        if arguments.what.to.is_some() {
            return Err(unfit(
                "--dry-run",
                "not with --to, whose way depends on where the joint stands",
            ));
        }
        let motion = arguments.motion(&limits)?;
        let mut text = format!("time_s,{column}\n");
        for (step, position) in motion.positions_rad.iter().enumerate() {
            text += &format!("{:.3},{position:.6}\n", step as f64 * TARGET_PERIOD_S);
        }
        return arguments.output.finish(&[("motion.csv", text.as_bytes())], &text, "");
    }
    let is_motion = arguments.what.to.is_none();
    let motion = is_motion.then(|| arguments.motion(&limits)).transpose()?;
    let hub = start_hub(&arguments.bus, &arguments.joint)?;
    let client = arguments.bus.client(arguments.bus.open(&hub)?)?;
    let options = MoveOptions {
        node: arguments.bus.node_id,
        limits,
        motion,
        to_rad: arguments.what.to,
        joint: arguments.bus.joint_name(),
    };
    let yes = arguments.yes || arguments.bus.is_loop();
    let mut user = Terminal { yes, quiet: arguments.output.json };
    let moved = perform(client, &options, super::interrupt::flag()?, &mut user)?;
    let Some(scores) = moved.scores else {
        let at_rad = moved.position_rad;
        return if arguments.output.json {
            print_text(&format!("{}\n", serde_json::json!({"position_rad": at_rad})))
        } else {
            print_text(&format!("{}: at {at_rad:.4} rad\n", options.joint))
        };
    };
    let mut document = serde_json::Map::new();
    let mut text = String::new();
    for quantity in TuneQuantity::ALL {
        let value = scores.of(quantity);
        text += &format!("{}: {value:.5} {}\n", quantity.in_words(), quantity.unit());
        let name = serde_json::to_value(quantity)?;
        document.insert(name.as_str().unwrap_or_default().to_owned(), value.into());
    }
    let document = serde_json::Value::Object(document).to_string() + "\n";
    let rows = emit_csv(&moved.recording);
    arguments.output.finish(&[("move.csv", rows.as_bytes())], &document, &text)
}
