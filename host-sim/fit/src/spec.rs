//! Specification of a model: a law, extension terms, and the rigid-body parts of the base model.
//!
//! A model is named `LAW+TERM+TERM`, as `lugre+pressure-coulomb`. Contributions to the torque that are not friction
//! (`--rigid-body inertia,gravity,load,offset,delay,gain`) are not part of the name: they belong to every model that is
//! compared. In the core both are terms.

use compensator_core::{LawKind, ParameterId, Parameters, Quantity, TermKind};
use joint_log::setting::{Message, Setting, plain};
use std::fmt;

/// A contribution to the torque that is not friction.
struct RigidBodyPart {
    /// Its name in `--rigid-body`.
    name: &'static str,
    /// The core term that computes it.
    term: TermKind,
    /// Its effect.
    effect: &'static str,
}

/// The parts. The known load is a part and not a cause: how it enters the reading is fitted, not diagnosed.
const RIGID_BODY: [RigidBodyPart; 6] = [
    RigidBodyPart {
        name: "inertia",
        term: TermKind::UnmodelledInertia,
        effect: "inertia times acceleration.",
    },
    RigidBodyPart {
        name: "gravity",
        term: TermKind::GravityImbalance,
        effect: "sine and cosine of the position, whichever way it moves.",
    },
    RigidBodyPart { name: "load", term: TermKind::LoadGain, effect: "a gain on the known load." },
    RigidBodyPart { name: "offset", term: TermKind::TorqueOffset, effect: "a constant." },
    RigidBodyPart {
        name: "delay",
        term: TermKind::ChannelDelay,
        effect: "the torque responds to the motion of a moment ago, the same in all runs.",
    },
    // The scale of the torque is observable only against a load that is known in its own unit: everything else in the
    // model has the torque's scale.
    RigidBodyPart { name: "gain", term: TermKind::LoadGain, effect: "a gain on the known load." },
];

/// Returns the name of a rigid-body part; `None` for another term.
pub fn rigid_body_name(term: TermKind) -> Option<&'static str> {
    RIGID_BODY.iter().find(|part| part.term == term).map(|part| part.name)
}

/// Returns the effect of a rigid-body part on the torque, for a list of models; `None` for another term.
pub fn rigid_body_effect(term: TermKind) -> Option<&'static str> {
    RIGID_BODY.iter().find(|part| part.term == term).map(|part| part.effect)
}

/// A model to be fitted: its law, its terms and its rigid-body parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spec {
    /// The friction law.
    pub law: LawKind,
    /// The extension terms, in the order named.
    pub terms: Vec<TermKind>,
    /// The rigid-body parts of the base model.
    pub rigid_body: Vec<TermKind>,
}

/// Error in a model name or a list of rigid-body parts; one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpecError(String);

impl Message for SpecError {
    fn marked(&self) -> String {
        self.0.clone()
    }
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&plain(&self.0))
    }
}

impl std::error::Error for SpecError {}

fn names(of: impl Iterator<Item = &'static str>) -> String {
    of.collect::<Vec<_>>().join(", ")
}

impl Spec {
    /// Returns a law without terms.
    pub fn law(law: LawKind) -> Self {
        Self { law, terms: Vec::new(), rigid_body: Vec::new() }
    }

    /// Returns the law and the terms of parameters.
    pub fn of<S>(parameters: &Parameters<S>) -> Self {
        Self { terms: parameters.terms.to_vec(), ..Self::law(parameters.law) }
    }

    /// Parses `LAW+TERM+...`.
    ///
    /// # Errors
    /// If a name is unknown (the message lists the known ones), or if the law already includes a term.
    pub fn parse(name: &str) -> Result<Self, SpecError> {
        let asked = Setting::Model.given(name);
        let mut parts = name.split('+');
        let first = parts.next().unwrap_or_default();
        let law = LawKind::parse(first).ok_or_else(|| {
            let known = names(LawKind::ALL.iter().map(|law| law.name()));
            SpecError(format!("{asked}: unknown model {first:?}, expected one of {known}"))
        })?;
        let mut spec = Self::law(law);
        for part in parts {
            let term = TermKind::parse(part).ok_or_else(|| {
                let known = names(TermKind::ALL.iter().map(|term| term.name()));
                SpecError(format!("{asked}: unknown term {part:?}, expected one of {known}"))
            })?;
            if law.includes(term) {
                let why = format!("{} already includes {part}", law.name());
                return Err(SpecError(format!("{asked}: {why}")));
            }
            if spec.terms.contains(&term) {
                return Err(SpecError(format!("{asked}: {part} is named twice")));
            }
            spec.terms.push(term);
        }
        Ok(spec)
    }

    /// Adds rigid-body parts to the model. A part that the law or a term already includes is not added twice.
    #[must_use]
    pub fn on(mut self, rigid_body: &[TermKind]) -> Self {
        self.rigid_body =
            rigid_body.iter().copied().filter(|part| !self.law.includes(*part)).collect();
        self.terms.retain(|term| !rigid_body.contains(term));
        self
    }

    /// Returns the parameters of the model at their defaults.
    ///
    /// # Errors
    /// If there are more terms than a model can carry.
    pub fn parameters(&self) -> Result<Parameters<f64>, SpecError> {
        let mut parameters = Parameters::new(self.law);
        for term in self.rigid_body.iter().chain(&self.terms) {
            if !parameters.add_term(*term) {
                let most = compensator_core::term::MAX_TERMS;
                return Err(SpecError(format!("{self}: a model takes at most {most} terms")));
            }
        }
        Ok(parameters)
    }

    /// Returns the name with the rigid-body parts, as in `params.toml`.
    pub fn full_name(&self) -> String {
        let parts = self.rigid_body.iter().chain(&self.terms);
        parts.fold(self.law.name().to_owned(), |name, term| name + "+" + term.name())
    }

    /// Returns the quantities that a fit of this model needs, with the parameters that depend on them. These are the
    /// parameters of terms that read a quantity, also where a law includes them.
    pub fn needs(&self) -> impl Iterator<Item = (ParameterId, Quantity)> + '_ {
        let read = |id: &ParameterId| {
            let owner = TermKind::ALL.iter().find(|term| term.parameters().contains(id));
            owner.and_then(|term| term.reads()).map(|quantity| (*id, quantity))
        };
        let of_law = self.law.parameters().iter();
        let terms = self.rigid_body.iter().chain(&self.terms);
        of_law.chain(terms.flat_map(|term| term.parameters())).filter_map(read)
    }
}

impl fmt::Display for Spec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.law.name())?;
        self.terms.iter().try_for_each(|term| write!(f, "+{}", term.name()))
    }
}

/// Parses a list of rigid-body parts, `inertia,gravity,load,offset,delay,gain`.
///
/// # Errors
/// If a part is unknown; the message lists the known ones.
pub fn parse_rigid_body(list: &str) -> Result<Vec<TermKind>, SpecError> {
    let mut parts = Vec::new();
    for name in list.split(',').map(str::trim).filter(|name| !name.is_empty()) {
        let part = RIGID_BODY.iter().find(|part| part.name == name);
        let part = part.ok_or_else(|| {
            let known = names(RIGID_BODY.iter().map(|part| part.name));
            let asked = Setting::RigidBody.alone();
            SpecError(format!("{asked}: unknown part {name:?}, expected one of {known}"))
        })?;
        if !parts.contains(&part.term) {
            parts.push(part.term);
        }
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_and_display_are_inverse() {
        let spec = Spec::parse("linear+direction-asymmetry").unwrap();
        assert_eq!(spec.to_string(), "linear+direction-asymmetry");
        let spec = spec.on(&parse_rigid_body("inertia,offset").unwrap());
        assert_eq!(spec.to_string(), "linear+direction-asymmetry");
        let full = "linear+unmodelled-inertia+torque-offset+direction-asymmetry";
        assert_eq!(spec.full_name(), full);
        assert_eq!(Spec::parse(full).unwrap().full_name(), full);
    }

    #[test]
    fn parse_with_invalid_name_reports_it() {
        for (name, word) in [
            ("lugra", "unknown model \"lugra\""),
            ("lugre+pressure", "unknown term \"pressure\""),
            ("improved-lugre+pressure-coulomb", "already includes pressure-coulomb"),
            ("atan+torque-offset", "already includes torque-offset"),
            ("dahl+backlash+backlash", "named twice"),
        ] {
            let error = Spec::parse(name).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
        assert!(parse_rigid_body("inertia,mass").unwrap_err().to_string().contains("\"mass\""));
    }

    #[test]
    fn on_with_offset_under_atan_law_keeps_the_law_offset() {
        let spec = Spec::parse("atan").unwrap().on(&[TermKind::TorqueOffset]);
        assert!(spec.rigid_body.is_empty());
    }
}
