//! The section `[compensator]` of a parameter file, and what a compensator gets of the file.
//!
//! ```toml
//! [compensator]
//! torque_constant_nm_per_a = 0.9          # any of the core's settings; a missing one is that of the driver
//! gravity = true                          # the gravity of the model is compensated, too
//! ```
//!
//! A fit of a complete drive torque holds more than friction. A compensator gets the friction: inertia would be positive feedback,
//! and offset, gain and delay describe the log. Gravity is compensated only where the owner asks for it, because it is wrong as
//! soon as the joint is mounted or tilted otherwise.

use super::{ParameterFile, ParameterFileErrorKind as Kind, number, section};
use crate::spec::{Spec, rigid_body_name};
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{Parameters, TermKind};
use joint_log::setting::Setting;
use toml_edit::Table;

/// The settings of a compensator that a file has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompensatorSection {
    /// The settings, in the order of [`CompensatorParameters::NAMES`].
    pub settings: [Option<f32>; CompensatorParameters::FIELDS],
    /// True if the gravity of the model is compensated.
    pub gravity: bool,
}

/// Settings for which no value is right for every joint.
const ASKED: [&str; 4] =
    ["scale", "torque_limit_nm", "torque_constant_nm_per_a", "current_limit_a"];

impl CompensatorSection {
    /// Key of the choice to compensate gravity.
    pub const GRAVITY: &'static str = "gravity";

    /// Returns these settings of the compensator; the missing ones are those of `others`.
    pub fn over(&self, others: &CompensatorParameters) -> CompensatorParameters {
        let mut values = others.to_array();
        for (value, setting) in values.iter_mut().zip(self.settings) {
            *value = setting.unwrap_or(*value);
        }
        CompensatorParameters::from_array(values)
    }

    /// Returns the place of a setting.
    fn place(name: &str) -> Option<usize> {
        CompensatorParameters::NAMES.iter().position(|known| *known == name)
    }

    /// Returns a setting by its name.
    pub fn get(&self, name: &str) -> Option<f32> {
        self.settings[Self::place(name)?]
    }

    /// Sets a setting.
    ///
    /// # Errors
    /// One line, if the name is unknown or the value is outside its range.
    pub fn set(&mut self, name: &str, value: f32) -> Result<(), Kind> {
        let known = || Kind::value(name, format!("of {}", CompensatorParameters::NAMES.join(", ")));
        self.settings[Self::place(name).ok_or_else(known)?] = Some(value);
        self.validate()
    }

    fn validate(&self) -> Result<(), Kind> {
        let all = self.over(&CompensatorParameters::default());
        Ok(all.validate()?)
    }

    /// Returns the names of the missing settings that only the owner of the joint knows.
    pub fn missing(&self) -> impl Iterator<Item = &'static str> + '_ {
        ASKED.into_iter().filter(|name| self.get(name).is_none())
    }

    pub(super) fn parse(root: &Table) -> Result<Self, Kind> {
        let mut settings = Self::default();
        for (key, item) in section(root, "compensator")? {
            let expected = |what: &str| Kind::value(format!("compensator.{key}"), what);
            if key == Self::GRAVITY {
                settings.gravity = item.as_bool().ok_or_else(|| expected("true or false"))?;
                continue;
            }
            let place = Self::place(key).ok_or_else(|| {
                let known = CompensatorParameters::NAMES.join(", ");
                let known = format!("{known}, {}", Self::GRAVITY);
                Kind::unknown(format!("compensator.{key}"), known)
            })?;
            let value = number(item).ok_or_else(|| expected("a finite number"))?;
            settings.settings[place] = Some(value as f32);
        }
        settings.validate().map(|()| settings)
    }
}

impl ParameterFile {
    /// Returns the friction of the model, with gravity if the file asks for it: what is compensated.
    pub fn compensated_model(&self) -> Parameters<f32> {
        let mut model = self.parameters.convert::<f32>();
        model.remove_left_out();
        if !self.compensator.gravity {
            model.terms.retain(|term| *term != TermKind::GravityImbalance);
        }
        model
    }

    /// Returns the name of what is compensated.
    pub fn compensated_name(&self) -> String {
        Spec::of(&self.compensated_model()).full_name()
    }

    /// Returns the configuration of a compensator. Settings that the file lacks have their defaults.
    pub fn friction(&self) -> Configuration {
        let compensator = self.compensator.over(&CompensatorParameters::default());
        Configuration { model: self.compensated_model(), compensator }
    }

    /// Returns a sentence on the parts of the model that are not compensated; `None` if there are none. It may refer to settings.
    pub fn left_out_in_words(&self) -> Option<String> {
        let gravity = TermKind::GravityImbalance;
        let has_gravity = self.parameters.terms.contains(&gravity) && !self.compensator.gravity;
        let others = self.parameters.left_out().chain(has_gravity.then_some(gravity));
        let names: Vec<&str> = others.filter_map(rigid_body_name).collect();
        let asked = Setting::With.suggested("gravity");
        let asked = if has_gravity { format!(" ({asked} adds gravity)") } else { String::new() };
        let names = (!names.is_empty()).then(|| names.join(", "))?;
        Some(format!("only friction is compensated; left out of the model: {names}{asked}"))
    }
}
