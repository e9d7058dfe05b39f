//! `joint-fd.dbc`: the frames of a joint that sends its telemetry in one frame of CAN FD (2001h:9).
//!
//! That frame has the identifier of Telemetry, and a DBC has one message per identifier. So it is a file of its own:
//! `joint.dbc` with Telemetry replaced. The signals of the parts are those of their classic frames, further back.
//! `UPDATE_TABLES=1 cargo test -p compensator-core --test all dbc::fd` writes it.

use super::{DBC, Expected, check_layout, expected, read, value};
use compensator_core::can::fd::{FORMAT, LENGTH};
use compensator_core::can::{FdTelemetry, NodeId};
use std::collections::BTreeSet;
use std::fmt::Write;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/joint-fd.dbc");

/// Identifier of the message, and of Telemetry in `joint.dbc`.
const IDENTIFIER: u16 = 897;

/// Identifiers of the parts in `joint.dbc`, in the order of the transmit PDOs.
const PARTS: [u16; 5] = [385, 641, IDENTIFIER, 1153, 1665];

/// First bit of the first part, and bits of a part.
const FIRST_BIT: u32 = 64;
const PART_BITS: u32 = 64;

/// A signal that is not in `joint.dbc`.
#[derive(Clone, Copy)]
struct FdSignal {
    name: &'static str,
    /// Bits, scale, range and unit, as the DBC states them.
    layout: &'static str,
    comment: &'static str,
}

const fn fd_signal(name: &'static str, layout: &'static str, comment: &'static str) -> FdSignal {
    FdSignal { name, layout, comment }
}

/// Signals before the parts, and behind them.
const FIRST_SIGNALS: [FdSignal; 9] = [
    fd_signal("Format", r#"0|8@1+ (1,0) [1|1] """#, "Number of this layout."),
    fd_signal(
        "HasAnswer",
        r#"8|1@1+ (1,0) [0|1] """#,
        "The frame has the data of Answer; otherwise they are 0.",
    ),
    fd_signal(
        "HasStatus",
        r#"9|1@1+ (1,0) [0|1] """#,
        "The frame has the data of Status; otherwise they are 0.",
    ),
    fd_signal(
        "HasTelemetry",
        r#"10|1@1+ (1,0) [0|1] """#,
        "The frame has the data of Telemetry; otherwise they are 0.",
    ),
    fd_signal(
        "HasMotion",
        r#"11|1@1+ (1,0) [0|1] """#,
        "The frame has the data of Motion; otherwise they are 0.",
    ),
    fd_signal(
        "HasTorque",
        r#"12|1@1+ (1,0) [0|1] """#,
        "The frame has the data of Torque; otherwise they are 0.",
    ),
    fd_signal(
        "HasDrive",
        r#"13|1@1+ (1,0) [0|1] """#,
        "The frame has the data of the sixth transmit PDO; otherwise they are 0.",
    ),
    fd_signal(
        "SyncCounter",
        r#"16|8@1+ (1,0) [1|240] """#,
        "Counter of the SYNC that the frame answers.",
    ),
    fd_signal(
        "SyncTime",
        r#"32|32@1+ (1,0) [0|4294967295] "us""#,
        "Time of the SYNC on the clock of the joint, modulo 2^32.",
    ),
];
const LAST_SIGNALS: [FdSignal; 3] = [
    fd_signal("Statusword", r#"384|16@1+ (1,0) [0|65535] """#, "Object 6041h."),
    fd_signal(
        "ActualTorque",
        r#"400|16@1- (1,0) [-32768|32767] "permille""#,
        "Object 6077h, of the rated torque (6076h).",
    ),
    fd_signal(
        "ActualPosition",
        r#"416|32@1- (0.000001,0) [-2147.483648|2147.483647] "rad""#,
        "Object 6064h.",
    ),
];

const COMMENT: &str = "Telemetry of a sample in one frame of CAN FD with a switched bit rate.";

/// Attributes that mark the frame as one of CAN FD, as Vector's tools read them.
const ATTRIBUTES: &str = r#"
BA_DEF_ "BusType" STRING ;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_ BO_ "CANFD_BRS" ENUM "0","1";
BA_DEF_DEF_ "BusType" "CAN";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "CANFD_BRS" "0";
BA_ "BusType" "CAN FD";
BA_ "VFrameFormat" BO_ 897 14;
BA_ "CANFD_BRS" BO_ 897 1;
"#;

/// Returns the lines of `joint.dbc` about a signal of a part: all with these first words, the identifier, and the rest.
fn lines_of_parts(keyword: &'static str) -> impl Iterator<Item = String> {
    PARTS.into_iter().flat_map(move |part| {
        let begin = format!("{keyword} {part} ");
        let rest = DBC.lines().filter_map(move |line| line.strip_prefix(&begin));
        rest.map(move |rest| format!("{keyword} {IDENTIFIER} {rest}\n"))
    })
}

/// Returns the message with its signals.
fn message() -> String {
    let mut text = format!("BO_ {IDENTIFIER} FdTelemetry: {LENGTH} Joint\n");
    let write_signals = |signals: &[FdSignal], text: &mut String| {
        for FdSignal { name, layout, .. } in signals {
            let _ = writeln!(text, " SG_ {name} : {layout} Host");
        }
    };
    write_signals(&FIRST_SIGNALS, &mut text);
    for (place, part) in (0..).zip(PARTS) {
        let head = format!("BO_ {part} ");
        let lines = DBC.lines().skip_while(|line| !line.starts_with(&head)).skip(1);
        for line in lines.take_while(|line| !line.is_empty()) {
            let (name, layout) = line.split_once(" : ").expect(line);
            let (start, layout) = layout.split_once('|').expect(line);
            let start = FIRST_BIT + PART_BITS * place + start.parse::<u32>().expect(line);
            let _ = writeln!(text, "{name} : {start}|{layout}");
        }
    }
    write_signals(&LAST_SIGNALS, &mut text);
    text
}

/// Returns the file.
fn fd_dbc() -> String {
    let mut text = String::new();
    let is_telemetry =
        |identifier: &str| identifier.trim_end_matches(':') == IDENTIFIER.to_string();
    let mut is_skipped = false;
    let mut previous = "";
    for line in DBC.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let keyword = previous.split_whitespace().next().unwrap_or_default();
        if line.is_empty() {
            // The lines of the new message end the block of their kind. Attributes stand between comments and tables.
            match keyword {
                "CM_" => {
                    text.extend(comments());
                    text += ATTRIBUTES;
                }
                "VAL_" => text.extend(tables()),
                _ => {}
            }
        }
        match words[..] {
            ["BO_", identifier, ..] if is_telemetry(identifier) => {
                is_skipped = true;
                text += &message();
            }
            ["CM_", "BO_" | "SG_", identifier, ..] if is_telemetry(identifier) => {}
            ["VAL_" | "SIG_VALTYPE_", identifier, ..] if is_telemetry(identifier) => {}
            ["SIG_VALTYPE_"] => {
                text += line;
                text += "\n    BA_DEF_\n    BA_DEF_DEF_\n    BA_\n";
            }
            [] => {
                is_skipped = false;
                text.push('\n');
            }
            _ if is_skipped => {}
            _ => {
                text += line;
                text.push('\n');
            }
        }
        previous = line;
    }
    text.extend(lines_of_parts("SIG_VALTYPE_"));
    text
}

fn comments() -> Vec<String> {
    let mut lines = vec![format!("CM_ BO_ {IDENTIFIER} \"{COMMENT}\";\n")];
    let comment_line = |FdSignal { name, comment, .. }: FdSignal| {
        format!("CM_ SG_ {IDENTIFIER} {name} \"{comment}\";\n")
    };
    lines.extend(FIRST_SIGNALS.into_iter().chain(LAST_SIGNALS).map(comment_line));
    lines.extend(lines_of_parts("CM_ SG_"));
    lines
}

fn tables() -> Vec<String> {
    let flags =
        FIRST_SIGNALS.iter().map(|signal| signal.name).filter(|name| name.starts_with("Has"));
    let values = flags.map(|name| format!("VAL_ {IDENTIFIER} {name} 0 \"no\" 1 \"yes\" ;\n"));
    values.chain(lines_of_parts("VAL_")).collect()
}

#[test]
fn fd_dbc_is_the_joints_with_telemetry_replaced() {
    let now = fd_dbc();
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(FILE, &now).expect("can be written");
    }
    let file = std::fs::read_to_string(FILE).expect("joint-fd.dbc is there");
    for (place, (found, expected)) in file.lines().zip(now.lines()).enumerate() {
        assert_eq!(found, expected, "line {}; UPDATE_TABLES=1 writes it anew", place + 1);
    }
    assert_eq!(file.lines().count(), now.lines().count());
    check_layout(&now);
    let (frames, classic) = (read(&now), read(DBC));
    assert!(frames.keys().eq(classic.keys()));
    assert_eq!(frames[&IDENTIFIER].length, LENGTH);
}

/// Decodes each frame of `joint.dbc` as a part of the frame of CAN FD.
#[test]
fn fd_frame_decoded_with_dbc_gives_encoded_values() {
    let frames = read(&std::fs::read_to_string(FILE).expect("joint-fd.dbc is there"));
    let signals = &frames[&IDENTIFIER].signals;
    let mut used: BTreeSet<&str> = BTreeSet::new();
    let mut check = |frame: &FdTelemetry, name: &str, expected: f64| {
        let (name, signal) = signals.get_key_value(name).unwrap_or_else(|| panic!("{name}"));
        assert_eq!(value(frame.data(), signal), expected, "{name}");
        used.insert(name);
    };
    let drive = [0x37, 0x02, 0x9C, 0xFF, 0x80, 0x7B, 0xE1, 0xFF];
    let mut frame = FdTelemetry::new(NodeId::FIRST, 240, 4_000_000_000);
    frame.put(5, drive);
    for (name, expected) in [
        ("Format", f64::from(FORMAT)),
        ("SyncCounter", 240.0),
        ("SyncTime", 4e9),
        ("HasDrive", 1.0),
        ("HasAnswer", 0.0),
        ("Statusword", 567.0),
        ("ActualTorque", -100.0),
        ("ActualPosition", -2.0),
    ] {
        check(&frame, name, expected);
    }
    let has = ["HasAnswer", "HasStatus", "HasTelemetry", "HasMotion", "HasTorque"];
    for Expected { message, signals, .. } in all_of_parts() {
        let classic = message.emit();
        let place = PARTS.iter().position(|part| *part == classic.identifier()).unwrap();
        let mut frame = FdTelemetry::new(NodeId::FIRST, 1, 0);
        frame.put(place, classic.data().try_into().unwrap());
        for (other, name) in has.into_iter().enumerate() {
            check(&frame, name, f64::from(u8::from(other == place)));
        }
        assert!(frame.frames().eq([classic]));
        signals.iter().for_each(|expected| check(&frame, &expected.name, expected.value));
    }
    assert_eq!(used.len(), signals.len(), "a signal of the DBC is not used by the code");
}

fn all_of_parts() -> impl Iterator<Item = Expected> {
    expected().into_iter().filter(|frame| PARTS.contains(&frame.message.emit().identifier()))
}
