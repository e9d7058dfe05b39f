//! The covariates that only terms read: their last valid values, guarded and faded.
//!
//! A macro generates them from the rows with a `guard` in the table of [`crate::quantity`]. A model without
//! terms skips this code. Without the feature `terms`, the module `no_covariates` replaces this one.

use super::guards::{Guard, Held, SealWeights};
use super::{BuiltParameters, limit};
use crate::envelope::Envelope;
use crate::flags::Flags;
use crate::model::FrictionModel;
use crate::number::Real;
use crate::quantity::{Inputs, Quantity, Sample, TEMPERATURE_RANGE_C};
use crate::quantity_table;

/// Valid range of an auxiliary covariate, in its own unit. The range is wide because the unit is unknown.
const AUXILIARY_RANGE: [f64; 2] = [-1e9, 1e9];

/// How a covariate fades when its last valid value is too old.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fade {
    /// The value fades to 0, where its terms have no effect.
    ToZero,
    /// The value fades to the reference temperature.
    ToReference,
    /// The value stays and the terms that depend on it fade, because it has no neutral value.
    Apart,
}

macro_rules! define_covariates {
    ($($(#[$doc:meta])* $quantity:ident {
        label: $label:literal, names: $names:expr, units: $units:expr, scale: $scale:expr,
        $(flags: [$invalid:ident, $stale:ident],)?
        $($(#[$field_doc:meta])* sample: $field:ident,)?
        $(input: $input:ident,)?
        $(covariate: $covariate:ident,)?
        $(column: $column:literal,)?
        $(guard: [
            $held:ident, $(envelope $size:ident)? $(range $range:ident)?, $fade:expr
        ],)?
    })*) => {
        /// Limits of the covariates, and the reference temperature, deg C.
        #[derive(Clone, Copy, Debug)]
        struct Limits<T> {
            $($($($size: T,)?)?)*
            campaign_max_h: T,
            temperature_reference: T,
        }

        /// The last valid values of the covariates.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Covariates<T> {
            $($($held: Held<T>,)?)*
            campaign_time_h: T,
            limits: Limits<T>,
        }

        impl<T: Real> Covariates<T> {
            /// Returns covariates that were never measured. The reference temperature is in deg C.
            pub(super) fn unmeasured(
                built: &BuiltParameters<T>,
                envelope: &Envelope,
                temperature_reference: f32,
            ) -> Self {
                let limits = Limits {
                    $($($($size: limit(envelope.$size),)?)?)*
                    campaign_max_h: limit(envelope.campaign_max_h),
                    temperature_reference: T::from_f64(f64::from(temperature_reference)),
                };
                Self { $($($held: Held::unmeasured(built),)?)* campaign_time_h: T::zero(), limits }
            }

            /// Updates the covariates from the inputs, and writes the guarded values to the sample.
            #[inline(always)]
            pub(super) fn update(
                &mut self,
                inputs: &Inputs<T>,
                model: &FrictionModel<T>,
                built: &BuiltParameters<T>,
                seal: SealWeights<T>,
                sample: &mut Sample<T>,
                flags: &mut Flags,
            ) {
                if model.has_no_terms() {
                    return;
                }
                let limits = self.limits;
                $($(
                    $(let (middle, half_width) = (T::zero(), limits.$size);)?
                    $(
                        let (middle, half_width) = (
                            T::from_f64(0.5 * ($range[0] + $range[1])),
                            T::from_f64(0.5 * ($range[1] - $range[0])),
                        );
                    )?
                    let info = const { Quantity::$quantity.info() };
                    let guard = Guard { middle, half_width, invalid: info.invalid, stale: info.stale };
                    let reading = Quantity::$quantity.reading_in(inputs);
                    let $held = self.$held.update(reading, &guard, built, flags);
                    let (value, reference) = (self.$held.value, limits.temperature_reference);
                    let guarded = match $fade {
                        Fade::ToZero => value * $held,
                        Fade::ToReference => reference + (value - reference) * $held,
                        Fade::Apart => value,
                    };
                    Quantity::$quantity.set_in_sample(sample, guarded);
                    if Quantity::$quantity == Quantity::Position {
                        sample.position_weight = $held;
                    }
                )?)*
                self.update_campaign_time(inputs, sample, flags);
                // The lookup table has no neutral value for its column. Its whole contribution fades instead.
                sample.lookup_weight = match model.terms.lookup_column() {
                    Quantity::RadialForce => seal.force,
                    Quantity::Pressure => seal.pressure,
                    $($(Quantity::$quantity => $held,)?)*
                    // The other quantities have guards of their own.
                    _ => T::one(),
                };
            }
        }
    };
}

quantity_table!(define_covariates);

impl<T: Real> Covariates<T> {
    /// Updates the campaign time, h. It has no age: an invalid time keeps the last valid one.
    #[inline(always)]
    fn update_campaign_time(
        &mut self,
        inputs: &Inputs<T>,
        sample: &mut Sample<T>,
        flags: &mut Flags,
    ) {
        let time = inputs.campaign_time_h;
        let is_invalid = time.negative_or_nan_mask() | time.abs_gt_mask(self.limits.campaign_max_h);
        self.campaign_time_h = T::select(is_invalid, self.campaign_time_h, time);
        *flags |= Flags::CAMPAIGN_TIME_INVALID.when(is_invalid);
        sample.campaign_time_h = self.campaign_time_h;
    }
}
