//! The operating range that a model is declared for.
//!
//! Validation proves over this range that the friction levels are positive and that fixed-point products do not
//! overflow. The compensator rejects readings outside it. Records store the fields by their order.

use crate::quantity::{Quantity, TEMPERATURE_RANGE_C};

crate::named_fields! {
    /// The operating range that a model is declared for. Validation proves the friction levels over it. The model
    /// step limits the velocity to it.
    pub struct Envelope {
        /// Largest speed, rad/s.
        velocity_max_rad_s: f32 = 12.0;
        /// Largest side load, N; the smallest is 0.
        radial_force_max_n: f32 = 100.0;
        /// Largest pressure difference, Pa; the smallest is 0.
        pressure_diff_max_pa: f32 = 3e5;
        /// Largest transmitted torque, Nm.
        load_torque_max_nm: f32 = 26.0;
        /// Largest distance of the position from zero, rad.
        position_max_rad: f32 = 1000.0;
        /// Largest acceleration, rad/s^2.
        acceleration_max_rad_s2: f32 = 1000.0;
        /// Longest campaign, h.
        campaign_max_h: f32 = 2000.0;
    }
    /// The range of the joint of Ding et al. (100 rpm, 100 N, 0.3 MPa, 26 Nm), with a margin.
}

impl Envelope {
    /// Returns least and largest permitted value of a quantity, in the internal unit of [`crate::Sample`].
    pub fn internal_range(&self, quantity: Quantity) -> [f64; 2] {
        let both = |most: f32| [-f64::from(most), f64::from(most)];
        let positive = |most: f32| [0.0, f64::from(most) * quantity.info().inside_scale];
        match quantity {
            Quantity::Velocity => both(self.velocity_max_rad_s),
            Quantity::Position => both(self.position_max_rad),
            Quantity::CampaignTime => [0.0, f64::from(self.campaign_max_h)],
            Quantity::RadialForce => positive(self.radial_force_max_n),
            Quantity::Pressure => positive(self.pressure_diff_max_pa),
            Quantity::Temperature => TEMPERATURE_RANGE_C,
            Quantity::LoadTorque => both(self.load_torque_max_nm),
            Quantity::Acceleration => both(self.acceleration_max_rad_s2),
            Quantity::Auxiliary | Quantity::Torque => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }
}
