//! The quantities of a joint, generated from one table.
//!
//! A [`Quantity`] is a column of a log and a reading of a driver: velocity, position, side load, pressure
//! and others. Its row gives its names, its units, its valid range and its flags. Logs use the unit that people
//! write. The model uses an internal unit, such as MPa for pressure and h for the campaign time, so that fixed
//! point can represent the value. [`Sample`], [`Inputs`] and the compensator's guards are generated from the rows.
//!
//! A new covariate needs a row at the end of the table and a pair of flags. If it is received over the bus, it
//! also needs a place in a frame of [`crate::can`].

mod table;

pub use crate::joint_kind::JointKind;

use crate::flags::Flags;
use crate::number::Real;
use crate::quantity_table;

/// Valid range of a seal temperature reading, deg C.
pub const TEMPERATURE_RANGE_C: [f64; 2] = [-50.0, 150.0];

/// A measured value and its age.
#[derive(Clone, Copy, Debug)]
pub struct Reading<T> {
    /// The value, in the unit of its field in [`Inputs`].
    pub value: T,
    /// Age of the value, s. A negative age (including -0) or NaN means never measured.
    pub age_s: T,
}

impl<T: Real> Reading<T> {
    /// Returns a reading of age 0.
    pub fn fresh(value: T) -> Self {
        Self { value, age_s: T::zero() }
    }

    /// Returns a missing reading: the sensor does not exist or has not reported yet.
    pub fn missing() -> Self {
        Self { value: T::zero(), age_s: -T::one() }
    }
}

/// Name, unit, scale and flags of a quantity.
#[derive(Clone, Copy, Debug)]
pub struct QuantityInfo {
    /// Name in a sentence or on an axis.
    pub label: &'static str,
    /// Column name in the log of a revolute joint and of a prismatic joint.
    pub names: [&'static str; 2],
    /// Unit of the column for a revolute joint and for a prismatic joint; empty if unknown.
    pub units: [&'static str; 2],
    /// Internal unit (of [`Sample`] and [`Inputs`]) divided by the unit of the column.
    pub inside_scale: f64,
    /// Unit of the column divided by the internal unit.
    pub outside_scale: f64,
    /// Flag of an invalid reading; empty if the compensator does not read the quantity.
    pub invalid: Flags,
    /// Flag of a last valid value that is so old that it fades; empty if the compensator does not read the quantity.
    pub stale: Flags,
    /// Column number for the lookup-table term; `None` if the term cannot use the quantity.
    pub column: Option<u8>,
}

macro_rules! define_quantities {
    ($($(#[$doc:meta])* $quantity:ident {
        label: $label:literal, names: $names:expr, units: $units:expr, scale: [$inside:expr, $outside:expr],
        $(flags: [$invalid:ident, $stale:ident],)?
        $($(#[$field_doc:meta])* sample: $field:ident,)?
        $(input: $input:ident,)?
        $(covariate: $covariate:ident,)?
        $(column: $column:literal,)?
        $(guard: [$($guard:tt)*],)?
    })*) => {
        /// A quantity that a log can contain as a column and a model can use as an input.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Quantity { $($(#[$doc])* $quantity),* }

        impl Quantity {
            /// All quantities, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$quantity),*];

            /// Returns the quantity's name, unit, scale and flags.
            pub const fn info(self) -> &'static QuantityInfo {
                match self {
                    $(Self::$quantity => const { &QuantityInfo {
                        label: $label,
                        names: $names,
                        units: $units,
                        inside_scale: $inside,
                        outside_scale: $outside,
                        invalid: Flags::empty()$(.union(Flags::$invalid))?,
                        stale: Flags::empty()$(.union(Flags::$stale))?,
                        column: Self::$quantity.column(),
                    } }),*
                }
            }

            /// Returns the number of the column in records; `None` if no driver reads the quantity. As in
            /// [`Quantity::info`], but without its texts in an image.
            pub const fn column(self) -> Option<u8> {
                match self {
                    $(Self::$quantity => {
                        let column: [Option<u8>; 1] = [None];
                        $(let column = [Some($column), column[0]];)?
                        column[0]
                    })*
                }
            }

            /// Returns the internal unit per unit, a constant of the number type.
            pub fn inside_scale<T: Real>(self) -> T {
                match self {
                    $(Self::$quantity => T::from_f64($inside)),*
                }
            }

            /// Returns the value in a sample, in the internal unit; `None` if no model reads the quantity.
            #[inline(always)]
            pub fn value_in<T: Real>(self, sample: &Sample<T>) -> Option<T> {
                match self {
                    $($(Self::$quantity => Some(sample.$field),)?)*
                    _ => None,
                }
            }

            /// Sets the value in a sample, in the internal unit. Has no effect if no model reads the quantity.
            #[inline(always)]
            pub fn set_in_sample<T: Real>(self, sample: &mut Sample<T>, value: T) {
                match self {
                    $($(Self::$quantity => sample.$field = value,)?)*
                    _ => {}
                }
            }

            /// Returns the reading, in the internal unit. It is missing if the compensator does not read the quantity.
            #[inline(always)]
            pub fn reading_in<T: Real>(self, inputs: &Inputs<T>) -> Reading<T> {
                match self {
                    $($(Self::$quantity => inputs.$input,)?)*
                    $($(Self::$quantity => inputs.$covariate,)?)*
                    _ => Reading::missing(),
                }
            }

            /// Sets the reading, in the internal unit. Has no effect if the compensator does not read the quantity.
            #[inline(always)]
            fn set_in_inputs<T: Real>(self, inputs: &mut Inputs<T>, reading: Reading<T>) {
                match self {
                    $($(Self::$quantity => inputs.$input = reading,)?)*
                    $($(Self::$quantity => inputs.$covariate = reading,)?)*
                    Self::CampaignTime => inputs.campaign_time_h = reading.value,
                    _ => {}
                }
            }
        }

        /// Inputs of a model for one sample. A value that is not measured keeps its default.
        #[derive(Clone, Copy, Debug)]
        pub struct Sample<T> {
            $($($(#[$field_doc])* pub $field: T,)?)*
            /// Weight of the position, 0..=1. It scales the terms that depend on the position.
            pub position_weight: T,
            /// Change of the side load since the last sample, N.
            pub radial_force_change_n: T,
            /// Weight of the lookup-table term's column, 0..=1.
            pub lookup_weight: T,
        }

        impl<T: Real> Default for Sample<T> {
            fn default() -> Self {
                let zero = T::zero();
                Self {
                    $($($field: zero,)?)*
                    position_weight: T::one(),
                    radial_force_change_n: zero,
                    lookup_weight: T::one(),
                }
            }
        }

        impl<T: Copy> Sample<T> {
            /// Converts every value with a function.
            #[inline(always)]
            pub fn map<R>(&self, mut convert: impl FnMut(T) -> R) -> Sample<R> {
                self.zip(self, |value, _| convert(value))
            }

            /// Combines every value with that of another sample.
            #[inline(always)]
            pub fn zip<O: Copy, R>(&self, other: &Sample<O>, mut combine: impl FnMut(T, O) -> R) -> Sample<R> {
                Sample {
                    $($($field: combine(self.$field, other.$field),)?)*
                    position_weight: combine(self.position_weight, other.position_weight),
                    radial_force_change_n: combine(self.radial_force_change_n, other.radial_force_change_n),
                    lookup_weight: combine(self.lookup_weight, other.lookup_weight),
                }
            }
        }

        /// Inputs of the compensator for one sample, in the units of a [`Sample`].
        #[derive(Clone, Copy, Debug)]
        pub struct Inputs<T> {
            $(
                $(
                    #[doc = concat!("Reading of the ", $label, ".")]
                    pub $input: Reading<T>,
                )?
                $(
                    #[doc = concat!("Reading of the ", $label, ".")]
                    pub $covariate: Reading<T>,
                )?
            )*
            /// Reference velocity, rad/s.
            pub velocity_reference_rad_s: Reading<T>,
            /// Time since the start of the campaign, h.
            pub campaign_time_h: T,
        }

        impl<T: Real> Inputs<T> {
            /// Returns inputs without any reading.
            pub fn missing() -> Self {
                Self {
                    $($($input: Reading::missing(),)? $($covariate: Reading::missing(),)?)*
                    velocity_reference_rad_s: Reading::missing(),
                    campaign_time_h: T::zero(),
                }
            }

            /// Converts every reading to another number type. The caller converts the campaign time, h.
            #[inline(always)]
            pub fn convert<R>(
                &self,
                reading: impl Fn(Reading<T>) -> Reading<R>,
                campaign_time_h: R,
            ) -> Inputs<R> {
                Inputs {
                    $($($input: reading(self.$input),)? $($covariate: reading(self.$covariate),)?)*
                    velocity_reference_rad_s: reading(self.velocity_reference_rad_s),
                    campaign_time_h,
                }
            }
        }
    };
}

quantity_table!(define_quantities);

impl<T: Real> Inputs<T> {
    /// Returns inputs with a fresh measured velocity, rad/s, and no other reading.
    pub fn velocity(velocity_rad_s: T) -> Self {
        Self { velocity_rad_s: Reading::fresh(velocity_rad_s), ..Self::missing() }
    }

    /// Sets a reading from a value in the unit of its log column: rad, rad/s^2, N, Pa, deg C, Nm or s. The age is in s.
    ///
    /// [`Sample`] has units in which fixed point holds the values, such as MPa. The conversion is one product in `f32`.
    /// [`Fixed`](crate::Fixed) converts through an emulated double: without an FPU, call this function where the sensor is read
    /// and not in the current loop. The campaign time has no age. A quantity that no compensator reads has no effect.
    #[must_use]
    #[inline(always)]
    pub fn with(mut self, quantity: Quantity, value: T::Setting, age_s: T) -> Self {
        let value = T::from_setting(value * quantity.inside_scale::<T::Setting>());
        quantity.set_in_inputs(&mut self, Reading { value, age_s });
        self
    }

    /// Sets the velocity of the set-point, rad/s. Near rest, where the sign of a measured velocity is not reliable, it is used
    /// instead.
    #[must_use]
    pub fn with_reference(self, velocity_rad_s: T) -> Self {
        Self { velocity_reference_rad_s: Reading::fresh(velocity_rad_s), ..self }
    }
}

impl Quantity {
    /// Returns the column name in the log of a joint of this kind. The name ends in the unit.
    pub const fn name(self, kind: JointKind) -> &'static str {
        kind.choose(self.info().names)
    }

    /// Returns the unit of the column, as people write it; empty if unknown.
    pub const fn unit(self, kind: JointKind) -> &'static str {
        kind.choose(self.info().units)
    }

    /// Returns the quantity with this column name, and the joint kind if only one kind uses the name.
    pub fn parse(name: &str) -> Option<(Self, Option<JointKind>)> {
        Self::ALL.iter().find_map(|quantity| {
            let [revolute, prismatic] = quantity.info().names;
            let kind = match (name == revolute, name == prismatic) {
                (true, true) => None,
                (true, false) => Some(JointKind::Revolute),
                (false, true) => Some(JointKind::Prismatic),
                (false, false) => return None,
            };
            Some((*quantity, kind))
        })
    }

    /// The largest column number.
    pub const MAX_COLUMN_NUMBER: u8 = {
        let (mut last, mut index) = (0, 0);
        while index < Self::ALL.len() {
            if let Some(column) = Self::ALL[index].column()
                && column > last
            {
                last = column;
            }
            index += 1;
        }
        last
    };

    /// Returns the quantity with this column number of the lookup-table term.
    pub fn from_column_number(number: u8) -> Option<Self> {
        Self::ALL.iter().copied().find(|quantity| quantity.column() == Some(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn parse_with_every_column_name_returns_its_quantity() {
        for quantity in Quantity::ALL {
            for kind in [JointKind::Revolute, JointKind::Prismatic] {
                let (found, found_kind) = Quantity::parse(quantity.name(kind)).unwrap();
                assert_eq!(found, *quantity);
                assert!(found_kind.is_none_or(|found_kind| found_kind == kind));
            }
        }
        assert_eq!(Quantity::parse("flow"), None);
    }

    #[test]
    fn column_numbers_are_consecutive() {
        let numbers: HashSet<u8> =
            Quantity::ALL.iter().filter_map(|quantity| quantity.info().column).collect();
        assert_eq!(numbers, (0..numbers.len() as u8).collect());
        assert_eq!(Quantity::from_column_number(4), Some(Quantity::Pressure));
    }

    #[test]
    fn scales_are_inverse_and_samples_return_stored_values() {
        for quantity in Quantity::ALL {
            let info = quantity.info();
            assert!((info.inside_scale * info.outside_scale - 1.0).abs() < 1e-15);
            let mut sample = Sample::<f64>::default();
            quantity.set_in_sample(&mut sample, 2.5);
            let expected = (*quantity != Quantity::Torque).then_some(2.5);
            assert_eq!(quantity.value_in(&sample), expected);
        }
    }

    #[test]
    fn with_converts_every_reading_to_its_internal_unit() {
        let float = Inputs::<f32>::velocity(1.0).with(Quantity::Pressure, 1.5e5, 0.01);
        let float = float.pressure_diff_mpa;
        assert!((float.value - 0.15).abs() < 1e-7 && float.age_s == 0.01);
        let age_s = crate::Fixed::from_f64(0.01);
        let fixed = Inputs::missing().with(Quantity::Pressure, 1.5e5, age_s).pressure_diff_mpa;
        assert_eq!((fixed.value, fixed.age_s), (crate::Fixed::from_f64(0.15), age_s));
        let later = Inputs::<f32>::missing().with(Quantity::CampaignTime, 7200.0, 0.0);
        assert_eq!(later.campaign_time_h, 2.0);
        for quantity in Quantity::ALL.iter().filter(|of| of.info().stale != of.info().invalid) {
            let inputs = Inputs::<f64>::missing().with(*quantity, 3.0, 0.25);
            let reading = quantity.reading_in(&inputs);
            assert_eq!(reading.value, 3.0 * quantity.info().inside_scale, "{quantity:?}");
            assert_eq!(reading.age_s, 0.25);
        }
    }
}
