//! Related columns: exactly proportional, so that their effects are confounded, or strongly correlated.

use simulated_machines::conditions::{Condition, Extra, Signal};
use simulated_machines::sampler::Sampler;
use simulated_machines::sampling::PlannedRun;
use simulated_machines::scenarios::drawn_cause::DrawnCause;
use simulated_machines::scenarios::setting::{Setting, correlation};
use simulated_machines::scenarios::{ColumnRelation, Decoy, HiddenCause, Plan, ScenarioTruth};

/// `follower` is an affine function of `leader`, so that `twin` explains the data as well as the truth.
struct Proportional {
    leader: &'static str,
    follower: &'static str,
    twin: HiddenCause,
}

/// `decoy` is strongly correlated with the column of the effect, but has no effect.
struct Correlated {
    follows: &'static str,
    decoy: &'static str,
}

/// Range of the decoy's correlation with the column of the effect, over the rows.
const DECOY_CORRELATION: (f64, f64) = (0.8, 0.95);

/// Ratio of the static to the Coulomb level of a seal with almost no stiction.
const LOW_STATIC_RATIO: f64 = 1.05;

/// Columns that can raise the levels, with the cause of each.
const LEVEL_CAUSES: [(&str, HiddenCause); 3] = [
    ("pressure_diff_pa", HiddenCause::PressureCoulomb),
    ("radial_force_n", HiddenCause::RadialForceCoulomb),
    ("load_torque_nm", HiddenCause::LoadTorqueCoulomb),
];

/// Draws an effect that is confounded with another.
pub(super) fn draw_confounded(sampler: &mut Sampler) -> Plan {
    let plan = |effect, relation: Proportional| Plan {
        effects: vec![effect],
        relation: Some(Box::new(relation)),
    };
    if sampler.chance(0.15) {
        // A campaign whose depth increases with time.
        let (leader, follower) = ("time_s", "pressure_diff_pa");
        let twin = HiddenCause::PressureCoulomb;
        return plan(HiddenCause::TimeDrift, Proportional { leader, follower, twin });
    }
    let mut columns = LEVEL_CAUSES;
    sampler.shuffle(&mut columns);
    let [(leader, first), (follower, second), _] = columns;
    let (effect, twin) = if sampler.chance(0.5) { (first, second) } else { (second, first) };
    plan(effect, Proportional { leader, follower, twin })
}

/// Draws an effect with a decoy column.
pub(super) fn draw_with_decoy(sampler: &mut Sampler) -> Plan {
    let humidity = Extra::Humidity.column();
    let cases = [
        (HiddenCause::TimeDrift, "time_s", "temperature_c"),
        (HiddenCause::TimeDrift, "time_s", humidity),
        (HiddenCause::PressureCoulomb, "pressure_diff_pa", "radial_force_n"),
        (HiddenCause::PressureCoulomb, "pressure_diff_pa", humidity),
        (HiddenCause::PressureCoulomb, "pressure_diff_pa", "temperature_c"),
        (HiddenCause::TemperatureViscous, "temperature_c", humidity),
        (HiddenCause::RadialForceCoulomb, "radial_force_n", "load_torque_nm"),
        (HiddenCause::RadialForceCoulomb, "radial_force_n", "pressure_diff_pa"),
        (HiddenCause::LoadTorqueCoulomb, "load_torque_nm", "radial_force_n"),
        (HiddenCause::LoadTorqueCoulomb, "load_torque_nm", humidity),
    ];
    let (effect, follows, decoy) = cases[sampler.below(cases.len())];
    Plan { effects: vec![effect], relation: Some(Box::new(Correlated { follows, decoy })) }
}

/// Returns the usual lowest and highest value of a column.
fn range(column: &str) -> (f64, f64) {
    match column {
        "radial_force_n" => (12.0, 60.0),
        "pressure_diff_pa" => (1e4, 3e5),
        "temperature_c" => (6.0, 28.0),
        "load_torque_nm" => (1.0, 10.0),
        _ => (30.0, 80.0),
    }
}

/// Gives the load one sign, which keeps the level proportional to it: the level depends on its magnitude.
fn keep_sign_of_load(setting: &mut Setting) {
    for run in &mut setting.runs {
        let load = &mut run.condition.load;
        load.level = load.level.abs().max(load.swing + 0.2);
    }
}

impl ColumnRelation for Proportional {
    fn kind(&self) -> &'static str {
        "confounded"
    }

    fn extra(&self) -> Option<Extra> {
        None
    }

    fn relate(&self, _: &mut Sampler, setting: &mut Setting) {
        keep_sign_of_load(setting);
        let Self { leader, follower, .. } = *self;
        if leader == "time_s" {
            // A drift scales the excess of the static level, but pressure adds to both levels equally.
            // The two effects are equivalent only if the excess is negligible.
            setting.seal.static_nm = LOW_STATIC_RATIO * setting.seal.coulomb_nm;
        }
        let ((a, b), (c, d)) = (range_of(leader, setting), range(follower));
        let gain = (d - c) / (b - a);
        for run in &mut setting.runs {
            let signal = column_signal(&run.condition, leader).affine(c - gain * a, gain);
            if let Some(follower) = signal_mut(&mut run.condition, follower) {
                *follower = signal;
            }
        }
        [leader, follower].into_iter().for_each(|column| setting.log_column(column));
    }

    /// Replaces a run-in by a linear drift, which alone is proportional to the time.
    fn adapt(&self, effect: &mut DrawnCause) {
        effect.run_in_s = None;
    }

    fn describe(&self, _: &Setting, truth: &mut ScenarioTruth) {
        let Self { leader, follower, twin } = self;
        truth.confusable_with.push(twin.name());
        truth.description += &format!("; {follower} always goes with {leader}");
    }
}

impl ColumnRelation for Correlated {
    fn kind(&self) -> &'static str {
        "decoy"
    }

    fn extra(&self) -> Option<Extra> {
        (self.decoy == Extra::Humidity.column()).then_some(Extra::Humidity)
    }

    fn relate(&self, sampler: &mut Sampler, setting: &mut Setting) {
        keep_sign_of_load(setting);
        correlate_decoy(sampler, setting, self.follows, self.decoy);
        [self.follows, self.decoy].into_iter().for_each(|column| setting.log_column(column));
    }

    fn adapt(&self, _: &mut DrawnCause) {}

    fn describe(&self, setting: &Setting, truth: &mut ScenarioTruth) {
        let Self { follows, decoy } = *self;
        let correlation = correlation_over_rows(setting, follows, decoy);
        truth.description += &format!("; {decoy} goes nearly with {follows} and does nothing");
        truth.decoys.push(Decoy { column: decoy, follows, correlation });
    }
}

/// Returns the signal of a column in a run. The campaign time is available as `time_s`.
fn column_signal(condition: &Condition, column: &str) -> Signal {
    let campaign = Signal { level: condition.start_s, per_s: 1.0, ..Signal::default() };
    condition.signal(column).unwrap_or(campaign)
}

/// Returns the signal of a column to change it, or `None` if the conditions do not have the column.
fn signal_mut<'a>(condition: &'a mut Condition, column: &str) -> Option<&'a mut Signal> {
    match column {
        "radial_force_n" => Some(&mut condition.force),
        "pressure_diff_pa" => Some(&mut condition.pressure),
        "temperature_c" => Some(&mut condition.temperature),
        "load_torque_nm" => Some(&mut condition.load),
        _ => {
            let mut extras = condition.extras.iter_mut();
            extras.find(|(extra, _)| extra.column() == column).map(|(_, signal)| signal)
        }
    }
}

/// Returns the usual range of a column; of `time_s`, the range of the campaign.
fn range_of(column: &str, setting: &Setting) -> (f64, f64) {
    if column == "time_s" { (0.0, setting.campaign_s) } else { range(column) }
}

/// Draws the decoy's levels until the correlation over the rows is close to a drawn target.
fn correlate_decoy(sampler: &mut Sampler, setting: &mut Setting, follows: &str, decoy: &str) {
    let levels: Vec<f64> =
        setting.runs.iter().map(|run| column_signal(&run.condition, follows).level).collect();
    let (c, d) = range(decoy);
    let (middle, half) = (0.5 * (c + d), 0.5 * (d - c));
    for run in &mut setting.runs {
        // Independent variations within a run are reduced, because they would lower the correlation.
        for column in [follows, decoy] {
            if let Some(signal) = signal_mut(&mut run.condition, column) {
                signal.swing *= 0.3;
                signal.per_s *= 0.3;
            }
        }
    }
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..60 {
        let target = sampler.between(DECOY_CORRELATION.0 + 0.02, DECOY_CORRELATION.1 - 0.02);
        let drawn = draw_correlated(sampler, &levels, target);
        let largest = drawn.iter().fold(0.0f64, |most, level| most.max(level.abs())).max(1e-9);
        let drawn: Vec<f64> = drawn.iter().map(|x| middle + half * x / largest).collect();
        set_levels(setting, decoy, &drawn);
        let miss = (correlation_over_rows(setting, follows, decoy) - target).abs();
        if best.as_ref().is_none_or(|(least, _)| miss < *least) {
            best = Some((miss, drawn));
        }
        if miss < 0.02 {
            break;
        }
    }
    if let Some((_, levels)) = best {
        set_levels(setting, decoy, &levels);
    }
}

/// Sets the level of a column in each run.
fn set_levels(setting: &mut Setting, column: &str, levels: &[f64]) {
    for (run, level) in setting.runs.iter_mut().zip(levels) {
        if let Some(signal) = signal_mut(&mut run.condition, column) {
            signal.level = *level;
        }
    }
}

/// Draws values of mean 0 whose correlation with `levels` is `target`.
fn draw_correlated(sampler: &mut Sampler, levels: &[f64], target: f64) -> Vec<f64> {
    let unit = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let norm = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>().sqrt().max(1e-12);
        values.iter().map(|x| (x - mean) / norm).collect::<Vec<f64>>()
    };
    let along = unit(levels);
    let random: Vec<f64> = unit(&levels.iter().map(|_| sampler.normal()).collect::<Vec<f64>>());
    let shared: f64 = along.iter().zip(&random).map(|(a, r)| a * r).sum();
    let across: Vec<f64> = random.iter().zip(&along).map(|(r, a)| r - shared * a).collect();
    let across = unit(&across);
    let other = (1.0 - target * target).sqrt();
    along.iter().zip(&across).map(|(a, b)| target * a + other * b).collect()
}

/// Returns the correlation of the magnitudes of two columns over the rows.
fn correlation_over_rows(setting: &Setting, one: &str, other: &str) -> f64 {
    let values = |column: &str| -> Vec<f64> {
        let of_run = |run: &PlannedRun| {
            let signal = column_signal(&run.condition, column);
            (0..25)
                .map(move |step| signal.at(setting.seconds * (f64::from(step) + 0.5) / 25.0).abs())
        };
        setting.runs.iter().flat_map(of_run).collect()
    };
    correlation(&values(one), &values(other))
}
