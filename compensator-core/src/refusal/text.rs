//! Texts of refusals, as numbers.
//!
//! A refusal names a field and gives a reason. On a microcontroller both would take flash, and formatting them more: so
//! a [`Text`] is a number there, the hash of the text, and a PC prints the text. A driver sends the numbers
//! over the bus, and the PC finds the texts in a table of all of them. Without the feature `texts`, a
//! `Text` has the number alone and prints as `text 1A2B3C4D`.

use core::fmt;

/// A text that an image contains as a number only: see [`text!`](crate::text).
#[derive(Clone, Copy)]
pub struct Text {
    number: u32,
    #[cfg(feature = "texts")]
    text: &'static str,
}

impl Text {
    /// Returns the text. In an image it must be computed by the compiler, so [`text!`](crate::text) is used.
    pub const fn new(text: &'static str) -> Self {
        Self {
            number: Self::number_of(text),
            #[cfg(feature = "texts")]
            text,
        }
    }

    /// Returns the number of a text: its hash FNV-1a of 32 bits (RFC 9923). It changes with the text.
    pub const fn number_of(text: &str) -> u32 {
        const OFFSET: u32 = 0x811C_9DC5;
        const PRIME: u32 = 0x0100_0193;
        let (mut hash, mut rest) = (OFFSET, text.as_bytes());
        while let [byte, after @ ..] = rest {
            hash = (hash ^ *byte as u32).wrapping_mul(PRIME);
            rest = after;
        }
        hash
    }

    /// Returns the number.
    pub const fn number(self) -> u32 {
        self.number
    }

    /// Returns the text itself.
    #[cfg(feature = "texts")]
    pub const fn as_str(self) -> &'static str {
        self.text
    }

    /// Returns these texts.
    pub const fn all<const N: usize>(texts: [&'static str; N]) -> [Self; N] {
        let mut all = [Self::new(""); N];
        let mut at = 0;
        while at < N {
            all[at] = Self::new(texts[at]);
            at += 1;
        }
        all
    }
}

/// Texts with the same number are the same text.
impl PartialEq for Text {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for Text {}

impl PartialEq<&str> for Text {
    fn eq(&self, other: &&str) -> bool {
        self.number == Self::number_of(other)
    }
}

impl fmt::Display for Text {
    #[cfg(feature = "texts")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text)
    }

    #[cfg(not(feature = "texts"))]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "text {:08X}", self.number)
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Makes a [`Text`](crate::parameters::Text) of a literal. Its number is computed while compiling.
///
/// ```
/// let why = compensator_core::text!("the joint must move");
/// assert_eq!(why.to_string(), "the joint must move");
/// ```
#[macro_export]
macro_rules! text {
    ($text:expr) => {
        const { $crate::parameters::Text::new($text) }
    };
}

#[cfg(test)]
mod tests {
    use super::Text;

    #[test]
    fn number_is_the_published_hash() {
        // RFC 9923, appendix C.
        for (text, number) in [("", 0x811C_9DC5), ("a", 0xE40C_292C), ("foobar", 0xBF9C_F968)] {
            assert_eq!(Text::new(text).number(), number);
        }
        assert_eq!(Text::new("a"), "a");
        assert_ne!(Text::new("a"), "b");
    }
}
