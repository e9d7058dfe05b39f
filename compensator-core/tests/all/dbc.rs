//! Checks that `joint.dbc` and the code describe the same frames.
//!
//! The tests read the DBC and decode each emitted frame by the bits that the DBC states. The decoded values must equal
//! the encoded values, under the expected name and unit. Both descriptions must be complete: the code uses every frame
//! and signal of the DBC, and every flag of the compensator has a bit, a comment and two value names.
//! `joint-fd.dbc` is derived from it ([`fd`]).

mod fd;

use compensator_core::Flags;
use compensator_core::can::{
    AnswerFrame, CommandFrame, JointKind, Message, MotionFrame, NodeId, SealFrame, StatusFrame,
    SurroundingsFrame, SyncFrame, TelemetryFrame, TorqueFrame, TraceEntry,
};
use std::collections::{BTreeMap, BTreeSet};

const DBC: &str = include_str!("../../joint.dbc");

#[derive(Debug)]
struct Signal {
    start: u32,
    length: u32,
    signed: bool,
    scale: f64,
    unit: String,
    float: bool,
    /// Value of the multiplexor that selects this signal; `None` if the signal is always present.
    multiplexed: Option<u64>,
    comment: bool,
    words: bool,
}

#[derive(Debug, Default)]
struct FrameInfo {
    name: String,
    length: usize,
    comment: bool,
    signals: BTreeMap<String, Signal>,
}

/// Reads a DBC. Panics on any other element of the format.
fn read(dbc: &str) -> BTreeMap<u16, FrameInfo> {
    let mut frames: BTreeMap<u16, FrameInfo> = BTreeMap::new();
    let mut current = 0;
    for line in dbc.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let identifier = |at: usize| -> u16 { words[at].parse().expect(line) };
        match words[..] {
            ["BO_", _, name, length, _] => {
                current = identifier(1);
                let name = name.strip_suffix(':').expect(line).to_owned();
                let info =
                    FrameInfo { name, length: length.parse().unwrap(), ..Default::default() };
                assert!(frames.insert(current, info).is_none(), "{line}");
            }
            ["SG_", name, .., ":", bits, scale, _, unit, _] => {
                let (start, rest) = bits.split_once('|').expect(line);
                let (length, order) = rest.split_once('@').expect(line);
                // Little-endian, without an offset.
                assert!(matches!(order, "1+" | "1-"), "{line}");
                let scale = scale.strip_prefix('(').and_then(|rest| rest.strip_suffix(",0)"));
                let multiplexed = match words[2] {
                    ":" | "M" => None,
                    of => Some(of.strip_prefix('m').expect(line).parse().unwrap()),
                };
                let signal = Signal {
                    start: start.parse().unwrap(),
                    length: length.parse().unwrap(),
                    signed: order == "1-",
                    scale: scale.expect(line).parse().unwrap(),
                    unit: unit.trim_matches('"').to_owned(),
                    float: false,
                    multiplexed,
                    comment: false,
                    words: false,
                };
                let signals = &mut frames.get_mut(&current).unwrap().signals;
                assert!(signals.insert(name.to_owned(), signal).is_none(), "{line}");
            }
            // List of the keywords.
            ["CM_" | "VAL_" | "SIG_VALTYPE_" | "BA_DEF_" | "BA_DEF_DEF_" | "BA_"] => {}
            ["BA_DEF_" | "BA_DEF_DEF_" | "BA_", _, ..] => {}
            ["CM_", "BO_", _, ..] => frames.get_mut(&identifier(2)).expect(line).comment = true,
            ["CM_", "SG_", _, name, ..] => signal(&mut frames, identifier(2), name).comment = true,
            ["VAL_", _, name, .., ";"] => signal(&mut frames, identifier(1), name).words = true,
            ["SIG_VALTYPE_", _, name, ":", "1;"] => {
                signal(&mut frames, identifier(1), name).float = true;
            }
            ["CM_", ..] if words[1].starts_with('"') => {}
            [] | ["VERSION", _] | ["NS_", ":"] | ["BS_:"] | ["BU_:", ..] => {}
            _ => panic!("unknown element: {line}"),
        }
    }
    frames
}

fn signal<'a>(
    frames: &'a mut BTreeMap<u16, FrameInfo>,
    identifier: u16,
    name: &str,
) -> &'a mut Signal {
    let frame = frames.get_mut(&identifier).expect(name);
    frame.signals.get_mut(name).unwrap_or_else(|| panic!("{name} of {identifier} is not there"))
}

fn bits(data: &[u8], signal: &Signal) -> u64 {
    let bit = |at: u32| u64::from(data[(at / 8) as usize] >> (at % 8) & 1);
    (0..signal.length).fold(0, |word, at| word | bit(signal.start + at) << at)
}

/// Returns the value of a signal in its unit.
fn value(data: &[u8], signal: &Signal) -> f64 {
    let word = bits(data, signal);
    let unused = 64 - signal.length;
    match (signal.float, signal.signed) {
        (true, _) => f64::from(f32::from_bits(word as u32)),
        (_, true) => ((word << unused) as i64 >> unused) as f64 * signal.scale,
        _ => word as f64 * signal.scale,
    }
}

/// A signal as the DBC must describe it, and its value.
struct ExpectedSignal {
    name: String,
    unit: &'static str,
    value: f64,
}

/// Expected content of a frame.
struct Expected {
    message: Message,
    name: &'static str,
    signals: Vec<ExpectedSignal>,
}

fn decoded(name: impl Into<String>, unit: &'static str, value: f64) -> ExpectedSignal {
    ExpectedSignal { name: name.into(), unit, value }
}

/// Returns the DBC name of a flag: `SLEW_LIMITED` becomes `SlewLimited`.
fn dbc_name(flag: &str) -> String {
    let word = |word: &str| word[..1].to_owned() + &word[1..].to_lowercase();
    flag.split('_').map(word).collect()
}

fn expected_status(flags: Flags) -> Expected {
    let bit = |flag: Flags| f64::from(u8::from(flags.contains(flag)));
    let names = Flags::all().iter_names();
    let mut signals: Vec<_> =
        names.map(|(name, flag)| decoded(dbc_name(name), "", bit(flag))).collect();
    signals.push(decoded("Sequence", "", 70_001.0));
    let frame = StatusFrame { flags, sequence: 70_001 };
    Expected { message: Message::Status(NodeId::FIRST, frame), name: "Status", signals }
}

fn expected_entry(entry: TraceEntry, sub_index: f64, name: &str, value: f64) -> Expected {
    let signals = vec![
        decoded("Command", "", 35.0),
        decoded("Index", "", 8192.0),
        decoded("SubIndex", "", sub_index),
        decoded(name, "", value),
    ];
    Expected { message: Message::Entry(NodeId::FIRST, entry), name: "Entry", signals }
}

fn expected() -> Vec<Expected> {
    let node = NodeId::FIRST;
    let frame = |message, name, signals| Expected { message, name, signals };
    let motion = MotionFrame { velocity_rad_s: -1.5, position_rad: 40.25 };
    let torque = TorqueFrame { torque_nm: 3.5, load_torque_nm: -26.0 };
    let seal = SealFrame { radial_force_n: 75.5, pressure_diff_pa: 250_000.0 };
    let surroundings = SurroundingsFrame { temperature_c: 11.5, auxiliary: -0.125 };
    let answer = AnswerFrame { friction_torque_nm: 2.75, feed_forward_current_a: -1.25 };
    let telemetry = TelemetryFrame { current_a: 4.5, residual_torque_nm: -0.375 };
    let mut all = vec![
        frame(
            Message::Sync(SyncFrame { counter: 239 }),
            "Sync",
            vec![decoded("Counter", "", 239.0)],
        ),
        frame(
            Message::Motion(node, motion),
            "Motion",
            vec![decoded("Velocity", "rad/s", -1.5), decoded("Position", "rad", 40.25)],
        ),
        frame(
            Message::Torque(node, torque),
            "Torque",
            vec![decoded("MeasuredTorque", "Nm", 3.5), decoded("LoadTorque", "Nm", -26.0)],
        ),
        frame(
            Message::Seal(node, seal),
            "Seal",
            vec![decoded("RadialForce", "N", 75.5), decoded("PressureDiff", "Pa", 250_000.0)],
        ),
        frame(
            Message::Surroundings(node, surroundings),
            "Surroundings",
            vec![decoded("Temperature", "degC", 11.5), decoded("Auxiliary", "", -0.125)],
        ),
        frame(
            Message::Answer(node, answer),
            "Answer",
            vec![decoded("FrictionTorque", "Nm", 2.75), decoded("FeedForwardCurrent", "A", -1.25)],
        ),
        frame(
            Message::Telemetry(node, telemetry),
            "Telemetry",
            vec![decoded("Current", "A", 4.5), decoded("ResidualTorque", "Nm", -0.375)],
        ),
        frame(
            Message::Command(node, CommandFrame::new(-2.5, -0.625, 200)),
            "Command",
            vec![
                decoded("CurrentCommand", "A", -2.5),
                decoded("VelocityReference", "rad/s", -0.625),
                decoded("CommandCounter", "", 200.0),
            ],
        ),
    ];
    all.push(expected_entry(TraceEntry::Run(12), 1.0, "Run", 12.0));
    all.push(expected_entry(TraceEntry::Sequence(240), 2.0, "NextSequence", 240.0));
    all.push(expected_entry(TraceEntry::JointKind(JointKind::Prismatic), 3.0, "JointKind", 1.0));
    all.push(expected_status(Flags::empty()));
    all.extend(Flags::all().iter().map(expected_status));
    all
}

#[test]
fn every_frame_decoded_with_dbc_gives_encoded_values() {
    let frames = read(DBC);
    let mut used: BTreeSet<(u16, String)> = BTreeSet::new();
    for Expected { message, name, signals } in expected() {
        let frame = message.emit();
        let identifier = frame.identifier();
        let info = frames.get(&identifier).unwrap_or_else(|| panic!("{name} is not in the DBC"));
        assert_eq!(info.name, name);
        assert_eq!(info.length, frame.data().len(), "{name}");
        let multiplexor = info.signals.get("SubIndex").map(|of| bits(frame.data(), of));
        for expected in signals {
            let place = format!("{name}.{}", expected.name);
            let signal = info.signals.get(&expected.name);
            let signal = signal.unwrap_or_else(|| panic!("{place} is not in the DBC"));
            assert!(signal.multiplexed.is_none() || signal.multiplexed == multiplexor);
            assert_eq!(signal.unit, expected.unit, "{place}");
            assert_eq!(value(frame.data(), signal), expected.value, "{place}");
            used.insert((identifier, expected.name));
        }
    }
    // A master maps this frame, and the reader of logs alone evaluates it.
    let sides = [0x60, 0xE3, 0x16, 0, 0x80, 0x7B, 0xE1, 0xFF];
    for (name, expected) in [("JointPosition", 1.5), ("MotorPosition", -2.0)] {
        let signal = &frames[&0x261].signals[name];
        assert!((value(&sides, signal) - expected).abs() < 1e-9 && signal.unit == "rad");
        used.insert((0x261, name.to_owned()));
    }
    let declared: BTreeSet<(u16, String)> = frames
        .iter()
        .flat_map(|(identifier, info)| {
            info.signals.keys().map(move |name| (*identifier, name.clone()))
        })
        .collect();
    assert_eq!(used, declared, "a signal of the DBC is not used by the code");
}

/// Checks what a DBC has beside the values: comments, tables of values, and a place in the frame of its own.
fn check_layout(dbc: &str) {
    for (identifier, info) in read(dbc) {
        assert!(info.comment, "{} has no comment", info.name);
        for (name, signal) in &info.signals {
            assert!(signal.comment, "{}.{name} has no comment", info.name);
            assert!(
                signal.start + signal.length <= 8 * info.length as u32,
                "{name} leaves the frame"
            );
            let is_choice = signal.length == 1 || ["SubIndex", "JointKind"].contains(&&**name);
            assert_eq!(signal.words, is_choice, "{}.{name}: table of values", info.name);
            for (other_name, other) in &info.signals {
                let apart = signal.start + signal.length <= other.start
                    || other.start + other.length <= signal.start
                    || signal.multiplexed != other.multiplexed;
                assert!(apart || name == other_name, "{identifier}: {name} and {other_name}");
            }
        }
    }
}

#[test]
fn dbc_signals_have_comments_and_do_not_overlap() {
    check_layout(DBC);
}
