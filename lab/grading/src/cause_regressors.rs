//! Regressors of each cause for the reference regression, as an engineer would choose them in an afternoon.

use super::regressors::{BaseModel, LongData, Regressor};
use compensator_core::TermKind;
use joint_log::{JointKind, Quantity};

/// Regressors, and the causes that use them.
#[derive(Default)]
pub(super) struct CauseRegressors {
    pub regressors: Vec<Regressor>,
    /// Name of each cause, and indices of its regressors.
    pub causes: Vec<(&'static str, Vec<usize>)>,
}

impl CauseRegressors {
    /// Adds a cause with regressors of its own if all of them vary; only an offset may be constant.
    fn add(&mut self, name: &'static str, regressors: Vec<Regressor>) {
        if regressors.iter().all(|regressor| varies(regressor) || name == "torque-offset") {
            let places = self.keep(regressors);
            self.causes.push((name, places));
        }
    }

    fn keep(&mut self, regressors: impl IntoIterator<Item = Regressor>) -> Vec<usize> {
        let first = self.regressors.len();
        self.regressors.extend(regressors);
        (first..self.regressors.len()).collect()
    }
}

/// Highest order of a ripple, per turn.
const MAX_RIPPLE_ORDER: u32 = 60;
/// Gaps of backlash, relative to the base's travel; smaller gaps only change the shape of the elastic sign.
const BACKLASH_GAPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Exponents of a Stribeck curve other than 2, and its velocities relative to the typical speed.
const STRIBECK_EXPONENTS: [f64; 3] = [0.5, 1.0, 4.0];
const STRIBECK_VELOCITIES: [f64; 3] = [0.01, 0.05, 0.2];
/// Cooling times, relative to the campaign, and warm-up heats, relative to the largest heat.
const COOLING_TIMES: [f64; 2] = [0.3, f64::INFINITY];
const WARM_HEATS: [f64; 1] = [0.4];
/// Correlation with the torque above which a covariate is the torque itself in another unit.
const MAX_TORQUE_CORRELATION: f64 = 0.98;
/// Share of the typical speed below which a joint is at rest.
const REST_SPEED_SHARE: f64 = 2e-3;

fn product(a: &[f64], b: &[f64]) -> Regressor {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

fn centred(column: Regressor) -> Regressor {
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

/// Returns all causes with their regressors beside a base.
pub(super) fn cause_regressors(
    data: &LongData,
    base: &BaseModel,
    rigid_body: &[TermKind],
) -> CauseRegressors {
    let mut causes = CauseRegressors::default();
    causes.add_load_causes(data, base, rigid_body);
    causes.add_temperature_causes(data, base);
    causes.add_covariate_causes(data, base);
    causes.add_motion_causes(data, base, rigid_body);
    causes.add_shape_causes(data, base);
    causes.add_history_causes(data, base);
    causes.add_angle_causes(data, base, rigid_body);
    causes
}

impl CauseRegressors {
    /// Adds the causes of pressure, side load and transmitted torque.
    fn add_load_causes(&mut self, data: &LongData, base: &BaseModel, rigid_body: &[TermKind]) {
        let sign = &base.sign;
        if let Some(pressure) = data.quantity(Quantity::Pressure) {
            let level = product(sign, &pressure);
            // Besides the level, pressure over the wrong area adds a force that does not change sign with the motion.
            self.add("pressure-coulomb", vec![level.clone(), pressure.clone()]);
            self.add("pressure-coulomb", vec![level]);
            self.add("unknown", vec![centred(pressure)]);
        }
        if let Some(force) = data.quantity(Quantity::RadialForce) {
            let size: Regressor = force.iter().map(|f| f.abs()).collect();
            self.add("radial-force-coulomb", vec![product(sign, &size)]);
            self.add("radial-force-rate", vec![side_load_deflection(data, base, &force)]);
            self.add("unknown", vec![centred(force)]);
        }
        if let Some(load) = data.quantity(Quantity::LoadTorque) {
            let size: Regressor = load.iter().map(|l| l.abs()).collect();
            self.add("load-torque-coulomb", vec![product(sign, &size)]);
            if !rigid_body.contains(&TermKind::LoadGain) {
                self.add("unknown", vec![centred(load)]);
            }
        }
    }

    fn add_temperature_causes(&mut self, data: &LongData, base: &BaseModel) {
        if let Some(temperature) = data.quantity(Quantity::Temperature) {
            let warmer = centred(temperature);
            self.add("temperature-coulomb", vec![product(&base.sign, &warmer)]);
            self.add("temperature-viscous", vec![product(&data.velocity, &warmer)]);
            self.add("unknown", vec![warmer]);
        }
    }

    /// Adds `unknown` for every covariate that is not the torque in another unit.
    fn add_covariate_causes(&mut self, data: &LongData, base: &BaseModel) {
        for at in 0..data.data.covariates.len() {
            let covariate: Regressor =
                data.data.runs.iter().flat_map(|run| run.extra[at].clone()).collect();
            let covariate = centred(covariate);
            if correlation(&covariate, &data.torque).abs() > MAX_TORQUE_CORRELATION {
                continue;
            }
            self.add("unknown", vec![product(&base.sign, &covariate)]);
            self.add("unknown", vec![covariate]);
        }
    }

    /// Adds the causes of direction, offset, speed, acceleration and delay.
    fn add_motion_causes(&mut self, data: &LongData, base: &BaseModel, rigid_body: &[TermKind]) {
        let (sign, velocity) = (&base.sign, &data.velocity);
        let speed: Regressor = velocity.iter().map(|v| v.abs()).collect();
        let size: Regressor = sign.iter().map(|s| s.abs()).collect();
        self.add("direction-asymmetry", vec![size, speed.clone()]);
        if !rigid_body.contains(&TermKind::TorqueOffset) {
            self.add("torque-offset", vec![vec![1.0; velocity.len()]]);
        }
        self.add("quadratic-drag", vec![product(velocity, &speed)]);
        if !rigid_body.contains(&TermKind::UnmodelledInertia) {
            self.add("unmodelled-inertia", vec![data.acceleration()]);
        }
        self.add("channel-delay", vec![data.derivative(sign), data.derivative(velocity)]);
    }

    /// Adds the causes that change the shape of the friction curve or of a reversal.
    fn add_shape_causes(&mut self, data: &LongData, base: &BaseModel) {
        let speed: Regressor = data.velocity.iter().map(|v| v.abs()).collect();
        for peak in STRIBECK_VELOCITIES {
            for exponent in STRIBECK_EXPONENTS {
                let curve = |at: usize| {
                    base.sign[at] * (-(speed[at] / (peak * data.speed)).powf(exponent)).exp()
                };
                self.add("stribeck-shape", vec![data.map(curve)]);
            }
        }
        for gap in BACKLASH_GAPS {
            self.add("backlash", vec![data.stop(base.travel, gap * base.travel)]);
        }
    }

    /// Adds the causes of rest, campaign time and heat.
    fn add_history_causes(&mut self, data: &LongData, base: &BaseModel) {
        self.add("dwell-time-static", vec![dwell(data, base)]);
        if let Some(time) = data.quantity(Quantity::CampaignTime) {
            self.add("time-drift", vec![product(&base.sign, &centred(time))]);
        }
        for heat in heats(data, &base.sign) {
            self.add("warm-up", vec![product(&base.sign, &heat)]);
        }
    }

    /// Adds the causes that follow the angle of a revolute joint.
    fn add_angle_causes(&mut self, data: &LongData, base: &BaseModel, rigid_body: &[TermKind]) {
        let is_revolute = data.data.joint == JointKind::Revolute;
        let angle = data.quantity(Quantity::Position).filter(|_| is_revolute);
        let Some(angle) = angle else { return };
        let wave = |of: fn(f64) -> f64, order: u32| -> Regressor {
            angle.iter().map(|q| of(f64::from(order) * q)).collect()
        };
        let waves: Vec<Vec<usize>> = (1..=MAX_RIPPLE_ORDER)
            .map(|order| self.keep([wave(f64::sin, order), wave(f64::cos, order)]))
            .collect();
        for order in 1..=MAX_RIPPLE_ORDER as usize {
            let level =
                waves[order - 1].iter().map(|wave| product(&base.sign, &self.regressors[*wave]));
            let level: Vec<Regressor> = level.collect();
            self.add("position-ripple", level);
            let of = |order: usize| waves.get(order - 1).into_iter().flatten().copied();
            if order > 1 {
                // Cogging seldom has one order: its neighbours and multiples are tried with it.
                let family = [order - 1, order, order + 1, 2 * order, 4 * order];
                self.causes.push(("torque-ripple", of(order).collect()));
                self.causes.push(("torque-ripple", family.into_iter().flat_map(of).collect()));
            } else if !rigid_body.contains(&TermKind::GravityImbalance) {
                self.causes.push(("gravity-imbalance", of(1).collect()));
            }
        }
    }
}

/// Returns the deflection by a changing side load, which decays with travel.
fn side_load_deflection(rows: &LongData, base: &BaseModel, force: &[f64]) -> Regressor {
    let mut column = vec![0.0; force.len()];
    for run in &rows.runs {
        let mut deflection = 0.0;
        for at in run.start + 1..run.end {
            let decay = (-2.0 * rows.displacement[at].abs() / base.travel).exp();
            deflection = deflection * decay + force[at] - force[at - 1];
            column[at] = deflection;
        }
    }
    column
}

/// Returns the sign times the logarithm of the preceding rest time, which decays with travel.
fn dwell(rows: &LongData, base: &BaseModel) -> Regressor {
    let mut column = vec![0.0; rows.velocity.len()];
    let decay_travel = (3.0 * base.travel).max(1e-3 * rows.span);
    for (run, range) in rows.data.runs.iter().zip(&rows.runs) {
        let mut age = 0.0;
        for at in 1..run.len() {
            let row = range.start + at;
            let seconds = run.time_s[at] - run.time_s[at - 1];
            let is_at_rest = rows.velocity[row].abs() < REST_SPEED_SHARE * rows.speed;
            age = if is_at_rest {
                age + seconds
            } else {
                age * (-rows.displacement[row].abs() / decay_travel).exp()
            };
            column[row] = base.sign[row] * f64::ln_1p(age / 0.1);
        }
    }
    column
}

/// Returns the warmth of the contact, from 0 to 1, for several ways of warming and cooling.
fn heats(rows: &LongData, sign: &[f64]) -> Vec<Regressor> {
    let time = rows.quantity(Quantity::CampaignTime).unwrap_or_default();
    let campaign =
        time.last().zip(time.first()).map_or(1.0, |(end, begin)| (end - begin).max(1e-9));
    let mut all = Vec::new();
    for cooling in COOLING_TIMES {
        let mut heat: f64 = 0.0;
        let heats: Regressor = rows.map(|at| {
            if at > 0 {
                let seconds = (time[at] - time[at - 1]).max(0.0);
                heat *= (-seconds / (cooling * campaign)).exp();
            }
            heat += (sign[at] * rows.displacement[at]).abs();
            heat
        });
        let most = heats.iter().copied().fold(1e-12, f64::max);
        for warm in WARM_HEATS {
            all.push(heats.iter().map(|heat| -(-heat / (warm * most)).exp_m1()).collect());
        }
    }
    all
}
