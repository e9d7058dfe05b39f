//! A refusal in five words: the text that says why, and the numbers in it.
//!
//! The text has a place for each number: `{f32}`, `{i32}`, `{u32}`, `{hex}`, or `{name}`, the number of a [`Text`]. A
//! driver stores and sends the words; formatting them is the work of the PC that reads them.

use super::{Bound, ParameterError, ShortNumber, Text};
use core::fmt;

/// Numbers that a reason has room for.
pub const WORDS: usize = 4;

/// Why something is refused: see [`refusal!`](crate::refusal).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reason {
    /// The text, with the places of its numbers.
    pub text: Text,
    /// The numbers, in the order of their places, then zeros.
    pub words: [u32; WORDS],
}

/// A number that a reason can contain.
pub trait Word {
    /// Returns the number as the text's place expects it.
    fn word(self) -> u32;
}

macro_rules! word {
    ($($type:ty, $number:ident => $word:expr;)*) => {
        $(impl Word for $type {
            fn word(self) -> u32 {
                let $number = self;
                $word
            }
        })*
    };
}

word! {
    f32, number => number.to_bits();
    u8, number => number.into();
    u16, number => number.into();
    u32, number => number;
    usize, number => number as u32;
    i8, number => i32::from(number) as u32;
    i32, number => number as u32;
    Text, number => number.number();
}

impl fmt::Display for Reason {
    /// Writes the text. A `{name}` in it is written as its number, which only its program knows.
    #[cfg(feature = "texts")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write(self.text.as_str(), &self.words, &NoNames, f)
    }

    #[cfg(not(feature = "texts"))]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:X?}", self.text, self.words)
    }
}

/// Names that the texts of a program refer to by number.
pub trait Names {
    /// Returns the text with this number.
    fn text(&self, number: u32) -> Option<&'static str>;

    /// Writes a number at a place that this module does not know.
    ///
    /// # Errors
    /// As [`fmt::Write::write_str`].
    fn write(&self, _place: &str, word: u32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{word}")
    }
}

/// No names.
#[cfg(feature = "texts")]
struct NoNames;

#[cfg(feature = "texts")]
impl Names for NoNames {
    fn text(&self, _: u32) -> Option<&'static str> {
        None
    }
}

/// Returns the number of places of a text.
pub const fn places(text: &str) -> usize {
    let (mut count, mut rest) = (0, text.as_bytes());
    while let [byte, after @ ..] = rest {
        if *byte == b'{' {
            count += 1;
        }
        rest = after;
    }
    count
}

/// Writes a text with the numbers at their places.
///
/// # Errors
/// As [`fmt::Write::write_str`].
pub fn write(
    text: &str,
    words: &[u32; WORDS],
    names: &impl Names,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    let mut words = words.iter();
    let mut parts = text.split('{');
    f.write_str(parts.next().unwrap_or_default())?;
    for part in parts {
        let (place, after) = part.split_once('}').unwrap_or((part, ""));
        let word = words.next().copied().unwrap_or_default();
        match place {
            "f32" => fmt::Display::fmt(&ShortNumber(f32::from_bits(word).into()), f)?,
            "i32" => fmt::Display::fmt(&(word as i32), f)?,
            "u32" => fmt::Display::fmt(&word, f)?,
            "hex" => write!(f, "{word:08x}")?,
            "name" => match names.text(word) {
                Some(name) => f.write_str(name)?,
                None => write!(f, "text {word:08X}")?,
            },
            other => names.write(other, word, f)?,
        }
        f.write_str(after)?;
    }
    Ok(())
}

/// Makes a [`Reason`] of a literal with places, and the numbers at them.
///
/// ```
/// let reason = compensator_core::refusal!("law = {u32}: there is no such law", 9u8);
/// assert_eq!(reason.words, [9, 0, 0, 0]);
/// ```
#[macro_export]
macro_rules! refusal {
    ($text:expr $(, $number:expr)* $(,)?) => {{
        const {
            let numbers: &[&str] = &[$(stringify!($number)),*];
            assert!($crate::parameters::reason::places($text) == numbers.len(), "a number for each place");
        }
        let mut words = [0; $crate::parameters::reason::WORDS];
        let numbers = [$($crate::parameters::reason::Word::word($number)),*];
        words[..numbers.len()].copy_from_slice(&numbers);
        $crate::parameters::reason::Reason { text: $crate::text!($text), words }
    }};
}

impl From<Text> for Reason {
    /// A text without places.
    fn from(text: Text) -> Self {
        Self { text, words: [0; WORDS] }
    }
}

impl From<ParameterError> for Reason {
    fn from(error: ParameterError) -> Self {
        let ParameterError { field, value, bound, why } = error;
        let (text, limit) = match bound {
            Bound::AtLeast(limit) => {
                (crate::text!("{name} = {f32}: must be at least {f32}: {name}"), Some(limit))
            }
            Bound::AtMost(limit) => {
                (crate::text!("{name} = {f32}: must be at most {f32}: {name}"), Some(limit))
            }
            Bound::MoreThan(limit) => {
                (crate::text!("{name} = {f32}: must be more than {f32}: {name}"), Some(limit))
            }
            Bound::Finite => {
                (crate::text!("{name} = {f32}: must be a finite number: {name}"), None)
            }
            Bound::Whole => (crate::text!("{name} = {f32}: must be a whole number: {name}"), None),
        };
        let [field, value, why] = [field.word(), value.word(), why.word()];
        let words = match limit {
            Some(limit) => [field, value, limit.word(), why],
            None => [field, value, why, 0],
        };
        Self { text, words }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::ParameterId;
    use std::string::ToString;

    struct Explained(Reason);

    impl Names for Explained {
        fn text(&self, number: u32) -> Option<&'static str> {
            let known = [ParameterId::ViscousFriction.name(), "it brakes"];
            known.into_iter().find(|text| Text::number_of(text) == number)
        }
    }

    impl fmt::Display for Explained {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write(self.0.text.as_str(), &self.0.words, self, f)
        }
    }

    #[test]
    fn reason_of_a_parameter_reads_as_its_error() {
        for bound in [
            Bound::AtLeast(0.1),
            Bound::AtMost(-1.0),
            Bound::MoreThan(0.0),
            Bound::Finite,
            Bound::Whole,
        ] {
            let error = ParameterError {
                field: ParameterId::ViscousFriction.text(),
                value: -0.5,
                bound,
                why: crate::text!("it brakes"),
            };
            assert_eq!(Explained(error.into()).to_string(), error.to_string());
        }
    }

    #[test]
    fn number_is_written_as_its_place_says() {
        let reason = crate::refusal!("{i32} {u32} {hex} {name}.", -1i8, 7u16, 0xABCDu32, 1u32);
        assert_eq!(Explained(reason).to_string(), "-1 7 0000abcd text 00000001.");
    }
}
