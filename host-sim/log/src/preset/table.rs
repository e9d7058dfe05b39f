//! The columns of each preset, by the words of their names.

use super::Preset;
use crate::unit;

/// The unit of a preset's column, unless its name or the file states another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PresetUnit {
    /// That of the contract.
    Si,
    /// A unit as `--columns` takes it.
    Fixed(&'static str),
    /// A share of the rated torque, percent.
    Rated(f64),
    /// Amperes.
    Current,
    /// Not known: an example of what to type.
    Unknown(&'static str),
}

/// Names of a column with one unit.
#[derive(Clone, Copy)]
pub(super) struct Pattern {
    /// The names in their order, parted by `|`: each the last words of a name in lower case, or `=` and the whole name.
    names: &'static str,
    unit: PresetUnit,
}

/// How a preset finds the column of a contract name.
pub(super) struct Rule {
    pub column: &'static str,
    /// The contract name for a linear joint.
    pub linear: Option<&'static str>,
    /// True if the log cannot be read without it.
    pub is_required: bool,
    /// True if each joint has its own.
    pub is_of_joint: bool,
    patterns: &'static [Pattern],
}

impl Rule {
    /// Returns the names of the column in their order, each with its unit.
    pub fn names(&self) -> impl Iterator<Item = (&'static str, PresetUnit)> {
        let names =
            |pattern: &'static Pattern| pattern.names.split('|').map(|name| (name, pattern.unit));
        self.patterns.iter().flat_map(names)
    }

    /// Returns true if a contract name is that of the rule, for either joint kind.
    pub fn covers(&self, name: &str) -> bool {
        name == self.column || self.linear == Some(name)
    }

    /// Returns the contract name that a unit fits.
    pub fn in_kind(&self, symbol: &str) -> Option<&'static str> {
        let names = [Some(self.column), self.linear];
        names.into_iter().flatten().find(|name| unit::conversion(name, symbol).is_ok())
    }
}

const fn at(names: &'static str, unit: PresetUnit) -> Pattern {
    Pattern { names, unit }
}

const fn time(patterns: &'static [Pattern]) -> Rule {
    Rule { column: "time_s", linear: None, is_required: true, is_of_joint: false, patterns }
}

const fn velocity(patterns: &'static [Pattern]) -> Rule {
    let linear = Some("velocity_m_s");
    Rule { column: "velocity_rad_s", linear, is_required: true, is_of_joint: true, patterns }
}

const fn position(patterns: &'static [Pattern]) -> Rule {
    let linear = Some("position_m");
    Rule { column: "position_rad", linear, is_required: false, is_of_joint: true, patterns }
}

const fn torque(patterns: &'static [Pattern]) -> Rule {
    let linear = Some("force_n");
    Rule { column: "torque_nm", linear, is_required: true, is_of_joint: true, patterns }
}

use PresetUnit::{Current, Fixed, Rated, Si, Unknown};

const TURNS: PresetUnit = Fixed("turns");
const TURNS_S: PresetUnit = Fixed("turns/s");

/// Times without a unit in their name are in seconds.
const ANY_TIME: Pattern = at("=time|=timestamp|=t|time|timestamp", Si);

/// ROS states SI units (REP 103).
const PLOTJUGGLER: &[Rule] = &[
    time(&[at("=__time", Si)]),
    velocity(&[at("velocity", Si)]),
    position(&[at("position", Si)]),
    torque(&[at("effort|torque", Si)]),
];

const MOTEUS: &[Rule] = &[
    time(&[at("=timestamp|=time|time|timestamp", Si)]),
    velocity(&[at("servo stats velocity|data velocity|=velocity", TURNS_S)]),
    position(&[at("servo stats position|data position|=position", TURNS)]),
    torque(&[at("servo stats torque nm|data torque nm|=torque_nm|=torque", Si)]),
];

/// Firmware 0.5 has `encoder.vel_estimate`, firmware 0.6 has `vel_estimate` of the axis and `pos_vel_mapper`.
const ODRIVE: &[Rule] = &[
    time(&[ANY_TIME]),
    velocity(&[at("encoder vel estimate|vel estimate|pos vel mapper vel", TURNS_S)]),
    position(&[at("encoder pos estimate|pos estimate|pos vel mapper pos rel", TURNS)]),
    torque(&[
        at("motor torque estimate|torque estimate", Si),
        at("motor current control iq measured|motor foc iq measured|iq measured", Current),
    ]),
];

/// Control table of the X series.
const DYNAMIXEL: &[Rule] = &[
    time(&[at("realtime tick", Fixed("ms")), ANY_TIME]),
    velocity(&[
        at("present velocity", Fixed("0.229rpm")),
        at("present speed", Unknown("0.111rpm, the size of one count")),
    ]),
    position(&[at("present position", Fixed("4096counts"))]),
    torque(&[
        at("present current", Unknown("0.0012Nm, the torque of one count")),
        at("present load", Rated(0.1)),
    ]),
    Rule {
        column: "temperature_c",
        linear: None,
        is_required: false,
        is_of_joint: true,
        patterns: &[at("present temperature", Fixed("degC"))],
    },
];

/// Velocity and position are in units that the drive's configuration defines (objects 60A8h, 60A9h, 608Fh).
const ETHERCAT: &[Rule] = &[
    time(&[ANY_TIME]),
    velocity(&[at("0x606c|606ch|606c|velocity actual value|actual velocity", DRIVE_VELOCITY)]),
    position(&[at("0x6064|6064h|position actual value|actual position", DRIVE_POSITION)]),
    torque(&[at("0x6077|6077h|torque actual value|actual torque", Rated(0.1))]),
];

const DRIVE_VELOCITY: PresetUnit = Unknown("rpm or 4096counts/s (object 60A9h)");
const DRIVE_POSITION: PresetUnit = Unknown("deg or 4096counts (object 60A8h)");

const TWINCAT_SCOPE: &[Rule] = &[
    time(&[at("=time", Fixed("ms"))]),
    velocity(&[at("actvelo|actvelocity|act velo|velo|velocity", NC_VELOCITY)]),
    position(&[at("actpos|actposition|act pos|position", NC_POSITION)]),
    torque(&[at("acttorque|act torque|torque", NC_TORQUE), at("torque actual value", Rated(0.1))]),
];

const NC_VELOCITY: PresetUnit = Unknown("deg/s or mm/s");
const NC_POSITION: PresetUnit = Unknown("deg or mm");
const NC_TORQUE: PresetUnit = Unknown("Nm, or 0.1% with --rated-torque");

impl Preset {
    /// Returns the rules of the preset's columns.
    pub(super) fn rules(self) -> &'static [Rule] {
        match self {
            Self::PlotJuggler => PLOTJUGGLER,
            Self::Moteus => MOTEUS,
            Self::ODrive => ODRIVE,
            Self::Dynamixel => DYNAMIXEL,
            Self::EtherCat => ETHERCAT,
            Self::TwinCatScope => TWINCAT_SCOPE,
        }
    }

    /// Returns the words by which a log of the tool is recognised: the names have all words of one of the lists.
    pub(super) fn marks(self) -> &'static [&'static [&'static str]] {
        match self {
            Self::PlotJuggler => &[&["=__time"]],
            Self::Moteus => &[
                &["servo stats"],
                &["=timestamp", "=velocity", "=torque_Nm"],
                &["=data.velocity", "=data.torque_Nm"],
                &["=POSITION", "=VELOCITY", "=TORQUE"],
            ],
            Self::ODrive => &[&["vel estimate"], &["pos vel mapper"]],
            Self::Dynamixel => &[&["present velocity"], &["present position"]],
            Self::EtherCat => {
                &[&["0x606c"], &["606ch"], &["0x6077"], &["6077h"], &["torque actual value"]]
            }
            // Known by its preamble.
            Self::TwinCatScope => &[],
        }
    }
}
