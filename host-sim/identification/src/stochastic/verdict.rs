//! What the paper's rule says of a log, and how to read it beside a diagnosis.
//!
//! The rule is "improve the parameter with the largest coefficient of variation". To hold it against a named
//! cause it must point at some: it points, generously, at every cause that acts through the parameter.
//! [`reading`] says where rule and diagnosis part, and why.

use super::certificate::Certificate;
use crate::number::significant;
use compensator_core::ParameterId;

fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [rest @ .., last] => format!("{} and {last}", rest.join(", ")),
    }
}

/// The paper's verdict beside a diagnosis', in words.
///
/// `not_determined` are the parameters the data say nothing of; `causes` what the diagnosis named, the
/// strongest first, each with the parameters it acts through.
pub fn reading(
    certificate: &Certificate,
    not_determined: &[ParameterId],
    causes: &[(&str, &[ParameterId])],
) -> String {
    let verdict = certificate.verdict;
    let Some(cv) = certificate.mean_cv(verdict) else {
        return "The stochastic extension has no parameter to certify here.".to_owned();
    };
    let unlimited = certificate.unlimited.contains(&verdict);
    let how_far = if unlimited {
        "it may vary by any factor that was tried".to_owned()
    } else {
        format!("its permitted coefficient of variation is the largest, {}", significant(cv, 2))
    };
    let off = certificate.around_the_fit();
    let off = if off.is_empty() {
        String::new()
    } else {
        let percent = significant(100.0 * certificate.levels.rho, 2);
        let classes = listed(&off);
        format!(
            " At {classes} the fitted model is itself outside the data's range more than {percent} % of the time, so \
             the range was laid around it."
        )
    };
    let rule = format!("The paper's rule would improve {}: {how_far}.{off}", verdict.name());
    let names: Vec<&str> = causes.iter().map(|(name, _)| *name).collect();
    let named = match names.as_slice() {
        [] => "the diagnosis finds nothing systematic".to_owned(),
        names => format!("the diagnosis names {}", listed(names)),
    };
    let points_at_one = causes.iter().any(|(_, through)| through.contains(&verdict));
    if not_determined.contains(&verdict) {
        let name = verdict.name();
        return format!(
            "{rule} This log does not determine {name}: its value hardly reaches the torque, so a large variance \
             is permitted whether its physics is right or wrong, and {named}."
        );
    }
    if points_at_one {
        return format!("{rule} Here both agree: {named}, which acts on it.");
    }
    if names.is_empty() {
        return format!(
            "{rule} The rule always names a parameter; {named}, and a permitted variance of this size is what the \
             noise alone permits."
        );
    }
    format!(
        "{rule} They part: {named}. A permitted variance tells how little the torque depends on a parameter, not \
         whether the parameter follows something that was measured; a cause is named for the latter."
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stochastic::{Settings, certify};
    use compensator_core::{LawKind, ParameterId as Id, Parameters};

    #[test]
    fn a_reading_says_why_the_two_part() {
        let parameters = Parameters::new(LawKind::Lugre);
        let mut certificate = certify(&parameters, &[], &[], &Settings::default());
        assert!(reading(&certificate, &[], &[]).contains("no parameter to certify"));
        certificate.parameters = vec![Id::BristleStiffness, Id::CoulombTorque];
        certificate.cv = vec![vec![1.0], vec![0.08]];
        certificate.violation_at_fit = vec![0.0];
        certificate.verdict = Id::BristleStiffness;
        let pressure = [("pressure-coulomb", [Id::CoulombTorque].as_slice())];
        let text = reading(&certificate, &[Id::BristleStiffness], &pressure);
        assert!(text.contains("does not determine bristle_stiffness"), "{text}");
        assert!(text.contains("names pressure-coulomb"), "{text}");
        assert!(reading(&certificate, &[], &pressure).contains("They part"));
        assert!(reading(&certificate, &[], &[]).contains("nothing systematic"));
        certificate.verdict = Id::CoulombTorque;
        assert!(reading(&certificate, &[], &pressure).contains("both agree"));
        assert!(!reading(&certificate, &[], &pressure).contains("laid around it"));
        certificate.classes = vec!["35 rpm".to_owned()];
        certificate.violation_at_fit = vec![0.9];
        assert!(reading(&certificate, &[], &pressure).contains("At 35 rpm the fitted model"));
    }
}
