//! Scenario 26: the table of the encoders' faults, with what the driver does about each. [`super::encoder_faults`] runs them.

use super::driver::ALL_ENCODER_FAULTS;
use super::encoder_kinds::{ABZ, ABZ_HALL, BISS, HALL, board};
use super::rig::Master;
use joint_rig::{EncoderFault, HallFault, LineFault, SerialFault};

pub const AS5047P: f32 = 0.0;
pub const AS5048A: f32 = 1.0;

/// Kinds of encoders: value of `encoder_kind`, and name.
pub const KINDS: [(f32, &str); 6] = [
    (AS5047P, "AS5047P"),
    (AS5048A, "AS5048A"),
    (ABZ, "ABZ"),
    (ABZ_HALL, "ABZ and Hall sensors"),
    (HALL, "Hall sensors alone"),
    (BISS, "BiSS C"),
];

/// A fault of any encoder.
#[derive(Clone, Copy)]
pub enum Fault {
    Chip(EncoderFault),
    Lines(LineFault),
    Hall(HallFault),
    Serial(SerialFault),
}

impl Fault {
    pub fn set(self, master: &mut Master) {
        match self {
            Self::Chip(fault) => board(master).set_encoder(fault),
            Self::Lines(fault) => board(master).set_lines(fault),
            Self::Hall(fault) => board(master).set_hall(fault),
            Self::Serial(fault) => board(master).set_serial(fault),
        }
    }
}

/// What the driver does, within a time in ms.
#[derive(Clone, Copy)]
pub enum Reaction {
    /// It opens the bridge with `encoder-lost`, and the position is unknown.
    Stops(f64),
    /// It drives on, and reports `encoder-magnet` or `encoder-coasting`.
    Warns(f64),
}

use Fault::{Chip, Hall, Lines, Serial};
use Reaction::{Stops, Warns};

/// Which drivers run a case: the library alone, or the image too.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum RunBy {
    Library,
    Both,
}

use RunBy::{Both, Library};

/// A fault in motion.
#[derive(Clone, Copy)]
pub struct Case {
    pub what: &'static str,
    pub fault: Fault,
    pub reaction: Reaction,
    run_by: RunBy,
}

const fn case(what: &'static str, fault: Fault, reaction: Reaction, run_by: RunBy) -> Case {
    Case { what, fault, reaction, run_by }
}

/// 2 ms until the rotor is lost, a step of the background, and one of the master.
const LOST_MS: f64 = 4.0;
/// 16 samples, 0.8 ms.
const FROZEN_MS: f64 = 3.0;
/// The observer comes to rest in 12 ms, and 3 electrical turns take 3 ms each at 2.7 rad/s.
const UNSEEN_MS: f64 = 30.0;

/// Faults of an AS504x.
const CHIP: [Case; 7] = [
    case("line open", Chip(EncoderFault::High), Stops(LOST_MS), Library),
    case("line low", Chip(EncoderFault::Low), Stops(LOST_MS), Library),
    case("angle frozen", Chip(EncoderFault::Frozen), Stops(FROZEN_MS), Library),
    case("magnet off its shaft", Chip(EncoderFault::Detached), Stops(UNSEEN_MS), Both),
    case("every word disturbed", Chip(EncoderFault::Disturbed(1.0)), Stops(LOST_MS), Library),
    // Missing words in two reports in a row, of twenty each, are nearly sure.
    case("5 % of the words disturbed", Chip(EncoderFault::Disturbed(0.05)), Warns(40.0), Library),
    case(
        "angle jumps by a quarter of a turn",
        Chip(EncoderFault::Jump(4096)),
        Stops(LOST_MS),
        Library,
    ),
];

/// Faults of an ABZ encoder, with Hall sensors and without.
const LINES: [Case; 5] = [
    // A contradiction of the Hall sensors in the first 0.8 ms leaves no angle for 2 ms.
    case("lines missing", Lines(LineFault::Missing), Stops(FROZEN_MS + 2.0), Both),
    case("count jumps by a quarter of a turn", Lines(LineFault::Jump(1024)), Stops(LOST_MS), Both),
    // The next index, after 41 ms at most, and 10 ms between two looks.
    case("30 counts lost", Lines(LineFault::Lost(30)), Warns(60.0), Both),
    case("index missing", Lines(LineFault::NoIndex), Warns(110.0), Both),
    case(
        "every 50th edge lost or counted twice",
        Lines(LineFault::Noisy(0.02)),
        Warns(130.0),
        Both,
    ),
];

/// Faults of Hall sensors alone.
const HALLS: [Case; 5] = [
    case("plug off", Hall(HallFault::Missing), Stops(LOST_MS), Both),
    // An illegal level within an electrical turn, 6 ms, and 2 ms until the rotor is lost.
    case("a sensor stuck", Hall(HallFault::StuckSensor), Stops(10.0), Both),
    case("all levels stuck", Hall(HallFault::Frozen), Stops(UNSEEN_MS + 10.0), Both),
    case("levels jump by half an electrical turn", Hall(HallFault::Jump), Stops(LOST_MS), Both),
    case(
        "a wrong level in 0.4 % of the periods",
        Hall(HallFault::Noisy(0.004)),
        Warns(130.0),
        Library,
    ),
];

/// Faults of an encoder with BiSS C.
const SERIAL: [Case; 9] = [
    case("line open", Serial(SerialFault::Open), Stops(LOST_MS), Both),
    case("line low", Serial(SerialFault::Low), Stops(LOST_MS), Both),
    case("position frozen", Serial(SerialFault::Frozen), Stops(FROZEN_MS), Both),
    case("disc off its shaft", Serial(SerialFault::Detached), Stops(UNSEEN_MS), Library),
    case("every frame disturbed", Serial(SerialFault::Disturbed(1.0)), Stops(LOST_MS), Both),
    case("error bit", Serial(SerialFault::Error), Stops(LOST_MS), Both),
    // A report comes every millisecond, and 10 ms are between two looks.
    case("5 % of the frames disturbed", Serial(SerialFault::Disturbed(0.05)), Warns(40.0), Both),
    case("warning bit", Serial(SerialFault::Warning), Warns(40.0), Both),
    case(
        "position jumps by a quarter of a turn",
        Serial(SerialFault::Jump(0.25)),
        Stops(LOST_MS),
        Both,
    ),
];

/// Faults of one part of two, or that only one of two kinds bears.
const LINE_A_OF_ABZ: Case =
    case("line A stuck", Lines(LineFault::StuckLine), Stops(UNSEEN_MS), Both);
const OF_BOTH: [Case; 5] = [
    // The Hall sensors contradict the count after 85 degrees (electrical), 1.4 ms, and the start of a sector; then 2 ms until the
    // rotor is lost.
    case("line A stuck", Lines(LineFault::StuckLine), Stops(6.0), Both),
    case("Hall sensors' plug off", Hall(HallFault::Missing), Stops(LOST_MS), Library),
    case("a Hall sensor stuck", Hall(HallFault::StuckSensor), Stops(10.0), Library),
    case("all Hall levels stuck", Hall(HallFault::Frozen), Stops(6.0), Library),
    case(
        "a wrong Hall level in 0.4 % of the periods",
        Hall(HallFault::Noisy(0.004)),
        Warns(130.0),
        Both,
    ),
];

/// Returns the faults of a kind of encoder that this driver runs.
pub fn cases(kind: f32) -> Vec<Case> {
    let mut cases = match kind {
        AS5047P | AS5048A => CHIP.to_vec(),
        ABZ => LINES.map(|case| Case { run_by: Library, ..case }).to_vec(),
        ABZ_HALL => [&LINES[..], &OF_BOTH].concat(),
        HALL => HALLS.to_vec(),
        _ => SERIAL.to_vec(),
    };
    if kind == ABZ {
        cases.push(LINE_A_OF_ABZ);
    }
    cases.retain(|case| ALL_ENCODER_FAULTS || case.run_by == Both && kind != AS5048A);
    cases
}

/// What stops a joint that was at rest.
#[derive(Clone, Copy)]
pub struct Stop {
    /// Name of the code.
    pub code: &'static str,
    /// Figure of the row with the time.
    pub figure: &'static str,
    pub within_ms: f64,
}

/// Half a second at 5 A, which the loop of the master reaches within 0.4 s.
const STANDS: Stop = Stop {
    code: "motor-stands",
    figure: "to open bridge with motor-stands, ms",
    within_ms: 1000.0,
};
/// Two sectors after the friction is overcome, by 5 A at most.
pub const LOST: Stop =
    Stop { code: "encoder-lost", figure: "to open bridge with encoder-lost, ms", within_ms: 500.0 };

/// A fault since before the start.
#[derive(Clone, Copy)]
pub struct Start {
    pub kind: f32,
    pub name: &'static str,
    pub fault: Fault,
    pub stop: Stop,
}

const fn start(kind: f32, name: &'static str, fault: Fault, stop: Stop) -> Start {
    Start { kind, name, fault, stop }
}

/// Encoders that count against the phases since before the start.
pub const REVERSED: [Start; 7] = [
    start(AS5047P, "AS5047P", Chip(EncoderFault::Reversed), STANDS),
    start(AS5048A, "AS5048A", Chip(EncoderFault::Reversed), STANDS),
    start(ABZ, "ABZ", Lines(LineFault::Reversed), STANDS),
    start(ABZ_HALL, "ABZ and Hall sensors, lines", Lines(LineFault::Reversed), LOST),
    start(ABZ_HALL, "ABZ and Hall sensors, Hall sensors", Hall(HallFault::Reversed), STANDS),
    start(HALL, "Hall sensors alone", Hall(HallFault::Reversed), STANDS),
    start(BISS, "BiSS C", Serial(SerialFault::Reversed), STANDS),
];

/// Encoders that stand since before the start.
pub const STUCK: [Start; 6] = [
    start(AS5047P, "AS5047P", Chip(EncoderFault::Detached), STANDS),
    start(AS5048A, "AS5048A", Chip(EncoderFault::Detached), STANDS),
    start(ABZ, "ABZ", Lines(LineFault::Missing), STANDS),
    start(ABZ_HALL, "ABZ and Hall sensors, lines", Lines(LineFault::Missing), LOST),
    start(HALL, "Hall sensors alone", Hall(HallFault::Frozen), STANDS),
    start(BISS, "BiSS C", Serial(SerialFault::Frozen), STANDS),
];
