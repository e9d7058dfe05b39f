//! Parameters in preparation: staged, validated, committed in two steps.
//!
//! Writes go to a staged set, which is not in use. A commit names the CRC of the set that the tool intends. The
//! staged set becomes active as a whole, and only if it has this CRC, is valid and can be built. So no partial
//! set, and no set of another tool, is used. A refused write changes nothing. Its reason is in the refusal
//! object: field, value, bound and explanation.

use crate::control::MotorParameters;
use crate::log::log;
use crate::node::dictionary::index;
use crate::node::sdo::{Abort, ValueBuffer};
use crate::parameter_set::{DRIVE_RECORD_BYTES, IdentifiedSet, ParameterSet, SetError};
use crate::sensors::SensorParameters;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::network::record as network_record;
use compensator_core::parameters::reason::Reason;
use compensator_core::parameters::{Choices, Envelope, LawKind, Text};
use compensator_core::record;
use compensator_core::refusal;
use compensator_core::term::MAX_TERMS;
use compensator_core::{ParameterId, TermKind};

/// Number of an empty term entry.
pub const NO_TERM: u8 = 0xFF;

/// The active set and the staged one.
#[derive(Clone, Debug)]
pub struct Staging {
    active: IdentifiedSet,
    /// [`ParameterSet::wiring_crc`] of the active set. It is compared every millisecond, and computing it takes longer than a
    /// period of the current loop.
    wiring_crc: u32,
    staged: IdentifiedSet,
    /// The staged terms as they were written: between two writes a term may appear twice.
    terms: [u8; MAX_TERMS],
    reason: Option<Reason>,
}

impl Default for Staging {
    /// The default set, active and staged.
    fn default() -> Self {
        let mut staging = Self {
            active: IdentifiedSet::default(),
            wiring_crc: 0,
            staged: IdentifiedSet::default(),
            terms: [NO_TERM; MAX_TERMS],
            reason: None,
        };
        staging.identify();
        staging
    }
}

impl Staging {
    /// Loads an encoded set, active and staged.
    ///
    /// # Errors
    /// Returns why the set is refused; the default set is loaded then.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), SetError> {
        let read = self.active.read(bytes);
        if read.is_err() {
            *self.active = ParameterSet::default();
        }
        self.identify();
        read
    }

    /// Computes the CRCs of the active set, which is then also the staged one: here, and not for a frame that reads them.
    fn identify(&mut self) {
        self.wiring_crc = self.active.wiring_crc();
        self.active.crc();
        self.discard();
    }

    /// Returns the set in use.
    pub fn active(&self) -> &ParameterSet {
        &self.active
    }

    /// Returns the CRC of the active set: see [`ParameterSet::crc`].
    pub fn active_crc(&self) -> u32 {
        self.active.crc()
    }

    /// Returns the CRC of the staged set.
    pub fn staged_crc(&self) -> u32 {
        self.staged.crc()
    }

    /// Returns the CRC of the wiring parameters in use: see [`ParameterSet::wiring_crc`].
    pub const fn wiring_crc(&self) -> u32 {
        self.wiring_crc
    }

    /// Returns the staged set, with its terms sorted.
    pub fn staged(&self) -> &ParameterSet {
        &self.staged
    }

    /// Returns the staged set, to change other values than law and terms.
    pub fn staged_mut(&mut self) -> &mut ParameterSet {
        self.list_terms();
        &mut self.staged
    }

    /// Replaces the staged set by the active one.
    #[inline(never)]
    pub fn discard(&mut self) {
        self.staged.copy_from(&self.active);
        self.list_terms();
    }

    /// Lists the terms of the staged set, and sorts them.
    fn list_terms(&mut self) {
        self.terms = [NO_TERM; MAX_TERMS];
        for (place, term) in self.terms.iter_mut().zip(&self.staged.friction.model.terms) {
            *place = *term as u8;
        }
        self.sort_terms();
    }

    /// Gives the staged set the terms of the list that its law does not include.
    fn sort_terms(&mut self) {
        let model = &mut self.staged.friction.model;
        model.terms.clear();
        for kind in self.terms.iter().filter_map(|code| TermKind::from_number(*code)) {
            model.add_term(kind);
        }
    }

    /// Returns the reason of the last refusal, if there was one since the last commit.
    pub const fn reason(&self) -> Option<&Reason> {
        self.reason.as_ref()
    }

    /// Stores a reason and returns the abort code.
    pub fn refuse(&mut self, abort: Abort, why: impl Into<Reason>) -> Abort {
        let reason = why.into();
        log!(warn, "refused: reason {=u32:08X}", reason.text.number());
        self.reason = Some(reason);
        abort
    }

    /// Reads a staged value.
    pub fn read(&self, at_index: u16, sub_index: u8, value: &mut ValueBuffer) -> Result<(), Abort> {
        let place = usize::from(sub_index).checked_sub(1).ok_or(Abort::NoSubIndex)?;
        let friction = &self.staged.friction;
        let model = &friction.model;
        let float = |numbers: &[f32]| numbers.get(place).copied().ok_or(Abort::NoSubIndex);
        let bytes = match at_index {
            index::ENVELOPE => float(&model.envelope.to_array())?.to_le_bytes(),
            index::COMPENSATOR => float(&friction.compensator.to_array())?.to_le_bytes(),
            index::MOTOR | index::THRESHOLDS | index::WATCH_PARAMETERS | index::SENSORS => {
                let (at, _) = drive_value(at_index, place).ok_or(Abort::NoSubIndex)?;
                let values = self.staged.emit_drive();
                *values.as_chunks().0.get(at).ok_or(Abort::NoSubIndex)?
            }
            index::PARAMETERS => {
                let id = ParameterId::ALL.get(place).ok_or(Abort::NoSubIndex)?;
                model.get(*id).to_le_bytes()
            }
            _ => {
                let byte = match place {
                    0 => model.law as u8,
                    1 => choices_to_bits(model.choices),
                    _ => *self.terms.get(place - 2).ok_or(Abort::NoSubIndex)?,
                };
                return value.push(byte).map_err(|_| Abort::Memory);
            }
        };
        value.extend_from_slice(&bytes).map_err(|_| Abort::Memory)
    }

    /// Stages a single value.
    ///
    /// # Errors
    /// The value is out of its own range. Whether the values fit together is checked at the commit, so that they
    /// can be written in any order.
    pub fn write(&mut self, at_index: u16, sub_index: u8, value: &[u8]) -> Result<(), Abort> {
        let place = usize::from(sub_index).checked_sub(1).ok_or(Abort::NoSubIndex)?;
        if at_index == index::MODEL {
            let [byte] = *value else { return Err(Abort::TooLong) };
            return self.write_choice(place, byte);
        }
        let number = f32::from_le_bytes(value.try_into().map_err(|_| Abort::TooLong)?);
        match at_index {
            index::ENVELOPE => {
                let mut fields = self.staged.friction.model.envelope.to_array();
                let name = *Envelope::TEXTS.get(place).ok_or(Abort::NoSubIndex)?;
                self.check_finite(name, number)?;
                *fields.get_mut(place).ok_or(Abort::NoSubIndex)? = number;
                self.staged.friction.model.envelope = Envelope::from_array(fields);
            }
            index::COMPENSATOR => {
                let mut fields = self.staged.friction.compensator.to_array();
                *fields.get_mut(place).ok_or(Abort::NoSubIndex)? = number;
                let changed = CompensatorParameters::from_array(fields);
                changed.validate().map_err(|error| self.refuse(Abort::Value, error))?;
                self.staged.friction.compensator = changed;
            }
            index::MOTOR | index::THRESHOLDS | index::WATCH_PARAMETERS | index::SENSORS => {
                let (at, name) = drive_value(at_index, place).ok_or(Abort::NoSubIndex)?;
                self.check_finite(name, number)?;
                let mut values = self.staged.emit_drive();
                *values.as_chunks_mut().0.get_mut(at).ok_or(Abort::NoSubIndex)? =
                    number.to_le_bytes();
                self.staged.set_drive(&values);
            }
            _ => {
                let id = *ParameterId::ALL.get(place).ok_or(Abort::NoSubIndex)?;
                let [least, most] = id.range();
                self.check(id.text(), number, least, most)?;
                self.staged.friction.model.set(id, number);
            }
        }
        Ok(())
    }

    fn write_choice(&mut self, place: usize, byte: u8) -> Result<(), Abort> {
        match place {
            0 => {
                let law = LawKind::from_number(byte).ok_or_else(|| {
                    self.refuse(Abort::Value, refusal!("law = {u32}: there is no such law", byte))
                })?;
                self.staged.friction.model.law = law;
                self.sort_terms();
            }
            1 => {
                self.staged.friction.model.choices = choices_from_bits(byte).ok_or_else(|| {
                    self.refuse(Abort::Value, refusal!("choices = {u32}: must be at most 7", byte))
                })?;
            }
            _ => {
                if byte != NO_TERM && TermKind::from_number(byte).is_none() {
                    let why = refusal!("term = {u32}: there is no such term", byte);
                    return Err(self.refuse(Abort::Value, why));
                }
                *self.terms.get_mut(place - 2).ok_or(Abort::NoSubIndex)? = byte;
                self.sort_terms();
            }
        }
        Ok(())
    }

    /// Checks that a value is finite. The commit checks the ranges, because they depend on each other.
    fn check_finite(&mut self, name: Text, number: f32) -> Result<(), Abort> {
        self.check(name, number, f32::MIN, f32::MAX)
    }

    fn check(&mut self, name: Text, number: f32, least: f32, most: f32) -> Result<(), Abort> {
        if !number.is_finite() {
            let why = refusal!("{name} = {f32}: must be finite", name, number);
            return Err(self.refuse(Abort::Value, why));
        }
        if number < least {
            let why = refusal!("{name} = {f32}: must be at least {f32}", name, number, least);
            return Err(self.refuse(Abort::TooLow, why));
        }
        if number > most {
            let why = refusal!("{name} = {f32}: must be at most {f32}", name, number, most);
            return Err(self.refuse(Abort::TooHigh, why));
        }
        Ok(())
    }

    /// Stages a whole friction model from its record.
    ///
    /// # Errors
    /// The record is damaged, or its parameters are refused.
    pub fn write_record(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let friction = record::parse(bytes).map_err(|error| self.refuse(Abort::Value, error))?;
        self.staged.friction = friction;
        self.list_terms();
        Ok(())
    }

    /// Stages a network from its record, or an empty record.
    ///
    /// # Errors
    /// The record is damaged, or the network is refused.
    pub fn write_network(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let network = network_record::parse(bytes);
        self.staged.network = network.map_err(|error| self.refuse(Abort::Value, error))?;
        Ok(())
    }

    /// Stages all parameters of motor, thresholds, watch and sensors.
    ///
    /// # Errors
    /// The length is wrong, or a value is refused.
    pub fn write_drive(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let drive: &[u8; DRIVE_RECORD_BYTES] = bytes.try_into().map_err(|_| Abort::TooShort)?;
        let set = &mut self.staged;
        let before = (set.motor, set.thresholds, set.watch, set.sensors);
        set.set_drive(drive);
        let valid = set.validate_drive();
        if valid.is_err() {
            (set.motor, set.thresholds, set.watch, set.sensors) = before;
        }
        valid.map_err(|error| self.refuse(Abort::Value, error))?;
        self.list_terms();
        Ok(())
    }

    /// Checks that the staged set has this CRC and is valid. It becomes active with [`Staging::activate`]; the
    /// driver builds it first.
    ///
    /// # Errors
    /// The CRC differs, or parameters are refused.
    pub fn validate_commit(&mut self, meant: u32) -> Result<(), Abort> {
        let found = self.staged.crc();
        if found != meant {
            let why = refusal!("commit of {hex}, but the staged set is {hex}", meant, found);
            return Err(self.refuse(Abort::Refused, why));
        }
        self.staged.validate().map_err(|error| self.refuse(Abort::Value, error))
    }

    /// Checks that these are the wiring parameters in use, by their CRC.
    ///
    /// # Errors
    /// The CRC differs.
    pub fn check_wiring(&mut self, seen: u32) -> Result<(), Abort> {
        let wiring = self.wiring_crc;
        if seen == wiring {
            return Ok(());
        }
        let why = refusal!(
            "confirm = {hex}: the wiring in use has the crc {hex}, and only this can be confirmed",
            seen,
            wiring
        );
        Err(self.refuse(Abort::Value, why))
    }

    /// Makes the staged set the active one.
    pub fn activate(&mut self) {
        self.active.copy_from(&self.staged);
        self.wiring_crc = self.active.wiring_crc();
        self.list_terms();
        self.reason = None;
    }
}

/// Returns the place of a value of motor, thresholds, watch or sensors in their common encoding, and its name.
#[inline(never)]
fn drive_value(at_index: u16, place: usize) -> Option<(usize, Text)> {
    const THRESHOLDS: usize = MotorParameters::FIELDS;
    const WATCH: usize = THRESHOLDS + Thresholds::FIELDS;
    const SENSORS: usize = WATCH + WatchParameters::FIELDS;
    let (first, names): (usize, &[Text]) = match at_index {
        index::MOTOR => (0, &MotorParameters::TEXTS),
        index::THRESHOLDS => (THRESHOLDS, &Thresholds::TEXTS),
        index::WATCH_PARAMETERS => (WATCH, &WatchParameters::TEXTS),
        _ => (SENSORS, &SensorParameters::TEXTS),
    };
    names.get(place).map(|name| (first + place, *name))
}

fn choices_to_bits(choices: Choices) -> u8 {
    u8::from(choices.damping_fades)
        | u8::from(choices.printed_extended) << 1
        | u8::from(choices.allow_active) << 2
}

fn choices_from_bits(bits: u8) -> Option<Choices> {
    (bits < 8).then_some(Choices {
        damping_fades: bits & 1 != 0,
        printed_extended: bits & 2 != 0,
        allow_active: bits & 4 != 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;
    use crate::refusal::Explained;
    use std::string::{String, ToString};

    fn reason_of(staging: &Staging) -> String {
        staging.reason().map(|reason| Explained::from(reason).to_string()).unwrap_or_default()
    }

    fn float(staging: &mut Staging, id: ParameterId, value: f32) -> Result<(), Abort> {
        staging.write(index::PARAMETERS, id as u8 + 1, &value.to_le_bytes())
    }

    #[test]
    fn staged_values_become_active_together_at_the_commit() {
        let mut staging = Staging::default();
        // In between, the static level is below the Coulomb level: a single write must not refuse that.
        float(&mut staging, ParameterId::CoulombTorque, 1.5).unwrap();
        float(&mut staging, ParameterId::StaticTorque, 2.0).unwrap();
        staging.write(index::MODEL, 1, &[LawKind::ImprovedLugre as u8]).unwrap();
        staging.write(index::MODEL, 3, &[TermKind::PositionRipple as u8]).unwrap();
        assert_eq!(staging.active(), &ParameterSet::default());
        let wrong = staging.validate_commit(1);
        assert_eq!(wrong, Err(Abort::Refused));
        let meant = staging.staged().crc();
        let (reason, crc) = (reason_of(&staging), format!("{meant:08x}"));
        message::require(&reason, &["00000001", &crc]);
        message::check("staging", "commit of another set", &reason.replace(&crc, "STAGED"), &[]);
        staging.validate_commit(meant).unwrap();
        staging.activate();
        assert_eq!(staging.active().friction.model.get(ParameterId::StaticTorque), 2.0);
        assert_eq!(staging.active().friction.model.terms.as_slice(), [TermKind::PositionRipple]);
        assert_eq!(staging.active().crc(), meant);
        assert_eq!(staging.wiring_crc(), staging.active().wiring_crc());
    }

    #[test]
    fn staged_write_with_invalid_value_names_the_field_and_changes_nothing() {
        let mut staging = Staging::default();
        let before = staging.staged().clone();
        let cases: [(u16, u8, &[u8], Abort, &str); 8] = [
            // The object, the value, the abort code, and what the reason starts with.
            (index::PARAMETERS, 1, &(-1f32).to_le_bytes(), Abort::TooLow, "coulomb_torque = -1:"),
            (
                index::PARAMETERS,
                1,
                &1e9f32.to_le_bytes(),
                Abort::TooHigh,
                "coulomb_torque = 1000000000:",
            ),
            (
                index::PARAMETERS,
                3,
                &f32::NAN.to_le_bytes(),
                Abort::Value,
                "stribeck_velocity = NaN:",
            ),
            (index::COMPENSATOR, 1, &1.5f32.to_le_bytes(), Abort::Value, "scale = 1.5:"),
            (
                index::ENVELOPE,
                1,
                &f32::INFINITY.to_le_bytes(),
                Abort::Value,
                "velocity_max_rad_s = inf:",
            ),
            (index::MOTOR, 1, &f32::NAN.to_le_bytes(), Abort::Value, "pole_pairs = NaN:"),
            (index::MODEL, 1, &[200], Abort::Value, "law = 200:"),
            (index::MODEL, 4, &[99], Abort::Value, "term = 99:"),
        ];
        let mut reasons = String::new();
        for (at, sub_index, bytes, abort, reason) in cases {
            assert_eq!(staging.write(at, sub_index, bytes), Err(abort));
            assert!(reason_of(&staging).starts_with(reason), "{}", reason_of(&staging));
            assert_eq!(staging.staged(), &before);
            reasons += &(reason_of(&staging) + "\n");
        }
        message::check("staging", "invalid values", &reasons, &[]);
    }

    #[test]
    fn staged_values_that_are_inconsistent_are_refused_at_the_commit() {
        let mut staging = Staging::default();
        float(&mut staging, ParameterId::CoulombTorque, 3.0).unwrap();
        let meant = staging.staged().crc();
        assert_eq!(staging.validate_commit(meant), Err(Abort::Value));
        message::require(&reason_of(&staging), &["static_torque = 1:", " 3"]);
        staging.discard();
        assert_eq!(staging.staged(), &ParameterSet::default());
        staging.write(index::THRESHOLDS, 1, &2e5f32.to_le_bytes()).unwrap();
        let meant = staging.staged().crc();
        assert_eq!(staging.validate_commit(meant), Err(Abort::Value));
        message::require(&reason_of(&staging), &["command_timeout_us = 200000:", " 100000"]);
    }

    #[test]
    fn staged_record_that_is_damaged_changes_nothing() {
        let mut staging = Staging::default();
        let mut other = ParameterSet::default();
        other.friction.model.set(ParameterId::ViscousFriction, 0.5);
        other.friction.model.add_term(TermKind::TorqueOffset);
        let mut record = record::emit(&other.friction);
        staging.write_record(&record).unwrap();
        assert_eq!(staging.staged(), &other);
        record[90] ^= 1;
        assert_eq!(staging.write_record(&record), Err(Abort::Value));
        message::check("staging", "damaged record", &reason_of(&staging), &["CRC"]);
        assert_eq!(staging.staged(), &other);
    }
}
