//! Computing cost of the models on the driver, in instructions: the limits that the tests on the emulated chip hold.

use crate::Goal;

/// The limits at build time.
const TABLE: &str = include_str!("../../../../tests/emulator/core-cost.tsv");

/// Rows, and the column of the upper limit in each: a step of a model, the evaluation of the network, and a step of its law.
const NAMED_CAUSES: (&str, usize) = ("lugre + the three terms of the damper, f32", 2);
const PLAIN_LUGRE: (&str, usize) = ("lugre, f32", 2);
const NETWORK: (&str, usize) = ("network of 8 cells, f32", 2);
const NETWORK_LAW: (&str, usize) = ("network of 8 cells, f32", 4);

/// Goal for the cost of the named causes, as a share of the network's.
const COST_SHARE_GOAL: f64 = 0.01;

/// Rates of the current loop and of the network, Hz.
const LOOP_HZ: f64 = 20_000.0;
const EVALUATIONS_HZ: f64 = 128.0;

/// Goal for one evaluation of the network, instructions.
const NETWORK_GOAL: f64 = 2500.0;

/// Returns the worst-case instructions of an update.
fn worst_case_instructions((row, column): (&str, usize)) -> Option<f64> {
    let line = TABLE.lines().find(|line| line.starts_with(&format!("{row}\t")))?;
    line.split('\t').nth(column)?.parse().ok()
}

/// Returns the comparison as a sentence; `None` if a row is missing in the table.
pub(super) fn cost_sentence() -> Option<String> {
    let (named, network, law) = (
        worst_case_instructions(NAMED_CAUSES)?,
        worst_case_instructions(NETWORK)?,
        worst_case_instructions(NETWORK_LAW)?,
    );
    let evaluated = network + law;
    let share = named / evaluated;
    let verdict = if share <= COST_SHARE_GOAL { "met" } else { "missed" };
    let per_second = |instructions: f64| instructions / 1e6;
    Some(format!(
        "Cost on a Cortex-M4F (tests/emulator/core-cost.tsv): a step of the named causes takes at most {named:.0} instructions, an evaluation of \
         the network with a step of its law {evaluated:.0}. The share is {:.0} %, so the goal of a hundredth is {verdict}. The \
         network is small (8 cells) and runs at 128 Hz, the law at {:.0} kHz. Per second \
         the named causes take {:.1} million instructions and lugre-lstm {:.1} million.",
        100.0 * share,
        1e-3 * LOOP_HZ,
        per_second(named * LOOP_HZ),
        per_second(law * LOOP_HZ + network * EVALUATIONS_HZ),
    ))
}

/// Returns the goals of the cost; none if a row is missing in the table.
pub(super) fn goals() -> Vec<Goal> {
    let all = || {
        Some((
            worst_case_instructions(NAMED_CAUSES)?,
            worst_case_instructions(NETWORK)?,
            worst_case_instructions(NETWORK_LAW)?,
            worst_case_instructions(PLAIN_LUGRE)?,
        ))
    };
    let Some((named, network, law, plain)) = all() else { return Vec::new() };
    let evaluated = network + law;
    let least = 100.0 * plain / evaluated;
    vec![
        Goal::at_most("an evaluation of the network", "instructions", network, NETWORK_GOAL),
        Goal::at_most(
            "a step of the named causes over an evaluation of the network with a step of its law",
            "%",
            100.0 * named / evaluated,
            100.0 * COST_SHARE_GOAL,
        )
        .remark(format!(
            "This goal and the goal above it exclude each other: plain LuGre alone, {plain:.0} instructions, is {least:.1} % of a \
             network within {NETWORK_GOAL:.0}. A hundredth would need a network of {:.0} instructions. Per second, as the driver \
             runs them, the named causes cost more: they run in the current loop, and the network runs less often.",
            named / COST_SHARE_GOAL
        )),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cost_table_has_rows_of_compared_models() {
        assert!(
            worst_case_instructions(NAMED_CAUSES)
                .is_some_and(|count| (200.0..600.0).contains(&count))
        );
        assert!(
            worst_case_instructions(NETWORK).is_some_and(|count| (1000.0..3000.0).contains(&count))
        );
        assert!(
            worst_case_instructions(NETWORK_LAW)
                .is_some_and(|count| (50.0..150.0).contains(&count))
        );
        let reached: Vec<bool> = goals().iter().map(Goal::is_reached).collect();
        assert_eq!(reached, [true, false]);
        let words = cost_sentence().expect("a complete table");
        crate::message::check("damper", "cost", &words, &["Cortex-M4F", "128 Hz"]);
    }
}
