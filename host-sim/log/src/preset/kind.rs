//! The tools whose logs have known column names and units.

named! {
    /// A tool whose logs have known column names and units.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Preset {
        /// Tables exported by PlotJuggler: `__time` and topics in SI units.
        PlotJuggler = "plotjuggler",
        /// Logs of mjbots' moteus: `tview` in CSV and JSON lines, and register dumps. Turns, turns per second, Nm.
        Moteus = "moteus",
        /// Properties of an ODrive: `axis0.encoder.vel_estimate` in turns per second.
        ODrive = "odrive",
        /// Registers of a Dynamixel of the X series: 0.229 rpm, 4096 counts per turn, load in 0.1 %.
        Dynamixel = "dynamixel",
        /// Objects of CiA 402 on EtherCAT: `0x6077` in per mille of the rated torque.
        EtherCat = "ethercat",
        /// Exports of TwinCAT Scope: a preamble, and times in ms for each channel.
        TwinCatScope = "twincat-scope",
    }
}
