//! Page and summary sentences of the damper's comparison.

use super::campaign::TestCampaign;
use super::network::NetworkInputs;
use super::printed::{
    FREQUENCIES_HZ, LSTM_PERCENT, LUGRE_PERCENT, TENSIONS_LB, format_test_name, printed_values,
};
use super::score::CampaignScore;
use super::{COULOMB_VISCOUS, LUGRE, NAMED, NAMED_WITH_TENSION, NamedScore};
use crate::{Goal, PaperOutcome};
use compensator_core::Sample;
use friction_results::report::{Axis, Block, Cell, Chart, Section, Series, Table};

/// Goals of the comparison, from the paper's results and from earlier trials on the same rows.
const LUGRE_EACH_MEAN_PERCENT: f64 = 5.44;
const NETWORK_GAIN_GOAL: f64 = 0.37;
const NAMED_CAUSES_RATIO_GOAL: f64 = 1.10;
const SECOND_CAMPAIGN_GOAL: f64 = 0.161;

/// Maximum number of points of a curve.
const MAX_CURVE_POINTS: usize = 1500;

/// What each choice of network inputs may claim.
pub(super) const NETWORK_CLAIMS: &str = "What the networks may claim: with the preset tension or the motion as inputs \
    they predict. With the actuators' forces as inputs, as in the paper, they do not. These forces are consequences of the friction \
    (the force is about -2 (a1 - a2)), so that model estimates the force from two load cells, and part of its answer \
    comes directly from its inputs. These channels are logged 45 ms late; the delay was removed.";

/// Definitions of the measures.
pub(super) fn definitions() -> Block {
    Block::Paragraph(
        "Measured by Daniel Coble, Parker Huggins, Liang Cao, James Ricles and Austin Downey \
         (Dataset-Friction-Damper-with-Backlash, 2022, CC BY-SA 4.0). The paper does not define its NRMSE. By the size of \
         its values it is the RMSE over the range (largest minus smallest force) of the test, and so are our values \
         in %. \"Pooled\" is the RMSE of all rows of all tests, \"/ std\" that over the standard deviation of all \
         rows. Held out means: evaluated by a model that has used no row of the test."
            .into(),
    )
}

fn score<'a>(scores: &'a [NamedScore], name: &str) -> &'a CampaignScore {
    &scores.iter().find(|(known, _)| *known == name).expect("a model that was evaluated").1
}

/// Returns "met" or "missed".
fn goal_verdict(is_met: bool) -> &'static str {
    if is_met { "met" } else { "missed" }
}

/// Table of tension by frequency, each of our values beside the printed one.
fn tension_by_frequency(
    caption: &str,
    tests: &TestCampaign,
    ours: &CampaignScore,
    printed: &[[f64; 4]; 6],
) -> Table {
    let columns = FREQUENCIES_HZ.map(|frequency| format!("{frequency} Hz, ours (%)|printed"));
    let row = |(tension, printed): (&u32, &[f64; 4])| {
        let cells = FREQUENCIES_HZ.iter().zip(printed).flat_map(|(frequency, printed)| {
            let name = format!("{tension}lb@{frequency}Hz");
            let test = tests.names.iter().position(|known| *known == name);
            [test.map(|test| ours.percent_of_range(test)).into(), Cell::Number(*printed)]
        });
        std::iter::once(format!("{tension} lb").into()).chain(cells).collect()
    };
    let header = format!("preset tension|{}", columns.join("|"));
    Table::new(caption, &header, TENSIONS_LB.iter().zip(printed).map(row))
}

/// Table of all models.
fn comparison(caption: &str, tests: &TestCampaign, scores: &[NamedScore]) -> Table {
    let row = |(name, score): &NamedScore| {
        let rmse = score.pooled_rmse();
        vec![
            Cell::from(*name),
            score.mean_percent_of_range().into(),
            rmse.into(),
            (rmse / tests.deviation()).into(),
        ]
    };
    let header = "model|mean over tests, of range (%)|pooled RMSE (N)|pooled RMSE / std";
    Table { best: vec![1, 2, 3], ..Table::new(caption, header, scores.iter().map(row)) }
}

/// Chart of force over position for the held-out test of this name, with some of the models; `None` without this test.
fn hysteresis_chart(
    tests: &TestCampaign,
    name: &str,
    scores: &[NamedScore],
    models: &[&'static str],
) -> Option<Chart> {
    let test = tests.names.iter().position(|known| known == name)?;
    let track = &tests.tracks[test];
    let step = track.len().div_ceil(MAX_CURVE_POINTS).max(1);
    let every = |values: &[f64]| values.iter().copied().step_by(step).collect::<Vec<f64>>();
    let mut position = 0.0;
    let millimetre = |sample: &Sample<f64>| {
        position += 1e3 * sample.velocity_rad_s * track.period_s;
        position
    };
    let millimetres: Vec<f64> = track.samples.iter().map(millimetre).collect();
    let curve = |name: &str, force: &[f64]| {
        let kilonewtons = every(force).iter().map(|force| 1e-3 * force).collect();
        Series::line(name, every(&millimetres), kilonewtons)
    };
    let simulated = models.iter().map(|name| curve(name, &score(scores, name).force[test]));
    Some(Chart {
        title: format!("{}, held out", format_test_name(name)),
        caption: "After each reversal the force stays constant while the gap is crossed: a bristle of one \
                  stiffness would turn at once."
            .into(),
        x: Axis::new("travel (mm)"),
        y: Axis::new("force (kN)"),
        series: std::iter::once(curve("measured", &track.torque).muted()).chain(simulated).collect(),
    })
}

/// Returns the test with the largest error, as text.
fn worst_test(tests: &TestCampaign, score: &CampaignScore) -> String {
    let order = |one: &usize, other: &usize| {
        score.percent_of_range(*one).total_cmp(&score.percent_of_range(*other))
    };
    let test = (0..tests.names.len()).max_by(order).unwrap_or(0);
    format!("{} with {:.1} %", format_test_name(&tests.names[test]), score.percent_of_range(test))
}

/// Scores of the first campaign, by model.
struct FirstCampaign<'a> {
    tests: &'a TestCampaign,
    /// LuGre fitted to each test.
    each: &'a CampaignScore,
    /// The network with the actuators' forces, trained on all tests.
    trained_on_all: &'a CampaignScore,
    lugre: &'a CampaignScore,
    coulomb_viscous: &'a CampaignScore,
    named: &'a CampaignScore,
    by_tension: &'a CampaignScore,
    by_motion: &'a CampaignScore,
    by_actuators: &'a CampaignScore,
}

impl FirstCampaign<'_> {
    /// Mean of the printed values of these tests, %.
    fn mean_printed(&self, which: fn((f64, f64)) -> f64) -> f64 {
        let of = self.tests.names.iter().filter_map(|name| printed_values(name)).map(which);
        let (sum, count) = of.fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
        sum / count.max(1) as f64
    }

    /// Error reduction of a model relative to LuGre.
    fn gain(&self, of: &CampaignScore) -> f64 {
        1.0 - of.pooled_rmse() / self.lugre.pooled_rmse()
    }

    /// The better of the two networks that predict, with its name.
    fn best_predicting(&self) -> (&CampaignScore, &'static str) {
        if self.by_motion.pooled_rmse() < self.by_tension.pooled_rmse() {
            (self.by_motion, NetworkInputs::Motion.name())
        } else {
            (self.by_tension, NetworkInputs::Tension.name())
        }
    }

    /// Error of the named causes over that of the best network that predicts.
    fn named_ratio(&self) -> f64 {
        self.named.pooled_rmse() / self.best_predicting().0.pooled_rmse()
    }

    fn summary(&self) -> [String; 4] {
        let ratio = self.named_ratio();
        [
            format!(
                "Characterisation, held out by whole tests: LuGre once for all leaves {:.0} N, with backlash, tension and \
                 directions named {:.0} N, lugre-lstm with the tension as input {:.0} N, with tension and motion {:.0} N, with the \
                 actuators' forces {:.0} N; Coulomb and viscous friction {:.0} N.",
                self.lugre.pooled_rmse(),
                self.named.pooled_rmse(),
                self.by_tension.pooled_rmse(),
                self.by_motion.pooled_rmse(),
                self.by_actuators.pooled_rmse(),
                self.coulomb_viscous.pooled_rmse(),
            ),
            format!(
                "lugre-lstm improves on LuGre once for all by {:.0} % (tension), {:.0} % (tension and motion), {:.0} % \
                 (actuators' forces); the goal of 37 % is {}.",
                100.0 * self.gain(self.by_tension),
                100.0 * self.gain(self.by_motion),
                100.0 * self.gain(self.by_actuators),
                goal_verdict(
                    self.gain(self.by_tension).max(self.gain(self.by_motion)) >= NETWORK_GAIN_GOAL
                ),
            ),
            format!(
                "The named causes leave {ratio:.2} of the error of the best network that predicts; the goal, at most 1.10, \
                 is {}.",
                goal_verdict(ratio <= NAMED_CAUSES_RATIO_GOAL),
            ),
            format!(
                "Compared with LuGre fitted to each test, which the paper prints with a mean of {LUGRE_EACH_MEAN_PERCENT} % over 24 \
                 tests and {:.2} % over these twelve: fitted to each here {:.2} %; once for all and held out, named causes \
                 {:.2} % ({}), lugre-lstm with the actuators' forces {:.2} % ({}). The paper's LSTM, trained on all \
                 tests, prints {:.2} % on these; ours trained in the same way gives {:.2} %.",
                self.mean_printed(|(lugre, _)| lugre),
                self.each.mean_percent_of_range(),
                self.named.mean_percent_of_range(),
                goal_verdict(self.named.mean_percent_of_range() < LUGRE_EACH_MEAN_PERCENT),
                self.by_actuators.mean_percent_of_range(),
                goal_verdict(self.by_actuators.mean_percent_of_range() < LUGRE_EACH_MEAN_PERCENT),
                self.mean_printed(|(_, lstm)| lstm),
                self.trained_on_all.mean_percent_of_range(),
            ),
        ]
    }

    fn goals(&self) -> [Goal; 5] {
        let printed_mean = |of: &CampaignScore, model: &str| {
            let what = format!(
                "held out, once for all, {model}: mean error of range over the twelve tests"
            );
            Goal::at_most(what, "%", of.mean_percent_of_range(), LUGRE_EACH_MEAN_PERCENT)
        };
        let (best, best_name) = self.best_predicting();
        let better = 100.0 * self.gain(self.by_tension).max(self.gain(self.by_motion));
        [
            printed_mean(self.named, NAMED_WITH_TENSION.name).remark(format!(
                "The bound is the paper's value for LuGre fitted to each test, over 24; over these twelve it prints {:.2} %. Its \
                 measure is not defined: ours is RMSE over the range of the test. The worst is {}.",
                self.mean_printed(|(lugre, _)| lugre),
                worst_test(self.tests, self.named),
            )),
            printed_mean(best, "lugre-lstm that predicts")
                .remark(format!("Here {best_name}. The worst is {}.", worst_test(self.tests, best))),
            printed_mean(self.by_actuators, NetworkInputs::Actuators.name()),
            Goal::at_least(
                "lugre-lstm that predicts, against LuGre once for all: error less by",
                "%",
                better,
                100.0 * NETWORK_GAIN_GOAL,
            ),
            Goal::at_most(
                "named causes, error over that of the best network that predicts",
                "",
                self.named_ratio(),
                NAMED_CAUSES_RATIO_GOAL,
            ),
        ]
    }
}

/// Adds page and summary of the first campaign.
pub(super) fn characterisation(
    tests: &TestCampaign,
    each: &CampaignScore,
    trained_on_all: &CampaignScore,
    scores: &[NamedScore],
    outcome: &mut PaperOutcome,
) {
    let campaign = FirstCampaign {
        tests,
        each,
        trained_on_all,
        lugre: score(scores, LUGRE.name),
        coulomb_viscous: score(scores, COULOMB_VISCOUS.name),
        named: score(scores, NAMED_WITH_TENSION.name),
        by_tension: score(scores, NetworkInputs::Tension.name()),
        by_motion: score(scores, NetworkInputs::Motion.name()),
        by_actuators: score(scores, NetworkInputs::Actuators.name()),
    };
    outcome.summary.extend(campaign.summary());
    outcome.goals.extend(campaign.goals());
    let section = Section::new("The paper's tests")
        .table(tension_by_frequency(
            "Table 2: LuGre fitted to each test. 0.05 and 0.1 Hz are not public",
            tests,
            each,
            &LUGRE_PERCENT,
        ))
        .table(tension_by_frequency(
            "Table 3: lugre-lstm with the actuators' forces, all tests seen",
            tests,
            trained_on_all,
            &LSTM_PERCENT,
        ))
        .table(comparison("Held out by whole tests, first campaign", tests, scores));
    let models = [LUGRE.name, NAMED_WITH_TENSION.name, NetworkInputs::Actuators.name()];
    let chart = hysteresis_chart(tests, "35lb@0.5Hz", scores, &models);
    outcome.blocks.extend(section.with(chart.map(Block::Chart)));
}

/// Adds page and summary of the second campaign.
pub(super) fn second_campaign(
    tests: &TestCampaign,
    scores: &[NamedScore],
    outcome: &mut PaperOutcome,
) {
    let of = |name: &str| score(scores, name).pooled_rmse() / tests.deviation();
    let named = of(NAMED.name);
    outcome.summary.push(format!(
        "Second campaign (36 lb), held out by whole tests: LuGre {:.3} of the standard deviation, with backlash and directions \
         {named:.3}, lugre-lstm with tension and motion {:.3}; the published LuGre leaves 0.2208 in sample, and the goal of \
         {SECOND_CAMPAIGN_GOAL} is {}.",
        of(LUGRE.name),
        of(NetworkInputs::Motion.name()),
        goal_verdict(named <= SECOND_CAMPAIGN_GOAL),
    ));
    outcome.goals.push(
        Goal::at_most(
            "second campaign, held out: named causes, pooled RMSE over standard deviation",
            "",
            named,
            SECOND_CAMPAIGN_GOAL,
        )
        .remark("The published LuGre leaves 0.2208, in sample."),
    );
    let models = [LUGRE.name, NAMED.name, NetworkInputs::Motion.name()];
    let section = Section::new("The second campaign")
        .table(comparison("Held out by whole tests, second campaign", tests, scores))
        .with(hysteresis_chart(tests, "36lb@0.5Hz@1in", scores, &models).map(Block::Chart));
    outcome.blocks.extend(section);
}
