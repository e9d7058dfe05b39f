//! The terms of a model: coefficients, memory and evaluation.
//!
//! Every kind has its own field for coefficients and memory, whether it is in the model or not. This is
//! sufficient, because a model has each kind at most once. In an array, every element would be as large as the
//! largest term. Without the feature `terms`, `no_list` replaces this module with the same interface.

use super::interface::{COEFFICIENTS, Term};
use super::{MAX_TERMS, TermKind, term_table};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::fits::product;
use crate::number::Real;
use crate::parameter::ParameterValues;
use crate::quantity::{Quantity, Sample};
use crate::refusal::Text;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;
use heapless::Vec;

macro_rules! define_list {
    ($($(#[$doc:meta])* $kind:ident = $name:literal in $file:ident,)*) => {
        /// Coefficients of the terms for one sample period.
        #[derive(Debug, Default)]
        pub(crate) struct Terms<T: Real> {
            kinds: Vec<TermKind, MAX_TERMS>,
            $($file: super::$file::$kind<T>,)*
        }

        /// Memory of the terms between samples.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct Memory<T: Real> {
            $($file: <super::$file::$kind<T> as Term<T>>::Memory,)*
        }

        impl<T: Real> Memory<T> {
            /// Clears the memory, field by field. An assignment of the whole value would need `memcpy`.
            pub(crate) fn clear(&mut self) {
                $(self.$file = Default::default();)*
            }
        }

        impl<T: Real> Clone for Terms<T> {
            fn clone(&self) -> Self {
                Self { kinds: self.kinds.clone(), $($file: self.$file,)* }
            }

            // Term by term, without a copy of the whole on the stack.
            fn clone_from(&mut self, from: &Self) {
                self.kinds.clone_from(&from.kinds);
                $(self.$file = from.$file;)*
            }
        }

        impl<T: Real> Terms<T> {
            /// Builds the terms of a list for a sample period in s. Out of line, so that an image has one copy.
            #[inline(never)]
            pub(crate) fn build(
                kinds: &Vec<TermKind, MAX_TERMS>,
                values: &ParameterValues<T::Setting>,
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

            /// Sets the coefficients to those of `of` for a sample period `ratio` times as long.
            pub(crate) fn rescale_period(&mut self, of: &Self, ratio: T) {
                for kind in &of.kinds {
                    match kind {
                        $(TermKind::$kind => self.$file = of.$file.rescale_period(ratio),)*
                    }
                }
            }

            /// Sets the coefficients to those of `of` times the gains, in the order of the list.
            pub(crate) fn set_gains(&mut self, of: &Self, gains: &[T; MAX_TERMS]) {
                for (kind, gain) in of.kinds.iter().zip(gains) {
                    self.set_gain(*kind, of, *gain);
                }
            }

            /// Sets the coefficients of one term to those of `of` times the gain.
            ///
            /// Out of line. Inlined into the loop, the compiler would load the coefficients of all kinds before it tests
            /// the kind.
            #[inline(never)]
            fn set_gain(&mut self, kind: TermKind, of: &Self, gain: T) {
                match kind {
                    $(TermKind::$kind => self.$file.set_gain(&of.$file, gain),)*
                }
            }

            /// Evaluates one term for one sample.
            ///
            /// Out of line. Inlined into the loop, the compiler would load and multiply the coefficients
            /// of all kinds before it tests the kind.
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

        /// Checks that the number type `T` can represent every term within the envelope, and that their
        /// parameters agree with the sample period, s. Returns the first violation.
        pub(crate) fn check<T: Real, S: Real<Setting = S>>(
            kinds: &Vec<TermKind, MAX_TERMS>,
            values: &ParameterValues<S>,
            envelope: &Envelope,
            period_s: S,
        ) -> Result<(), ParameterError> {
            // Built in the number type of the parameters, which has the range, then compared with that of T.
            let built = Terms::<S>::build(kinds, values, period_s);
            for kind in kinds {
                let (coefficients, largest) = match kind {
                    $(TermKind::$kind => {
                        super::$file::$kind::<S>::validate_period(values, period_s.single())?;
                        (built.$file.coefficients(), built.$file.largest_product(envelope))
                    })*
                };
                check_representable::<T>(kind.text(), coefficients.map(Real::single), largest)?;
            }
            Ok(())
        }
    };
}

term_table!(define_list);

impl<T: Real> Memory<T> {
    /// Stores the power that the law dissipated in this sample, W.
    #[inline(always)]
    pub(crate) fn take_power(&mut self, power: T) {
        self.warm_up.power = power;
    }

    /// Sets the initial heat of the warm-up term; see [`Heat`](super::warm_up::Heat).
    pub(crate) fn set_heat(&mut self, heat: T) {
        self.warm_up.heat = heat;
    }
}

impl<T: Real> Terms<T> {
    /// Evaluates all terms of the list for one sample.
    #[inline(always)]
    pub(crate) fn act(&self, sample: &Sample<T>, memory: &mut Memory<T>, effects: &mut Effects<T>) {
        for kind in &self.kinds {
            self.act_one(*kind, sample, memory, effects);
        }
    }

    /// Returns true if the model has no terms.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Returns the input quantity of the lookup table, or the velocity if there is no table.
    #[inline(always)]
    pub(crate) fn lookup_column(&self) -> Quantity {
        self.lookup_table.column()
    }
}

/// Checks that `T` can represent these coefficients and this largest product of a term.
fn check_representable<T: Real>(
    name: Text,
    coefficients: [f32; COEFFICIENTS],
    largest: f32,
) -> Result<(), ParameterError> {
    for value in coefficients {
        if !T::represents(value) {
            let why =
                text!("the number type cannot hold what this term computes within the envelope");
            return refuse(name, value, Bound::Finite, why);
        }
    }
    product::<T>(name, largest)
}
