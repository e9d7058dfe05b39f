//! Estimates the computing time of a model in the current loop of the joint driver.
//!
//! `tests/cost/core-cost.tsv` lists the instructions of the whole current-loop interrupt on an emulated processor, without
//! terms and with each term alone. Its cycles assume two cycles per instruction. The cost of a model is the sum of the
//! interrupt without terms, the overhead of the term list, and for each term its own cost and its overhead in the list.
//! This reproduces the rows of the table with three and with eight terms.
//!
//! If the loop takes more than 90 % of its period, the driver switches the compensation off (`loop-late`). This module
//! warns of such a model before it is written to a driver. Every law is counted as improved LuGre, which is the most
//! expensive one.

use compensator_core::TermKind;

// A link to tests/cost/core-cost.tsv, so that packages of the source contain the table.
const TABLE: &str = include_str!("core_cost");

/// First words of the rows with at most one term.
const BASE_LAW_ROW: &str = "improved LuGre";

/// Overhead of one more term in the list, cycles: half of what the three most expensive terms take together beyond the
/// sum of their own costs.
const LIST_ENTRY_CYCLES: f64 = 52.0;

/// The cheapest term, which adds a constant. Its row gives the overhead of the list.
const CHEAPEST_TERM: TermKind = TermKind::TorqueOffset;

/// Share of the period above which the driver reports `loop-late`, %.
pub const LATE_LOOP_PERCENT: f64 = 90.0;

/// Returns cycles and share of the period, %, of a row of the table; `None` selects the row without terms.
fn row(terms: Option<&str>) -> Option<[f64; 2]> {
    let wanted = terms.map_or(BASE_LAW_ROW.to_owned(), |term| format!("{BASE_LAW_ROW} + {term}"));
    TABLE.lines().find_map(|line| {
        let mut cells = line.split('\t');
        (cells.next() == Some(wanted.as_str()) && cells.clone().count() == 4).then_some(())?;
        let mut numbers = cells.skip(2).map(|cell| cell.parse().ok());
        Some([numbers.next()??, numbers.next()??])
    })
}

/// Returns the maximum cycles of the whole interrupt with these terms; `None` if a term is not in the table.
fn cycles(terms: &[TermKind]) -> Option<f64> {
    let bare = row(None)?[0];
    // Some terms are part of improved LuGre itself and need no list entry.
    let listed = |term: &&TermKind| row(Some(term.name())).is_none_or(|[own, _]| own > bare);
    let mut listed = terms.iter().filter(listed).peekable();
    if listed.peek().is_none() {
        return Some(bare);
    }
    let cheapest = row(Some(CHEAPEST_TERM.name()))?[0];
    let own = |term: &TermKind| Some(row(Some(term.name()))?[0] - cheapest + LIST_ENTRY_CYCLES);
    let terms = listed.map(own).sum::<Option<f64>>()?;
    Some(cheapest - LIST_ENTRY_CYCLES + terms)
}

/// Returns the estimated maximum share of the loop's period that the interrupt takes with these terms, %; `None` if a
/// term is not in the table.
pub fn loop_share_percent(terms: &[TermKind]) -> Option<f64> {
    let [cycles_of_row, percent_of_row] = row(Some("the eight dearest"))?;
    Some(cycles(terms)? / cycles_of_row * percent_of_row)
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
    fn row_exists_for_every_term() {
        for term in TermKind::ALL {
            let name = term.name();
            let Some([cycles, percent]) = row(Some(name)) else { panic!("{name} has no row") };
            assert!((3e3..7e3).contains(&cycles) && (40.0..75.0).contains(&percent), "{name}");
        }
    }

    #[test]
    fn cycles_of_several_terms_match_the_rows_of_the_table() {
        let mut dearest: Vec<TermKind> = TermKind::ALL.to_vec();
        let of = |term: &TermKind| cycles(&[*term]).expect("a row");
        dearest.sort_by(|a, b| of(b).total_cmp(&of(a)));
        for (count, name) in [(3, "the three dearest"), (8, "the eight dearest")] {
            let counted = row(Some(name)).expect(name)[0];
            let estimated = cycles(&dearest[..count]).expect("rows");
            assert!(
                (estimated / counted - 1.0).abs() < 0.01,
                "{name}: {estimated}, counted {counted}"
            );
        }
        // The interrupt is short enough for every model of the core; more terms than it holds would be too many.
        assert_eq!(late_loop_warning(&dearest[..8]), None);
        let too_many = dearest[..8].repeat(3);
        let warning = late_loop_warning(&too_many).expect("a warning");
        assert!(warning.contains("with 24 terms"), "{warning}");
    }
}
