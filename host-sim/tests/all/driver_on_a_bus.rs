//! A driver in this process, accessed over its bus by a client and by the commands `params`, `node` and `replay`.

use crate::snapshot;
use canopen_rs::{Address, NmtCommand};
use compensator_core::can::NodeId;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use joint_bus::bus::{Bus, Hub, Port};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::joint::{JointError, JointNode};
use std::cell::RefCell;
use std::path::Path;
use std::process::{Command, Output};
use std::rc::Rc;
use std::time::Duration;

const NODE: NodeId = NodeId::FIRST;

fn client(flash: Option<&Path>) -> Client<Port> {
    let hub = Hub::new();
    hub.attach(JointNode::start(NODE, flash).expect("a flash"));
    Client::new(hub.port(), NODE)
}

fn host_sim(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).output().expect("runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn client_reads_writes_and_receives_reason_of_rejection() {
    let mut client = client(None);
    let at = Address::new;
    assert_eq!(client.read_number(at(index::SYNC_OVERFLOW, 0)).unwrap(), 240);
    assert_eq!(client.read_text(at(index::HARDWARE_VERSION, 0)).unwrap(), "PC, host-sim node");
    let scale = at(index::COMPENSATOR, 1);
    client.write(scale, &0.5f32.to_le_bytes()).unwrap();
    assert_eq!(client.read_float(scale).unwrap(), 0.5);
    let error = client.write(scale, &7f32.to_le_bytes()).unwrap_err().to_string();
    assert!(error.starts_with("compensator.scale (2022h:1): "), "{error}");
    assert!(error.contains("scale = 7: ") && error.contains(" 1: "), "{error}");
    snapshot::check("params", "a scale above the limit", &error);
    let record = client.read(at(index::COMMIT, 5)).unwrap();
    client.write(at(index::COMMIT, 5), &record).unwrap();
}

#[test]
fn client_read_of_missing_node_returns_silent_error() {
    let hub = Hub::new();
    let mut client = Client::new(hub.port(), NodeId::new(9).unwrap());
    let error = client.read(Address::new(0x1000, 0)).unwrap_err();
    assert!(matches!(error, SdoError::Silent { node: 9 }), "{error}");
}

/// Returns a driver that has saved this scale, and has not written its flash file yet.
fn joint_with_saved_scale(flash: &Path, value: f32) -> JointNode {
    let joint = Rc::new(RefCell::new(JointNode::start(NODE, Some(flash)).unwrap()));
    let hub = Hub::new();
    hub.attach(joint.clone());
    let mut client = Client::new(hub.port(), NODE);
    client.write(Address::new(index::COMPENSATOR, 1), &value.to_le_bytes()).unwrap();
    let mut set = firmware::parameter_set::ParameterSet::default();
    set.friction.compensator.scale = value;
    client.write(Address::new(index::COMMIT, 3), &set.crc().to_le_bytes()).unwrap();
    client.write(Address::new(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    drop((client, hub));
    Rc::into_inner(joint).expect("the hub is gone").into_inner()
}

/// `run` writes the flash file; a driver attached to a hub does not.
fn run_shortly(joint: &mut JointNode) -> Result<(), JointError> {
    let hub = Hub::new();
    let until = hub.now_ns() + 3_000_000;
    joint.run(&mut hub.port(), |_| hub.now_ns() >= until)
}

#[test]
fn saved_parameters_are_read_from_flash_file_after_restart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash.bin");
    run_shortly(&mut joint_with_saved_scale(&path, 0.625)).unwrap();
    let mut again = client(Some(&path));
    let scale = again.read_float(Address::new(index::COMPENSATOR, 1)).unwrap();
    assert_eq!(scale, 0.625);
    std::fs::write(&path, b"no flash").unwrap();
    let error = JointNode::start(NODE, Some(&path)).err().unwrap().to_string();
    assert!(error.contains("8 bytes") && error.contains("8192"), "{error}");
}

#[test]
fn run_with_a_flash_file_that_cannot_be_written_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash.bin");
    let mut joint = joint_with_saved_scale(&path, 0.625);
    drop(folder);
    let error = run_shortly(&mut joint).unwrap_err();
    assert!(matches!(error, JointError::Flash { .. }), "{error}");
    assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
}

#[test]
fn reset_command_restarts_driver_with_default_parameters() {
    let mut client = client(None);
    client.write(Address::new(index::COMPENSATOR, 1), &0.5f32.to_le_bytes()).unwrap();
    client.command(NmtCommand::ResetNode).unwrap();
    let boot_up = client.bus().receive_within(Duration::from_millis(10)).unwrap().unwrap();
    assert_eq!(boot_up.frame.to_joint().unwrap().identifier(), 0x701);
    assert_eq!(client.read_float(Address::new(index::COMPENSATOR, 1)).unwrap(), 0.9);
}

/// Runs `params` with a driver in the same process.
fn params(arguments: &[&str]) -> Output {
    host_sim(&[&["params", "--bus", "loop"], arguments].concat())
}

#[test]
fn access_shows_and_changes_the_lock_of_a_joint() {
    let folder = tempfile::tempdir().unwrap();
    let key = folder.path().join("joint.key");
    let access = |arguments: &[&str]| host_sim(&[&["access"], arguments].concat());
    std::fs::write(&key, "000102030405060708090a0b0c0d0e0f\n").unwrap();
    let file = key.to_str().unwrap();
    for (arguments, state, policy) in [
        (&["status"][..], "locked", "starts locked"),
        (&["set-key", file], "not locked", "starts locked"),
        (&["policy", "open"], "not locked", "starts open"),
        (&["lock", "--bus", "loop"], "locked", "starts locked"),
    ] {
        let done = access(arguments);
        let printed = text(&done.stdout);
        let start = format!("node 1 on loop: {state}, {policy}, ");
        assert!(printed.starts_with(&start), "{printed}{}", text(&done.stderr));
        assert!(printed.ends_with(": 0\n") && printed.lines().count() == 1, "{printed}");
    }
    let status = text(&access(&["status"]).stdout);
    snapshot::check("access", "state of the lock", &status);
    // The joint has the default key.
    let refused = params(&["save", "--key", file]);
    let words = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{words}");
    assert!(words.contains("node 1 ") && words.contains("FRICTION_JOINT_KEY"), "{words}");
    let mut messages = words;
    for (content, found) in [
        (&b"0001"[..], "joint.key: 4 bytes"),
        (b"ed25519-private 0707", "joint.key: "),
        (&[0xFF; 16], "joint.key: 16 bytes"),
    ] {
        std::fs::write(&key, content).unwrap();
        let refused = access(&["status", "--key", file]);
        let words = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{words}");
        assert!(words.contains(found) && words.contains("32 hexadecimal"), "{words}");
        messages += &words;
    }
    let words = text(&access(&["status", "--key", "none.key"]).stderr);
    assert!(words.starts_with("error: key none.key: "), "{words}");
    snapshot::check("access", "bad keys", &(messages + &words));
}

#[test]
fn params_get_output_has_no_difference_to_driver() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("joint.toml");
    let name = path.to_str().unwrap();
    let got = params(&["get"]);
    assert!(got.status.success());
    std::fs::write(&path, &got.stdout).unwrap();
    let same = params(&["diff", name]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stdout));
    let changed = text(&got.stdout).replace("gear_ratio = 51.0", "gear_ratio = 20.0");
    std::fs::write(&path, changed.replace("damping_fades = false", "damping_fades = true"))
        .unwrap();
    let other = params(&["diff", name]);
    assert_eq!(other.status.code(), Some(1));
    let stdout = text(&other.stdout);
    let differences: Vec<Vec<&str>> =
        stdout.lines().map(|line| line.split([':', ',', ' ']).collect()).collect();
    let expected =
        [["choices.damping_fades", "false", "true"], ["motor.gear_ratio", "51.0", "20.0"]];
    assert_eq!(differences.len(), expected.len(), "{stdout}");
    for (found, expected) in differences.iter().zip(expected) {
        assert!(expected.iter().all(|part| found.contains(part)), "{stdout}");
    }
    snapshot::check("params", "differences to a file", &stdout);
    // The compensator's torque constant must match the gear ratio: validation covers the whole set.
    let refused = params(&["set", name]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr).starts_with("error: torque_constant"),
        "{}",
        text(&refused.stderr)
    );
    // A file of a prismatic joint has units N and m.
    let slides = text(&got.stdout).replace("revolute", "prismatic");
    let slides =
        slides.replace("Nm/rad", "N/m").replace("Nm s/rad", "N s/m").replace("\"Nm\"", "\"N\"");
    std::fs::write(&path, slides.replace("rad/s\"", "m/s\"")).unwrap();
    for action in ["set", "diff"] {
        let refused = params(&[action, name]);
        let error = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{error}");
        assert!(
            error.contains("prismatic joint (N)") && error.contains("revolute (Nm)"),
            "{error}"
        );
        snapshot::check("params", "a file of a prismatic joint", &error);
    }
}

#[test]
fn params_without_bus_returns_one_line_error() {
    for action in [&["save"][..], &["arm"], &["set", "static_torque=2"], &["get"]] {
        let refused = host_sim(&[&["params"], action].concat());
        let error = text(&refused.stderr);
        assert_eq!(
            (refused.status.code(), text(&refused.stdout).as_str()),
            (Some(2), ""),
            "{action:?}"
        );
        assert!(error.contains("--bus is missing") && error.lines().count() == 1, "{error}");
    }
}

#[test]
fn params_actions_print_what_was_done() {
    let mut printed = String::new();
    for (action, expected) in [
        (&["save"][..], " saved"),
        (&["restore"], " default"),
        (&["disarm"], " safe\n"),
        (&["clear"], " safe\n"),
        (&["reset"], " restart"),
    ] {
        let done = params(action);
        let line = text(&done.stdout);
        assert_eq!((done.status.code(), line.lines().count()), (Some(0), 1), "{action:?}");
        assert!(line.starts_with("node 1 on loop: ") && line.contains(expected), "{line}");
        printed += &line;
    }
    snapshot::check("params", "what actions did", &printed);
    let set = text(&params(&["set", "static_torque=2.5", "choices.damping_fades=true"]).stdout);
    let changes = "choices.damping_fades false -> true, static_torque 1.0 -> 2.5 (crc ";
    assert!(set.contains(changes) && set.contains("not saved"), "{set}");
    let active =
        params(&["set", "static_torque=2.5", "bristle_damping=100", "choices.allow_active=true"]);
    assert_eq!(active.status.code(), Some(0));
    let warning = text(&active.stderr);
    assert!(
        warning.starts_with("warning: allow_active: ") && warning.lines().count() == 1,
        "{warning}"
    );
}

#[test]
fn params_get_and_set_use_names_and_reject_unknown_ones() {
    let got = params(&["get", "compensator.scale", "static_torque", "choices.allow_active"]);
    let printed = "compensator.scale = 0.9\nstatic_torque = 1.0\nchoices.allow_active = false\n";
    assert_eq!(text(&got.stdout), printed);
    let set = params(&["set", "model=improved-lugre", "static_torque=2.5", "--save"]);
    assert_eq!(set.status.code(), Some(0), "{}", text(&set.stderr));
    let mut messages = String::new();
    for (what, found, expected) in [
        ("coulomb_torque=5", "static_torque = 1: ", " 5"),
        ("compensator.scale=2", "scale = 2: ", " 1"),
        ("scale=1", "scale: ", "unknown_scale or compensator.scale"),
        ("static_torque=much", "static_torque: ", "\"much\""),
        ("choices.passive=true", "choices.passive: ", "damping_fades"),
        ("nowhere.toml", "nowhere.toml: ", "NAME=VALUE"),
    ] {
        let refused = params(&["set", what]);
        let error = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{what}");
        let is_named = error.contains(found) && error.contains(expected);
        assert!(is_named && error.lines().count() == 1, "{what}: {error}");
        messages += &error;
    }
    snapshot::check("params", "bad parameters", &messages);
    let status = text(&params(&["status"]).stdout);
    assert!(
        status.contains("state       safe") && status.contains("parameters-default"),
        "{status}"
    );
}

#[test]
fn replay_and_node_with_bad_arguments_return_reason() {
    let mut messages = String::new();
    for (arguments, found) in [
        (&["replay", "nowhere.log"][..], "nowhere.log: "),
        (&["replay", "x.log", "--rate", "0"], "--rate"),
        (&["replay", "x.log", "--bus", "slcan:"], "slcan:"),
        (&["replay", "x.log", "--faults", "loose=1"], "loose"),
        (&["replay", "x.log", "--node-id", "200"], "127"),
        (&["node"], "loop"),
        (&["node", "--seconds=-1"], "above 0"),
    ] {
        let refused = host_sim(arguments);
        let error = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}");
        assert!(error.contains(found), "{arguments:?}: {error}");
        messages += &error;
    }
    snapshot::check("replay", "bad arguments of replay and node", &messages);
}

/// The simulated encoder counts in the negative direction with an offset of 0.3 pi; the phase resistance is 0.13 ohm.
#[test]
fn params_commission_measure_finds_the_simulated_motor() {
    let with_motor = |arguments: &[&str]| params(&[&["commission", "--motor"], arguments].concat());
    let words = |output: &Output| {
        let both = [output.stdout.as_slice(), output.stderr.as_slice()].concat();
        String::from_utf8(both).expect("text")
    };
    let done = with_motor(&["--measure", "--yes"]);
    let text = words(&done);
    assert!(done.status.success(), "{text}");
    for expected in ["ohm (was 0.1200)", "pole pairs                 7"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    snapshot::check("params", "commissioning", &text);
    let done = with_motor(&["--measure", "--yes", "--json"]);
    let result: serde_json::Value = serde_json::from_slice(&done.stdout).expect("JSON");
    let offset = result["wiring"]["encoder_offset_rad"].as_f64().expect("a number");
    let truth = 0.3 * std::f64::consts::PI;
    let turns = (offset - truth) * 7.0 / std::f64::consts::TAU;
    assert!((turns - turns.round()).abs() < 0.002, "{offset}");
    assert_eq!(result["wiring"]["encoder_direction"], -1.0);
    let ohm = result["wiring"]["resistance_ohm"].as_f64().expect("a number");
    assert!((ohm / 0.13 - 1.0).abs() < 0.01, "{ohm}");
    // Each rejection states its reason.
    let mut messages = String::new();
    for (arguments, found) in [
        (&["--measure"][..], "--yes"),
        (&["--measure", "--yes", "--travel", "0.05"], "travel: "),
        (&["--measure", "--yes", "--current", "99"], "0.5 to 26"),
        (&["--measure", "--confirm"], "--confirm"),
    ] {
        let refused = with_motor(arguments);
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}");
        assert!(words(&refused).contains(found), "{arguments:?}: {}", words(&refused));
        messages += &words(&refused);
    }
    let no_motor = params(&["commission", "--measure", "--yes"]);
    assert_eq!(no_motor.status.code(), Some(2), "{}", words(&no_motor));
    snapshot::check("params", "refused commissioning", &(messages + &words(&no_motor)));
}

#[test]
fn params_trend_of_a_joint_without_entries_states_how_to_get_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trend.json");
    let done = params(&["trend", "--write", path.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    assert!(text(&done.stdout).contains(" adapt on"), "{}", text(&done.stdout));
    snapshot::check("params", "a trend without entries", &text(&done.stdout));
    let document: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(document["entries"], serde_json::json!([]));
    assert_eq!(text(&params(&["trend", "--json"]).stdout), std::fs::read_to_string(&path).unwrap());
    let refused = params(&["trend", "--write", "trend.toml"]);
    assert_eq!(refused.status.code(), Some(2));
    let error = text(&refused.stderr);
    assert!(["trend.toml", ".json", ".csv"].iter().all(|name| error.contains(name)), "{error}");
    snapshot::check("params", "a trend to a file of another kind", &error);
}
