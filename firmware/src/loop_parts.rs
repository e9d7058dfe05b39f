//! The parts of a current loop: built in the background, passed to the interrupt whole.
//!
//! Building validates, divides and takes milliseconds, so it is done outside the interrupt. The interrupt swaps
//! motor and friction model between two periods ([`crate::loop_task::LoopTask::swap`]).

use crate::control::parameters::OVERCURRENT_MARGIN;
use crate::control::{JointCompensator, Motor, MotorParameters, PERIOD_S};
use crate::log::log;
use crate::parameter_set::ParameterSet;
use crate::sensors::encoder::EncoderKind;
use compensator_core::ParameterError;
use compensator_core::parameters::Bound;
use compensator_core::text;

/// Properties of a power stage that apply in addition to the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTraits {
    /// Age of the angle of an encoder that is read in frames, caused by the way it is read, s. It is added to the
    /// parameter `encoder_delay_s`, the delay of the sensor itself.
    pub encoder_age_s: f32,
    /// The same of an encoder with BiSS C, which latches earlier.
    pub biss_age_s: f32,
    /// Largest phase current that the stage can measure, A; limits `overcurrent_a` and `current_limit_a`.
    pub current_max_a: f32,
    /// Maximum modulation that leaves the shunts time to settle; limits `modulation_max`.
    pub modulation_max: f32,
}

impl StageTraits {
    /// A stage that reads the encoder together with the currents and has current sensors of any range in the phases.
    pub const NONE: Self = Self {
        encoder_age_s: 0.0,
        biss_age_s: 0.0,
        current_max_a: f32::INFINITY,
        modulation_max: 1.0,
    };

    /// Checks the currents of a set against what the stage can measure. A current that is not measured is neither
    /// controlled nor limited.
    ///
    /// # Errors
    /// Names the current, its bound and the reason.
    pub fn check_currents(&self, set: &ParameterSet) -> Result<(), ParameterError> {
        let most_a = self.current_max_a;
        for (field, value, most_a) in [
            (text!("current_limit_a"), set.motor.current_limit_a, most_a / OVERCURRENT_MARGIN),
            (text!("overcurrent_a"), set.motor.overcurrent_a, most_a),
            (text!("overcurrent_a"), set.thresholds.overcurrent_a, most_a),
        ] {
            if value > most_a {
                let why = text!("the current sensors of this board measure no more");
                let bound = Bound::AtMost(most_a);
                return Err(ParameterError { field, value, bound, why });
            }
        }
        Ok(())
    }

    /// Returns the maximum modulation for low-side shunts. They are sampled at the top of the PWM period. Before
    /// it, every low side conducts for half of `(1 - duty) T` less the dead time, which must be at least the
    /// settling time of the amplifiers. A modulation `m` has its largest duty at `(1 + m) / 2`. All times are in
    /// s.
    pub const fn max_modulation(period_s: f32, dead_time_s: f32, settle_s: f32) -> f32 {
        1.0 - 4.0 * (dead_time_s + settle_s) / period_s
    }
}

/// The parts of a current loop: built outside the interrupt, passed whole.
#[derive(Clone, Debug)]
pub struct LoopParts {
    pub(crate) motor: Motor,
    pub(crate) model: JointCompensator<f32>,
    pub(crate) may_drive: bool,
}

impl LoopParts {
    /// Builds the parts for a period in s and a power stage.
    ///
    /// # Errors
    /// Names the parameter of motor or friction model that was refused.
    pub fn build(
        set: &ParameterSet,
        stage: StageTraits,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        // Validate the written values first, so that the error names what was written.
        set.motor.validate()?;
        stage.check_currents(set)?;
        let kind = EncoderKind::of(set.sensors.encoder_kind);
        let encoder_age_s = kind.age_s(stage.encoder_age_s, stage.biss_age_s);
        let motor = MotorParameters {
            encoder_delay_s: set.motor.encoder_delay_s + encoder_age_s,
            modulation_max: set.motor.modulation_max.min(stage.modulation_max),
            ..set.motor
        }
        .build(period_s)?
        .with_overspeed(set.thresholds.overspeed_rad_s);
        let max_current_a = set.motor.current_limit_a.min(set.friction.compensator.current_limit_a);
        let model = JointCompensator::build(&set.friction, period_s)?.limited_to(max_current_a);
        Ok(Self { motor, model, may_drive: true })
    }

    /// Builds the parts of a set in use. If it cannot be built, stores why in `refused`, and returns parts of the default set
    /// that measure and never drive.
    ///
    /// # Errors
    /// The default set cannot be built either, which the tests rule out.
    // Not inlined, to reduce the size of the image.
    #[inline(never)]
    pub fn build_or_measure_only(
        set: &ParameterSet,
        stage: StageTraits,
        refused: &mut Option<ParameterError>,
    ) -> Result<Self, ParameterError> {
        let mut built = Self::build(set, stage, PERIOD_S);
        if let Err(error) = built {
            log!(error, "stored parameters cannot be built: {=u32:08X}", error.field.number());
            *refused = Some(error);
            // Parts that never drive may have currents that the stage cannot measure.
            let stage = StageTraits { current_max_a: f32::INFINITY, ..stage };
            built = Self::build(&ParameterSet::default(), stage, PERIOD_S);
            if let Ok(parts) = &mut built {
                parts.may_drive = false;
            }
        }
        built
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_defaults_beyond_the_range_of_the_stage_measure_only() {
        let stage = StageTraits { current_max_a: 1.0, ..StageTraits::NONE };
        let may_drive = |stage, refused: &mut Option<_>| {
            let built = LoopParts::build_or_measure_only(&ParameterSet::default(), stage, refused);
            built.expect("the default set measures").may_drive
        };
        let mut refused = None;
        assert!(may_drive(StageTraits::NONE, &mut refused) && refused.is_none());
        assert!(!may_drive(stage, &mut refused) && refused.is_some());
    }

    #[test]
    fn build_of_parts_with_invalid_set_names_the_field() {
        let mut set = ParameterSet::default();
        set.motor.current_bandwidth_hz = 5000.0;
        assert_eq!(
            LoopParts::build(&set, StageTraits::NONE, PERIOD_S).unwrap_err().field,
            "current_bandwidth_hz"
        );
    }

    /// Checks the stage of the STM32G474: 0.5 us of dead time and 1.5 us of settling leave 84 % of the circle. The
    /// encoder age of 52 us adds to the delay of the encoder.
    #[test]
    fn stage_traits_limit_modulation_and_add_to_the_encoder_delay() {
        let (dead_s, settle_s) = (0.5e-6, 1.5e-6);
        let most = StageTraits::max_modulation(PERIOD_S, dead_s, settle_s);
        assert!((0.83..0.85).contains(&most), "{most}");
        // At the largest duty the low side conducts just long enough before the sample.
        let duty = (1.0 + most) / 2.0;
        let conducts_s = (1.0 - duty) * PERIOD_S / 2.0 - dead_s;
        assert!((conducts_s - settle_s).abs() < 1e-8, "{conducts_s}");

        let stage = StageTraits { encoder_age_s: 52e-6, modulation_max: most, ..StageTraits::NONE };
        let mut set = ParameterSet::default();
        let built =
            |set: &ParameterSet, stage| LoopParts::build(set, stage, PERIOD_S).unwrap().motor;
        set.motor.modulation_max = 0.95;
        let mut meant = set.clone();
        meant.motor.modulation_max = most;
        meant.motor.encoder_delay_s = 52e-6;
        assert_eq!(built(&set, stage), built(&meant, StageTraits::NONE));
        // A modulation below the bound is kept, and the sensor's own delay is added.
        set.motor.modulation_max = 0.5;
        set.motor.encoder_delay_s = 100e-6;
        meant.motor.modulation_max = 0.5;
        meant.motor.encoder_delay_s = 152e-6;
        let (found, expected) = (built(&set, stage), built(&meant, StageTraits::NONE));
        assert_eq!(found, expected);
    }
}
