//! The quantities a joint is described by: one table, from which all else that lists them is made.
//!
//! A [`Quantity`] is what a log has a column for and a driver a reading of: velocity, position, side load,
//! pressure, and so on. Its row says how it is called and in which unit people write it, in which unit the
//! model computes with it (pressure in MPa and campaign time in h, so that fixed point can hold them), what
//! a believable reading is, and which flags speak of it. [`Sample`], [`Inputs`] and the guards of the
//! compensator are made from the rows.
//!
//! A new covariate is a row, at the end, and a pair of flags; and, where it is to come over the bus, its
//! place in a frame of [`crate::can`].

mod table;

pub use crate::joint_kind::JointKind;
pub(crate) use table::quantity_table;

use crate::flags::Flags;
use crate::number::Real;

/// Coldest and hottest seal a temperature reading is believed of, deg C.
pub const TEMPERATURE_RANGE_C: [f64; 2] = [-50.0, 150.0];

/// A measured value and how long ago it was true.
#[derive(Clone, Copy, Debug)]
pub struct Reading<T> {
    /// The value, in the unit its place in [`Inputs`] says.
    pub value: T,
    /// Its age, s; negative (-0 too) or NaN counts as never measured.
    pub age_s: T,
}

impl<T: Real> Reading<T> {
    /// A value just measured.
    pub fn fresh(value: T) -> Self {
        Self { value, age_s: T::zero() }
    }

    /// No such sensor, or nothing heard of it yet.
    pub fn missing() -> Self {
        Self { value: T::zero(), age_s: -T::one() }
    }
}

/// What is known of a quantity.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// What it is called in a sentence or on an axis.
    pub label: &'static str,
    /// Its column in a log of a joint that turns, and of one that slides.
    pub names: [&'static str; 2],
    /// The unit of that column, likewise; empty where it is not known.
    pub units: [&'static str; 2],
    /// The unit inside ([`Sample`], [`Inputs`]) over the unit of the column.
    pub inside_scale: f64,
    /// The unit of the column over the unit inside.
    pub outside_scale: f64,
    /// How the compensator says that a reading is wrong; empty for what it does not read.
    pub invalid: Flags,
    /// How it says that the last good one is so old that it fades.
    pub stale: Flags,
    /// Its number for the term that is a lookup table, where that can follow it.
    pub column: Option<u8>,
}

macro_rules! define_quantities {
    ($($(#[$doc:meta])* $quantity:ident {
        label: $label:literal, names: $names:expr, units: $units:expr, scale: [$inside:expr, $outside:expr],
        $(flags: [$invalid:ident, $stale:ident],)?
        $($(#[$field_doc:meta])* sample: $field:ident,)?
        $(input: $input:ident,)?
        $(column: $column:literal,)?
        $(guard: [$($guard:tt)*],)?
    })*) => {
        /// What a log may have a column for, and a model an input.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Quantity { $($(#[$doc])* $quantity),* }

        impl Quantity {
            /// Every quantity, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$quantity),*];

            /// What is known of it.
            pub const fn info(self) -> &'static Info {
                match self {
                    $(Self::$quantity => const { &Info {
                        label: $label,
                        names: $names,
                        units: $units,
                        inside_scale: $inside,
                        outside_scale: $outside,
                        invalid: Flags::empty()$(.union(Flags::$invalid))?,
                        stale: Flags::empty()$(.union(Flags::$stale))?,
                        column: {
                            let column: [Option<u8>; 1] = [None];
                            $(let column = [Some($column), column[0]];)?
                            column[0]
                        },
                    } }),*
                }
            }

            /// Its value in a sample, in the unit inside; `None` of what no model reads.
            #[inline(always)]
            pub fn of_sample<T: Real>(self, sample: &Sample<T>) -> Option<T> {
                match self {
                    $($(Self::$quantity => Some(sample.$field),)?)*
                    _ => None,
                }
            }

            /// Sets its value in a sample, in the unit inside; of what no model reads, nothing.
            #[inline(always)]
            pub fn set_in_sample<T: Real>(self, sample: &mut Sample<T>, value: T) {
                match self {
                    $($(Self::$quantity => sample.$field = value,)?)*
                    _ => {}
                }
            }

            /// Its reading, in the unit inside; of what the compensator takes no reading of, a missing one.
            #[inline(always)]
            pub fn of_inputs<T: Real>(self, inputs: &Inputs<T>) -> Reading<T> {
                match self {
                    $($(Self::$quantity => inputs.$input,)?)*
                    _ => Reading::missing(),
                }
            }
        }

        /// What a model is told in one sample. Everything not measured is left at its default.
        #[derive(Clone, Copy, Debug)]
        pub struct Sample<T> {
            $($($(#[$field_doc])* pub $field: T,)?)*
            /// How far the position is to be believed, 0..=1: scales what follows the angle.
            pub position_trust: T,
            /// Change of the side load since the last sample, N.
            pub radial_force_change_n: T,
            /// How far the column that the lookup-table term follows is to be believed, 0..=1.
            pub lookup_trust: T,
        }

        impl<T: Real> Default for Sample<T> {
            fn default() -> Self {
                let zero = T::zero();
                Self {
                    $($($field: zero,)?)*
                    position_trust: T::one(),
                    radial_force_change_n: zero,
                    lookup_trust: T::one(),
                }
            }
        }

        impl<T: Copy> Sample<T> {
            /// Each number of it made into another.
            #[inline(always)]
            pub fn map<R>(&self, mut to: impl FnMut(T) -> R) -> Sample<R> {
                self.zip(self, |of, _| to(of))
            }

            /// Each number of it put together with that of another sample.
            #[inline(always)]
            pub fn zip<O: Copy, R>(&self, other: &Sample<O>, mut to: impl FnMut(T, O) -> R) -> Sample<R> {
                Sample {
                    $($($field: to(self.$field, other.$field),)?)*
                    position_trust: to(self.position_trust, other.position_trust),
                    radial_force_change_n: to(self.radial_force_change_n, other.radial_force_change_n),
                    lookup_trust: to(self.lookup_trust, other.lookup_trust),
                }
            }
        }

        /// What the compensator is told in one sample, in the units of a [`Sample`].
        #[derive(Clone, Copy, Debug)]
        pub struct Inputs<T> {
            $($(
                #[doc = concat!("Reading of the ", $label, ".")]
                pub $input: Reading<T>,
            )?)*
            /// Velocity the joint is meant to have, rad/s.
            pub velocity_reference_rad_s: Reading<T>,
            /// Time since the campaign began, h.
            pub campaign_time_h: T,
        }

        impl<T: Real> Inputs<T> {
            /// Nothing measured.
            pub fn missing() -> Self {
                Self {
                    $($($input: Reading::missing(),)?)*
                    velocity_reference_rad_s: Reading::missing(),
                    campaign_time_h: T::zero(),
                }
            }
        }
    };
}

quantity_table!(define_quantities);

impl<T: Real> Inputs<T> {
    /// A measured velocity and nothing else.
    pub fn velocity(velocity_rad_s: T) -> Self {
        Self { velocity_rad_s: Reading::fresh(velocity_rad_s), ..Self::missing() }
    }

    /// The same with a pressure difference as sensors and logs have it (`pressure_diff_pa`), Pa, of this age, s. The field
    /// is in MPa, because fixed point ends at 2048. One product in `f32`; [`Fixed`](crate::Fixed) takes it by way of an
    /// emulated double, so a loop without an FPU does this where the sensor is read.
    #[must_use]
    pub fn with_pressure_pa(self, pressure_diff_pa: T::Setting, age_s: T) -> Self {
        let mega_pascal = pressure_diff_pa * T::Setting::from_f64(1e-6);
        let pressure_diff_mpa = Reading { value: T::from_setting(mega_pascal), age_s };
        Self { pressure_diff_mpa, ..self }
    }
}

impl Quantity {
    /// Its column in the log of such a joint: a name that ends in the unit.
    pub const fn name(self, kind: JointKind) -> &'static str {
        kind.choose(self.info().names)
    }

    /// The unit of that column, as people write it; empty where it is not known.
    pub const fn unit(self, kind: JointKind) -> &'static str {
        kind.choose(self.info().units)
    }

    /// The quantity with this column name, and the joint kind that the name belongs to, where it tells.
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
    pub const LAST_COLUMN: u8 = {
        let (mut last, mut index) = (0, 0);
        while index < Self::ALL.len() {
            if let Some(column) = Self::ALL[index].info().column
                && column > last
            {
                last = column;
            }
            index += 1;
        }
        last
    };

    /// The quantity that the lookup-table term follows for this column number.
    pub fn of_column(number: u8) -> Option<Self> {
        Self::ALL.iter().copied().find(|quantity| quantity.info().column == Some(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn each_name_means_one_quantity() {
        for quantity in Quantity::ALL {
            for kind in [JointKind::Revolute, JointKind::Prismatic] {
                let (found, of) = Quantity::parse(quantity.name(kind)).unwrap();
                assert_eq!(found, *quantity);
                assert!(of.is_none_or(|of| of == kind));
            }
        }
        assert_eq!(Quantity::parse("flow"), None);
    }

    #[test]
    fn columns_are_numbered_without_a_gap() {
        let numbers: HashSet<u8> =
            Quantity::ALL.iter().filter_map(|quantity| quantity.info().column).collect();
        assert_eq!(numbers, (0..numbers.len() as u8).collect());
        assert_eq!(Quantity::of_column(4), Some(Quantity::Pressure));
    }

    #[test]
    fn scales_undo_each_other_and_samples_hold_what_they_were_given() {
        for quantity in Quantity::ALL {
            let info = quantity.info();
            assert!((info.inside_scale * info.outside_scale - 1.0).abs() < 1e-15);
            let mut sample = Sample::<f64>::default();
            quantity.set_in_sample(&mut sample, 2.5);
            let held = (*quantity != Quantity::Torque).then_some(2.5);
            assert_eq!(quantity.of_sample(&sample), held);
        }
    }
    #[test]
    fn a_pressure_in_pascals_is_the_one_in_megapascals() {
        let float = Inputs::<f32>::velocity(1.0).with_pressure_pa(1.5e5, 0.01).pressure_diff_mpa;
        assert!((float.value - 0.15).abs() < 1e-7 && float.age_s == 0.01);
        let age_s = crate::Fixed::from_f64(0.01);
        let fixed = Inputs::missing().with_pressure_pa(1.5e5, age_s).pressure_diff_mpa;
        assert_eq!((fixed.value, fixed.age_s), (crate::Fixed::from_f64(0.15), age_s));
    }
}
