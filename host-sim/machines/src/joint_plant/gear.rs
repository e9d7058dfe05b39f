//! A gear or coupling between the motor and the output: a spring with damping, and play between its flanks.

/// The gear. Angles, torques and coefficients are those of the joint's side.
#[derive(Clone, Copy, Debug)]
pub struct Gear {
    /// Stiffness in contact, Nm/rad.
    pub stiffness_nm_per_rad: f64,
    /// Damping in contact, Nm s/rad.
    pub damping_nm_s_per_rad: f64,
    /// Play from end to end, rad.
    pub play_rad: f64,
}

impl Gear {
    /// Returns the part of a twist beyond the play, rad.
    pub fn strain_rad(&self, twist_rad: f64) -> f64 {
        let half = 0.5 * self.play_rad;
        twist_rad - twist_rad.clamp(-half, half)
    }

    /// Returns the torque at a twist (rad) that changes at a rate (rad/s), Nm. It is 0 within the play.
    ///
    /// A real flank only pushes. Here one that leaves fast also pulls by its damping, for about `damping / stiffness` at most:
    /// less than a millisecond.
    pub fn torque_nm(&self, twist_rad: f64, rate_rad_s: f64) -> f64 {
        match self.strain_rad(twist_rad) {
            0.0 => 0.0,
            strain => self.stiffness_nm_per_rad * strain + self.damping_nm_s_per_rad * rate_rad_s,
        }
    }
}
