//! The state of a driver, its faults and its limits, by name.
//!
//! A driver reports its active codes as two bit sets (2002h:3 and :4), and each new one in an emergency by its number:
//! faults are 1 to 32, limits 33 to 64.

use firmware::supervisor::Code;

/// State of a joint as it reports it (2002h:2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportedState {
    /// The bridge is off, waiting to be armed.
    Safe,
    /// The bridge is on.
    Armed,
    /// The bridge is off until the faults are cleared.
    Fault,
    /// A state of a newer version.
    Unknown,
}

impl ReportedState {
    /// Returns the state with this number on the bus.
    pub const fn from_number(number: u32) -> Self {
        match number {
            0 => Self::Safe,
            1 => Self::Armed,
            2 => Self::Fault,
            _ => Self::Unknown,
        }
    }

    /// Returns the name on a screen, where a fault stands out.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Safe => "safe",
            Self::Armed => "armed",
            Self::Fault => "FAULT",
            Self::Unknown => "unknown",
        }
    }
}

/// Number of the code of bit 0 among the faults.
pub const FIRST_FAULT: u8 = 1;
/// Number of the code of bit 0 among the limits.
pub const FIRST_LIMIT: u8 = 33;

/// Returns the name of a code: `bus-overvoltage`, or `code-63` for one that is not known.
pub fn code_name(number: u8) -> String {
    let known = Code::from_number(number).map(|code| code.info().name.to_owned());
    known.unwrap_or_else(|| format!("code-{number}"))
}

/// Returns the names of the codes in a bit set. `first` is [`FIRST_FAULT`] or [`FIRST_LIMIT`].
pub fn code_names(bits: u32, first: u8) -> Vec<String> {
    (0..32).filter(|bit| bits >> bit & 1 != 0).map(|bit| code_name(first + bit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_names_of_faults_and_limits_are_those_of_their_bits() {
        let derated = 1 << (Code::Derated.number() - FIRST_LIMIT);
        assert_eq!(code_names(derated, FIRST_LIMIT), ["derated"]);
        assert_eq!(code_names(1 | 1 << 7, FIRST_FAULT), [code_name(1), "bus-overvoltage".into()]);
        assert_eq!(code_name(65), "code-65");
    }
}
