//! Bristle stiffness is low while the play in the drive is crossed.
//!
//! Where that is depends on what is preloaded. A brake or a seal that turns in its seat keeps its grip and
//! is carried along: the play is crossed right after the reversal, and the torque stays what it was. A band
//! or a gear train that is wound up first gives its windup back; the flanks part when nothing is held any
//! more, so the play is crossed at zero torque, in the middle of the swing from one level to the other.

use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::{Bound, ParameterError, refuse};

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Backlash<T> {
    /// The share of the stiffness that is missing inside the play.
    missing: T,
    /// Share of half the play that is crossed in a sample, per speed, s/rad.
    per_velocity: T,
    /// Crossed once nothing is held any more, not right after a reversal.
    unloaded: bool,
}

impl<T: Real> Term<T> for Backlash<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::BacklashTravel, Id::BacklashStiffnessRatio, Id::BacklashUnloaded];

    const READS: Option<Quantity> = None;

    /// Position within the play, from its middle at 0 to its ends at -1 and 1.
    type Memory = T;

    fn build(values: &Values<T::Setting>, period_s: T::Setting) -> Self {
        let constant = T::Setting::from_f64;
        let unloaded = values.value(Id::BacklashUnloaded) > 0.5;
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
        // What was wound up the other way unwinds first, flank on flank.
        let unwinds = self.unloaded && effects.held * sign < T::zero();
        let room = if unwinds { T::zero() } else { one - *play * sign };
        let crossed = travel.at_most(room);
        *play = (*play + crossed.copy_sign(velocity)).within(one);
        // The share of this sample's travel made without contact: 1 inside the play, 0 at
        // its end, to the last bit. The full division, for these may be the last few bits
        // of a fixed-point number.
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

    fn largest_product(&self, envelope: &Envelope) -> f64 {
        self.per_velocity.value().abs() * f64::from(envelope.velocity_max_rad_s)
    }

    fn widen<S: Real>(_: &Values<S>, _: &Envelope, _: &mut Bounds) {
        // A softer bristle takes no quantity beyond what the law is proven for.
    }

    fn validate<S: Real>(values: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        let unloaded = values.value(Id::BacklashUnloaded);
        if unloaded != libm::trunc(unloaded) {
            let why = "the play is crossed either way";
            return refuse(Id::BacklashUnloaded.name(), unloaded, Bound::Whole, why);
        }
        Ok(())
    }
}
