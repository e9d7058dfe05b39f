//! Parsers of the values of arguments.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::borrow::Cow;

/// Why the value of an argument is not accepted, as the end of a message that names both.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("expected {0}")]
pub struct Expected(Cow<'static, str>);

/// Returns the error of a value that is not what is expected.
pub fn expected(what: impl Into<Cow<'static, str>>) -> Expected {
    Expected(what.into())
}

/// Parses a finite number that is accepted.
pub fn number(
    text: &str,
    is_accepted: impl Fn(&f64) -> bool,
    what: impl Into<Cow<'static, str>>,
) -> Result<f64, Expected> {
    let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    number.filter(is_accepted).ok_or_else(|| expected(what))
}

/// Parses a duration, s.
pub fn seconds(text: &str) -> Result<f64, Expected> {
    number(text, |seconds| *seconds > 0.0, "a number above 0")
}

/// Returns the parser of values with a name. The help lists each with its description.
pub fn one_of<T: Clone + Send + Sync + 'static>(
    values: impl IntoIterator<Item = (&'static str, &'static str, T)>,
) -> impl TypedValueParser<Value = T> {
    let values: Vec<_> = values.into_iter().collect();
    let names = values.iter().map(|(name, help, _)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names.collect::<Vec<_>>()).map(move |name| {
        let value = values.iter().find(|(known, ..)| *known == name);
        value.map(|(.., value)| value.clone()).expect("one of the possible values")
    })
}
