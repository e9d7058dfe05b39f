//! What the models cost on the driver: instructions, from the table that the cost image is held to.

use crate::papers::Goal;

/// The table, as it was built with.
const TABLE: &str = include_str!("../../../../tests/cost/table.md");

const NAMED: &str = "LuGre + backlash + directions + a level's formula, f32";
const NETWORK: &str = "network of 8 cells, f32";
const PLAIN: &str = "plain LuGre, f32";
const LAW: &str = "lugre-lstm, its law, f32";

/// Goal: the named causes at this share of the network's cost.
const GOAL: f64 = 0.01;

/// Periods of the current loop a second, and evaluations of the network.
const LOOP_HZ: f64 = 20_000.0;
const EVALUATIONS_HZ: f64 = 128.0;

/// Goal for an evaluation of the network by itself.
const NETWORK_GOAL: f64 = 2500.0;

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

/// The goals of cost; none where the table lacks a row.
pub(super) fn goals() -> Vec<Goal> {
    let all = || Some((worst(NAMED)?, worst(NETWORK)?, worst(LAW)?, worst(PLAIN)?));
    let Some((named, network, law, plain)) = all() else { return Vec::new() };
    let evaluated = network + law;
    let least = 100.0 * plain / evaluated;
    vec![
        Goal::at_most("an evaluation of the network", "instructions", network, NETWORK_GOAL),
        Goal::at_most(
            "a step of the named causes over an evaluation of the network with a step of its law",
            "%",
            100.0 * named / evaluated,
            100.0 * GOAL,
        )
        .remark(format!(
            "Not to be had beside the goal above it: plain LuGre alone, {plain:.0} instructions, is {least:.1} % of a network that \
             keeps within {NETWORK_GOAL:.0}. A hundredth would need one of {:.0} instructions. Counted by the second, as the driver runs \
             them, the named causes are the dearer: they step in the current loop, the network below it.",
            named / GOAL
        )),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_stand_in_the_table() {
        assert!(worst(NAMED).is_some_and(|count| (200.0..600.0).contains(&count)));
        assert!(worst(NETWORK).is_some_and(|count| (1000.0..3000.0).contains(&count)));
        assert!(worst(LAW).is_some_and(|count| (50.0..150.0).contains(&count)));
        let reached: Vec<bool> = goals().iter().map(Goal::reached).collect();
        assert_eq!(reached, [true, false]);
        assert!(in_words().is_some_and(|words| words.contains("goal of a hundredth is missed")));
    }
}
