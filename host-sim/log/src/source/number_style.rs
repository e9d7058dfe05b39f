//! Numbers with thousands separators and decimal commas.
//!
//! `1,234.5`, `1.234,5`, `1 234,5` and `1'234.5` state by themselves which sign is which. `1,234` and `1.234` do not:
//! they need another number of the file. The style is therefore a property of the file. Without such evidence, a point
//! is the decimal point, and so is a comma in a file that another sign separates. A comma between commas in quotes
//! (`"1,234"`) is then not a number. If the evidence contradicts other numbers, it was text, such as an address.

/// What the numbers of a file have shown about their signs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct NumberStyle {
    /// A comma was the decimal point where a point could not be.
    pub decimal_comma: bool,
    /// Commas separated thousands.
    pub thousands_comma: bool,
    /// Points separated thousands.
    pub thousands_point: bool,
    /// Spaces or apostrophes separated thousands.
    pub thousands_space: bool,
    /// A point was the decimal point where it could not separate thousands. Only noted once points are in doubt.
    pub decimal_point: bool,
    /// True if no sign separates thousands: what looked like it was text, such as an address.
    pub is_plain: bool,
}

/// Signs that only separate thousands: space, no-break space, narrow no-break space, apostrophe.
const GROUP_SIGNS: [&[u8]; 4] = [b" ", &[0xc2, 0xa0], &[0xe2, 0x80, 0xaf], b"'"];

/// Maximum length of a number, bytes.
const MAX_BYTES: usize = 40;

impl NumberStyle {
    /// Returns true if a number without a comma may mean something else than its point says: `1.234` may be 1234.
    pub fn is_point_misleading(self) -> bool {
        self.thousands_point
    }

    /// Returns true if one sign has two meanings.
    pub fn is_contradictory(self) -> bool {
        self.thousands_comma && (self.decimal_comma || self.thousands_point)
            || self.thousands_point && self.decimal_point
    }

    /// Parses a number with these signs, and adds what it shows about them. `is_comma_free` is true if a comma does
    /// not separate cells.
    pub fn parse(&mut self, cell: &[u8], is_comma_free: bool) -> Option<f64> {
        if cell.len() > MAX_BYTES || !cell.iter().any(u8::is_ascii_digit) {
            return None;
        }
        let joined = without_group_signs(cell)?;
        let has_group_signs = joined.len() < cell.len();
        let commas = joined.iter().filter(|byte| **byte == b',').count();
        let points = joined.iter().filter(|byte| **byte == b'.').count();
        let last = joined.iter().rposition(|byte| matches!(byte, b',' | b'.'));
        let (group, decimal) = match (commas, points) {
            (0, 0) => (None, None),
            // Thousands twice: in spaces, the other sign is decimal.
            (1, 0) if has_group_signs => (None, Some(b',')),
            (0, 1) if has_group_signs => (None, Some(b'.')),
            (1.., 1) if joined[last?] == b'.' => (Some(b','), Some(b'.')),
            (1, 1..) if joined[last?] == b',' => (Some(b'.'), Some(b',')),
            (2.., 0) => (Some(b','), None),
            (0, 2..) => (Some(b'.'), None),
            (1, 0) if !is_group(&joined, last?) => (None, Some(b',')),
            (1, 0) if self.thousands_comma => (Some(b','), None),
            (1, 0) if self.decimal_comma || is_comma_free => (None, Some(b',')),
            (0, 1) if self.thousands_point && is_group(&joined, last?) => (Some(b'.'), None),
            (0, 1) => (None, Some(b'.')),
            _ => return None,
        };
        let is_grouped = has_group_signs || group.is_some();
        if has_group_signs && group.is_some() || self.is_plain && is_grouped {
            return None;
        }
        if self.is_plain && decimal == Some(b',') && !is_comma_free {
            return None;
        }
        let plain = to_plain(&joined, group, decimal)?;
        let value = fast_float2::parse(&plain).ok()?;
        self.thousands_space |= has_group_signs;
        self.thousands_comma |= group == Some(b',');
        self.thousands_point |= group == Some(b'.');
        self.decimal_comma |= decimal == Some(b',');
        self.decimal_point |= decimal == Some(b'.') && commas == 0 && !has_group_signs;
        Some(value)
    }
}

/// Returns true if the sign at `at` may separate thousands: one to three digits before it and just three after it.
fn is_group(number: &[u8], at: usize) -> bool {
    let digits = |part: &[u8]| part.iter().all(u8::is_ascii_digit);
    let before = number[..at].strip_prefix(b"-").unwrap_or(&number[..at]);
    let after = &number[at + 1..];
    (1..=3).contains(&before.len())
        && digits(before)
        && before[0] != b'0'
        && after.len() == 3
        && digits(after)
}

/// Removes spaces and apostrophes between digits; `None` if they do not stand between groups of three.
fn without_group_signs(cell: &[u8]) -> Option<Vec<u8>> {
    let mut groups: Vec<Vec<u8>> = vec![Vec::new()];
    let mut rest = cell;
    while let Some(&first) = rest.first() {
        let sign = GROUP_SIGNS.iter().find(|sign| rest.starts_with(sign));
        match sign {
            Some(sign) => {
                groups.push(Vec::new());
                rest = &rest[sign.len()..];
            }
            None => {
                groups.last_mut()?.push(first);
                rest = &rest[1..];
            }
        }
    }
    let whole = |group: &[u8]| {
        let end = group.iter().position(|byte| matches!(byte, b',' | b'.')).unwrap_or(group.len());
        end == 3 && group[..end].iter().all(u8::is_ascii_digit)
    };
    let count = groups.len();
    let first = groups[0].strip_prefix(b"-").unwrap_or(&groups[0]);
    let starts = (1..=3).contains(&first.len()) && first.iter().all(u8::is_ascii_digit);
    let others = groups[1..].iter().enumerate();
    let fits =
        |(at, group): (usize, &Vec<u8>)| whole(group) && (at + 2 == count || group.len() == 3);
    (count == 1 || starts && others.clone().all(fits)).then(|| groups.concat())
}

/// Returns the number with a decimal point and without separators of thousands.
fn to_plain(number: &[u8], group: Option<u8>, decimal: Option<u8>) -> Option<Vec<u8>> {
    let end = decimal.and_then(|sign| number.iter().position(|byte| *byte == sign));
    let (whole, fraction) = number.split_at(end.unwrap_or(number.len()));
    let mut plain = Vec::with_capacity(number.len());
    if let Some(sign) = group {
        let bare = whole.strip_prefix(b"-").unwrap_or(whole);
        let mut parts = bare.split(|byte| *byte == sign);
        let digits = |part: &[u8]| part.iter().all(u8::is_ascii_digit);
        let first = parts.next()?;
        if !(1..=3).contains(&first.len())
            || !digits(first)
            || !parts.all(|part| part.len() == 3 && digits(part))
        {
            return None;
        }
    }
    plain.extend(whole.iter().filter(|byte| Some(**byte) != group));
    if let Some((_, digits)) = fraction.split_first() {
        plain.push(b'.');
        plain.extend(digits);
    }
    Some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(cell: &str, is_comma_free: bool) -> Option<f64> {
        NumberStyle::default().parse(cell.as_bytes(), is_comma_free)
    }

    #[test]
    fn parse_with_unambiguous_signs_returns_number() {
        for (cell, value) in [
            ("1,234.5", 1234.5),
            ("-1,234,567.25", -1_234_567.25),
            ("1.234,5", 1234.5),
            ("1.234.567", 1_234_567.0),
            ("1 234,5", 1234.5),
            ("12\u{a0}345.5", 12345.5),
            ("1\u{202f}234\u{202f}567", 1_234_567.0),
            ("1'234.5", 1234.5),
            ("1 234,567", 1234.567),
            ("-1,5e3", -1500.0),
            ("0,234", 0.234),
            ("1234,567", 1234.567),
        ] {
            assert_eq!(parse(cell, false), Some(value), "{cell}");
        }
    }

    #[test]
    fn parse_with_invalid_groups_returns_none() {
        for cell in
            ["1,23,456.5", "1.23.456", "12 34,5", "1,234.5.6", "off", "1 2 3", "1,234.567,8", ""]
        {
            assert_eq!(parse(cell, true), None, "{cell}");
        }
        assert_eq!(parse(&",".repeat(100), true), None);
    }

    #[test]
    fn parse_with_ambiguous_comma_follows_the_file() {
        assert_eq!(parse("1,234", true), Some(1.234));
        assert_eq!(parse("1,234", false), None);
        let mut english = NumberStyle::default();
        english.parse(b"1,234.5", false);
        assert_eq!(english.parse(b"1,234", false), Some(1234.0));
        let mut german = NumberStyle::default();
        german.parse(b"1.234,5", true);
        assert_eq!(german.parse(b"1.234", true), Some(1234.0));
        assert!(german.is_point_misleading() && !german.is_contradictory());
        german.parse(b"1,234.5", true);
        assert!(german.is_contradictory());
    }

    #[test]
    fn parse_with_text_that_looks_like_thousands_is_contradictory() {
        let mut style = NumberStyle::default();
        assert_eq!(style.parse(b"192.168.100.200", false), Some(192_168_100_200.0));
        assert!(style.is_point_misleading() && !style.is_contradictory());
        style.parse(b"0.25", false);
        assert!(style.is_contradictory());
        let mut plain = NumberStyle { is_plain: true, ..NumberStyle::default() };
        assert_eq!(plain.parse(b"192.168.100.200", false), None);
        assert_eq!(plain.parse(b"1,5", true), Some(1.5));
    }
}
