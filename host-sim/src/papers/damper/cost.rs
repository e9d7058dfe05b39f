//! What the models cost on the driver: instructions, from the table that the cost image is held to.

/// The table, as it was built with.
const TABLE: &str = include_str!("../../../../tests/cost/table.md");

const NAMED: &str = "LuGre + backlash + directions + a level's formula, f32";
const NETWORK: &str = "network of 8 cells, f32";
const LAW: &str = "lugre-lstm, its law, f32";

/// Goal: the named causes at this share of the network's cost.
const GOAL: f64 = 0.01;

/// Periods of the current loop a second, and evaluations of the network.
const LOOP_HZ: f64 = 20_000.0;
const EVALUATIONS_HZ: f64 = 128.0;

/// The most instructions an update takes.
fn worst(row: &str) -> Option<f64> {
    let line = TABLE.lines().find(|line| line.starts_with(&format!("| {row} |")))?;
    line.split('|').rev().nth(1)?.trim().parse().ok()
}

/// The comparison in words; nothing where the table lacks a row.
pub(super) fn in_words() -> Option<String> {
    let (named, network, law) = (worst(NAMED)?, worst(NETWORK)?, worst(LAW)?);
    let evaluated = network + law;
    let share = named / evaluated;
    let verdict = if share <= GOAL { "met" } else { "missed" };
    let per_second = |instructions: f64| instructions / 1e6;
    Some(format!(
        "Cost on a Cortex-M4F (tests/cost/table.md): a step of the named causes takes {named:.0} instructions, an evaluation of \
         the network with a step of its law {evaluated:.0}: {:.0} % of it, so the goal of a hundredth is {verdict}. The \
         network is small (8 cells) and is asked 128 times a second while the law steps {:.0} thousand times: in a second \
         the named causes take {:.1} million instructions and lugre-lstm {:.1} million.",
        100.0 * share,
        1e-3 * LOOP_HZ,
        per_second(named * LOOP_HZ),
        per_second(law * LOOP_HZ + network * EVALUATIONS_HZ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_stand_in_the_table() {
        assert!(worst(NAMED).is_some_and(|count| (200.0..600.0).contains(&count)));
        assert!(worst(NETWORK).is_some_and(|count| (1000.0..3000.0).contains(&count)));
        assert!(worst(LAW).is_some_and(|count| (50.0..150.0).contains(&count)));
        assert!(in_words().is_some_and(|words| words.contains("goal of a hundredth is missed")));
    }
}
