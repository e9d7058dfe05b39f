//! `update`: installs a signed package on a joint over its bus.

use super::bus::BusArguments;
use super::error::{Result, unfit};
use super::output::print_text;
use super::progress::counted_progress;
use joint_bus::bus::Hub;
use joint_bus::program::package::Release;
use joint_bus::program::update::{Outcome, Stage, Update};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `update`.
#[derive(clap::Args)]
pub struct UpdateArguments {
    /// File of packages that `host-sim sign` made
    #[arg(value_name = "FILE")]
    package: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bus: BusArguments,
}

/// Runs the command.
pub fn run(arguments: &UpdateArguments) -> Result {
    let release = Release::read(&arguments.package)?;
    let (bus, node) = (&arguments.bus, arguments.bus.node_id);
    if bus.is_loop() {
        return Err(unfit(
            "--bus",
            "a driver in this process has no second program; name a bus, such as can0",
        ));
    }
    let mut client = bus.client(bus.open(&Hub::new())?)?;
    let bytes = release.packages().iter().map(|part| part.bytes.len()).max().unwrap_or_default();
    let bar = counted_progress("transfer", "bytes", bytes as u64);
    let update = Update::new(&mut client, node.number(), &release);
    let outcome = update.run(&mut |stage, done| {
        bar.set_position(done.into());
        match stage {
            Stage::Transfer => {}
            Stage::Verification => bar.set_message("verification"),
            Stage::Trial => bar.set_message("restart and trial"),
        }
    });
    bar.finish_and_clear();
    print_text(&(described(arguments, &outcome?) + "\n"))
}

fn described(arguments: &UpdateArguments, outcome: &Outcome) -> String {
    let (bus, node) = (&arguments.bus.bus, arguments.bus.node_id.number());
    let (version, bytes) = (outcome.version, outcome.bytes);
    if arguments.json {
        return json!({
            "node": node,
            "bus": bus.to_string(),
            "previous_version": outcome.previous.map(|version| version.to_string()),
            "version": version.to_string(),
            "was_present": outcome.was_present,
            "bytes": bytes,
            "resumed_at": outcome.resumed_at,
            "duration_s": outcome.duration_ms as f64 * 1e-3,
            "accepts_test_key": outcome.accepts_test_key,
        })
        .to_string();
    }
    let (name, seconds) = (arguments.bus.joint_name(), outcome.duration_ms as f64 * 1e-3);
    let mut text = if outcome.was_present {
        format!("{name}: runs version {version} already")
    } else {
        format!("{name}: version {version} is confirmed, {bytes} bytes in {seconds:.1} s")
    };
    if outcome.accepts_test_key {
        text += "\nnote: this joint accepts the published test key, so anyone can install a program on it";
    }
    text
}
