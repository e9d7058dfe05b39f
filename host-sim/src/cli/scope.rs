//! `scope`: records signals of a joint's current loop, at up to 20 kHz, around a trigger.
//!
//! The joint keeps the rows in its memory, and they are read afterwards. On the bus `loop`, a simulated joint is moved to
//! and fro.

use super::bus::BusArguments;
use super::error::{Result, found, in_part, unfit};
use super::interrupt;
use super::output::{OutputArguments, print_formatted, print_text};
use super::table;
use super::values::{Expected, expected, number};
use crate::moving_joint;
use clap::Args;
use firmware::control::PERIOD_S;
use firmware::scope::{MAX_SIGNALS, Signal};
use friction_results::scope::{ScopeCapture, ScopeResult};
use joint_bus::bus::{Bus, Hub};
use joint_bus::canopen::Client;
use joint_bus::scope::{Capture, ScopeError, ScopeRequest, ScopeTrigger, capture};
use std::time::Duration;

/// Arguments of `scope`.
#[derive(Args)]
pub struct ScopeArguments {
    /// Signals to record, 1 to 8, such as current_a, velocity_rad_s, torque_nm
    ///
    /// One to eight of current_a, current_d_a, current_reference_a, voltage_q_v, bus_voltage_v, phase_a_a, phase_b_a,
    /// phase_c_a, velocity_rad_s, position_rad, torque_nm, friction_torque_nm, feed_forward_current_a, residual_torque_nm,
    /// level_gain.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', value_parser = signal,
        default_value = "velocity_rad_s,torque_nm")]
    signals: Vec<Signal>,
    /// Rows per second, at most 20000
    #[arg(long, value_name = "HZ", default_value = "20000", value_parser = rate)]
    rate: f64,
    /// What triggers: now, fault, or a recorded signal that crosses a level, such as "velocity_rad_s>0.1" or
    /// "current_a<-2"
    #[arg(long, value_name = "TRIGGER", default_value = "now", value_parser = trigger)]
    trigger: ScopeTrigger,
    /// Share of the rows before the trigger, from 0 to 0.95 [default: 0.1 with a trigger]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    before: Option<f64>,
    /// Number of captures, each with its own trigger; several are several runs of one log
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u16).range(1..=1000))]
    captures: u16,
    /// Longest time to wait for a trigger, s
    #[arg(long, value_name = "S", default_value = "30", value_parser = seconds)]
    timeout: f64,
    #[command(flatten)]
    bus: BusArguments,
    #[command(flatten)]
    output: OutputArguments,
}

fn signal(text: &str) -> Result<Signal, Expected> {
    Signal::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = Signal::ALL.iter().map(|(_, name)| *name).collect();
        expected(format!("one of {}", names.join(", ")))
    })
}

fn rate(text: &str) -> Result<f64, Expected> {
    let most = 1.0 / f64::from(PERIOD_S);
    let least = most / f64::from(u16::MAX);
    let expected = format!("{least:.1} to {most:.0}");
    number(text, |rate| (least..=most.round()).contains(rate), expected)
}

fn share(text: &str) -> Result<f64, Expected> {
    number(text, |share| (0.0..=0.95).contains(share), "0 to 0.95")
}

fn seconds(text: &str) -> Result<f64, Expected> {
    number(text, |time| (0.0..=1e6).contains(time), "0 to 1000000")
}

fn trigger(text: &str) -> Result<ScopeTrigger, Expected> {
    const EXPECTED: &str = "now, fault, NAME>LEVEL or NAME<LEVEL";
    match text {
        "now" => return Ok(ScopeTrigger::Now),
        "fault" => return Ok(ScopeTrigger::Fault),
        _ => {}
    }
    let at = text.find(['<', '>']).ok_or_else(|| expected(EXPECTED))?;
    let (name, level) = text.split_at(at);
    let level_number = number(&level[1..], |_| true, EXPECTED)?;
    Ok(ScopeTrigger::Level {
        signal: signal(name.trim())?,
        level: level_number as f32,
        is_falling: level.starts_with('<'),
    })
}

fn trigger_in_words(trigger: ScopeTrigger) -> String {
    match trigger {
        ScopeTrigger::Now => "now".to_owned(),
        ScopeTrigger::Fault => "fault".to_owned(),
        ScopeTrigger::Level { signal, level, is_falling } => {
            format!("{}{}{level}", signal.name(), if is_falling { '<' } else { '>' })
        }
    }
}

/// Runs the command.
pub fn run(arguments: &ScopeArguments) -> Result {
    let request = request(arguments)?;
    let is_stopped = interrupt::flag()?;
    let is_loop = arguments.bus.is_loop();
    let mut hub = Hub::new();
    if is_loop {
        arguments.bus.check_first_node("--bus loop")?;
        hub = moving_joint::start()?;
    }
    let mut client = arguments.bus.client(arguments.bus.open(&hub)?)?;
    if is_loop {
        moving_joint::bring_up(&mut client)?;
    }
    let captures = record(&mut client, &request, arguments.captures, is_stopped)?;
    let name = if is_loop { "simulated joint".to_owned() } else { arguments.bus.bus.to_string() };
    let result = ScopeResult {
        signals: request.signals.iter().map(|signal| signal.name().to_owned()).collect(),
        period_s: request.period_s(),
        trigger: trigger_in_words(request.trigger),
        joint: format!("{name}, node {}", arguments.bus.node_id.number()),
        captures,
    };
    let files = result.files()?;
    let all: Vec<(&str, &[u8])> = files.all().collect();
    arguments.output.write(&all)?;
    if arguments.output.json {
        return print_text(&files.document.1);
    }
    let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
    let folder = arguments.output.folder().display();
    print_formatted(&format!(
        "{}\n\n{}\n\nWritten to {folder}: {}\n",
        result.headline(),
        table::scope(&result.summary()),
        names.join(", ")
    ))
}

/// Checks the arguments and returns the capture to make.
fn request(arguments: &ScopeArguments) -> Result<ScopeRequest> {
    let signals = arguments.signals.clone();
    if signals.len() > MAX_SIGNALS {
        let expected = format!("1 to {MAX_SIGNALS}");
        return Err(found("--signals", signals.len().to_string(), expected));
    }
    if let Some(twice) = signals.iter().enumerate().find(|(at, one)| signals[..*at].contains(one)) {
        return Err(unfit("--signals", format!("{} is given twice", twice.1.name())));
    }
    if let ScopeTrigger::Level { signal, .. } = arguments.trigger
        && !signals.contains(&signal)
    {
        return Err(unfit("--trigger", format!("{} is not one of --signals", signal.name())));
    }
    let has_trigger = arguments.trigger != ScopeTrigger::Now;
    Ok(ScopeRequest {
        signals,
        every: (1.0 / (f64::from(PERIOD_S) * arguments.rate)).round().max(1.0) as u16,
        trigger: arguments.trigger,
        before: arguments.before.unwrap_or(if has_trigger { 0.1 } else { 0.0 }),
        timeout: Duration::from_secs_f64(arguments.timeout),
    })
}

fn record(
    client: &mut Client<Box<dyn Bus>>,
    request: &ScopeRequest,
    count: u16,
    is_stopped: impl Fn() -> bool,
) -> Result<Vec<ScopeCapture>> {
    let mut captures = Vec::new();
    for number in 1..=count {
        match capture(client, request, &is_stopped) {
            Ok(Capture { columns, trigger_row }) => {
                captures.push(ScopeCapture { columns, trigger_row });
            }
            // What is complete is kept.
            Err(ScopeError::Stopped) if !captures.is_empty() => break,
            Err(error) if count > 1 => return Err(in_part(format!("capture {number}"))(error)),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(captures)
}
