//! `access`: the lock of a joint: its state, its key, and whether it starts locked.
//!
//! The other commands unlock a joint by themselves. This one locks it, and gives it another key.

use super::bus::BusArguments;
use super::error::{Result, unfit};
use super::output::print_text;
use canopen_rs::Address;
use clap::{Args, Subcommand, ValueEnum};
use firmware::node::dictionary::records::AccessObject;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, SdoError, read_key};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `access`.
#[derive(Args)]
pub struct AccessArguments {
    #[command(flatten)]
    bus: BusArguments,
    #[command(subcommand)]
    action: Action,
    /// Print the result as JSON
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Action {
    /// Show whether the joint is locked, and the wrong responses since the last unlock
    Status,
    /// Lock the joint; staged parameters are discarded
    Lock,
    /// Give the joint another key and save it; --key is the present one. It travels in clear text: no other node may listen
    SetKey {
        /// File with the new key: 32 hexadecimal digits
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
    /// Set whether the joint starts locked, and save it
    Policy {
        /// locked: writes that can hurt need the key; open: every node may write everything
        #[arg(value_name = "locked|open")]
        policy: Policy,
    },
}

#[derive(Clone, Copy, ValueEnum)]
enum Policy {
    Locked,
    Open,
}

/// Runs the command.
pub fn run(arguments: &AccessArguments) -> Result {
    let hub = arguments.bus.hub_with_driver()?;
    let mut client = arguments.bus.client(arguments.bus.open(&hub)?)?;
    match &arguments.action {
        Action::Status => {}
        Action::Lock => {
            client.lock()?;
            require_policy(&mut client, arguments)?;
        }
        Action::SetKey { file } => {
            client.set_key(read_key(file)?)?;
            save(&mut client)?;
        }
        Action::Policy { policy } => {
            let is_locked = matches!(policy, Policy::Locked);
            client.set_locked_by_default(is_locked)?;
            save(&mut client)?;
            if is_locked {
                client.lock()?;
            }
        }
    }
    print_text(&report(&mut client, arguments)?)
}

/// Returns an error if the joint cannot be locked, because every node may write everything.
fn require_policy<B: Bus>(client: &mut Client<B>, arguments: &AccessArguments) -> Result {
    let policy = Address::new(index::ACCESS, AccessObject::LOCKED_BY_DEFAULT);
    if client.read_number(policy)? == 1 {
        return Ok(());
    }
    Err(unfit(
        arguments.bus.joint_name(),
        "not locked, because its policy is open; set it with `host-sim access policy locked`",
    ))
}

fn save<B: Bus>(client: &mut Client<B>) -> Result<(), SdoError> {
    client.write(Address::new(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes())
}

fn report<B: Bus>(client: &mut Client<B>, arguments: &AccessArguments) -> Result<String, SdoError> {
    let mut number = |sub_index| client.read_number(Address::new(index::ACCESS, sub_index));
    let is_locked = number(AccessObject::LOCKED_BY_DEFAULT)? == 1;
    // The first entry is the level, and the seventh counts wrong responses.
    let (is_service, wrong) = (number(1)? == 1, number(7)?);
    let node = arguments.bus.node_id.number();
    if arguments.json {
        let level = if is_service { "service" } else { "open" };
        let object = json!({
            "node": node, "level": level, "locked_by_default": is_locked, "wrong_responses": wrong,
        });
        return Ok(object.to_string() + "\n");
    }
    let state = if is_service { "not locked" } else { "locked" };
    let start = if is_locked { "locked" } else { "open" };
    let name = arguments.bus.joint_name();
    Ok(format!("{name}: {state}, starts {start}, wrong responses: {wrong}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use compensator_core::can::NodeId;
    use joint_bus::bus::Hub;
    use joint_bus::joint::JointNode;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        access: AccessArguments,
    }

    #[test]
    fn lock_of_a_joint_with_an_open_policy_is_an_error_with_the_remedy() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("starts without a file"));
        let mut client = Client::new(hub.port(), NodeId::FIRST);
        let arguments = Line::parse_from(["access", "lock"]).access;
        assert!(require_policy(&mut client, &arguments).is_ok());
        client.set_locked_by_default(false).expect("unlocks by the default key");
        let words = require_policy(&mut client, &arguments).expect_err("not locked").to_string();
        assert!(words.starts_with("node 1 on loop: "), "{words}");
        assert!(words.contains("access policy locked"), "{words}");
        crate::snapshot::check("units-of-commands", "a lock with an open policy", &words);
    }
}
