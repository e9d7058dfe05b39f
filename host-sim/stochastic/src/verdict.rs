//! Comparison of the paper's rule with a diagnosis.
//!
//! The rule is "improve the parameter with the largest coefficient of variation". For the comparison, the rule is taken
//! to support every cause that acts through this parameter. [`reading`] explains where rule and diagnosis differ.

use super::certificate::Certificate;
use compensator_core::ParameterId;
use joint_log::number::significant;

fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [rest @ .., last] => format!("{} and {last}", rest.join(", ")),
    }
}

/// Describes the paper's verdict compared with that of a diagnosis.
///
/// `not_determined` are the parameters that the data do not determine. `causes` are those of the diagnosis, strongest
/// first, each with the parameters that it acts through.
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
        "it may vary by any factor that was tested".to_owned()
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
            " At {classes} the fitted model itself is outside the data's range more than {percent} % of the time, so \
             the range was centred on the model."
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
            "{rule} This log does not determine {name}: the torque hardly depends on its value, so a large variance \
             is permitted whether its physics is right or wrong, and {named}."
        );
    }
    if points_at_one {
        return format!("{rule} Here both agree: {named}, which acts on it.");
    }
    if names.is_empty() {
        return format!(
            "{rule} The rule always names a parameter; {named}, and noise alone permits a variance of this size."
        );
    }
    format!(
        "{rule} They differ: {named}. A permitted variance shows how little the torque depends on a parameter, not \
         whether the parameter follows a measured quantity; a cause is named for the latter."
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Settings, certify, message};
    use compensator_core::{LawKind, ParameterId as Id, Parameters};

    #[track_caller]
    fn check(section: &str, text: &str, parts: &[&str]) {
        message::check("verdicts", section, text, parts);
    }

    #[test]
    fn reading_explains_difference_between_rule_and_diagnosis() {
        let parameters = Parameters::new(LawKind::Lugre);
        let mut certificate = certify(&parameters, &[], &[], &Settings::default());
        check("nothing to certify", &reading(&certificate, &[], &[]), &[]);
        certificate.parameters = vec![Id::BristleStiffness, Id::CoulombTorque];
        certificate.cv = vec![vec![1.0], vec![0.08]];
        certificate.violation_at_fit = vec![0.0];
        certificate.verdict = Id::BristleStiffness;
        let pressure = [("pressure-coulomb", [Id::CoulombTorque].as_slice())];
        let text = reading(&certificate, &[Id::BristleStiffness], &pressure);
        let names = ["bristle_stiffness", "pressure-coulomb"];
        check("verdict on a parameter that is not determined", &text, &names);
        let differ = reading(&certificate, &[], &pressure);
        check("rule and diagnosis differ", &differ, &names);
        check("rule without a cause", &reading(&certificate, &[], &[]), &names[..1]);
        certificate.verdict = Id::CoulombTorque;
        let agree = reading(&certificate, &[], &pressure);
        check("rule and diagnosis agree", &agree, &["coulomb_torque", "pressure-coulomb"]);
        certificate.classes = vec!["35 rpm".to_owned()];
        certificate.violation_at_fit = vec![0.9];
        let beside = reading(&certificate, &[], &pressure);
        check("fitted model violated", &beside, &["35 rpm"]);
        let readings = [text, differ, agree, beside];
        assert!((1..4).all(|at| !readings[..at].contains(&readings[at])), "{readings:?}");
    }
}
