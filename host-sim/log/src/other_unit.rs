//! Units in columns' names that no factor of the log converts: percent of the rated torque, amperes, counts, volts.
//!
//! Such a column is never read without a unit. The message shows how to give the size of one count, or the torque of
//! 100 %.

use super::name_words::{is_among, is_motor_current};
use super::torque_scale::expected_constant;
use super::unit;
use crate::setting::Setting;
use compensator_core::quantity::Quantity;

/// Why a mapping is refused.
pub(super) struct Refusal {
    pub found: String,
    pub expected: String,
}

/// A unit that needs a number that the log does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OtherUnit {
    Percent,
    PerMille,
    Ampere,
    Milliampere,
    Count,
    Volt,
}

const PERCENT: [&str; 4] = ["%", "pct", "percent", "prozent"];
const PER_MILLE: [&str; 5] = ["‰", "permille", "promille", "0.1%", "1/1000"];
const AMPERES: [&str; 7] = ["a", "arms", "a rms", "amp", "amps", "ampere", "amperes"];
const VOLTS: [&str; 4] = ["v", "mv", "volt", "volts"];
const COUNTS: &str = "cnt cnts count counts inc incs increments ticks pulses lsb qc digits";

/// Symbols that end a name without brackets. Others, such as `a` of a joint, are too common.
const SUFFIXES: &str = "% pct percent prozent permille promille cnt cnts counts ticks";

/// Returns such a unit in brackets, or as the last word of a name. A current without a unit is in amperes.
pub(super) fn other_unit(name: &str) -> Option<OtherUnit> {
    let text = name.trim().to_lowercase();
    let brackets = [('[', ']'), ('(', ')'), ('{', '}')];
    let inside = brackets.iter().find_map(|(open, close)| {
        let inside = text.strip_suffix(*close)?;
        Some(inside[inside.rfind(*open)? + open.len_utf8()..].trim().to_owned())
    });
    let last = text.rsplit(['_', ' ', '.', '-']).next().unwrap_or_default();
    let stated = match inside {
        Some(inside) => of_symbol(&inside),
        None if last == text => None,
        None if last.ends_with('%') => Some(OtherUnit::Percent),
        None => of_word(last),
    };
    let current = || match last {
        "ma" => OtherUnit::Milliampere,
        _ => OtherUnit::Ampere,
    };
    let is_current = || is_motor_current(name) && unit::stated("torque_nm", name).is_none();
    stated.or_else(|| is_current().then(current))
}

fn of_word(last: &str) -> Option<OtherUnit> {
    of_symbol(last).filter(|_| is_among(SUFFIXES, last))
}

fn of_symbol(symbol: &str) -> Option<OtherUnit> {
    let has = |all: &[&str], symbol: &str| all.contains(&symbol);
    // `1/1000 of motor rated torque` and `% of rated`.
    let first = symbol.split(' ').next().unwrap_or_default();
    let rate = symbol.split('/').next().unwrap_or_default().trim();
    if has(&PER_MILLE, first) || has(&PER_MILLE, symbol) {
        Some(OtherUnit::PerMille)
    } else if has(&PERCENT, first) {
        Some(OtherUnit::Percent)
    } else if has(&AMPERES, symbol) {
        Some(OtherUnit::Ampere)
    } else if symbol == "ma" {
        Some(OtherUnit::Milliampere)
    } else if has(&VOLTS, symbol) {
        Some(OtherUnit::Volt)
    } else {
        is_among(COUNTS, rate).then_some(OtherUnit::Count)
    }
}

impl OtherUnit {
    /// Returns the unit as `--columns` takes it, if it needs no number of its own there.
    pub fn symbol(self) -> Option<&'static str> {
        match self {
            Self::Percent => Some("%"),
            Self::PerMille => Some("0.1%"),
            Self::Ampere => Some("A"),
            Self::Milliampere => Some("mA"),
            Self::Count | Self::Volt => None,
        }
    }

    /// Returns the unit to suggest in `--columns`. `UNIT` stands for a number that the user must know.
    pub fn suggestion(self) -> &'static str {
        self.symbol().unwrap_or("UNIT")
    }

    /// Returns the refusal of a mapping without a unit.
    pub fn refusal(self, contract_name: &str, column: &str) -> Refusal {
        let pair =
            |unit: &str| Setting::Columns.suggested(format!("{contract_name}={column}:{unit}"));
        let rated = Setting::RatedTorque.suggested("1.2Nm");
        let is = |of: Quantity| Quantity::parse(contract_name).is_some_and(|found| found.0 == of);
        let (of_volt, of_count) = if is(Quantity::Position) {
            ("0.1rad", "4096counts")
        } else if is(Quantity::Velocity) {
            ("0.5rad/s", "4096counts/s")
        } else {
            ("0.4Nm", "0.01Nm")
        };
        let (what, expected) = match self {
            Self::Percent => {
                ("percent", format!("{} with {rated}, the torque of 100 %", pair("%")))
            }
            Self::PerMille => {
                ("per mille", format!("{} with {rated}, the torque of 100 %", pair("0.1%")))
            }
            Self::Ampere | Self::Milliampere if is(Quantity::Torque) => {
                ("amperes", expected_constant(contract_name, column, self.suggestion()))
            }
            Self::Ampere | Self::Milliampere => {
                ("amperes", format!("the value of 1 A, such as {}", pair(of_volt)))
            }
            Self::Volt => ("volts", format!("the value of 1 V, such as {}", pair(of_volt))),
            Self::Count if of_count.starts_with('4') => {
                ("counts", format!("the counts of a turn, such as {}", pair(of_count)))
            }
            Self::Count => ("counts", format!("the value of a count, such as {}", pair(of_count))),
        };
        Refusal { found: format!("a name in {what}, without a unit"), expected }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;
    use crate::setting::plain;

    #[test]
    fn other_unit_with_share_current_or_count_returns_it() {
        for (name, expected) in [
            ("DRV.TORQUE(%)", Some(OtherUnit::Percent)),
            ("torque_pct", Some(OtherUnit::Percent)),
            ("Torque %", Some(OtherUnit::Percent)),
            ("Torque actual value [1/1000 of motor rated torque]", Some(OtherUnit::PerMille)),
            ("Moment [‰]", Some(OtherUnit::PerMille)),
            ("Active Current [IQ] [A]", Some(OtherUnit::Ampere)),
            ("Velocity Feedback [cnt/sec]", Some(OtherUnit::Count)),
            ("position_counts", Some(OtherUnit::Count)),
            ("CH1 (V)", Some(OtherUnit::Volt)),
            ("tau_a", None),
            ("tau [Nm]", None),
            ("counts", None),
            ("velocity[1]", None),
        ] {
            assert_eq!(other_unit(name), expected, "{name}");
        }
    }

    #[test]
    fn refusal_names_what_to_type() {
        let Refusal { found, expected } = OtherUnit::PerMille.refusal("torque_nm", "T");
        let text = format!("found {found}, expected {}", plain(&expected));
        let parts = ["columns torque_nm=T:0.1%", "rated torque 1.2Nm", "100 %"];
        message::check("units", "name in per mille", &text, &parts);
        let Refusal { found, expected } = OtherUnit::Count.refusal("velocity_rad_s", "v");
        let text = format!("found {found}, expected {}", plain(&expected));
        message::check(
            "units",
            "name in counts",
            &text,
            &["columns velocity_rad_s=v:4096counts/s"],
        );
    }
}
