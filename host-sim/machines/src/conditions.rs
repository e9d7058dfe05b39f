//! Operating conditions of a joint during a run: side load, pressure, temperature, load torque, and others.
//!
//! Each quantity has a level, a slow ramp and a slow oscillation. The quantities are drawn independently.
//! Scenarios with correlated columns change them afterwards ([`crate::scenarios::ColumnRelation`]).

use std::f64::consts::TAU;

/// Operating conditions at an instant. Quantities without an effect on the joint stay 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conditions {
    /// Side load, N.
    pub force: f64,
    /// Rate of the side load, N/s.
    pub force_rate: f64,
    /// Pressure difference, Pa.
    pub pressure: f64,
    /// Temperature, deg C.
    pub temperature: f64,
    /// Transmitted load torque, Nm.
    pub load: f64,
    /// Extra column that acts on the joint, in its own unit.
    pub extra: f64,
    /// Campaign time, s.
    pub campaign_s: f64,
    /// Friction heat stored in the seal, J.
    pub heat_j: f64,
}

/// A quantity as a function of the time of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Signal {
    /// Value at the start, without the oscillation.
    pub level: f64,
    /// Ramp, per second.
    pub per_s: f64,
    /// Amplitude of the oscillation.
    pub swing: f64,
    /// Frequency of the oscillation, Hz.
    pub hz: f64,
    /// Phase of the oscillation at the start, rad.
    pub phase: f64,
}

impl Signal {
    /// Returns the value at a time from the start of the run, s.
    pub fn at(&self, t: f64) -> f64 {
        self.level + self.per_s * t + self.swing * (TAU * self.hz * t + self.phase).sin()
    }

    /// Returns the rate of change, per second.
    pub fn rate(&self, t: f64) -> f64 {
        let w = TAU * self.hz;
        self.per_s + self.swing * w * (w * t + self.phase).cos()
    }

    /// Returns the signal `offset + gain x self`.
    pub fn affine(&self, offset: f64, gain: f64) -> Self {
        Self {
            level: offset + gain * self.level,
            per_s: gain * self.per_s,
            swing: gain * self.swing,
            ..*self
        }
    }
}

/// Extra columns of a log beyond those of the data contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extra {
    /// Relative humidity of the air in the laboratory.
    Humidity,
    /// Time since the seal was last greased.
    LubricantAge,
    /// Tension of a cable along the arm.
    CableTension,
    /// Supply voltage of the drive.
    SupplyVoltage,
}

impl Extra {
    /// Returns the name of the column.
    pub const fn column(self) -> &'static str {
        match self {
            Extra::Humidity => "humidity_percent",
            Extra::LubricantAge => "lubricant_age_h",
            Extra::CableTension => "cable_tension_n",
            Extra::SupplyVoltage => "supply_voltage_v",
        }
    }

    /// Returns the usual lowest and highest reading.
    pub const fn range(self) -> (f64, f64) {
        match self {
            Extra::Humidity => (30.0, 80.0),
            Extra::LubricantAge => (0.0, 40.0),
            Extra::CableTension => (20.0, 80.0),
            Extra::SupplyVoltage => (46.0, 50.0),
        }
    }
}

/// Operating conditions of a joint in one run.
#[derive(Clone, Debug, Default)]
pub struct Condition {
    /// Start of the run in campaign time, s.
    pub start_s: f64,
    /// Side load, N.
    pub force: Signal,
    /// Pressure difference, Pa.
    pub pressure: Signal,
    /// Temperature, deg C.
    pub temperature: Signal,
    /// Transmitted load torque, Nm.
    pub load: Signal,
    /// The extra columns.
    pub extras: Vec<(Extra, Signal)>,
}

impl Condition {
    /// Returns the signal of an extra column. It is 0 if the scenario has no such column.
    pub fn extra(&self, extra: Extra) -> Signal {
        let found = self.extras.iter().find(|(known, _)| *known == extra);
        found.map_or_else(Signal::default, |(_, signal)| *signal)
    }

    /// Returns the signal of a column.
    pub fn signal(&self, column: &str) -> Option<Signal> {
        match column {
            "radial_force_n" => Some(self.force),
            "pressure_diff_pa" => Some(self.pressure),
            "temperature_c" => Some(self.temperature),
            "load_torque_nm" => Some(self.load),
            _ => {
                let mut extras = self.extras.iter();
                extras.find(|(extra, _)| extra.column() == column).map(|(_, signal)| *signal)
            }
        }
    }
}
