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

/// Expected content of a frame: the name, and each signal with its unit and value.
type Expected = (Message, &'static str, Vec<(String, &'static str, f64)>);

fn named(values: &[(&str, &'static str, f64)]) -> Vec<(String, &'static str, f64)> {
    values.iter().map(|(name, unit, value)| ((*name).to_owned(), *unit, *value)).collect()
}

/// Returns the DBC name of a flag: `SLEW_LIMITED` becomes `SlewLimited`.
fn dbc_name(flag: &str) -> String {
    let word = |word: &str| word[..1].to_owned() + &word[1..].to_lowercase();
    flag.split('_').map(word).collect()
}

fn expected() -> Vec<Expected> {
    let node = NodeId::FIRST;
    let status = |flags: Flags| {
        let mut values: Vec<_> = Flags::all()
            .iter_names()
            .map(|(name, flag)| (dbc_name(name), "", f64::from(u8::from(flags.contains(flag)))))
            .collect();
        values.push(("Sequence".to_owned(), "", 70_001.0));
        (Message::Status(node, StatusFrame { flags, sequence: 70_001 }), "Status", values)
    };
    let entry = |entry: TraceEntry, sub_index: f64, name, value| {
        let head = [("Command", "", 35.0), ("Index", "", 8192.0), ("SubIndex", "", sub_index)];
        (Message::Entry(node, entry), "Entry", named(&[&head[..], &[(name, "", value)]].concat()))
    };
    let mut all = vec![
        (Message::Sync(SyncFrame { counter: 239 }), "Sync", named(&[("Counter", "", 239.0)])),
        (
            Message::Motion(node, MotionFrame { velocity_rad_s: -1.5, position_rad: 40.25 }),
            "Motion",
            named(&[("Velocity", "rad/s", -1.5), ("Position", "rad", 40.25)]),
        ),
        (
            Message::Torque(node, TorqueFrame { torque_nm: 3.5, load_torque_nm: -26.0 }),
            "Torque",
            named(&[("MeasuredTorque", "Nm", 3.5), ("LoadTorque", "Nm", -26.0)]),
        ),
        (
            Message::Seal(node, SealFrame { radial_force_n: 75.5, pressure_diff_pa: 250_000.0 }),
            "Seal",
            named(&[("RadialForce", "N", 75.5), ("PressureDiff", "Pa", 250_000.0)]),
        ),
        (
            Message::Surroundings(
                node,
                SurroundingsFrame { temperature_c: 11.5, auxiliary: -0.125 },
            ),
            "Surroundings",
            named(&[("Temperature", "degC", 11.5), ("Auxiliary", "", -0.125)]),
        ),
        (
            Message::Answer(
                node,
                AnswerFrame { friction_torque_nm: 2.75, feed_forward_current_a: -1.25 },
            ),
            "Answer",
            named(&[("FrictionTorque", "Nm", 2.75), ("FeedForwardCurrent", "A", -1.25)]),
        ),
        (
            Message::Telemetry(node, TelemetryFrame { current_a: 4.5, residual_torque_nm: -0.375 }),
            "Telemetry",
            named(&[("Current", "A", 4.5), ("ResidualTorque", "Nm", -0.375)]),
        ),
        (
            Message::Command(node, CommandFrame::new(-2.5, -0.625, 200)),
            "Command",
            named(&[
                ("CurrentCommand", "A", -2.5),
                ("VelocityReference", "rad/s", -0.625),
                ("CommandCounter", "", 200.0),
            ]),
        ),
        entry(TraceEntry::Run(12), 1.0, "Run", 12.0),
        entry(TraceEntry::Sequence(240), 2.0, "NextSequence", 240.0),
        entry(TraceEntry::JointKind(JointKind::Prismatic), 3.0, "JointKind", 1.0),
    ];
    all.push(status(Flags::empty()));
    all.extend(Flags::all().iter().map(status));
    all
}

#[test]
fn every_frame_decoded_with_dbc_gives_encoded_values() {
    let frames = read(DBC);
    let mut used: BTreeSet<(u16, String)> = BTreeSet::new();
    for (message, name, values) in expected() {
        let frame = message.emit();
        let identifier = frame.identifier();
        let info = frames.get(&identifier).unwrap_or_else(|| panic!("{name} is not in the DBC"));
        assert_eq!(info.name, name);
        assert_eq!(info.length, frame.data().len(), "{name}");
        let multiplexor = info.signals.get("SubIndex").map(|of| bits(frame.data(), of));
        for (signal_name, unit, expected) in values {
            let signal = info
                .signals
                .get(&signal_name)
                .unwrap_or_else(|| panic!("{name}.{signal_name} is not in the DBC"));
            assert!(signal.multiplexed.is_none() || signal.multiplexed == multiplexor);
            assert_eq!(signal.unit, unit, "{name}.{signal_name}");
            assert_eq!(value(frame.data(), signal), expected, "{name}.{signal_name}");
            used.insert((identifier, signal_name));
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
