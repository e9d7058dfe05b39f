//! Reduces the bristle stiffness while the drive crosses its play.
//!
//! The parameter [`Id::BacklashUnloaded`] selects the point at which this happens. A brake or seal that turns
//! in its seat keeps its preload. It crosses the play directly after a reversal, at constant torque. A belt or
//! gear train first releases its elastic torsion. The flanks separate at zero torque, so it crosses the play in
//! the middle of the transition from one level to the other.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Backlash<T> {
    /// Relative reduction of the stiffness inside the play, 0..=1.
    missing: T,
    /// Share of half the play crossed in one sample, per speed, s/rad.
    per_velocity: T,
    /// True if the drive crosses the play at zero bristle torque, false if directly after a reversal.
    unloaded: bool,
}

impl<T: Real> Term<T> for Backlash<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::BacklashTravel, Id::BacklashStiffnessRatio, Id::BacklashUnloaded];

    /// Position within the play: -1 and 1 at its ends, 0 at its middle.
    type Memory = T;

    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self {
        let constant = T::Setting::from_f64;
        let unloaded = values.single(Id::BacklashUnloaded) > 0.5;
        let half_travel = values.get(Id::BacklashTravel) * constant(0.5);
        if half_travel > constant(0.0) {
            let stiffness = values.get(Id::BacklashStiffnessRatio);
            Self {
                missing: T::from_setting(constant(1.0) - stiffness),
                per_velocity: T::from_setting(period_s / half_travel),
                unloaded,
            }
        } else {
            Self { missing: T::zero(), per_velocity: T::zero(), unloaded }
        }
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self { per_velocity: self.per_velocity * ratio, ..*self }
    }

    #[inline]
    fn act(&self, _: &Sample<T>, play: &mut Self::Memory, effects: &mut Effects<T>) {
        let (one, velocity) = (T::one(), effects.velocity);
        let travel = velocity.abs() * self.per_velocity;
        let sign = velocity.sign();
        // Elastic torsion in the opposite direction is released first, with the flanks in contact.
        let is_releasing = self.unloaded && effects.held * sign < T::zero();
        let room = if is_releasing { T::zero() } else { one - *play * sign };
        let crossed = travel.at_most(room);
        *play = (*play + crossed.copy_sign(velocity)).within(one);
        // Share of the travel of this sample that is without contact: exactly 1 inside the play and
        // exactly 0 at its end. `/` has full precision, which `ratio` has not: the operands can be
        // a few bits of a fixed-point number.
        let free = if travel < room {
            one
        } else if room > T::zero() {
            room / travel
        } else {
            T::zero()
        };
        effects.stiffness_scale = effects.stiffness_scale * (one - self.missing * free);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.missing, self.per_velocity, T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.per_velocity.single().abs() * envelope.velocity_max_rad_s
    }

    fn widen<S: Real>(_: &ParameterValues<S>, _: &Envelope, _: &mut Bounds) {
        // A lower stiffness does not widen any bound of the law.
    }

    fn validate<S: Real>(values: &ParameterValues<S>, _: &Envelope) -> Result<(), ParameterError> {
        let unloaded = values.single(Id::BacklashUnloaded);
        if unloaded != libm::truncf(unloaded) {
            let why = text!("the play is crossed either way");
            return refuse(Id::BacklashUnloaded.text(), unloaded, Bound::Whole, why);
        }
        Ok(())
    }
}
