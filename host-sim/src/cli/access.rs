//! `access`: the lock of a joint: its state, its key, and whether it starts locked.
//!
//! The other commands unlock a joint by themselves. This one locks it, and gives it another key.

use super::bus::BusArguments;
use super::output::print_text;
use canopen_rs::Address;
use clap::{Args, Subcommand, ValueEnum};
use firmware::node::dictionary::records::AccessObject;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::canopen::{Client, SdoError, read_key};
use joint_bus::joint::JointNode;
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
pub fn run(arguments: &AccessArguments) -> Result<(), String> {
    let hub = Hub::new();
    if arguments.bus.bus == BusName::Loop {
        let joint = JointNode::start(arguments.bus.node_id, None);
        hub.attach(joint.map_err(|error| error.to_string())?);
    }
    let mut client = arguments.bus.client(arguments.bus.open(&hub)?)?;
    let words = |error: SdoError| error.to_string();
    match &arguments.action {
        Action::Status => {}
        Action::Lock => {
            client.lock().map_err(words)?;
            require_policy(&mut client, arguments)?;
        }
        Action::SetKey { file } => {
            client.set_key(read_key(file)?).and_then(|()| save(&mut client)).map_err(words)?;
        }
        Action::Policy { policy } => {
            let is_locked = matches!(policy, Policy::Locked);
            let set = client.set_locked_by_default(is_locked);
            set.and_then(|()| save(&mut client)).map_err(words)?;
            if is_locked {
                client.lock().map_err(words)?;
            }
        }
    }
    report(&mut client, arguments).map_err(words).and_then(|text| print_text(&text))
}

/// Returns an error if the joint cannot be locked, because every node may write everything.
fn require_policy<B: Bus>(
    client: &mut Client<B>,
    arguments: &AccessArguments,
) -> Result<(), String> {
    let policy = client.read_number(Address::new(index::ACCESS, AccessObject::LOCKED_BY_DEFAULT));
    if policy.map_err(|error| error.to_string())? == 1 {
        return Ok(());
    }
    let (node, bus) = (arguments.bus.node_id.number(), &arguments.bus.bus);
    Err(format!(
        "node {node} on {bus}: not locked, because its policy is open; set it with `host-sim access policy locked`"
    ))
}

fn save<B: Bus>(client: &mut Client<B>) -> Result<(), SdoError> {
    client.write(Address::new(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes())
}

fn report<B: Bus>(client: &mut Client<B>, arguments: &AccessArguments) -> Result<String, SdoError> {
    let mut number = |sub_index| client.read_number(Address::new(index::ACCESS, sub_index));
    let (is_service, is_locked, wrong) = (number(1)? == 1, number(6)? == 1, number(7)?);
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
    let name = format!("node {node} on {}", arguments.bus.bus);
    Ok(format!("{name}: {state}, starts {start}, wrong responses: {wrong}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use compensator_core::can::NodeId;

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
        assert_eq!(require_policy(&mut client, &arguments), Ok(()));
        client.set_locked_by_default(false).expect("unlocks by the default key");
        let words = require_policy(&mut client, &arguments).expect_err("not locked");
        assert!(words.starts_with("node 1 on loop: "), "{words}");
        assert!(words.contains("access policy locked"), "{words}");
        crate::snapshot::check("units-of-commands", "a lock with an open policy", &words);
    }
}
