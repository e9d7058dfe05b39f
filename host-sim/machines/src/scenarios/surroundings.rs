//! What surrounds a joint during a run: side load, pressure, temperature, load, and more.
//!
//! Each quantity has a level of the run, a mild ramp and a slow swing. They are drawn independently
//! of each other; kinds of scenario that want two of them to move together say so afterwards.

use std::f64::consts::TAU;

/// What surrounds the seal at an instant, as far as it acts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Around {
    pub force: f64,
    pub force_rate: f64,
    pub pressure: f64,
    pub temperature: f64,
    pub load: f64,
    pub extra: f64,
    pub campaign_s: f64,
    /// Heat of what was rubbed, J.
    pub heat_j: f64,
}

/// A quantity over the time of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signal {
    /// At the start, without the swing.
    pub level: f64,
    /// Ramp, per second.
    pub per_s: f64,
    /// Amplitude of the swing.
    pub swing: f64,
    /// Its frequency, Hz.
    pub hz: f64,
    /// Its phase at the start, rad.
    pub phase: f64,
}

impl Signal {
    /// At a time from the start of the run, s.
    pub fn at(&self, t: f64) -> f64 {
        self.level + self.per_s * t + self.swing * (TAU * self.hz * t + self.phase).sin()
    }

    /// Its rate of change, per second.
    pub fn rate(&self, t: f64) -> f64 {
        let w = TAU * self.hz;
        self.per_s + self.swing * w * (w * t + self.phase).cos()
    }

    /// The quantity that is always `offset + gain x` this one.
    pub fn affine(&self, offset: f64, gain: f64) -> Self {
        Self {
            level: offset + gain * self.level,
            per_s: gain * self.per_s,
            swing: gain * self.swing,
            ..*self
        }
    }
}

/// The extra columns a log may have beyond the contract's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extra {
    /// Of the air in the lab.
    Humidity,
    /// Since the seal was last greased.
    LubricantAge,
    /// Of a cable along the arm.
    CableTension,
    /// Of the drive.
    SupplyVoltage,
}

impl Extra {
    /// Name of the column.
    pub const fn column(self) -> &'static str {
        match self {
            Extra::Humidity => "humidity_percent",
            Extra::LubricantAge => "lubricant_age_h",
            Extra::CableTension => "cable_tension_n",
            Extra::SupplyVoltage => "supply_voltage_v",
        }
    }

    /// Usual lowest and highest reading.
    pub const fn range(self) -> (f64, f64) {
        match self {
            Extra::Humidity => (30.0, 80.0),
            Extra::LubricantAge => (0.0, 40.0),
            Extra::CableTension => (20.0, 80.0),
            Extra::SupplyVoltage => (46.0, 50.0),
        }
    }
}

/// Everything around a joint in one run.
#[derive(Clone, Debug, Default)]
pub(super) struct Condition {
    /// Start of the run on the campaign's clock, s.
    pub start_s: f64,
    /// Side load, N.
    pub force: Signal,
    /// Pressure difference, Pa.
    pub pressure: Signal,
    /// Temperature, deg C.
    pub temperature: Signal,
    /// Transmitted torque, Nm.
    pub load: Signal,
    /// The extra columns.
    pub extras: Vec<(Extra, Signal)>,
}

impl Condition {
    /// An extra column's signal; nothing where the scenario has no such column.
    pub fn extra(&self, extra: Extra) -> Signal {
        let found = self.extras.iter().find(|(known, _)| *known == extra);
        found.map_or_else(Signal::default, |(_, signal)| *signal)
    }

    /// A signal by its column.
    pub fn signal_mut(&mut self, column: &str) -> Option<&mut Signal> {
        match column {
            "radial_force_n" => Some(&mut self.force),
            "pressure_diff_pa" => Some(&mut self.pressure),
            "temperature_c" => Some(&mut self.temperature),
            "load_torque_nm" => Some(&mut self.load),
            _ => {
                let mut extras = self.extras.iter_mut();
                extras.find(|(extra, _)| extra.column() == column).map(|(_, signal)| signal)
            }
        }
    }
}
