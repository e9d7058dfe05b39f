//! Terms that raise both levels in proportion to a load of the seal.

/// Makes such a term: its load, the parameters of its increase of `F_C` and of `F_S - F_C`, the reading, the units of the
/// parameters per unit of the reading, the largest load of the envelope, and the bounds that it widens.
macro_rules! seal_levels {
    ($(#[$doc:meta])* $kind:ident of $quantity:ident {
        parameters: [$coulomb:ident, $excess:ident],
        reading: $reading:ident,
        per_unit: $per_unit:literal,
        envelope: $most:ident,
        bounds: $bounds:ident,
    }) => {
        /// Coefficients of the term for one sample period.
        ///
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct $kind<T> {
            /// Increase of `F_C`.
            coulomb: T,
            /// Increase of `F_S`.
            static_level: T,
        }

        impl<T: Real> Term<T> for $kind<T> {
            const PARAMETERS: &'static [Id] = &[Id::$coulomb, Id::$excess];

            const SIZES: &'static [Id] = Self::PARAMETERS;

            const READS: Option<Quantity> = Some(Quantity::$quantity);

            type Memory = ();

            fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
                let per_unit = T::Setting::from_f64($per_unit);
                let (coulomb, excess) = (values.get(Id::$coulomb), values.get(Id::$excess));
                Self {
                    coulomb: T::from_setting(coulomb * per_unit),
                    static_level: T::from_setting((coulomb + excess) * per_unit),
                }
            }

            fn set_gain(&mut self, of: &Self, gain: T) {
                self.coulomb = of.coulomb * gain;
                self.static_level = of.static_level * gain;
            }

            #[inline]
            fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
                let (seal, load) = (&mut effects.seal, sample.$reading);
                seal.coulomb = seal.coulomb + self.coulomb * load;
                seal.static_level = seal.static_level + self.static_level * load;
            }

            fn coefficients(&self) -> [T; COEFFICIENTS] {
                [self.coulomb, self.static_level, T::zero(), T::zero()]
            }

            fn largest_product(&self, envelope: &Envelope) -> f32 {
                let steeper = self.coulomb.single().abs().max(self.static_level.single().abs());
                steeper * envelope.$most * (1.0 / $per_unit)
            }

            fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
                bounds.$bounds.coulomb += values.single(Id::$coulomb);
                bounds.$bounds.excess += values.single(Id::$excess);
            }
        }
    };
}

pub(super) use seal_levels;
