//! `+ sum a_k sin(n_k q) + b_k cos(n_k q)`: cogging torque and gear mesh.
//!
//! The torque depends on the shaft angle. It does not depend on the direction and is also present at rest. A few
//! orders dominate: a fundamental, its multiples, and its side bands if the machine is eccentric. The table
//! therefore has a few orders, each with a sine and a cosine factor. The order 0 marks an unused entry, which
//! costs one comparison.

use super::angle::over_angle;
use super::bounds::amplitude;
use super::interface::*;

/// Maximum number of orders.
pub const TORQUE_RIPPLE_ORDERS: usize = 4;

/// Parameters of each order: the order, the factor of its sine and the factor of its cosine.
pub const TORQUE_RIPPLE_PARAMETERS: [[Id; 3]; TORQUE_RIPPLE_ORDERS] = [
    [Id::TorqueRippleOrder1, Id::TorqueRippleSine1, Id::TorqueRippleCosine1],
    [Id::TorqueRippleOrder2, Id::TorqueRippleSine2, Id::TorqueRippleCosine2],
    [Id::TorqueRippleOrder3, Id::TorqueRippleSine3, Id::TorqueRippleCosine3],
    [Id::TorqueRippleOrder4, Id::TorqueRippleSine4, Id::TorqueRippleCosine4],
];

/// Factors of sine and cosine of every order.
const SIZES: [Id; 2 * TORQUE_RIPPLE_ORDERS] = [
    Id::TorqueRippleSine1,
    Id::TorqueRippleCosine1,
    Id::TorqueRippleSine2,
    Id::TorqueRippleCosine2,
    Id::TorqueRippleSine3,
    Id::TorqueRippleCosine3,
    Id::TorqueRippleSine4,
    Id::TorqueRippleCosine4,
];

/// One order of the ripple.
#[derive(Clone, Copy, Debug, Default)]
struct Wave<T> {
    /// `n`, periods per turn; 0 if unused.
    order: T,
    /// Factor of `sin(n q)`, Nm.
    sine: T,
    /// Factor of `cos(n q)`, Nm.
    cosine: T,
}

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TorqueRipple<T> {
    waves: [Wave<T>; TORQUE_RIPPLE_ORDERS],
}

impl<T: Real> Term<T> for TorqueRipple<T> {
    const PARAMETERS: &'static [Id] = TORQUE_RIPPLE_PARAMETERS.as_flattened();

    const SIZES: &'static [Id] = &SIZES;

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let waves = TORQUE_RIPPLE_PARAMETERS.map(|ids| {
            let [order, sine, cosine] = ids.map(|id| T::from_setting(values.get(id)));
            Wave { order, sine, cosine }
        });
        Self { waves }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        for (wave, of) in self.waves.iter_mut().zip(&of.waves) {
            (wave.sine, wave.cosine) = (of.sine * gain, of.cosine * gain);
        }
    }

    // Out of line, because inlined into the loop over the terms it would slow down the others.
    #[inline(never)]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let mut torque = T::zero();
        for Wave { order, sine, cosine } in self.waves {
            if order > T::zero() {
                torque = torque + over_angle(order * sample.position_rad, sine, cosine);
            }
        }
        effects.torque = effects.torque + torque * sample.position_weight;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // Only the orders. Rounding of a factor changes the torque by at most one unit of the resolution.
        self.waves.map(|wave| wave.order)
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let size = |number: T| number.single().abs();
        let torque = self.waves.iter().map(|wave| size(wave.sine) + size(wave.cosine)).sum();
        let angles = self.waves.iter().map(|wave| size(wave.order) * envelope.position_max_rad);
        angles.fold(torque, f32::max)
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        for [_, sine, cosine] in TORQUE_RIPPLE_PARAMETERS {
            bounds.torque += amplitude(values.single(sine), values.single(cosine));
        }
    }
}
