//! Covariates: what is measured of the joint besides its encoder.
//!
//! Side load, pressure, temperature and the like come over the bus or from the board's own slow sensors. Each
//! has an age that grows in the interrupt between two commands, so that a sensor that fails goes stale.
//! [`Covariates`] and everything that lists its fields are made from the rows of
//! [`compensator_core::quantity_table`] with a `covariate`. A new row is aged, checked and passed to the compensator
//! without a change here. The compiler then asks for the frame that carries it.

use compensator_core::compensator::Reading;
use compensator_core::{Inputs, Quantity};

/// Readings that the encoder gives, and the reference that comes with the set-point.
#[derive(Clone, Copy, Debug)]
pub struct MotionReadings {
    /// Joint velocity, rad/s.
    pub velocity_rad_s: Reading<f32>,
    /// Reference velocity, rad/s.
    pub velocity_reference_rad_s: Reading<f32>,
    /// Joint position, rad.
    pub position_rad: Reading<f32>,
    /// Joint acceleration, rad/s^2.
    pub acceleration_rad_s2: Reading<f32>,
}

const MISSING: Reading<f32> = Reading { value: 0.0, age_s: -1.0 };

macro_rules! define_covariates {
    ($($(#[$doc:meta])* $quantity:ident {
        label: $label:literal, names: $names:expr, units: $units:expr, scale: $scale:expr,
        $(flags: [$invalid:ident, $stale:ident],)?
        $($(#[$field_doc:meta])* sample: $field:ident,)?
        $(input: $input:ident,)?
        $(covariate: $covariate:ident,)?
        $(column: $column:literal,)?
        $(guard: [$($guard:tt)*],)?
    })*) => {
        /// Readings of the covariates, in the units of [`Inputs`].
        #[derive(Clone, Copy, Debug)]
        pub struct Covariates {
            $($(
                #[doc = concat!("Reading of the ", $label, ".")]
                pub $covariate: Reading<f32>,
            )?)*
            /// Time since the campaign began, h.
            pub campaign_time_h: f32,
        }

        impl Covariates {
            /// No covariate is measured.
            pub const MISSING: Self = Self { $($($covariate: MISSING,)?)* campaign_time_h: 0.0 };

            /// The covariates, in the order of the table.
            pub const QUANTITIES: &'static [Quantity] = &[$($(covariate!($quantity, $covariate),)?)*];

            /// Returns the reading of a covariate, or `None` for any other quantity.
            pub fn get_mut(&mut self, quantity: Quantity) -> Option<&mut Reading<f32>> {
                match quantity {
                    $($(covariate!($quantity, $covariate) => Some(&mut self.$covariate),)?)*
                    _ => None,
                }
            }

            /// Returns true if any covariate marked as present is not finite.
            #[inline(always)]
            pub(super) fn has_invalid(&self) -> bool {
                let invalid = |r: &Reading<f32>| r.age_s >= 0.0 && !r.value.is_finite();
                $($(invalid(&self.$covariate) |)?)* !self.campaign_time_h.is_finite()
            }

            /// Changes every age, s.
            #[inline(always)]
            pub(crate) fn for_each_age(&mut self, mut change: impl FnMut(&mut f32)) {
                $($(change(&mut self.$covariate.age_s);)?)*
            }

            /// Returns the covariates among the inputs of a compensator.
            pub(crate) fn of_inputs(inputs: &Inputs<f32>) -> Self {
                Self {
                    $($($covariate: inputs.$covariate,)?)*
                    campaign_time_h: inputs.campaign_time_h,
                }
            }

            /// Returns the inputs of the compensator.
            #[inline(always)]
            pub(crate) fn inputs(&self, motion: MotionReadings) -> Inputs<f32> {
                Inputs {
                    velocity_rad_s: motion.velocity_rad_s,
                    velocity_reference_rad_s: motion.velocity_reference_rad_s,
                    position_rad: motion.position_rad,
                    acceleration_rad_s2: motion.acceleration_rad_s2,
                    $($($covariate: self.$covariate,)?)*
                    campaign_time_h: self.campaign_time_h,
                }
            }
        }
    };
}

/// The variant of a row that has a covariate: names the field so that a repetition over such rows can use it.
macro_rules! covariate {
    ($quantity:ident, $covariate:ident) => {
        Quantity::$quantity
    };
}

compensator_core::quantity_table!(define_covariates);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::compensation::Compensate;
    use crate::control::{
        CurrentLoop, LoopFlags, MotorParameters, PERIOD_S, Setpoint, StageSample, ValidChannels,
    };
    use compensator_core::network::Factors;
    use compensator_core::{CompensatorOutput, Flags};

    /// A compensator that keeps its last inputs.
    struct Recorder(Inputs<f32>);

    impl Compensate for Recorder {
        fn set_enabled(&mut self, _: bool) {}
        fn is_enabled(&self) -> bool {
            true
        }
        fn step(&mut self, inputs: &Inputs<f32>) -> CompensatorOutput<f32> {
            self.0 = *inputs;
            CompensatorOutput {
                friction_torque_nm: 0.0,
                compensation_torque_nm: 0.0,
                feed_forward_current_a: 0.0,
                flags: Flags::empty(),
            }
        }
        fn sum(&self, command_a: f32, _: &CompensatorOutput<f32>) -> (f32, Flags) {
            (command_a, Flags::empty())
        }
        fn torque_constant_nm_per_a(&self) -> f32 {
            1.0
        }
        fn supply(&mut self, _: Option<Factors<f32>>) {}
        fn bristle_torque_nm(&self) -> f32 {
            0.0
        }
    }

    /// Runs one cycle with these covariates; returns what the compensator received, and the flags.
    fn step(covariates: &Covariates) -> (Inputs<f32>, LoopFlags) {
        let motor = MotorParameters::default().build(PERIOD_S).expect("defaults are legal");
        let mut current_loop = CurrentLoop::new(motor, Recorder(Inputs::missing()));
        let sample = StageSample {
            currents_a: [0.0; 3],
            bus_v: 48.0,
            encoder: 0,
            valid: ValidChannels::all(),
        };
        let cycle = current_loop.step(&sample, &Setpoint::NONE, covariates);
        (current_loop.compensator().0, cycle.flags)
    }

    #[test]
    fn quantities_are_the_inputs_that_the_encoder_does_not_give() {
        let is_motion = |quantity: &Quantity| {
            matches!(quantity, Quantity::Velocity | Quantity::Position | Quantity::Acceleration)
        };
        // Fresh in every field: only quantities that the compensator reads give a reading.
        let inputs = Inputs::<f32>::missing().convert(|_| Reading::fresh(1.0), 0.0);
        let expected: Vec<Quantity> = Quantity::ALL
            .iter()
            .copied()
            .filter(|quantity| !is_motion(quantity) && quantity.reading_in(&inputs).age_s >= 0.0)
            .collect();
        assert_eq!(Covariates::QUANTITIES, expected);
    }

    #[test]
    fn every_covariate_reaches_the_compensator() {
        let mut covariates = Covariates::MISSING;
        for (place, &quantity) in Covariates::QUANTITIES.iter().enumerate() {
            *covariates.get_mut(quantity).unwrap() =
                Reading { value: place as f32 + 1.0, age_s: 0.25 };
        }
        let (inputs, flags) = step(&covariates);
        assert!(!flags.contains(LoopFlags::COVARIATE_INVALID));
        for (place, quantity) in Covariates::QUANTITIES.iter().enumerate() {
            let reading = quantity.reading_in(&inputs);
            assert_eq!((reading.value, reading.age_s), (place as f32 + 1.0, 0.25), "{quantity:?}");
        }
    }

    #[test]
    fn every_covariate_that_is_present_and_not_finite_is_reported() {
        for &quantity in Covariates::QUANTITIES {
            let mut covariates = Covariates::MISSING;
            for (value, age_s, is_reported) in
                [(f32::NAN, 0.0, true), (f32::INFINITY, 1.0, true), (f32::NAN, -1.0, false)]
            {
                *covariates.get_mut(quantity).unwrap() = Reading { value, age_s };
                let (_, flags) = step(&covariates);
                assert_eq!(
                    flags.contains(LoopFlags::COVARIATE_INVALID),
                    is_reported,
                    "{quantity:?} {value} {age_s}"
                );
            }
        }
    }
}
