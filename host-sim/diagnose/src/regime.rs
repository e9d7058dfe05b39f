//! Shares of the squared error by motion regime, direction, column and run.
//!
//! The shares show where a model is inaccurate. Errors are in Nm.

use super::sensitivities::Sensitivities;
use super::train_test::TrainTest;
use compensator_core::Quantity;
use friction_fit::Track;
use joint_log::contract;

/// Speed below which a joint is at rest, as a share of the largest speed.
const AT_REST: f64 = 1e-3;

/// Share of the friction level below which bristles have not broken away.
const HELD: f64 = 0.9;

/// Travel after a reversal or a rest that forms a regime of its own, in presliding travels.
const AFTER: f64 = 20.0;

/// Motion regime of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regime {
    /// At rest.
    Rest,
    /// In motion within the deflection of the bristles.
    Presliding,
    /// In motion shortly after a rest.
    Breakaway,
    /// In motion shortly after a reversal.
    Reversal,
    /// Sliding.
    Sliding,
}

impl Regime {
    /// All regimes.
    pub const ALL: [Self; 5] =
        [Self::Rest, Self::Presliding, Self::Breakaway, Self::Reversal, Self::Sliding];

    /// Returns the name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Presliding => "presliding",
            Self::Breakaway => "breakaway",
            Self::Reversal => "reversal",
            Self::Sliding => "sliding",
        }
    }
}

/// A part of the rows, and its share of the squared error.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// Name of the part.
    pub name: String,
    /// Share of the rows.
    pub of_rows: f64,
    /// Share of the squared error.
    pub of_error: f64,
    /// Standard error of `of_error`, over the tracks.
    pub uncertainty: f64,
    /// RMS error within the part, Nm.
    pub rmse: f64,
    /// Mean error within the part, Nm.
    pub mean: f64,
}

/// Shares of the squared error over a column.
#[derive(Clone, Debug)]
pub struct ColumnShares {
    /// Name of the column, or `run`.
    pub column: String,
    /// The lowest, middle and highest third of its values, or each run.
    pub parts: Vec<Share>,
}

/// Returns the regime of every row of a track.
///
/// `bristle` is the signed share of the level that the bristles hold. `presliding` is the
/// deflection of the bristles, rad, and `fastest` the largest speed, rad/s.
pub fn regimes(track: &Track, bristle: &[f64], presliding: f64, fastest: f64) -> Vec<Regime> {
    let mut travelled = f64::INFINITY;
    let mut after = Regime::Sliding;
    let mut direction = 0.0;
    let bristles = presliding > 0.0;
    (0..track.len())
        .map(|row| {
            let velocity = track.samples[row].velocity_rad_s;
            if velocity.abs() < AT_REST * fastest {
                (travelled, after) = (0.0, Regime::Breakaway);
                return Regime::Rest;
            }
            if direction * velocity < 0.0 && travelled > 0.0 {
                (travelled, after) = (0.0, Regime::Reversal);
            }
            direction = velocity.signum();
            travelled += velocity.abs() * track.period_s * track.period_ratio_of(row);
            if bristles && bristle[row] * direction < HELD {
                return Regime::Presliding;
            }
            if travelled < AFTER * presliding { after } else { Regime::Sliding }
        })
        .collect()
}

/// Returns the shares of a model's squared error by regime.
pub fn by_regime(tracks: &[Track], at: &Sensitivities) -> Vec<Share> {
    use compensator_core::ParameterId as Id;
    let parameters = &at.parameters;
    let presliding = if parameters.law.has_bristles() {
        parameters.get(Id::CoulombTorque) / parameters.get(Id::BristleStiffness).max(1e-9)
    } else {
        0.0
    };
    let samples = tracks.iter().flat_map(|track| &track.samples);
    let fastest = samples.map(|s| s.velocity_rad_s.abs()).fold(0.0, f64::max);
    let all: Vec<Vec<Regime>> = tracks
        .iter()
        .zip(&at.tracks)
        .map(|(track, at)| regimes(track, &at.bristle, presliding, fastest))
        .collect();
    let parts = Regime::ALL.map(|regime| (regime.name().to_owned(), regime));
    shares(tracks, at, &parts, |track, row, regime| all[track][row] == *regime)
}

/// Returns the shares of a model's squared error by direction.
pub fn by_direction(tracks: &[Track], at: &Sensitivities) -> Vec<Share> {
    let parts = [("forwards".to_owned(), 1.0), ("backwards".to_owned(), -1.0)];
    shares(tracks, at, &parts, |track, row, sign| {
        tracks[track].samples[row].velocity_rad_s * sign > 0.0
    })
}

/// Returns the shares of a model's squared error by these parts of the rows.
pub fn shares<P>(
    tracks: &[Track],
    at: &Sensitivities,
    parts: &[(String, P)],
    is_in: impl Fn(usize, usize, &P) -> bool,
) -> Vec<Share> {
    let squares = |track: usize| at.tracks[track].residual.iter().map(|r| r * r).sum::<f64>();
    let total: f64 = (0..tracks.len()).map(squares).sum::<f64>().max(f64::MIN_POSITIVE);
    let rows: usize = tracks.iter().map(Track::len).sum();
    parts
        .iter()
        .map(|(name, part)| {
            let (mut count, mut sum, mut error) = (0usize, 0.0, 0.0);
            let mut by_track = Vec::with_capacity(tracks.len());
            for (index, track) in tracks.iter().enumerate() {
                let mut of_track = 0.0;
                for row in (0..track.len()).filter(|row| is_in(index, *row, part)) {
                    let residual = at.tracks[index].residual[row];
                    count += 1;
                    sum += residual;
                    of_track += residual * residual;
                }
                error += of_track;
                by_track.push((of_track, squares(index)));
            }
            let share = error / total;
            // Linearised standard error of a ratio of sums, from the deviation of each track.
            let pulls: f64 =
                by_track.iter().map(|(of_track, all)| (of_track - share * all).powi(2)).sum();
            let n = count.max(1) as f64;
            Share {
                name: name.clone(),
                of_rows: count as f64 / rows.max(1) as f64,
                of_error: share,
                uncertainty: pulls.sqrt() / total,
                rmse: (error / n).sqrt(),
                mean: sum / n,
            }
        })
        .collect()
}

/// Returns the shares of a model's squared error by column and by run, with the name of each
/// column.
///
/// Each column that varies is divided into its lowest, middle and highest third.
pub fn by_column(log: &TrainTest, at: &Sensitivities) -> Vec<ColumnShares> {
    type Read<'a> = Box<dyn Fn(usize, usize) -> f64 + 'a>;
    let tracks = &log.test_tracks;
    let sample = |track: usize, row: usize| &tracks[track].samples[row];
    let mut columns: Vec<(String, Read)> = vec![
        ("speed".into(), Box::new(|t, r| sample(t, r).velocity_rad_s.abs())),
        ("time_s".into(), Box::new(|t, r| 3600.0 * sample(t, r).campaign_time_h)),
    ];
    for quantity in std::iter::once(Quantity::Position).chain(contract::covariates()) {
        let name = quantity.name(log.train.joint);
        if log.varies(name) {
            let scale = quantity.info().outside_scale;
            let read = move |t: usize, r: usize| {
                scale * quantity.value_in(sample(t, r)).unwrap_or_default()
            };
            columns.push((name.to_owned(), Box::new(read)));
        }
    }
    for index in &log.extras {
        let read = move |t: usize, r: usize| tracks[t].covariates[*index][r];
        columns.push((log.test.covariates[*index].clone(), Box::new(read)));
    }
    let of_column = |(column, read)| ColumnShares { column, parts: thirds(tracks, at, read) };
    let mut all: Vec<ColumnShares> = columns.into_iter().map(of_column).collect();
    let runs: Vec<(String, usize)> =
        log.test.runs.iter().enumerate().map(|(at, run)| (run.name.clone(), at)).collect();
    let parts = shares(tracks, at, &runs, |t, _, run| tracks[t].run == *run);
    all.push(ColumnShares { column: "run".into(), parts });
    all
}

fn thirds(tracks: &[Track], at: &Sensitivities, read: impl Fn(usize, usize) -> f64) -> Vec<Share> {
    let rows =
        tracks.iter().enumerate().flat_map(|(t, track)| (0..track.len()).map(move |r| (t, r)));
    let mut values: Vec<f64> = rows.map(|(t, r)| read(t, r)).collect();
    values.sort_by(f64::total_cmp);
    let cut = |third: usize| values.get(third * values.len() / 3).copied().unwrap_or_default();
    let (low, high) = (cut(1), cut(2));
    let parts = [
        ("lowest third".to_owned(), (f64::NEG_INFINITY, low)),
        ("middle third".to_owned(), (low, high)),
        ("highest third".to_owned(), (high, f64::INFINITY)),
    ];
    shares(tracks, at, &parts, |t, r, (from, to)| (*from..*to).contains(&read(t, r)))
}
