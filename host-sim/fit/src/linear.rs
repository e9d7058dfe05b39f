//! A torque as a sum of regressors, with their coefficients: what a diagnosis fits by linear least squares.
//!
//! ```text
//! Dataset -> Motion -> Factor, Regressor -> torque of each term -> as the torque channel logs it
//!            motion    factor               here                   measurement
//! ```
//!
//! A driver runs a law of the core. On a PC, a model may hold more: several causes at once, columns that no driver has, friction
//! that builds up over several travels. Such a model is exact and convex to fit, and it is the model that was judged on held-out
//! rows: [`LinearModel`] is written to `params.toml` beside the law for the driver, and `predict` computes it.

mod factor;
pub(crate) mod motion;
mod operator;

pub use factor::{Factor, Inputs, Regressor, heat, mean_growth};
pub use motion::{Motion, has_campaign_clock};
pub use operator::{later, play, stop};

use crate::measurement::Measurement;
use crate::parameter_file_error::ParameterFileErrorKind;
use joint_log::Dataset;
use motion::long;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;

/// A regressor with its coefficient.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearTerm {
    /// Part of the law, as `coulomb`, or a cause, as `pressure-coulomb`.
    pub part: String,
    /// Coefficient: torque per unit of the regressor.
    pub size: f64,
    /// The regressor.
    pub factors: Regressor,
}

/// Names of the parts that are no causes: friction, and the rigid body in the torque column.
const LAW_PARTS: [&str; 7] =
    ["coulomb", "viscous", "stribeck", "inertia", "gravity", "load", "offset"];

/// A torque as a sum of regressors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearModel {
    /// Friction level that scales other terms: the law's friction part over its RMS.
    #[serde(default)]
    pub level: Vec<LinearTerm>,
    /// All terms.
    #[serde(rename = "term", default)]
    pub terms: Vec<LinearTerm>,
}

impl LinearModel {
    /// Returns the name in a report: Maxwell slip, stops of several travels, with its causes in the order of the terms.
    pub fn name(&self) -> String {
        let mut name = "maxwell-slip".to_owned();
        let mut causes: Vec<&str> = Vec::new();
        for part in self.terms.iter().map(|term| term.part.as_str()) {
            if !LAW_PARTS.contains(&part) && !causes.contains(&part) {
                causes.push(part);
                name += &format!("+{part}");
            }
        }
        name
    }

    /// Returns the columns that it follows and a log lacks.
    pub fn missing_columns<'a>(&'a self, data: &Dataset) -> Vec<&'a str> {
        let mut missing: Vec<&str> =
            self.columns().filter(|name| long(data, name).is_none()).collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// Returns the columns that it follows.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let factors = self.level.iter().chain(&self.terms).flat_map(|term| &term.factors.factors);
        factors.filter_map(Factor::column_name)
    }

    /// Returns the logged torque in all rows, run after run. A term whose column the log lacks adds nothing.
    pub fn predict(&self, data: &Dataset, measurement: &Measurement) -> Vec<f64> {
        let motion = Motion::new(data);
        let columns: BTreeMap<&str, Vec<f64>> =
            self.columns().filter_map(|name| Some((name, long(data, name)?))).collect();
        let find = |name: &str| columns.get(name).map(Vec::as_slice);
        let law = Inputs { motion: &motion, level: &[], column: &find };
        let level = sum(&self.level, &law);
        let shaft = sum(&self.terms, &Inputs { level: &level, ..law });
        measurement.logged(data, &motion, &shaft)
    }

    /// Appends the section `linear` of a parameter file.
    pub fn emit(&self, text: &mut String) {
        for (name, terms) in [("level", &self.level), ("term", &self.terms)] {
            for LinearTerm { part, size, factors } in terms {
                let factors = factors.factors.iter().map(inline).collect::<Vec<_>>().join(", ");
                // Writing to a string does not fail.
                let _ = write!(
                    text,
                    "\n[[linear.{name}]]\npart = {part:?}\nsize = {size:?}\nfactors = [{factors}]\n"
                );
            }
        }
    }

    /// Parses the section of a parameter file; `None` if it has none.
    ///
    /// # Errors
    /// One line that names the key.
    pub fn parse(text: &str) -> Result<Option<Self>, ParameterFileErrorKind> {
        #[derive(Deserialize)]
        struct File {
            linear: Option<LinearModel>,
        }
        let file: File = toml_edit::de::from_str(text).map_err(ParameterFileErrorKind::Linear)?;
        file.linear.iter().try_for_each(Self::check)?;
        Ok(file.linear)
    }

    /// Refuses numbers that no fit gives.
    fn check(&self) -> Result<(), ParameterFileErrorKind> {
        let of_level = self.level.iter().map(|term| ("linear.level", term));
        for (name, term) in of_level.chain(self.terms.iter().map(|term| ("linear.term", term))) {
            let refuse = |key: &str, expected: &str| {
                Err(ParameterFileErrorKind::value(
                    format!("{name}.{key} of {}", term.part),
                    expected,
                ))
            };
            if !term.size.is_finite() {
                return refuse("size", "a finite number");
            }
            if !term.factors.factors.iter().all(Factor::is_legal) {
                return refuse("factors", "scales above 0 and curves of degree 1 to 3");
            }
        }
        Ok(())
    }
}

/// Returns a factor as an inline table.
fn inline(factor: &Factor) -> String {
    let value = factor.serialize(toml_edit::ser::ValueSerializer::new());
    value.expect("a factor that is transferable").to_string()
}

fn sum(terms: &[LinearTerm], inputs: &Inputs) -> Vec<f64> {
    let mut total = vec![0.0; inputs.motion.len()];
    for term in terms {
        if let Some(values) = term.factors.values(inputs) {
            total.iter_mut().zip(values).for_each(|(total, value)| *total += term.size * value);
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> LinearModel {
        let stop = Regressor::from([Factor::Stop { travel: 0.01 }]);
        let pressure =
            Factor::Column { name: "pressure_diff_pa".into(), mean: 2e5, spread: 1e5, late_s: 0.0 };
        let term = |part: &str, size, factors| LinearTerm { part: part.into(), size, factors };
        LinearModel {
            level: vec![term("coulomb", 1.0, stop.clone())],
            terms: vec![
                term("coulomb", 1.5, stop),
                term("viscous", 0.2, Regressor::from([Factor::Velocity])),
                term("pressure-coulomb", 0.3, Regressor::from([Factor::Level, pressure])),
                term(
                    "warm-up",
                    -0.1,
                    Regressor::from([Factor::Warmth { scale: 2.0, cooling_s: f64::INFINITY }]),
                ),
            ],
        }
    }

    fn log(with_pressure: bool) -> Dataset {
        let mut names: Vec<String> =
            ["time_s", "velocity_rad_s", "torque_nm"].map(String::from).into();
        let time: Vec<f64> = (0..200).map(|row| 0.01 * f64::from(row)).collect();
        let mut columns = vec![time, vec![1.0; 200], vec![0.0; 200]];
        if with_pressure {
            names.push("pressure_diff_pa".into());
            columns.push(vec![3e5; 200]);
        }
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("a log")
    }

    #[test]
    fn emit_then_parse_returns_the_model() {
        let mut text = "schema = 1\n".to_owned();
        model().emit(&mut text);
        assert_eq!(LinearModel::parse(&text).unwrap(), Some(model()));
        assert_eq!(LinearModel::parse("schema = 1").unwrap(), None);
        assert_eq!(model().name(), "maxwell-slip+pressure-coulomb+warm-up");
        for (from, to) in
            [("travel", "way"), ("size = 1.5", "size = nan"), ("spread = 100000.0", "spread = 0")]
        {
            assert!(
                text.contains(from) && LinearModel::parse(&text.replace(from, to)).is_err(),
                "{to}"
            );
        }
        let curve = |degree: u8| {
            let factor = format!("{{ kind = \"curve\", degree = {degree}, from = 0, to = 1 }}");
            LinearModel::parse(&format!(
                "[[linear.term]]\npart = \"a\"\nsize = 1\nfactors = [{factor}]"
            ))
        };
        assert!(curve(3).is_ok() && curve(0).is_err() && curve(4).is_err());
    }

    #[test]
    fn predict_of_sliding_joint_sums_the_terms_and_leaves_out_those_without_a_column() {
        let mut model = model();
        model.terms.pop();
        let torque = |data: &Dataset| model.predict(data, &Measurement::default())[100];
        assert!((torque(&log(true)) - 2.0).abs() < 1e-12);
        assert!((torque(&log(false)) - 1.7).abs() < 1e-12);
        assert_eq!(model.missing_columns(&log(false)), ["pressure_diff_pa"]);
        assert!(model.missing_columns(&log(true)).is_empty());
    }
}
