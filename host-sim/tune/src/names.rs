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

/// Returns the name, first value and second value of each difference between two sets. Parameters that neither model uses
/// are ignored.
pub fn differences(first: &ParameterSet, second: &ParameterSet) -> Vec<(String, String, String)> {
    let models = [&first.friction.model, &second.friction.model];
    let used: Vec<ParameterId> = models.iter().flat_map(|model| model.active()).collect();
    let both = entries(first, &used).into_iter().zip(entries(second, &used));
    let differ = both.filter(|((_, first), (_, second))| first != second);
    differ.map(|((name, first), (_, second))| (name, first, second)).collect()
}

/// Returns every number of a set with its name.
pub fn numbers(set: &ParameterSet) -> Vec<(String, f32)> {
    let model = &set.friction.model;
    let own = ParameterId::ALL.iter().map(|id| (id.name().to_owned(), model.get(*id)));
    let mut all: Vec<(String, f32)> = own.collect();
    let mut section = |name: &str, names: &[&str], values: &[f32]| {
        all.extend(
            names.iter().zip(values).map(|(field, value)| (format!("{name}.{field}"), *value)),
        );
    };
    section("envelope", &Envelope::NAMES, &model.envelope.to_array());
    let compensator = set.friction.compensator.to_array();
    section("compensator", &CompensatorParameters::NAMES, &compensator);
    section("motor", &MotorParameters::NAMES, &set.motor.to_array());
    section("thresholds", &Thresholds::NAMES, &set.thresholds.to_array());
    section("watch", &WatchParameters::NAMES, &set.watch.to_array());
    section("sensors", &SensorParameters::NAMES, &set.sensors.to_array());
    all
}

/// Returns the error message for an unknown parameter, with up to five similar names.
pub fn unknown(name: &str, all: &[String]) -> String {
    let last = name.rsplit('.').next().unwrap_or(name);
    let near: Vec<&str> = all
        .iter()
        .map(String::as_str)
        .filter(|known| known.contains(last) || last.contains(*known))
        .take(5)
        .collect();
    if near.is_empty() {
        format!("{name}: no such parameter; `params get` lists them")
    } else {
        format!("{name}: no such parameter; did you mean {}?", near.join(" or "))
    }
}

/// Sets the model, a choice or a number of a set from text.
pub fn put(set: &mut ParameterSet, name: &str, value: &str) -> Result<(), String> {
    if name == "model" {
        let spec = friction_fit::spec::Spec::parse(value).map_err(|error| error.to_string())?;
        let mut model = spec.parameters().map_err(|error| error.to_string())?.convert::<f32>();
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
        let place = place.ok_or_else(|| {
            format!("{name}: no such choice, expected one of {}", Choices::NAMES.join(", "))
        })?;
        let mut choices = set.friction.model.choices.to_array();
        choices[place] = value
            .parse()
            .map_err(|_| format!("{name}: found {value:?}, expected true or false"))?;
        set.friction.model.choices = Choices::from_array(choices);
        return Ok(());
    }
    let all: Vec<String> = numbers(set).into_iter().map(|(known, _)| known).collect();
    if !all.iter().any(|known| known == name) {
        return Err(unknown(name, &all));
    }
    let number: f32 =
        value.parse().map_err(|_| format!("{name}: found {value:?}, expected a number"))?;
    fn change<const N: usize>(fields: [f32; N], names: &[&str], field: &str, to: f32) -> [f32; N] {
        let mut fields = fields;
        for (place, name) in fields.iter_mut().zip(names) {
            if *name == field {
                *place = to;
            }
        }
        fields
    }
    match name.split_once('.') {
        None => {
            if let Some(id) = ParameterId::parse(name) {
                set.friction.model.set(id, number);
            }
        }
        Some(("envelope", field)) => {
            let fields = set.friction.model.envelope.to_array();
            let fields = change(fields, &Envelope::NAMES, field, number);
            set.friction.model.envelope = Envelope::from_array(fields);
        }
        Some(("compensator", field)) => {
            let fields = set.friction.compensator.to_array();
            let fields = change(fields, &CompensatorParameters::NAMES, field, number);
            set.friction.compensator = CompensatorParameters::from_array(fields);
        }
        Some(("motor", field)) => {
            let fields = change(set.motor.to_array(), &MotorParameters::NAMES, field, number);
            set.motor = MotorParameters::from_array(fields);
        }
        Some(("thresholds", field)) => {
            let fields = change(set.thresholds.to_array(), &Thresholds::NAMES, field, number);
            set.thresholds = Thresholds::from_array(fields);
        }
        Some(("sensors", field)) => {
            let fields = change(set.sensors.to_array(), &SensorParameters::NAMES, field, number);
            set.sensors = SensorParameters::from_array(fields);
        }
        Some((_, field)) => {
            let fields = change(set.watch.to_array(), &WatchParameters::NAMES, field, number);
            set.watch = WatchParameters::from_array(fields);
        }
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
        let error = put(&mut set, "scale", "1").unwrap_err();
        assert!(error.contains("compensator.scale"), "{error}");
        assert!(put(&mut set, "compensator.scale", "much").is_err());
        for (name, on) in choices(&set) {
            put(&mut set, &name, &(!on).to_string()).unwrap();
        }
        assert!(choices(&set).iter().all(|(_, on)| *on));
        assert!(
            put(&mut set, "choices.allow_active", "yes").unwrap_err().contains("true or false")
        );
    }
}
