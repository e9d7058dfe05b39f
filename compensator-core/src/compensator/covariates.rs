//! The covariates that terms alone read: their last good values, guarded and faded.
//!
//! Made from the rows with a `guard` in the table of [`crate::quantity`]. A model without terms is spared
//! all of it; without the feature `terms`, `no_covariates` stands in with the same interface.

use super::{Built, Guard, Held, SealTrust, limit};
use crate::envelope::Envelope;
use crate::flags::Flags;
use crate::model::Model;
use crate::number::Real;
use crate::quantity::{Inputs, Quantity, Sample, TEMPERATURE_RANGE_C, quantity_table};

/// Least and most an auxiliary covariate is believed of; its unit is not known here.
const AUXILIARY_RANGE: [f64; 2] = [-1e9, 1e9];

/// What becomes of a covariate while its last good value grows too old.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fade {
    /// It fades to 0, where its terms do nothing.
    ToZero,
    /// It fades to the reference temperature.
    ToReference,
    /// It stays, and what follows it fades: it has no neutral value.
    Apart,
}

macro_rules! define_covariates {
    ($($(#[$doc:meta])* $quantity:ident {
        label: $label:literal, names: $names:expr, units: $units:expr, scale: $scale:expr,
        $(flags: [$invalid:ident, $stale:ident],)?
        $($(#[$field_doc:meta])* sample: $field:ident,)?
        $(input: $input:ident,)?
        $(column: $column:literal,)?
        $(guard: [
            $held:ident, $(envelope $size:ident)? $(range $range:ident)?, $fade:expr
        ],)?
    })*) => {
        /// How large they may be, and what they fade to.
        #[derive(Clone, Copy, Debug)]
        struct Limits<T> {
            $($($($size: T,)?)?)*
            campaign_max_h: T,
            temperature_reference: T,
        }

        /// Their last good values.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Covariates<T> {
            $($($held: Held<T>,)?)*
            campaign_time_h: T,
            limits: Limits<T>,
        }

        impl<T: Real> Covariates<T> {
            /// None measured yet; the reference temperature in deg C.
            pub(super) fn never(
                built: &Built<T>,
                envelope: &Envelope,
                temperature_reference: f32,
            ) -> Self {
                let limits = Limits {
                    $($($($size: limit(envelope.$size),)?)?)*
                    campaign_max_h: limit(envelope.campaign_max_h),
                    temperature_reference: T::from_f64(f64::from(temperature_reference)),
                };
                Self { $($($held: Held::never(built),)?)* campaign_time_h: T::zero(), limits }
            }

            /// Takes the readings of a sample, and puts into it what is to be believed.
            #[inline(always)]
            pub(super) fn take(
                &mut self,
                inputs: &Inputs<T>,
                model: &Model<T>,
                built: &Built<T>,
                seal: SealTrust<T>,
                sample: &mut Sample<T>,
                flags: &mut Flags,
            ) {
                if model.is_plain() {
                    return;
                }
                let limits = self.limits;
                $($(
                    $(let (middle, reach) = (T::zero(), limits.$size);)?
                    $(
                        let (middle, reach) = (
                            T::from_f64(0.5 * ($range[0] + $range[1])),
                            T::from_f64(0.5 * ($range[1] - $range[0])),
                        );
                    )?
                    let info = const { Quantity::$quantity.info() };
                    let guard = Guard { middle, reach, invalid: info.invalid, stale: info.stale };
                    let reading = Quantity::$quantity.of_inputs(inputs);
                    let $held = self.$held.take(reading, &guard, built, flags);
                    let (value, reference) = (self.$held.value, limits.temperature_reference);
                    let believed = match $fade {
                        Fade::ToZero => value * $held,
                        Fade::ToReference => reference + (value - reference) * $held,
                        Fade::Apart => value,
                    };
                    Quantity::$quantity.set_in_sample(sample, believed);
                    if Quantity::$quantity == Quantity::Position {
                        sample.position_trust = $held;
                    }
                )?)*
                self.take_campaign_time(inputs, sample, flags);
                // A column at its neutral value says nothing to the lookup table: that fades whole.
                sample.lookup_trust = match model.terms.lookup_column() {
                    Quantity::RadialForce => seal.force,
                    Quantity::Pressure => seal.pressure,
                    $($(Quantity::$quantity => $held,)?)*
                    // Guarded by themselves.
                    _ => T::one(),
                };
            }
        }
    };
}

quantity_table!(define_covariates);

impl<T: Real> Covariates<T> {
    /// The campaign's time has no age: the last good one stands.
    #[inline(always)]
    fn take_campaign_time(
        &mut self,
        inputs: &Inputs<T>,
        sample: &mut Sample<T>,
        flags: &mut Flags,
    ) {
        let time = inputs.campaign_time_h;
        let illegal = time.negative_or_nan_mask() | time.abs_gt_mask(self.limits.campaign_max_h);
        self.campaign_time_h = T::select(illegal, self.campaign_time_h, time);
        *flags |= Flags::CAMPAIGN_TIME_INVALID.when(illegal);
        sample.campaign_time_h = self.campaign_time_h;
    }
}
