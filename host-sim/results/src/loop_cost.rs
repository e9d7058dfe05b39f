//! Estimates the computing time of a model in the current loop of the joint driver.
//!
//! `tests/emulator/core-cost.tsv` bounds the instructions of the compensator without terms and with each term alone, on an
//! emulated processor. The cost of a model is the sum of the interrupt without terms, the overhead of the term list, and for
//! each term its own cost and its overhead in the list. The sum of upper limits is more than the emulated interrupt takes:
//! target/figures/interrupt-cycles.tsv has three models.
//!
//! If the loop takes more than 90 % of its period, the driver switches the compensation off (`loop-late`). This module
//! warns of such a model before it is written to a driver. Every law is counted as improved LuGre, which is the most
//! expensive one.

use compensator_core::TermKind;

// A link to tests/emulator/core-cost.tsv, so that packages of the source contain the table.
const TABLE: &str = include_str!("core_cost");

/// Laws of the rows; the second includes some terms.
const LAWS: [&str; 2] = ["lugre", "improved-lugre"];

/// Instructions of the whole interrupt with improved LuGre.
const INTERRUPT_INSTRUCTIONS: f64 = 1850.0;

/// Instructions of one more term in the list, beyond its own.
const LIST_ENTRY_INSTRUCTIONS: f64 = 22.0;

/// Cycles of an instruction of the interrupt, at most: memory, pipeline and floating point.
const CYCLES_PER_INSTRUCTION: f64 = 1.7;

/// Period of the current loop, cycles: 170 MHz, 20 kHz.
const PERIOD_CYCLES: f64 = 8500.0;

/// The cheapest term, which adds a constant. Its row gives the overhead of the list.
const CHEAPEST_TERM: TermKind = TermKind::TorqueOffset;

/// Share of the period above which the driver reports `loop-late`, %.
pub const LATE_LOOP_PERCENT: f64 = 90.0;

/// Returns the most instructions of the compensator with this law and term, if the table has them.
fn instructions(law: &str, term: Option<TermKind>) -> Option<f64> {
    let wanted = term.map_or(law.to_owned(), |term| format!("{law} + {}", term.name()));
    let row = TABLE.lines().find_map(|line| line.strip_prefix(&wanted)?.strip_prefix(", f32\t"))?;
    row.split('\t').nth(3)?.parse().ok()
}

/// Returns the most instructions of the whole interrupt with these terms; `None` if a term is not in the table.
fn interrupt_instructions(terms: &[TermKind]) -> Option<f64> {
    let [plain, improved] = LAWS;
    let cheapest = instructions(improved, Some(CHEAPEST_TERM))?;
    let mut sum = INTERRUPT_INSTRUCTIONS;
    let mut is_listed = false;
    for term in terms {
        match instructions(improved, Some(*term)) {
            Some(of_term) => {
                is_listed = true;
                sum += (of_term - cheapest).max(0.0) + LIST_ENTRY_INSTRUCTIONS;
            }
            // It is part of improved LuGre itself, and needs no list entry.
            None => {
                instructions(plain, Some(*term))?;
            }
        }
    }
    Some(if is_listed { sum + cheapest - instructions(improved, None)? } else { sum })
}

/// Returns the estimated maximum share of the loop's period that the interrupt takes with these terms, %; `None` if a
/// term is not in the table.
pub fn loop_share_percent(terms: &[TermKind]) -> Option<f64> {
    Some(100.0 * CYCLES_PER_INSTRUCTION * interrupt_instructions(terms)? / PERIOD_CYCLES)
}

/// Returns a warning if the current loop with these terms may exceed [`LATE_LOOP_PERCENT`].
pub fn late_loop_warning(terms: &[TermKind]) -> Option<String> {
    let percent = loop_share_percent(terms).filter(|percent| *percent > LATE_LOOP_PERCENT)?;
    Some(format!(
        "with {} terms the current loop may take {percent:.0} % of its period (estimate); above {LATE_LOOP_PERCENT:.0} % the driver \
         switches the compensation off (loop-late)",
        terms.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn share_of_the_period_is_known_for_every_term() {
        for term in TermKind::ALL {
            let percent = loop_share_percent(&[*term]).unwrap_or_else(|| panic!("{}", term.name()));
            assert!((35.0..60.0).contains(&percent), "{}: {percent}", term.name());
        }
    }

    /// The interrupt with these models takes 47 and 57 % (target/figures/interrupt-cycles.tsv).
    #[test]
    fn share_of_several_terms_is_a_little_more_than_the_interrupt_takes() {
        let mut dearest: Vec<TermKind> = TermKind::ALL.to_vec();
        let of = |term: &TermKind| loop_share_percent(&[*term]).expect("a row");
        dearest.sort_by(|a, b| of(b).total_cmp(&of(a)));
        for (count, least, most) in [(3, 47.0, 56.0), (8, 57.0, 68.0)] {
            let percent = loop_share_percent(&dearest[..count]).expect("rows");
            assert!((least..most).contains(&percent), "{count} terms: {percent}");
        }
        // The interrupt is short enough for every model of the core; more terms than it holds would be too many.
        assert_eq!(late_loop_warning(&dearest[..8]), None);
        let too_many = dearest[..8].repeat(4);
        let warning = late_loop_warning(&too_many).expect("a warning");
        assert!(warning.contains("with 32 terms"), "{warning}");
    }
}
