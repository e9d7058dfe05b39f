//! What a model takes of the current loop's period on the joint driver, from the table of instructions in git.
//!
//! `tests/cost/table.md` counts the whole interrupt of the shipped loop on an emulated processor: without terms, and with each
//! term alone; cycles are reckoned from that, at two an instruction. A model's cost is put together of its terms': what walking the
//! list takes at all, then for each term what it takes itself and its place in the list. So reckoned, the table's own
//! rows of three and of eight terms come out to the cycle.
//!
//! The driver watches its period itself: past nine tenths of it the loop goes without compensation (`loop-late`). This says so before a model
//! is on a joint. Improved LuGre is reckoned for every law: the others take as much or less.

use compensator_core::TermKind;

const TABLE: &str = include_str!("../../tests/cost/table.md");

/// A row of the interrupt's table with one term begins so.
const ROW: &str = "improved LuGre";

/// A term's place in a list, cycles: what three terms take in the table beyond what they take alone, by two.
const PLACE: f64 = 52.0;

/// A step of a term that adds a constant, and the list's walk; the light one all others are held against.
const LIGHTEST: TermKind = TermKind::TorqueOffset;

/// Share of the period past which the loop says `loop-late`, %.
pub const LATE_PERCENT: f64 = 90.0;

/// Cycles and the share of the period, %, of the interrupt with so much beside improved LuGre.
fn row(beside: Option<&str>) -> Option<[f64; 2]> {
    let wanted = beside.map_or(ROW.to_owned(), |term| format!("{ROW} + {term}"));
    TABLE.lines().find_map(|line| {
        let mut cells = line.trim_matches('|').split('|').map(str::trim);
        (cells.next() == Some(wanted.as_str()) && cells.clone().count() == 4).then_some(())?;
        let mut numbers = cells.skip(2).map(|cell| cell.parse().ok());
        Some([numbers.next()??, numbers.next()??])
    })
}

/// Cycles of the whole interrupt at the most, with these terms; `None` where the table lacks one.
fn cycles(terms: &[TermKind]) -> Option<f64> {
    let bare = row(None)?[0];
    // A few are part of improved LuGre itself and take no list.
    let listed = |term: &&TermKind| row(Some(term.name())).is_none_or(|[own, _]| own > bare);
    let mut listed = terms.iter().filter(listed).peekable();
    if listed.peek().is_none() {
        return Some(bare);
    }
    let lightest = row(Some(LIGHTEST.name()))?[0];
    let own = |term: &TermKind| Some(row(Some(term.name()))?[0] - lightest + PLACE);
    let terms = listed.map(own).sum::<Option<f64>>()?;
    Some(lightest - PLACE + terms)
}

/// Share of the loop's period the interrupt takes at the most with these terms, %, reckoned; `None` where the table lacks one.
pub fn percent(terms: &[TermKind]) -> Option<f64> {
    let [cycles_of_row, percent_of_row] = row(Some("the eight dearest"))?;
    Some(cycles(terms)? / cycles_of_row * percent_of_row)
}

/// What is to be said of a model whose interrupt may come too late.
pub fn warning(terms: &[TermKind]) -> Option<String> {
    let percent = percent(terms).filter(|percent| *percent > LATE_PERCENT)?;
    Some(format!(
        "with {} terms the current loop may take {percent:.0} % of its period (reckoned); past {LATE_PERCENT:.0} % it goes without \
         compensation (loop-late)",
        terms.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_term_has_a_row_and_costs_something() {
        for term in TermKind::ALL {
            let name = term.name();
            let Some([cycles, percent]) = row(Some(name)) else { panic!("{name} has no row") };
            assert!((5e3..9e3).contains(&cycles) && (50.0..100.0).contains(&percent), "{name}");
        }
    }

    #[test]
    fn terms_put_together_take_what_the_table_counts_of_them_together() {
        let mut dearest: Vec<TermKind> = TermKind::ALL.to_vec();
        let of = |term: &TermKind| cycles(&[*term]).expect("a row");
        dearest.sort_by(|a, b| of(b).total_cmp(&of(a)));
        for (count, name) in [(3, "the three dearest"), (8, "the eight dearest")] {
            let counted = row(Some(name)).expect(name)[0];
            let reckoned = cycles(&dearest[..count]).expect("rows");
            assert!(
                (reckoned / counted - 1.0).abs() < 0.01,
                "{name}: {reckoned}, counted {counted}"
            );
        }
        assert_eq!((warning(&[]), warning(&dearest[..3])), (None, None));
        let said = warning(&dearest[..8]).expect("a warning");
        assert!(said.contains("with 8 terms") && said.contains("98 %"), "{said}");
    }
}
