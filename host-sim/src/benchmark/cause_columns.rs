//! The columns of each cause in the rival's regression: what an engineer would write down in an afternoon.

use super::regression::{Base, Column, Rows};
use friction_identification::data::{JointKind, Quantity};

/// Columns, and the causes that are made of some of them each.
#[derive(Default)]
pub(super) struct CauseColumns {
    pub columns: Vec<Column>,
    /// Name and places in `columns`.
    pub causes: Vec<(&'static str, Vec<usize>)>,
}

impl CauseColumns {
    /// A cause of columns of its own, where all of them vary; an offset is what does not.
    fn add(&mut self, name: &'static str, columns: Vec<Column>) {
        if columns.iter().all(|column| varies(column) || name == "torque-offset") {
            let places = self.keep(columns);
            self.causes.push((name, places));
        }
    }

    fn keep(&mut self, columns: impl IntoIterator<Item = Column>) -> Vec<usize> {
        let first = self.columns.len();
        self.columns.extend(columns);
        (first..self.columns.len()).collect()
    }
}

/// Orders of a ripple that are tried, in one turn.
const ORDERS: u32 = 60;
/// Gaps of backlash that are tried, of the base's travel; smaller ones only mend the elastic sign's shape.
const GAPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Exponents of a Stribeck curve beside 2, and its velocities of the usual speed.
const EXPONENTS: [f64; 3] = [0.5, 1.0, 4.0];
const STRIBECK: [f64; 3] = [0.01, 0.05, 0.2];
/// Times in which heat leaves, and heats at which a seal is warm, of the campaign's.
const COOLING: [f64; 2] = [0.3, f64::INFINITY];
const WARM: [f64; 1] = [0.4];
/// A covariate that goes with the torque more closely than this is the torque, in other units.
const SAME: f64 = 0.98;
/// Below this share of the usual speed a joint rests.
const REST: f64 = 2e-3;

fn product(a: &[f64], b: &[f64]) -> Column {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

fn centred(column: Column) -> Column {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    column.into_iter().map(|x| x - mean).collect()
}

fn correlation(centred_column: &[f64], other: &[f64]) -> f64 {
    let other = centred(other.to_vec());
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = (dot(centred_column, centred_column) * dot(&other, &other)).sqrt();
    if size > 0.0 { dot(centred_column, &other) / size } else { 0.0 }
}

fn varies(column: &[f64]) -> bool {
    column.iter().any(|x| (x - column[0]).abs() > 1e-12 * column[0].abs())
}

/// All causes with their columns beside a base.
pub(super) fn causes(rows: &Rows, base: &Base, rigid_body: &[&str]) -> CauseColumns {
    let sign = &base.sign;
    let velocity = &rows.velocity;
    let mut all = CauseColumns::default();
    let base_has = |part: &str| rigid_body.contains(&part);

    if let Some(pressure) = rows.quantity(Quantity::Pressure) {
        let level = product(sign, &pressure);
        // Beside a level, pressure over a wrong area adds a force that does not turn with the motion.
        all.add("pressure-coulomb", vec![level.clone(), pressure.clone()]);
        all.add("pressure-coulomb", vec![level]);
        all.add("unknown", vec![centred(pressure)]);
    }
    if let Some(force) = rows.quantity(Quantity::RadialForce) {
        let size: Column = force.iter().map(|f| f.abs()).collect();
        all.add("radial-force-coulomb", vec![product(sign, &size)]);
        all.add("radial-force-rate", vec![bent(rows, base, &force)]);
        all.add("unknown", vec![centred(force)]);
    }
    if let Some(load) = rows.quantity(Quantity::LoadTorque) {
        let size: Column = load.iter().map(|l| l.abs()).collect();
        all.add("load-torque-coulomb", vec![product(sign, &size)]);
        if !base_has("load") {
            all.add("unknown", vec![centred(load)]);
        }
    }
    if let Some(temperature) = rows.quantity(Quantity::Temperature) {
        let warmer = centred(temperature);
        all.add("temperature-coulomb", vec![product(sign, &warmer)]);
        all.add("temperature-viscous", vec![product(velocity, &warmer)]);
        all.add("unknown", vec![warmer]);
    }
    for at in 0..rows.data.covariates.len() {
        let column: Column = rows.data.runs.iter().flat_map(|run| run.extra[at].clone()).collect();
        let column = centred(column);
        if correlation(&column, &rows.torque).abs() > SAME {
            continue;
        }
        all.add("unknown", vec![product(sign, &column)]);
        all.add("unknown", vec![column]);
    }

    let speed: Column = velocity.iter().map(|v| v.abs()).collect();
    let size: Column = sign.iter().map(|s| s.abs()).collect();
    all.add("direction-asymmetry", vec![size, speed.clone()]);
    if !base_has("offset") {
        all.add("torque-offset", vec![vec![1.0; velocity.len()]]);
    }
    all.add("quadratic-drag", vec![product(velocity, &speed)]);
    if !base_has("inertia") {
        all.add("unmodelled-inertia", vec![rows.acceleration()]);
    }
    all.add("channel-delay", vec![rows.derivative(sign), rows.derivative(velocity)]);
    for peak in STRIBECK {
        for exponent in EXPONENTS {
            let curve =
                |at: usize| sign[at] * (-(speed[at] / (peak * rows.speed)).powf(exponent)).exp();
            all.add("stribeck-shape", vec![rows.map(curve)]);
        }
    }
    for gap in GAPS {
        all.add("backlash", vec![rows.stop(base.travel, gap * base.travel)]);
    }
    all.add("dwell-time-static", vec![dwell(rows, base)]);

    if let Some(time) = rows.quantity(Quantity::CampaignTime) {
        all.add("time-drift", vec![product(sign, &centred(time))]);
    }
    for heat in heats(rows, sign) {
        all.add("warm-up", vec![product(sign, &heat)]);
    }
    // A slide's position has no turns.
    let turns = rows.data.joint == JointKind::Revolute;
    if let Some(angle) = rows.quantity(Quantity::Position).filter(|_| turns) {
        let wave = |of: fn(f64) -> f64, order: u32| -> Column {
            angle.iter().map(|q| of(f64::from(order) * q)).collect()
        };
        let waves: Vec<Vec<usize>> = (1..=ORDERS)
            .map(|order| all.keep([wave(f64::sin, order), wave(f64::cos, order)]))
            .collect();
        for order in 1..=ORDERS as usize {
            let level = waves[order - 1].iter().map(|wave| product(sign, &all.columns[*wave]));
            let level: Vec<Column> = level.collect();
            all.add("position-ripple", level);
            let of = |order: usize| waves.get(order - 1).into_iter().flatten().copied();
            if order > 1 {
                // Cogging seldom comes alone: its neighbours and multiples.
                let family = [order - 1, order, order + 1, 2 * order, 4 * order];
                all.causes.push(("torque-ripple", of(order).collect()));
                all.causes.push(("torque-ripple", family.into_iter().flat_map(of).collect()));
            } else if !base_has("gravity") {
                all.causes.push(("gravity-imbalance", of(1).collect()));
            }
        }
    }
    all
}

/// Deflection by a changing side load, forgotten with travel.
fn bent(rows: &Rows, base: &Base, force: &[f64]) -> Column {
    let mut column = vec![0.0; force.len()];
    for run in &rows.runs {
        let mut bent = 0.0;
        for at in run.start + 1..run.end {
            let forgotten = (-2.0 * rows.displacement[at].abs() / base.travel).exp();
            bent = bent * forgotten + force[at] - force[at - 1];
            column[at] = bent;
        }
    }
    column
}

/// The sign times the logarithm of the rest before, forgotten with travel.
fn dwell(rows: &Rows, base: &Base) -> Column {
    let mut column = vec![0.0; rows.velocity.len()];
    let forgetting = (3.0 * base.travel).max(1e-3 * rows.span);
    for (run, range) in rows.data.runs.iter().zip(&rows.runs) {
        let mut age = 0.0;
        for at in 1..run.len() {
            let row = range.start + at;
            let seconds = run.time_s[at] - run.time_s[at - 1];
            let rests = rows.velocity[row].abs() < REST * rows.speed;
            age = if rests {
                age + seconds
            } else {
                age * (-rows.displacement[row].abs() / forgetting).exp()
            };
            column[row] = base.sign[row] * f64::ln_1p(age / 0.1);
        }
    }
    column
}

/// How warm the contact is, 0 to 1, for a few ways to warm and to cool.
fn heats(rows: &Rows, sign: &[f64]) -> Vec<Column> {
    let time = rows.quantity(Quantity::CampaignTime).unwrap_or_default();
    let campaign =
        time.last().zip(time.first()).map_or(1.0, |(end, begin)| (end - begin).max(1e-9));
    let mut all = Vec::new();
    for cooling in COOLING {
        let mut heat: f64 = 0.0;
        let heats: Column = rows.map(|at| {
            if at > 0 {
                let seconds = (time[at] - time[at - 1]).max(0.0);
                heat *= (-seconds / (cooling * campaign)).exp();
            }
            heat += (sign[at] * rows.displacement[at]).abs();
            heat
        });
        let most = heats.iter().copied().fold(1e-12, f64::max);
        for warm in WARM {
            all.push(heats.iter().map(|heat| -(-heat / (warm * most)).exp_m1()).collect());
        }
    }
    all
}
