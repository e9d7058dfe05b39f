//! `predict --adapt`: its options, and the errors with and without gains that follow the log.

use super::values::expected;
use compensator_core::Quantity;
use compensator_core::adaptation::{AdaptationParameters, Frozen};
use friction_fit::Metrics;
use friction_fit::prediction::{AdaptationOptions, AdaptedPrediction};
use joint_log::number::significant;
use joint_log::{Dataset, JointKind};
use serde_json::{Map, Value, json};
use std::error::Error;

/// Arguments of `predict --adapt`.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct AdaptArguments {
    /// Let gains on the levels, the viscous friction and the terms follow the log, as a driver does
    ///
    /// The prediction of a row uses what was learnt from earlier rows.
    #[arg(long)]
    adapt: bool,
    /// Memory of the gains in time of sliding, such as 20s
    #[arg(long, value_name = "TIME", requires = "adapt", value_parser = memory_s)]
    adapt_memory: Option<f64>,
    /// Least and largest gain, such as 0.4:2.5
    #[arg(long, value_name = "LEAST:LARGEST", requires = "adapt", value_parser = gain_range)]
    adapt_range: Option<GainRange>,
}

/// Least and largest gain.
#[derive(Clone, Copy, Debug)]
struct GainRange([f64; 2]);

impl AdaptArguments {
    /// Returns the options of the prediction; `None` for the fixed set.
    pub fn options(&self) -> Option<AdaptationOptions> {
        let range = self.adapt_range.map(|GainRange(range)| range);
        self.adapt.then_some(AdaptationOptions { memory_s: self.adapt_memory, range })
    }
}

/// Parses a memory, s.
fn memory_s(text: &str) -> Result<f64, Box<dyn Error + Send + Sync>> {
    let memory_s = joint_log::parse_value("time_s", text)
        .map_err(|_| expected("a time with its unit, such as 20s"))?;
    AdaptationParameters { memory_s: memory_s as f32, ..Default::default() }.validate()?;
    Ok(memory_s)
}

/// Parses a least and a largest gain.
fn gain_range(text: &str) -> Result<GainRange, Box<dyn Error + Send + Sync>> {
    let bounds = text.split_once(':').and_then(|(least, largest)| {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        Some([number(least)?, number(largest)?])
    });
    let bounds = bounds.ok_or_else(|| expected("a least and a largest gain, such as 0.4:2.5"))?;
    let [least_gain, largest_gain] = bounds.map(|bound| bound as f32);
    AdaptationParameters { least_gain, largest_gain, ..Default::default() }.validate()?;
    Ok(GainRange(bounds))
}

/// Returns the gain with this number in every row that has one.
fn gains_of(adapted: &AdaptedPrediction, at: usize) -> impl Iterator<Item = f32> + '_ {
    adapted.rows.iter().flatten().flatten().map(move |row| row.gains[at])
}

/// Returns the least and the largest value.
fn extremes(values: impl Iterator<Item = f32>) -> [f32; 2] {
    let empty = [f32::INFINITY, f32::NEG_INFINITY];
    values.fold(empty, |[least, most], value| [least.min(value), most.max(value)])
}

/// Returns each reason why nothing was learnt, with its share of the rows.
fn frozen_shares(adapted: &AdaptedPrediction) -> Vec<(Frozen, f64)> {
    let rows = || adapted.rows.iter().flatten().flatten();
    let count = rows().count().max(1) as f64;
    let share = |reason: &Frozen| {
        let frozen = rows().filter(|row| row.frozen == *reason).count();
        (*reason, frozen as f64 / count)
    };
    let all = Frozen::ALL.iter().filter(|reason| **reason != Frozen::None).map(share);
    all.filter(|(_, share)| *share > 0.0).collect()
}

/// Returns the errors of each run with the gains and without.
fn of_runs<'a>(
    adapted: &'a AdaptedPrediction,
    data: &'a Dataset,
) -> impl Iterator<Item = (&'a str, [Metrics; 2])> {
    let with = adapted.prediction.run_metrics(data);
    let both = with.zip(adapted.fixed.run_metrics(data));
    both.map(|((run, with), (_, fixed))| (run, [with, fixed]))
}

/// Returns the member `adaptation` of the document.
pub fn document(adapted: &AdaptedPrediction, data: &Dataset) -> Value {
    let settings = &adapted.settings;
    let mut gains = Map::new();
    for (at, name) in adapted.names.iter().enumerate() {
        let [least, largest] = extremes(gains_of(adapted, at));
        let value = json!({
            "last": adapted.last[at], "std": adapted.last_deviations[at],
            "least": least, "largest": largest,
        });
        gains.insert(name.clone(), value);
    }
    let frozen = frozen_shares(adapted).into_iter();
    let frozen: Map<String, Value> =
        frozen.map(|(reason, share)| (reason.name().to_owned(), json!(share))).collect();
    let errors = |metrics: Metrics| json!({ "rmse": metrics.rmse, "nrmse_std": metrics.nrmse_std });
    let runs: Vec<Value> = of_runs(adapted, data)
        .map(|(run, [with, fixed])| {
            json!({ "run": run, "rows": with.rows, "adapted": errors(with), "fixed": errors(fixed) })
        })
        .collect();
    json!({
        "fixed": adapted.fixed.metrics, "adapted": adapted.prediction.metrics, "runs": runs,
        "gains": gains, "learnt_s": adapted.learnt_s, "frozen": frozen,
        "followed": adapted.followed.map(|followed| {
            json!({ "column": followed.quantity.name(data.joint), "share": followed.share })
        }),
        "settings": {
            "period_s": adapted.period_s, "memory_s": settings.memory_s,
            "least_gain": settings.least_gain, "largest_gain": settings.largest_gain,
            "least_velocity": settings.least_velocity_rad_s, "noise": settings.noise_nm,
        },
    })
}

/// Most runs that the terminal lists.
pub const MAX_LISTED_RUNS: usize = 12;

/// Returns the lines of the text output, for a torque in this unit.
pub fn text(adapted: &AdaptedPrediction, data: &Dataset, unit: &str) -> String {
    let fixed = &adapted.fixed.metrics;
    let mut text = format!(
        "fixed set: RMSE {} {unit}, {:.1} % of the torque's standard deviation\n",
        significant(fixed.rmse, 4),
        100.0 * fixed.nrmse_std
    );
    let runs: Vec<_> = of_runs(adapted, data).collect();
    if runs.len() > 1 {
        text += &format!("RMSE of each run, adapted and fixed, {unit}:\n");
        for (run, errors) in runs.iter().take(MAX_LISTED_RUNS) {
            let [with, fixed] = errors.map(|metrics| significant(metrics.rmse, 3));
            text += &format!("  {run}: {with} {fixed}\n");
        }
        if runs.len() > MAX_LISTED_RUNS {
            text += "  ..\n";
        }
    }
    for (at, name) in adapted.names.iter().enumerate() {
        let [least, most] = extremes(gains_of(adapted, at));
        let (last, deviation) = (adapted.last[at], adapted.last_deviations[at]);
        text += &format!(
            "gain of {name}: {last:.3} at the end (standard deviation {deviation:.3}), \
             {least:.3} to {most:.3} in the log\n"
        );
    }
    let shares: Vec<String> = frozen_shares(adapted)
        .into_iter()
        .map(|(reason, share)| format!("{} {:.1} %", reason.name(), 100.0 * share))
        .collect();
    let frozen = if shares.is_empty() { "none".to_owned() } else { shares.join(", ") };
    text += &format!(
        "learnt from {} s of sliding; rows without learning: {frozen}\n",
        significant(adapted.learnt_s, 3)
    );
    text += &settings_line(adapted, data.joint, unit);
    if let Some(followed) = adapted.followed {
        text += &format!(
            "- the learnt level follows {} ({:.0} % of its variance): a term would explain it\n",
            followed.quantity.name(data.joint),
            100.0 * followed.share
        );
    }
    text
}

fn settings_line(adapted: &AdaptedPrediction, joint: JointKind, unit: &str) -> String {
    let settings = &adapted.settings;
    let number = |value: f32| significant(value.into(), 3);
    format!(
        "memory {} s, gains {} to {}, sliding above {} {}, noise {} {unit}\n",
        number(settings.memory_s),
        number(settings.least_gain),
        number(settings.largest_gain),
        number(settings.least_velocity_rad_s),
        Quantity::Velocity.info().units[joint as usize],
        number(settings.noise_nm),
    )
}
