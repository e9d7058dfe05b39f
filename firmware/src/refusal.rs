//! Why the driver refused the last request: object 2028h.
//!
//! The object has [`LENGTH`] bytes: the number of a text, then the numbers at its places, as little-endian words
//! ([`Reason`]). No text is in an image. On a PC, `texts` returns every text, and [`Explained`] prints a reason with them;
//! `cargo run -p firmware --example refusals` prints their numbers.
//!
//! Besides the places of the core, a text may have `{faults}`, a set of codes, `{conditions}`, further reasons against
//! arming, and `{test}`, the number of the self-test that failed.

#[cfg(not(target_os = "none"))]
mod texts;

#[cfg(not(target_os = "none"))]
pub use texts::texts;

use crate::parameter_set::SetError;
use crate::store::StoreError;
use crate::supervisor::{ArmRefusal, SelfTest};
use compensator_core::parameters::reason::{self, Names, Reason, WORDS};
use core::fmt;

/// Length of a reason on the bus, bytes.
pub const LENGTH: usize = 4 * (1 + WORDS);

/// Conditions against arming, by bit.
const CONDITIONS: [&str; 2] = ["unobserved", "unmeasured"];

/// Returns a reason as it is sent; none is all zeros.
pub fn emit(reason: Option<&Reason>) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    if let Some(reason) = reason {
        let words = core::iter::once(reason.text.number()).chain(reason.words);
        for (place, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
    }
    bytes
}

/// A reason as it was sent, to be printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Explained {
    text: u32,
    words: [u32; WORDS],
}

impl Explained {
    /// Parses a reason; `None` if there is none, or if the length is wrong.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; LENGTH] = bytes.try_into().ok()?;
        let mut all = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
        let text = all.next().filter(|number| *number != 0)?;
        let mut words = [0; WORDS];
        words.iter_mut().zip(all).for_each(|(place, word)| *place = word);
        Some(Self { text, words })
    }
}

impl From<&Reason> for Explained {
    fn from(reason: &Reason) -> Self {
        Self { text: reason.text.number(), words: reason.words }
    }
}

impl fmt::Display for Explained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Table.text(self.text) {
            Some(text) => reason::write(text, &self.words, &Table, f),
            None => write!(
                f,
                "reason {:08X} of another version of the firmware: {:X?}",
                self.text, self.words
            ),
        }
    }
}

macro_rules! explained {
    ($($error:ty),*) => {
        $(impl fmt::Display for $error {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                Explained::from(&Reason::from(*self)).fmt(f)
            }
        }

        impl core::error::Error for $error {})*
    };
}

explained!(ArmRefusal, SetError, StoreError);

#[cfg(not(target_os = "none"))]
fn name_of_code(number: u8) -> Option<&'static str> {
    crate::supervisor::Code::from_number(number).map(|code| code.info().name)
}

#[cfg(not(target_os = "none"))]
fn text_of(number: u32) -> Option<&'static str> {
    texts().find(|text| text.number() == number).map(|text| text.as_str())
}

/// A board prints no reasons.
#[cfg(target_os = "none")]
fn text_of(_: u32) -> Option<&'static str> {
    None
}

/// A board prints no reasons.
#[cfg(target_os = "none")]
fn name_of_code(_: u8) -> Option<&'static str> {
    None
}

/// The texts of this version.
struct Table;

impl Names for Table {
    fn text(&self, number: u32) -> Option<&'static str> {
        text_of(number)
    }

    fn write(&self, place: &str, word: u32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if place == "test" {
            return match SelfTest::from_number(word as u8) {
                Some(test) => write!(f, " (test {test})"),
                None if word == 0 => Ok(()),
                None => write!(f, " (test {word})"),
            };
        }
        for bit in (0..32).filter(|bit| word >> bit & 1 == 1) {
            let name = if place == "conditions" {
                CONDITIONS.get(bit as usize).copied()
            } else {
                name_of_code((1 + bit) as u8)
            };
            match name {
                Some(name) => write!(f, " {name}")?,
                None => write!(f, " {}", 1 + bit)?,
            }
        }
        Ok(())
    }
}
