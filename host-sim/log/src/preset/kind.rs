//! The tools whose logs have known column names and units.

/// A tool whose logs have known column names and units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// Tables exported by PlotJuggler: `__time` and topics in SI units.
    PlotJuggler,
    /// Logs of mjbots' moteus: `tview` in CSV and JSON lines, and register dumps. Turns, turns per second, Nm.
    Moteus,
    /// Properties of an ODrive: `axis0.encoder.vel_estimate` in turns per second.
    ODrive,
    /// Registers of a Dynamixel of the X series: 0.229 rpm, 4096 counts per turn, load in 0.1 %.
    Dynamixel,
    /// Objects of CiA 402 on EtherCAT: `0x6077` in per mille of the rated torque.
    EtherCat,
    /// Exports of TwinCAT Scope: a preamble, and times in ms for each channel.
    TwinCatScope,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 6] = [
        Self::PlotJuggler,
        Self::Moteus,
        Self::ODrive,
        Self::Dynamixel,
        Self::EtherCat,
        Self::TwinCatScope,
    ];

    /// Returns the name for the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PlotJuggler => "plotjuggler",
            Self::Moteus => "moteus",
            Self::ODrive => "odrive",
            Self::Dynamixel => "dynamixel",
            Self::EtherCat => "ethercat",
            Self::TwinCatScope => "twincat-scope",
        }
    }
}
