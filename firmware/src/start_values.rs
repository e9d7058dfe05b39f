//! The values that a board reads at its start only.
//!
//! Encoder, shunts and comparators are set up once, before the first PWM. A set that is committed later may have other values for
//! them, and the joint would move with those of the start. Therefore:
//!
//! - A board gets its [`StartValues`] from the [background loop](crate::background::Background::start_values), and no other
//!   parameter: an image cannot reach the node behind it. A value that a board needs at the start is added here, and is compared
//!   from then on.
//! - The node keeps them ([`StartRecord`]). It refuses to arm and to measure the motor, and keeps no proof of the wiring,
//!   while the set in use has other ones.

use crate::node_settings::BusSettings;
use crate::parameter_set::ParameterSet;
use crate::sensors::encoder_kind::EncoderKind;
use compensator_core::ParameterError;
use compensator_core::parameters::Text;
use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;

compensator_core::named_fields! {
    /// Parameters that a board reads at its start only. One that the encoder in use does not need is 0.
    pub struct StartValues {
        /// Kind of the motor's encoder.
        encoder_kind: f32 = 0.0;
        /// 1, or -1 if a current into the motor lowers the voltage of the shunt amplifiers.
        shunt_sign: f32 = 0.0;
        /// Current of the joint's motor at which the comparators open the bridge, A.
        overcurrent_a: f32 = 0.0;
        /// Pole pairs by which an encoder with lines or Hall sensors relates mechanical and electrical angle.
        pole_pairs: f32 = 0.0;
        /// Lines per turn of an ABZ encoder.
        abz_lines: f32 = 0.0;
        /// Direction of the Hall sensors beside an ABZ encoder.
        hall_order: f32 = 0.0;
        /// Begin of the first sector of these Hall sensors, rad.
        hall_offset_rad: f32 = 0.0;
        /// Bits of the position of a BiSS encoder.
        biss_bits: f32 = 0.0;
        /// Bits of its number of turns.
        biss_turn_bits: f32 = 0.0;
        /// Kind of the encoder at the joint's side of the gear.
        joint_encoder_kind: f32 = 0.0;
    }
    /// No set: every value is 0.
}

impl StartValues {
    /// Returns the values of a set.
    pub fn of(set: &ParameterSet) -> Self {
        let (motor, sensors) = (&set.motor, &set.sensors);
        let kind = EncoderKind::of(sensors.encoder_kind);
        let has_lines = matches!(kind, EncoderKind::Abz | EncoderKind::AbzHall);
        let has_both = kind == EncoderKind::AbzHall;
        let is_biss = kind == EncoderKind::Biss;
        let used = |is_used: bool, value: f32| if is_used { value } else { 0.0 };
        Self {
            overcurrent_a: motor.overcurrent_a,
            shunt_sign: sensors.shunt_sign,
            encoder_kind: sensors.encoder_kind,
            pole_pairs: used(has_lines || kind == EncoderKind::Hall, motor.pole_pairs),
            abz_lines: used(has_lines, sensors.abz_lines),
            hall_order: used(has_both, sensors.hall_order),
            hall_offset_rad: used(has_both, sensors.hall_offset_rad),
            biss_bits: used(is_biss, sensors.biss_bits),
            biss_turn_bits: used(is_biss, sensors.biss_turn_bits),
            joint_encoder_kind: sensors.joint_encoder_kind,
        }
    }

    /// Returns the kind of the motor's encoder.
    pub const fn kind(&self) -> EncoderKind {
        EncoderKind::of(self.encoder_kind)
    }

    /// Returns true if there is an encoder at the joint's side of the gear.
    pub fn has_joint_encoder(&self) -> bool {
        self.joint_encoder_kind != 0.0
    }

    /// Returns the first value in which a set differs.
    fn first_change(&self, set: &ParameterSet) -> Option<Text> {
        let values = self.to_array().into_iter().zip(Self::of(set).to_array());
        let mut named = Self::TEXTS.into_iter().zip(values);
        named.find(|(_, (start, now))| start.to_bits() != now.to_bits()).map(|(name, _)| name)
    }
}

/// What a node keeps of its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct StartRecord {
    values: StartValues,
    bus: BusSettings,
    /// Why the power stage cannot drive with the set in use.
    refused: Option<ParameterError>,
}

impl StartRecord {
    /// Returns the record of a start with this set and these settings.
    pub(crate) fn of(set: &ParameterSet, bus: BusSettings) -> Self {
        Self { values: StartValues::of(set), bus, refused: None }
    }

    /// Returns the parameters that the board reads.
    pub(crate) const fn values(&self) -> &StartValues {
        &self.values
    }

    /// Returns the settings of the bus that the board reads.
    pub(crate) const fn bus(&self) -> BusSettings {
        self.bus
    }

    /// Records whether the power stage can drive with the set in use.
    pub fn set_refused(&mut self, refused: Option<ParameterError>) {
        self.refused = refused;
    }

    /// Returns true if the board uses the values of this set.
    pub(crate) fn is_in_use(&self, set: &ParameterSet) -> bool {
        self.values.first_change(set).is_none()
    }

    /// Checks that the board uses the values of this set, and can drive with it.
    ///
    /// # Errors
    /// Returns the reason against closing the bridge.
    pub(crate) fn check(&self, set: &ParameterSet) -> Result<(), Reason> {
        if let Some(name) = self.values.first_change(set) {
            return Err(refusal!(
                "{name}: needs a restart, because the board reads it at its start only: save it, then reset the joint",
                name
            ));
        }
        self.refused.map_or(Ok(()), |refused| Err(refused.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets with one start value changed, for an encoder that uses it.
    #[test]
    fn check_with_one_value_changed_names_it() {
        for (kind, name) in [
            (0.0, "overcurrent_a"),
            (0.0, "shunt_sign"),
            (0.0, "encoder_kind"),
            (4.0, "pole_pairs"),
            (2.0, "abz_lines"),
            (3.0, "hall_order"),
            (3.0, "hall_offset_rad"),
            (5.0, "biss_bits"),
            (5.0, "biss_turn_bits"),
            (0.0, "joint_encoder_kind"),
        ] {
            let mut set = ParameterSet::default();
            set.sensors.encoder_kind = kind;
            let record = StartRecord::of(&set, BusSettings::default());
            assert_eq!(record.check(&set), Ok(()));
            let value = match name {
                "overcurrent_a" => &mut set.motor.overcurrent_a,
                "shunt_sign" => &mut set.sensors.shunt_sign,
                "encoder_kind" => &mut set.sensors.encoder_kind,
                "pole_pairs" => &mut set.motor.pole_pairs,
                "abz_lines" => &mut set.sensors.abz_lines,
                "hall_order" => &mut set.sensors.hall_order,
                "hall_offset_rad" => &mut set.sensors.hall_offset_rad,
                "biss_bits" => &mut set.sensors.biss_bits,
                "biss_turn_bits" => &mut set.sensors.biss_turn_bits,
                _ => &mut set.sensors.joint_encoder_kind,
            };
            *value += 1.0;
            let why = record.check(&set).expect_err(name);
            assert_eq!(why.words[0], Text::new(name).number());
            assert!(!record.is_in_use(&set));
        }
        assert_eq!(StartValues::FIELDS, 10, "each value has its row above");
    }

    #[test]
    fn values_that_the_encoder_does_not_use_need_no_restart() {
        let mut set = ParameterSet::default();
        let record = StartRecord::of(&set, BusSettings::default());
        set.motor.pole_pairs += 1.0;
        set.sensors.abz_lines += 1.0;
        set.sensors.biss_bits += 1.0;
        set.motor.current_limit_a -= 1.0;
        assert_eq!(record.check(&set), Ok(()));
    }
}
