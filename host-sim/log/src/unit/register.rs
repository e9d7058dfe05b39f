//! Registers whose sign a log lost: `int16 0.01Nm` for two's complement, `sign10 0.111rpm` if bit 10 is the sign.

/// How a register holds the sign of a number that the log holds without it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Register {
    /// The log holds the sign.
    Signed,
    /// Two's complement, with the range of the register: `int16`.
    Complement(f64),
    /// The bit above the magnitude is the sign, with its value: `sign10`.
    SignBit(f64),
}

impl Register {
    /// Registers of two's complement, and their ranges.
    const COMPLEMENTS: [(&str, f64); 3] =
        [("int8", 256.0), ("int16", 65_536.0), ("int32", 4_294_967_296.0)];

    /// Largest number of a sign bit.
    const MAX_SIGN_BIT: u32 = 31;

    /// Splits a unit into its register and the unit of one count: `int16 0.01Nm`, `sign10 0.111rpm`.
    pub fn parse(symbol: &str) -> Option<(Self, &str)> {
        let complement = Self::COMPLEMENTS
            .iter()
            .find_map(|(name, range)| Some((Self::Complement(*range), symbol.strip_prefix(name)?)));
        let sign_bit = || {
            let rest = symbol.strip_prefix("sign")?;
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            let bit: u32 = rest[..end].parse().ok().filter(|bit| *bit <= Self::MAX_SIGN_BIT)?;
            Some((Self::SignBit(2f64.powi(bit as i32)), &rest[end..]))
        };
        let (register, unit) = complement.or_else(sign_bit)?;
        Some((register, unit.trim().trim_start_matches(['*', 'x']).trim()))
    }

    /// Returns a number of the register with its sign.
    #[inline]
    pub fn signed(self, value: f64) -> f64 {
        match self {
            Self::Complement(range) if value >= 0.5 * range => value - range,
            Self::SignBit(sign) if value >= sign => sign - value,
            _ => value,
        }
    }
}

/// Splits a unit into its register and the unit of one count.
pub(crate) fn split_register(symbol: &str) -> (Register, &str) {
    Register::parse(symbol).unwrap_or((Register::Signed, symbol))
}
