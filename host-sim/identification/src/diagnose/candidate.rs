//! What a residual can be blamed on: every cause of the catalogue, as columns beside the base model's.
//!
//! A candidate is a term of the core at rest (its size 0) with the columns by which the torque would
//! change if it acted. Where a term has a parameter that does not enter linearly (the order of a ripple,
//! the time constant of a run-in), there are several candidates of one cause, one for each setting of a
//! coarse grid; the fit moves on from the best. A cause whose column is not in the log, or does not vary
//! there, is no candidate: nothing is invented.
//!
//! `unknown` stands beside them on equal terms: a smooth curve over any column, once as a torque of its
//! own (a sensor's error, a load) and once as a share of the friction level.

use super::log::Log;
use super::order::{MOST_PRISMATIC, MOST_REVOLUTE, Peak, Point, peaks};
use super::tangent::{Exact, Tangent};
use crate::data::Joint;
use crate::spec::Spec;
use ParameterId as Id;
use compensator_core::term::{KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, MAX_TERMS};
use compensator_core::{ParameterId, Sample, TermKind};

/// Orders of a ripple that are tried.
const ORDERS: usize = 3;

/// One row as a regressor sees it.
pub struct Row<'a> {
    /// The core's input.
    pub sample: &'a Sample<f64>,
    /// Change of the torque where the levels are raised by 1 Nm.
    pub added: f64,
    /// Change of the torque where the level is scaled.
    pub level: f64,
    /// The viscous part, Nm.
    pub viscous: f64,
    /// Rate of the simulated torque, Nm/s.
    pub slope: f64,
    /// The followed covariate.
    pub extra: f64,
}

/// A column of a candidate.
pub enum Regressor {
    /// From what is known of each row.
    Row(Box<dyn Fn(&Row) -> f64 + Send + Sync>),
    /// Simulated for itself.
    Exact(Exact),
}

/// How a parameter is set from the panel's coefficients.
#[derive(Clone, Debug)]
pub enum Seed {
    /// To this value.
    At(f64),
    /// To this multiple of the coefficient of this column.
    Times(usize, f64),
}

/// What `unknown` follows, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Follows {
    /// Name of the column.
    pub column: String,
    /// Whether it is one of the log's extra covariates.
    pub extra: bool,
    /// A share of the friction level; else a torque of its own.
    pub level: bool,
    /// A torque of its own, proportional to the column: a gain that is off.
    pub proportional: bool,
}

/// One way a residual may be explained.
pub struct Candidate {
    /// The term.
    pub kind: TermKind,
    /// Columns of the log it needs.
    pub columns: Vec<String>,
    /// What it follows, for `unknown`.
    pub follows: Option<Follows>,
    /// Its columns.
    pub regressors: Vec<Regressor>,
    /// Where a fit with it begins.
    pub seeds: Vec<(ParameterId, Seed)>,
    /// Parameters of the term a fit keeps.
    pub fixed: Vec<ParameterId>,
    /// For a ripple: the order and its probability under nothing hidden.
    pub peak: Option<Peak>,
    /// Index of the extra covariate it reads.
    pub extra: Option<usize>,
}

fn row(f: impl Fn(&Row) -> f64 + Send + Sync + 'static) -> Regressor {
    Regressor::Row(Box::new(f))
}

impl Candidate {
    fn new(kind: TermKind, columns: &[&str], regressors: Vec<Regressor>) -> Self {
        Self {
            kind,
            columns: columns.iter().map(|&name| name.to_owned()).collect(),
            follows: None,
            regressors,
            seeds: Vec::new(),
            fixed: Vec::new(),
            peak: None,
            extra: None,
        }
    }

    fn seeded(mut self, seeds: &[(ParameterId, Seed)]) -> Self {
        self.seeds = seeds.to_vec();
        self
    }

    fn keeping(mut self, fixed: &[ParameterId]) -> Self {
        self.fixed = fixed.to_vec();
        self
    }
}

/// The candidates beside a model that has been fitted.
pub fn catalogue(log: &Log, spec: &Spec, tangent: &Tangent) -> Vec<Candidate> {
    let taken = |kind: TermKind| {
        spec.terms.contains(&kind) || spec.rigid_body.contains(&kind) || spec.law.includes(kind)
    };
    let mut all = Vec::new();
    if tangent.parameters.terms.len() >= MAX_TERMS {
        return all;
    }
    covariates(log, &mut all);
    motion(log, spec, &mut all);
    if spec.law.has_bristles() {
        bristles(log, tangent, &mut all);
    }
    position(log, tangent, &mut all);
    drift(log, &mut all);
    if !taken(TermKind::LookupTable) {
        // With an offset in the model, the spline's constant would be a second one.
        let offset = taken(TermKind::TorqueOffset);
        unknown(log, offset, &mut all);
    }
    all.retain(|candidate| !taken(candidate.kind));
    all
}

fn covariates(log: &Log, all: &mut Vec<Candidate>) {
    use TermKind as Kind;
    let times = |factor| Seed::Times(0, factor);
    if log.varies("radial_force_n") {
        let by = vec![row(|r| r.added * r.sample.radial_force_n)];
        all.push(
            Candidate::new(Kind::RadialForceCoulomb, &["radial_force_n"], by)
                .seeded(&[(Id::RadialForceCoulomb, times(1.0))])
                .keeping(&[Id::RadialForceStaticExcess]),
        );
    }
    if log.varies("pressure_diff_pa") {
        let by = vec![row(|r| r.added * r.sample.pressure_diff_mpa)];
        all.push(
            Candidate::new(Kind::PressureCoulomb, &["pressure_diff_pa"], by)
                .seeded(&[(Id::PressureCoulomb, times(1e-6))])
                .keeping(&[Id::PressureStaticExcess]),
        );
    }
    if log.varies("load_torque_nm") {
        let by = vec![row(|r| r.added * r.sample.load_torque_nm.abs())];
        all.push(
            Candidate::new(Kind::LoadTorqueCoulomb, &["load_torque_nm"], by)
                .seeded(&[(Id::LoadCoulomb, times(1.0))]),
        );
    }
    if log.varies("temperature_c") {
        let samples = || log.train_tracks.iter().flat_map(|track| &track.samples);
        let rows = samples().count().max(1) as f64;
        let mean = samples().map(|s| s.temperature_c).sum::<f64>() / rows;
        let by = vec![row(move |r| -r.viscous * (r.sample.temperature_c - mean))];
        all.push(
            Candidate::new(Kind::TemperatureViscous, &["temperature_c"], by)
                .seeded(&[
                    (Id::TemperatureViscosity, times(1.0)),
                    (Id::TemperatureReference, Seed::At(mean)),
                ])
                .keeping(&[Id::TemperatureReference]),
        );
    }
}

fn motion(log: &Log, spec: &Spec, all: &mut Vec<Candidate>) {
    use TermKind as Kind;
    let velocity = log.velocity_name();
    let sign = |velocity: f64| if velocity == 0.0 { 0.0 } else { velocity.signum() };
    all.push(
        Candidate::new(
            Kind::DirectionAsymmetry,
            &[velocity],
            vec![
                row(move |r| sign(r.sample.velocity_rad_s) * r.level),
                row(move |r| sign(r.sample.velocity_rad_s) * r.viscous),
            ],
        )
        .seeded(&[
            (Id::CoulombAsymmetry, Seed::Times(0, 1.0)),
            (Id::ViscousAsymmetry, Seed::Times(1, 1.0)),
        ]),
    );
    all.push(
        Candidate::new(Kind::TorqueOffset, &[], vec![row(|_| 1.0)])
            .seeded(&[(Id::TorqueOffset, Seed::Times(0, 1.0))]),
    );
    if !spec.law.parameters().contains(&Id::QuadraticFriction) {
        let drag = |r: &Row| r.sample.velocity_rad_s * r.sample.velocity_rad_s.abs();
        all.push(
            Candidate::new(Kind::QuadraticDrag, &[velocity], vec![row(drag)])
                .seeded(&[(Id::QuadraticDrag, Seed::Times(0, 1.0))]),
        );
    }
    all.push(
        Candidate::new(
            Kind::UnmodelledInertia,
            &[velocity],
            vec![row(|r| r.sample.acceleration_rad_s2)],
        )
        .seeded(&[(Id::Inertia, Seed::Times(0, 1.0))]),
    );
    all.push(
        Candidate::new(Kind::ChannelDelay, &[velocity], vec![row(|r| -r.slope)])
            .seeded(&[(Id::ChannelDelay, Seed::Times(0, 1.0))]),
    );
    // The rate of the torque stands for a delay within a sample; a longer one turns the torque elsewhere.
    let period = log.train_tracks.first().map_or(1e-3, |track| track.period_s);
    for samples in [1.0, 3.0, 9.0, 27.0] {
        let delay = samples * period;
        let settings = vec![(Id::ChannelDelay, delay)];
        let by = Exact { kind: Kind::ChannelDelay, settings, derivative: None };
        all.push(
            Candidate::new(Kind::ChannelDelay, &[velocity], vec![Regressor::Exact(by)])
                .seeded(&[(Id::ChannelDelay, Seed::At(delay))]),
        );
    }
    if spec.law.has_stribeck_curve() {
        // An exponent of 2 is the table's own curve, without a derivative: a hair beside it there is one.
        for (start, setting, derivative) in
            [(1.0, 1.0, None), (3.0, 2.001, Some(Id::StribeckExponent))]
        {
            let settings = vec![(Id::StribeckExponent, setting)];
            let by = Exact { kind: Kind::StribeckShape, settings, derivative };
            all.push(
                Candidate::new(Kind::StribeckShape, &[velocity], vec![Regressor::Exact(by)])
                    .seeded(&[(Id::StribeckExponent, Seed::At(start))]),
            );
        }
    }
}

fn bristles(log: &Log, tangent: &Tangent, all: &mut Vec<Candidate>) {
    use TermKind as Kind;
    let velocity = log.velocity_name();
    if log.varies("radial_force_n") {
        let by = Exact {
            kind: Kind::RadialForceRate,
            settings: Vec::new(),
            derivative: Some(Id::RadialForceRate),
        };
        all.push(
            Candidate::new(Kind::RadialForceRate, &["radial_force_n"], vec![Regressor::Exact(by)])
                .seeded(&[(Id::RadialForceRate, Seed::Times(0, 1.0))]),
        );
    }
    for dwell_time in [0.03, 0.3, 3.0] {
        let settings = vec![(Id::DwellTime, dwell_time)];
        let by = Exact { kind: Kind::DwellTimeStatic, settings, derivative: Some(Id::DwellGain) };
        all.push(
            Candidate::new(Kind::DwellTimeStatic, &[velocity], vec![Regressor::Exact(by)])
                .seeded(&[
                    (Id::DwellTime, Seed::At(dwell_time)),
                    (Id::DwellGain, Seed::Times(0, 1.0)),
                ])
                .keeping(&[Id::DwellTravel]),
        );
    }
    let presliding =
        tangent.parameters.get(Id::StaticTorque).max(tangent.parameters.get(Id::CoulombTorque))
            / tangent.parameters.get(Id::BristleStiffness).max(1e-9);
    for times in [0.5, 2.0, 6.0, 20.0] {
        let travel = times * presliding;
        let settings = vec![(Id::BacklashTravel, travel)];
        let by = Exact { kind: Kind::Backlash, settings, derivative: None };
        all.push(
            Candidate::new(Kind::Backlash, &[velocity], vec![Regressor::Exact(by)])
                .seeded(&[(Id::BacklashTravel, Seed::At(travel))])
                .keeping(&[Id::BacklashStiffnessRatio]),
        );
    }
}

fn position(log: &Log, tangent: &Tangent, all: &mut Vec<Candidate>) {
    use TermKind as Kind;
    let name = log.position_name();
    if !log.varies(name) {
        return;
    }
    if log.train.joint == Joint::Revolute {
        all.push(
            Candidate::new(
                Kind::GravityImbalance,
                &[name],
                vec![row(|r| r.sample.position_rad.sin()), row(|r| r.sample.position_rad.cos())],
            )
            .seeded(&[
                (Id::GravitySine, Seed::Times(0, 1.0)),
                (Id::GravityCosine, Seed::Times(1, 1.0)),
            ]),
        );
    }
    let points: Vec<Point> = log
        .train_tracks
        .iter()
        .zip(&tangent.tracks)
        .flat_map(|(track, at)| {
            track.samples.iter().zip(&at.level).zip(&at.residual).map(|((s, level), residual)| {
                Point { position: s.position_rad, weighed: level * residual }
            })
        })
        .collect();
    let most = if log.train.joint == Joint::Revolute { MOST_REVOLUTE } else { MOST_PRISMATIC };
    for peak in peaks(&points, most, ORDERS) {
        let n = peak.order;
        let mut candidate = Candidate::new(
            Kind::PositionRipple,
            &[name],
            vec![
                row(move |r| r.level * (n * r.sample.position_rad).sin()),
                row(move |r| r.level * (n * r.sample.position_rad).cos()),
            ],
        )
        .seeded(&[
            (Id::RippleOrder, Seed::At(n)),
            (Id::RippleSine, Seed::Times(0, 1.0)),
            (Id::RippleCosine, Seed::Times(1, 1.0)),
        ]);
        candidate.peak = Some(peak);
        all.push(candidate);
    }
}

fn drift(log: &Log, all: &mut Vec<Candidate>) {
    use TermKind as Kind;
    let campaign_h = log.campaign_s() / 3600.0;
    all.push(
        Candidate::new(
            Kind::TimeDrift,
            &["time_s"],
            vec![row(|r| r.level * r.sample.campaign_time_h)],
        )
        .seeded(&[
            (Id::DriftRate, Seed::Times(0, 1.0 / 3600.0)),
            (Id::DriftAmplitude, Seed::At(0.0)),
        ])
        .keeping(&[Id::DriftAmplitude, Id::DriftTime]),
    );
    for share in [0.1, 0.3] {
        let time_h = share * campaign_h;
        let by = vec![row(move |r| r.level * (-r.sample.campaign_time_h / time_h).exp())];
        all.push(
            Candidate::new(Kind::TimeDrift, &["time_s"], by)
                .seeded(&[
                    (Id::DriftTime, Seed::At((time_h * 3600.0).max(1.0))),
                    (Id::DriftAmplitude, Seed::Times(0, 1.0)),
                    (Id::DriftRate, Seed::At(0.0)),
                ])
                .keeping(&[Id::DriftRate]),
        );
    }
}

/// Reads a column in the core's unit.
type Read = fn(&Row) -> f64;

/// A column `unknown` may follow: its name, its number in the core, its unit's factor, how it is read.
struct Followed {
    name: String,
    number: f64,
    /// What a value in the core's unit is multiplied by for the file's unit.
    factor: f64,
    read: Read,
    extra: Option<usize>,
}

fn unknown(log: &Log, offset: bool, all: &mut Vec<Candidate>) {
    let contract: [(&str, f64, f64, Read); 7] = [
        (log.velocity_name(), 0.0, 1.0, |r| r.sample.velocity_rad_s),
        (log.position_name(), 1.0, 1.0, |r| r.sample.position_rad),
        ("time_s", 2.0, 3600.0, |r| r.sample.campaign_time_h),
        ("radial_force_n", 3.0, 1.0, |r| r.sample.radial_force_n),
        ("pressure_diff_pa", 4.0, 1e6, |r| r.sample.pressure_diff_mpa),
        ("temperature_c", 5.0, 1.0, |r| r.sample.temperature_c),
        ("load_torque_nm", 6.0, 1.0, |r| r.sample.load_torque_nm),
    ];
    let mut columns: Vec<Followed> = contract
        .into_iter()
        .filter(|(name, ..)| log.varies(name))
        .map(|(name, number, factor, read)| Followed {
            name: name.to_owned(),
            number,
            factor,
            read,
            extra: None,
        })
        .collect();
    columns.extend(log.extras.iter().map(|index| Followed {
        name: log.train.covariates[*index].clone(),
        number: 7.0,
        factor: 1.0,
        read: |r| r.extra,
        extra: Some(*index),
    }));
    for followed in columns {
        // A sensor's gain error is a straight line over a covariate, and so simple that it is heard as
        // such too. (Over velocity it would be viscous friction; over angle or time it means nothing.)
        let is_covariate = followed.number > 2.5;
        let ways = [(false, false), (true, false), (false, true)];
        for (level, proportional) in ways.into_iter().filter(|(_, line)| !line || is_covariate) {
            all.extend(spline(log, &followed, level, proportional, level || offset));
        }
    }
}

/// A spline over one column. Where it `pins`, the knot nearest the median stays at 0: the constant is
/// the base's.
fn spline(
    log: &Log,
    followed: &Followed,
    level: bool,
    proportional: bool,
    pins: bool,
) -> Option<Candidate> {
    let mut values: Vec<f64> = log
        .train_tracks
        .iter()
        .flat_map(|track| {
            track.samples.iter().enumerate().step_by(7).map(|(row, sample)| {
                let extra = followed.extra.map_or(0.0, |index| {
                    log.train.runs[track.run].extra[index][track.first_row + row]
                });
                let row = Row { sample, added: 0.0, level: 0.0, viscous: 0.0, slope: 0.0, extra };
                (followed.read)(&row)
            })
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() - 1) as f64 * share) as usize).copied();
    let (least, median, most) = (at(0.0)?, at(0.5)?, at(1.0)?);
    if most <= least {
        return None;
    }
    let width = (most - least) / (KNOTS - 1) as f64;
    let pinned = (((median - least) / width).round() as usize).min(KNOTS - 1);
    let knots = if level { LOOKUP_LEVELS } else { LOOKUP_TORQUES };
    let others = if level { LOOKUP_TORQUES } else { LOOKUP_LEVELS };
    let read = followed.read;
    let mut seeds = vec![
        (Id::LookupColumn, Seed::At(followed.number)),
        (Id::LookupLower, Seed::At(least * followed.factor)),
        (Id::LookupUpper, Seed::At(most * followed.factor)),
    ];
    if pins {
        seeds.push((knots[pinned], Seed::At(0.0)));
    }
    let mut regressors = Vec::new();
    for (knot, id) in knots.iter().enumerate().filter(|(knot, _)| !pins || *knot != pinned) {
        let centre = least + knot as f64 * width;
        if proportional {
            let from = if pins { least + pinned as f64 * width } else { 0.0 };
            seeds.push((*id, Seed::Times(0, centre - from)));
            continue;
        }
        seeds.push((*id, Seed::Times(regressors.len(), 1.0)));
        regressors.push(row(move |r| {
            let hat = (1.0 - ((read(r) - centre) / width).abs()).max(0.0);
            if level { hat * r.level } else { hat }
        }));
    }
    if proportional {
        regressors.push(row(read));
    }
    let mut fixed = vec![Id::LookupColumn, Id::LookupLower, Id::LookupUpper];
    fixed.extend(pins.then_some(knots[pinned]));
    fixed.extend(others);
    seeds.extend(others.map(|id| (id, Seed::At(0.0))));
    let mut candidate =
        Candidate::new(TermKind::LookupTable, &[followed.name.as_str()], regressors);
    candidate.follows = Some(Follows {
        column: followed.name.clone(),
        extra: followed.extra.is_some(),
        level,
        proportional,
    });
    candidate.seeds = seeds;
    candidate.fixed = fixed;
    candidate.extra = followed.extra;
    Some(candidate)
}
