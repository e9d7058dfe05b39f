//! Columns that move together: exactly, so that nobody can tell them apart, or nearly.

use super::hidden_cause::HiddenCause;
use super::sampler::Sampler;
use super::setting::{RunSetting, Setting, correlation};
use super::surroundings::{Condition, Extra, Signal};

/// What a scenario beyond one with independent columns is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Arrangement {
    /// All columns are independent.
    Independent,
    /// `follower` is always a multiple of `leader`, so that `twin` explains as much as the truth.
    Exactly { leader: &'static str, follower: &'static str, twin: HiddenCause },
    /// `decoy` nearly follows what the effect follows, and does nothing.
    Nearly { follows: &'static str, decoy: &'static str },
}

/// The decoy's correlation with the column that acts, over the rows.
pub(super) const NEARLY: (f64, f64) = (0.8, 0.95);

/// Static over Coulomb level of a seal that hardly sticks.
const NO_EXCESS: f64 = 1.05;

/// Levels that grow with one of these columns, by what does it.
const BY_COLUMN: [(&str, HiddenCause); 3] = [
    ("pressure_diff_pa", HiddenCause::PressureCoulomb),
    ("radial_force_n", HiddenCause::RadialForceCoulomb),
    ("load_torque_nm", HiddenCause::LoadTorqueCoulomb),
];

/// An effect that cannot be told from another, and how that comes.
pub(super) fn confounded(sampler: &mut Sampler) -> (HiddenCause, Arrangement) {
    if sampler.chance(0.15) {
        // A campaign that went deeper day by day.
        let (leader, follower) = ("time_s", "pressure_diff_pa");
        let twin = HiddenCause::PressureCoulomb;
        return (HiddenCause::TimeDrift, Arrangement::Exactly { leader, follower, twin });
    }
    let mut columns = BY_COLUMN;
    sampler.shuffle(&mut columns);
    let [(leader, first), (follower, second), _] = columns;
    let (effect, twin) = if sampler.chance(0.5) { (first, second) } else { (second, first) };
    (effect, Arrangement::Exactly { leader, follower, twin })
}

/// An effect with a decoy.
pub(super) fn with_decoy(sampler: &mut Sampler) -> (HiddenCause, Arrangement) {
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
    (effect, Arrangement::Nearly { follows, decoy })
}

/// A column's usual lowest and highest value.
fn range(column: &str) -> (f64, f64) {
    match column {
        "radial_force_n" => (12.0, 60.0),
        "pressure_diff_pa" => (1e4, 3e5),
        "temperature_c" => (6.0, 28.0),
        "load_torque_nm" => (1.0, 10.0),
        _ => (30.0, 80.0),
    }
}

impl Arrangement {
    /// The extra column it needs.
    pub fn extra(&self) -> Option<Extra> {
        match self {
            Arrangement::Nearly { decoy, .. } if *decoy == Extra::Humidity.column() => {
                Some(Extra::Humidity)
            }
            _ => None,
        }
    }

    /// Makes the columns move as arranged and sees to it that they are in the log.
    pub fn impose(&self, sampler: &mut Sampler, setting: &mut Setting) {
        // A load that presses is a load whichever way it pulls: here it pulls one way.
        for run in &mut setting.runs {
            let load = &mut run.condition.load;
            if *self != Arrangement::Independent {
                load.level = load.level.abs().max(load.swing + 0.2);
            }
        }
        match *self {
            Arrangement::Independent => return,
            Arrangement::Exactly { leader, follower, .. } => {
                if leader == "time_s" {
                    // A drift scales the static level's excess, pressure adds to both levels alike:
                    // only where there is hardly an excess are they the same.
                    setting.seal.static_nm = NO_EXCESS * setting.seal.coulomb_nm;
                }
                let ((a, b), (c, d)) = (range_of(leader, setting), range(follower));
                let gain = (d - c) / (b - a);
                for run in &mut setting.runs {
                    let signal = leading(&mut run.condition, leader).affine(c - gain * a, gain);
                    if let Some(follower) = run.condition.signal_mut(follower) {
                        *follower = signal;
                    }
                }
            }
            Arrangement::Nearly { follows, decoy } => nearly(sampler, setting, follows, decoy),
        }
        let (Self::Exactly { leader: one, follower: other, .. }
        | Self::Nearly { follows: one, decoy: other }) = *self
        else {
            return;
        };
        for column in [one, other] {
            setting.log_column(column);
        }
    }
}

/// A column of a run; campaign time is one too.
fn leading(condition: &mut Condition, column: &str) -> Signal {
    let campaign = Signal { level: condition.start_s, per_s: 1.0, ..Signal::default() };
    condition.signal_mut(column).map_or(campaign, |signal| *signal)
}

fn range_of(column: &str, setting: &Setting) -> (f64, f64) {
    if column == "time_s" { (0.0, setting.campaign_s) } else { range(column) }
}

/// Draws the decoy's levels until the correlation over the rows is as it should be.
fn nearly(sampler: &mut Sampler, setting: &mut Setting, follows: &str, decoy: &str) {
    let levels: Vec<f64> =
        setting.runs.iter_mut().map(|run| leading(&mut run.condition, follows).level).collect();
    let (c, d) = range(decoy);
    let (middle, half) = (0.5 * (c + d), 0.5 * (d - c));
    for run in &mut setting.runs {
        // Swings of their own would hide that the two go together.
        for column in [follows, decoy] {
            if let Some(signal) = run.condition.signal_mut(column) {
                signal.swing *= 0.3;
                signal.per_s *= 0.3;
            }
        }
    }
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..60 {
        let wanted = sampler.between(NEARLY.0 + 0.02, NEARLY.1 - 0.02);
        let drawn = related(sampler, &levels, wanted);
        let largest = drawn.iter().fold(0.0f64, |most, level| most.max(level.abs())).max(1e-9);
        let drawn: Vec<f64> = drawn.iter().map(|x| middle + half * x / largest).collect();
        set_levels(setting, decoy, &drawn);
        let miss = (correlation_over_rows(setting, follows, decoy) - wanted).abs();
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

fn set_levels(setting: &mut Setting, column: &str, levels: &[f64]) {
    for (run, level) in setting.runs.iter_mut().zip(levels) {
        if let Some(signal) = run.condition.signal_mut(column) {
            signal.level = *level;
        }
    }
}

/// Numbers of mean 0 whose correlation with `levels` is `wanted`.
fn related(sampler: &mut Sampler, levels: &[f64], wanted: f64) -> Vec<f64> {
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
    let other = (1.0 - wanted * wanted).sqrt();
    along.iter().zip(&across).map(|(a, b)| wanted * a + other * b).collect()
}

/// Correlation of two columns over the rows; of a load, of its magnitude.
pub(super) fn correlation_over_rows(setting: &Setting, one: &str, other: &str) -> f64 {
    let values = |column: &str| -> Vec<f64> {
        let of_run = |run: &RunSetting| {
            let mut condition = run.condition.clone();
            let signal = leading(&mut condition, column);
            (0..25)
                .map(move |step| signal.at(setting.seconds * (f64::from(step) + 0.5) / 25.0).abs())
        };
        setting.runs.iter().flat_map(of_run).collect()
    };
    correlation(&values(one), &values(other))
}
