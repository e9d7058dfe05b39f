//! `+ sum a_k sin(n_k q) + b_k cos(n_k q)`: cogging and gear mesh, a torque of the angle.
//!
//! Magnets against slots, teeth against teeth: the torque is there whichever way the shaft turns, and at
//! rest. A few orders make up most of it (a fundamental, its multiples, its neighbours where the machine is
//! not quite round), so the table is a short one of orders with a sine and a cosine each. An order of 0 is a
//! place that is not taken, and costs a comparison.

use super::angle::over_angle;
use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::ParameterError;

/// Orders the term has room for.
pub const TORQUE_RIPPLES: usize = 4;

/// Of each order: itself, the factor on its sine and that on its cosine.
pub const TORQUE_RIPPLE_PARAMETERS: [[Id; 3]; TORQUE_RIPPLES] = [
    [Id::TorqueRippleOrder1, Id::TorqueRippleSine1, Id::TorqueRippleCosine1],
    [Id::TorqueRippleOrder2, Id::TorqueRippleSine2, Id::TorqueRippleCosine2],
    [Id::TorqueRippleOrder3, Id::TorqueRippleSine3, Id::TorqueRippleCosine3],
    [Id::TorqueRippleOrder4, Id::TorqueRippleSine4, Id::TorqueRippleCosine4],
];

/// One order: `n`, 1/rad; on the sine of `n q`, Nm; on its cosine, Nm.
type Wave<T> = [T; 3];

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TorqueRipple<T> {
    waves: [Wave<T>; TORQUE_RIPPLES],
}

impl<T: Real> Term<T> for TorqueRipple<T> {
    const PARAMETERS: &'static [Id] = TORQUE_RIPPLE_PARAMETERS.as_flattened();

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &Values<T::Setting>, _: T::Setting) -> Self {
        let waves =
            TORQUE_RIPPLE_PARAMETERS.map(|ids| ids.map(|id| T::from_setting(values.get(id))));
        Self { waves }
    }

    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    // Out of line, as the lookup table.
    #[inline(never)]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let mut torque = T::zero();
        for [order, sine, cosine] in self.waves {
            if order > T::zero() {
                torque = torque + over_angle(order * sample.position_rad, sine, cosine);
            }
        }
        effects.torque = effects.torque + torque * sample.position_trust;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // The orders. A sine's factor may be rounded to a last bit, which is a last bit of torque.
        self.waves.map(|[order, ..]| order)
    }

    fn largest_product(&self, envelope: &Envelope) -> f64 {
        let position = f64::from(envelope.position_max_rad);
        let sizes = self.waves.map(|wave| wave.map(|number| number.value().abs()));
        let torque: f64 = sizes.iter().map(|[_, sine, cosine]| sine + cosine).sum();
        sizes.iter().map(|[order, ..]| order * position).fold(torque, f64::max)
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        for [_, sine, cosine] in TORQUE_RIPPLE_PARAMETERS {
            bounds.torque += libm::hypot(values.value(sine), values.value(cosine));
        }
    }

    fn validate<S: Real>(_: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }
}
