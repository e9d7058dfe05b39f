//! Physical effects on friction, as functions of the quantity that each depends on.
//!
//! Both kinds of simulated joint have them: the one whose motion is imposed ([`crate::scenarios`]) and the driven one
//! ([`crate::joint_plant`]). Each integrates the contact age and the stored heat by its own scheme, and the driven one has its
//! own [`Thinning`].

/// A sinusoidal function of the angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wave {
    /// Amplitude, in the unit of the effect: Nm of an additive torque, a share of the level of a ripple.
    pub size: f64,
    /// Periods per turn.
    pub order: f64,
    /// Phase at angle 0, rad.
    pub phase: f64,
}

impl Wave {
    /// Returns the value at an angle, rad.
    pub fn at(&self, angle: f64) -> f64 {
        self.size * (self.order * angle + self.phase).sin()
    }
}

/// Exponential decrease with temperature, of the viscous friction or of the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// Relative decrease per K.
    pub per_k: f64,
    /// Temperature at which the factor is 1, deg C.
    pub reference_c: f64,
}

impl Thinning {
    /// Returns the factor at a temperature, deg C.
    pub fn factor(&self, temperature_c: f64) -> f64 {
        (-self.per_k * (temperature_c - self.reference_c)).exp()
    }
}

/// Static friction that grows with the contact age. The age grows with time and is lost with travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dwell {
    /// Increase per factor e of the contact age, Nm.
    pub gain_nm: f64,
    /// Contact age from which the friction grows, s.
    pub onset_s: f64,
    /// Travel over which the age is lost, rad.
    pub travel_rad: f64,
}

impl Dwell {
    /// Returns the increase at a contact age (s), Nm.
    pub fn raised_nm(&self, age_s: f64) -> f64 {
        self.gain_nm * (age_s / self.onset_s).ln_1p()
    }
}

/// Change of the level over the campaign. The factor is 1 at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drift {
    /// `1 + rate t`.
    Wear {
        /// Relative change per second.
        per_s: f64,
    },
    /// `(1 + a exp(-t/T)) / (1 + a)`.
    RunIn {
        /// Relative excess at the start.
        amplitude: f64,
        /// Time constant, s.
        time_s: f64,
    },
}

impl Drift {
    /// Returns the factor at a time of the campaign, s.
    pub fn factor(&self, campaign_s: f64) -> f64 {
        match *self {
            Drift::Wear { per_s } => 1.0 + per_s * campaign_s,
            Drift::RunIn { amplitude, time_s } => {
                (1.0 + amplitude * (-campaign_s / time_s).exp()) / (1.0 + amplitude)
            }
        }
    }
}

/// Decrease of the level with the stored friction heat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warming {
    /// Share of the level that is lost at high heat.
    pub fall: f64,
    /// Heat at which a share of 1 - 1/e of the decrease has occurred, J.
    pub energy_j: f64,
    /// Time constant of the cooling, s.
    pub cooling_s: f64,
}

impl Warming {
    /// Returns the factor of the level at a stored heat, J.
    pub fn factor(&self, heat_j: f64) -> f64 {
        1.0 + self.fall * (-heat_j / self.energy_j).exp_m1()
    }
}
