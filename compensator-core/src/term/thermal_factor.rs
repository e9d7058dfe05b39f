//! Terms that scale a quantity by `exp(-b (T - T0))`, so that it decreases exponentially with temperature.
//!
//! The viscosity of a lubricant follows this form over the temperatures of a joint (Reynolds 1886), and so does the
//! level of a seal, which stiffens in the cold. The factor is 1 at the reference `T0`, which these terms share. It is
//! monotonic, so its extremes are at the ends of the valid temperature range.

/// Makes such a term: its rate parameter, the scaled quantity, the function that includes the smallest and the largest
/// factor in the bounds, and the smallest and largest legal factor, with the reason for them.
macro_rules! thermal_factor {
    ($kind:ident of $rate:ident {
        scales: $scale:ident,
        widen: $widen:expr,
        legal: $legal:expr,
        why: $why:literal,
    }) => {
        /// Coefficients of the term.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct $kind<T> {
            /// `b`, 1/K.
            rate: T,
            /// `T0`, deg C.
            reference: T,
        }

        /// Returns the smallest and the largest exponent at valid temperatures.
        #[inline(never)]
        fn exponents(rate_per_k: f32, reference_c: f32) -> [f32; 2] {
            let [cold, hot] = TEMPERATURES_C.map(|end| -rate_per_k * (end - reference_c));
            [cold.min(hot), cold.max(hot)]
        }

        impl<T: Real> Term<T> for $kind<T> {
            const PARAMETERS: &'static [Id] = &[Id::$rate, Id::TemperatureReference];

            const SIZES: &'static [Id] = &[Id::$rate];

            const READS: Option<Quantity> = Some(Quantity::Temperature);

            type Memory = ();

            fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
                let [rate, reference] =
                    [Id::$rate, Id::TemperatureReference].map(|id| T::from_setting(values.get(id)));
                Self { rate, reference }
            }

            fn set_gain(&mut self, of: &Self, gain: T) {
                self.rate = of.rate * gain;
            }

            #[inline]
            fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
                let factor = (-(self.rate * (sample.temperature_c - self.reference))).exp();
                effects.$scale = effects.$scale * factor;
            }

            fn coefficients(&self) -> [T; COEFFICIENTS] {
                [self.rate, self.reference, T::zero(), T::zero()]
            }

            fn largest_product(&self, _: &Envelope) -> f32 {
                let [least, most] = exponents(self.rate.single(), self.reference.single());
                // The factor, which exceeds its exponent, or the magnitude of a negative exponent.
                libm::expf(most).max(-least)
            }

            fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
                let reference = values.single(Id::TemperatureReference);
                let [least, most] = exponents(values.single(Id::$rate), reference).map(libm::expf);
                $widen(bounds, least, most);
            }

            fn validate<S: Real>(
                values: &ParameterValues<S>,
                _: &Envelope,
            ) -> Result<(), ParameterError> {
                let rate = values.single(Id::$rate);
                let [least, most] = exponents(rate, values.single(Id::TemperatureReference));
                let [legal_least, legal_most] = $legal.map(libm::logf);
                // The ratio of the rate to its bound, because the exponents are proportional to the rate.
                let steepness = (least / legal_least).max(most / legal_most);
                if steepness > 1.0 {
                    let most = rate / steepness;
                    let bound = if rate > 0.0 { Bound::AtMost(most) } else { Bound::AtLeast(most) };
                    return refuse(Id::$rate.text(), rate, bound, text!($why));
                }
                Ok(())
            }
        }
    };
}

pub(super) use thermal_factor;
