//! Names of all values of a parameter set, as `params` uses them: `static_torque`, `choices.damping_fades`,
//! `compensator.scale`, `motor.gear_ratio`, `model`.

use compensator_core::compensator::CompensatorParameters;
use compensator_core::network::record as network_record;
use compensator_core::parameters::{Choices, Envelope};
use compensator_core::{ParameterId, Parameters};
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::SensorParameters;
use firmware::supervisor::Thresholds;
use firmware::watch::WatchParameters;
use friction_fit::params::Section;
use friction_fit::spec::{Spec, SpecError};

/// A section of a set: numbers by name.
pub(crate) struct SetSection {
    pub section: Section,
    pub get: fn(&ParameterSet) -> Vec<f32>,
    /// Replaces all values.
    pub put: fn(&mut ParameterSet, &[f32]),
}

macro_rules! section {
    ($name:literal, $type:ty, $($field:ident).+) => {
        SetSection {
            section: Section { name: $name, fields: &<$type>::NAMES },
            get: |set| set.$($field).+.to_array().to_vec(),
            put: |set, values| {
                if let Ok(values) = values.try_into() {
                    set.$($field).+ = <$type>::from_array(values);
                }
            },
        }
    };
}

/// The sections of a set. The first two belong to the model, the others to the driver.
pub(crate) const SECTIONS: [SetSection; 6] = [
    section!("envelope", Envelope, friction.model.envelope),
    section!("compensator", CompensatorParameters, friction.compensator),
    section!("motor", MotorParameters, motor),
    section!("thresholds", Thresholds, thresholds),
    section!("watch", WatchParameters, watch),
    section!("sensors", SensorParameters, sensors),
];

/// Returns every choice of a set with its name.
pub fn choices(set: &ParameterSet) -> Vec<(String, bool)> {
    let choices = set.friction.model.choices.to_array();
    Choices::NAMES.iter().zip(choices).map(|(name, on)| (format!("choices.{name}"), on)).collect()
}

/// Returns the name of the model: the law and its terms.
pub fn model_name(model: &Parameters<f32>) -> String {
    let terms = model.terms.iter().map(|term| term.name());
    terms.fold(model.law.name().to_owned(), |name, term| name + "+" + term)
}

/// Returns the CRC of the network as its name. Its weights cannot be set one by one.
pub fn network_name(set: &ParameterSet) -> String {
    let record = network_record::emit(set.network.as_ref());
    let crc = record.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc));
    set.network.as_ref().map_or("none".to_owned(), |_| format!("crc {crc:08x}"))
}

/// Returns the values of a set with their names, as text. Of the model's parameters, only the `used` ones are included.
fn entries(set: &ParameterSet, used: &[ParameterId]) -> Vec<(String, String)> {
    let is_used = |name: &str| name.contains('.') || used.iter().any(|id| id.name() == name);
    let mut all = vec![("model".to_owned(), model_name(&set.friction.model))];
    all.push(("network".to_owned(), network_name(set)));
    all.extend(choices(set).into_iter().map(|(name, on)| (name, on.to_string())));
    let numbers = numbers(set).into_iter().filter(|(name, _)| is_used(name));
    // Exact: `{:?}` gives different texts for different numbers.
    all.extend(numbers.map(|(name, value)| (name, format!("{value:?}"))));
    all
}

/// A value that differs between two sets, as a text of all digits.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Difference {
    pub name: String,
    pub before: String,
    pub after: String,
}

/// Returns each difference between two sets. Parameters that neither model uses are ignored.
pub fn differences(before: &ParameterSet, after: &ParameterSet) -> Vec<Difference> {
    let models = [&before.friction.model, &after.friction.model];
    let used: Vec<ParameterId> = models.iter().flat_map(|model| model.active()).collect();
    let both = entries(before, &used).into_iter().zip(entries(after, &used));
    let differ = both.filter(|((_, before), (_, after))| before != after);
    differ.map(|((name, before), (_, after))| Difference { name, before, after }).collect()
}

/// Returns every number of a set with its name.
pub fn numbers(set: &ParameterSet) -> Vec<(String, f32)> {
    let model = &set.friction.model;
    let of_model = ParameterId::ALL.iter().map(|id| (id.name().to_owned(), model.get(*id)));
    let of_sections = SECTIONS.iter().flat_map(|of| {
        let names = of.section.fields.iter().map(|field| format!("{}.{field}", of.section.name));
        names.zip((of.get)(set))
    });
    of_model.chain(of_sections).collect()
}

/// Error of a name or of its value; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum NameError {
    #[error("{name}: no such parameter; {}", match similar.as_slice() {
        [] => "`params get` lists them".to_owned(),
        similar => format!("did you mean {}?", similar.join(" or ")),
    })]
    Unknown { name: String, similar: Vec<String> },
    #[error("{name}: no such choice, expected one of {}", Choices::NAMES.join(", "))]
    Choice { name: String },
    #[error("{name}: found {found:?}, expected {expected}")]
    Value { name: String, found: String, expected: &'static str },
    #[error(transparent)]
    Model(#[from] SpecError),
}

impl NameError {
    /// Returns the error for an unknown parameter, with up to five similar names of all.
    pub fn unknown(name: &str, all: impl IntoIterator<Item = String>) -> Self {
        let last = name.rsplit('.').next().unwrap_or(name);
        let is_similar = |known: &String| known.contains(last) || last.contains(known.as_str());
        let similar = all.into_iter().filter(is_similar).take(5).collect();
        Self::Unknown { name: name.to_owned(), similar }
    }

    /// Returns the error for a value that was found.
    pub fn value(name: &str, found: &str, expected: &'static str) -> Self {
        Self::Value { name: name.to_owned(), found: found.to_owned(), expected }
    }
}

/// Sets the model, a choice or a number of a set from text.
///
/// # Errors
/// See [`NameError`].
pub fn put(set: &mut ParameterSet, name: &str, value: &str) -> Result<(), NameError> {
    if name == "model" {
        let mut model = Spec::parse(value)?.parameters()?.convert::<f32>();
        for id in ParameterId::ALL {
            model.set(*id, set.friction.model.get(*id));
        }
        model.envelope = set.friction.model.envelope;
        model.choices = set.friction.model.choices;
        set.friction.model = model;
        return Ok(());
    }
    if let Some(choice) = name.strip_prefix("choices.") {
        let place = Choices::NAMES.iter().position(|known| *known == choice);
        let place = place.ok_or_else(|| NameError::Choice { name: name.to_owned() })?;
        let mut choices = set.friction.model.choices.to_array();
        choices[place] =
            value.parse().map_err(|_| NameError::value(name, value, "true or false"))?;
        set.friction.model.choices = Choices::from_array(choices);
        return Ok(());
    }
    let mut all = numbers(set).into_iter().map(|(known, _)| known);
    if !all.any(|known| known == name) {
        return Err(NameError::unknown(name, numbers(set).into_iter().map(|(known, _)| known)));
    }
    let number: f32 = value.parse().map_err(|_| NameError::value(name, value, "a number"))?;
    if let Some(id) = ParameterId::parse(name) {
        set.friction.model.set(id, number);
    }
    let (section, field) = name.split_once('.').unwrap_or_default();
    for of in SECTIONS.iter().filter(|of| of.section.name == section) {
        let mut values = (of.get)(set);
        for (value, _) in
            values.iter_mut().zip(of.section.fields).filter(|(_, known)| **known == field)
        {
            *value = number;
        }
        (of.put)(set, &values);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn put_accepts_every_printed_name() {
        let mut set = ParameterSet::default();
        for (name, value) in numbers(&set) {
            put(&mut set, &name, &format!("{}", value + 0.5)).unwrap();
        }
        let changed = numbers(&set);
        for ((name, before), (_, after)) in numbers(&ParameterSet::default()).iter().zip(&changed) {
            // Times in us and counts are integers, so adding 0.5 may not change them.
            assert!((after - before).abs() > 0.0 || name.starts_with("thresholds."), "{name}");
        }
        assert!(put(&mut set, "static_tork", "1").is_err());
        let error = put(&mut set, "scale", "1").unwrap_err().to_string();
        assert!(error.contains("compensator.scale"), "{error}");
        assert!(put(&mut set, "compensator.scale", "much").is_err());
        for (name, on) in choices(&set) {
            put(&mut set, &name, &(!on).to_string()).unwrap();
        }
        assert!(choices(&set).iter().all(|(_, on)| *on));
        assert!(
            put(&mut set, "choices.allow_active", "yes")
                .unwrap_err()
                .to_string()
                .contains("true or false")
        );
    }
}
