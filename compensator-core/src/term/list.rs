//! The terms of a model: built for a sample period, what they remember, and the walk along the list.
//!
//! Each kind has its place, in the list or not, and so has its memory: a model has a term at most once, and
//! a list of terms would have to make every place as large as the largest of them. Without the feature
//! `terms`, `no_list` stands in with the same interface.

use super::interface::{COEFFICIENTS, Term};
use super::{MAX_TERMS, TermKind, term_table};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::fits::product;
use crate::number::Real;
use crate::parameter::Values;
use crate::quantity::{Quantity, Sample};
use crate::refusal::{Bound, ParameterError, refuse};
use heapless::Vec;

macro_rules! define_list {
    ($($(#[$doc:meta])* $kind:ident = $name:literal in $file:ident,)*) => {
        /// Terms built for a sample period.
        #[derive(Clone, Debug, Default)]
        pub(crate) struct Terms<T: Real> {
            kinds: Vec<TermKind, MAX_TERMS>,
            $($file: super::$file::$kind<T>,)*
        }

        /// What terms remember between samples.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct Memory<T: Real> {
            $($file: <super::$file::$kind<T> as Term<T>>::Memory,)*
        }

        impl<T: Real> Memory<T> {
            /// Forgets all of it. In place: assigned whole it would be made elsewhere and copied, by 900 bytes of `memcpy`.
            pub(crate) fn clear(&mut self) {
                $(self.$file = Default::default();)*
            }
        }

        impl<T: Real> Terms<T> {
            /// Builds the terms of a list for a sample period in s. Out of line: it is once in an image then.
            #[inline(never)]
            pub(crate) fn build(
                kinds: &Vec<TermKind, MAX_TERMS>,
                values: &Values<T::Setting>,
                period_s: T::Setting,
            ) -> Self {
                let mut built = Self { kinds: kinds.clone(), ..Self::default() };
                for kind in kinds {
                    match kind {
                        $(TermKind::$kind => built.$file = Term::build(values, period_s),)*
                    }
                }
                built
            }

            /// Becomes `of` for a sample period `ratio` times as long.
            pub(crate) fn rescale_period(&mut self, of: &Self, ratio: T) {
                for kind in &of.kinds {
                    match kind {
                        $(TermKind::$kind => self.$file = of.$file.rescale_period(ratio),)*
                    }
                }
            }

            /// Lets one of the terms act on one sample. Out of line: within the loop the compiler would
            /// load the coefficients of all kinds, and multiply with them, before it asks for the kind.
            #[inline(never)]
            fn act_one(
                &self,
                kind: TermKind,
                sample: &Sample<T>,
                memory: &mut Memory<T>,
                effects: &mut Effects<T>,
            ) {
                match kind {
                    $(TermKind::$kind => self.$file.act(sample, &mut memory.$file, effects),)*
                }
            }
        }

        /// Refuses a term that the number `T` has no room for within the envelope, or whose parameters
        /// do not go with the sample period, s.
        pub(crate) fn check<T: Real, S: Real<Setting = S>>(
            kinds: &Vec<TermKind, MAX_TERMS>,
            values: &Values<S>,
            envelope: &Envelope,
            period_s: S,
        ) -> Result<(), ParameterError> {
            // Built in the number of the settings, which has the range, and held against T's.
            let built = Terms::<S>::build(kinds, values, period_s);
            for kind in kinds {
                let (coefficients, largest) = match kind {
                    $(TermKind::$kind => {
                        super::$file::$kind::<S>::validate_period(values, period_s.value())?;
                        (built.$file.coefficients(), built.$file.largest_product(envelope))
                    })*
                };
                held::<T>(kind.name(), coefficients.map(Real::value), largest)?;
            }
            Ok(())
        }
    };
}

term_table!(define_list);

impl<T: Real> Memory<T> {
    /// Takes note of what the law dissipated in this sample, W.
    #[inline(always)]
    pub(crate) fn take_power(&mut self, power: T) {
        self.warm_up.power = power;
    }

    /// Sets the heat of what has rubbed before; see [`Heat`](super::warm_up::Heat).
    pub(crate) fn set_heat(&mut self, heat: T) {
        self.warm_up.heat = heat;
    }
}

impl<T: Real> Terms<T> {
    /// Lets the terms act on one sample.
    #[inline(always)]
    pub(crate) fn act(&self, sample: &Sample<T>, memory: &mut Memory<T>, effects: &mut Effects<T>) {
        for kind in &self.kinds {
            self.act_one(*kind, sample, memory, effects);
        }
    }

    /// Whether there are none.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// The quantity that the lookup table follows; the velocity where there is none.
    #[inline(always)]
    pub(crate) fn lookup_column(&self) -> Quantity {
        self.lookup_table.column()
    }
}

fn held<T: Real>(
    name: &'static str,
    coefficients: [f64; COEFFICIENTS],
    largest: f64,
) -> Result<(), ParameterError> {
    for value in coefficients {
        if !T::represents(value) {
            let why = "the number type cannot hold what this term computes within the envelope";
            return refuse(name, value, Bound::Finite, why);
        }
    }
    product::<T>(name, largest)
}
