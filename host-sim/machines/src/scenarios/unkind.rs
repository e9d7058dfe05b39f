//! Worlds as unkind as real logs: sensors with weaknesses, motions that nobody planned, two plants.
//!
//! The scenarios above this module ask whether a diagnosis finds what a good log shows. These ask what it says of a
//! log as it is: an encoder's differences for a velocity, no angle, a torque behind a filter, covariates that go
//! together, a contact far stiffer than the log can resolve, an effect far below the noise. A world is drawn from its
//! seed alone ([`draw`]); half-way between physics and log stands [`SensorKind`], and [`UnkindTruth`] says not only what was
//! hidden but how plainly it could be seen at all, so that a score can be a curve over the effect's size.
//!
//! ```text
//! seed ─► campaign (plant, motions, covariates, sensors) ─► effect, sized ─► torque ─► sensors ─► log
//!                                                                 └─► visible (what a refit of the truth gains) ─► truth
//! ```

mod bristle_fit;
mod campaign;
mod effect;
mod motions;
mod plant;
mod reading;
mod sensing;
mod truth;
mod visible;

pub use sensing::SensorKind;
pub use truth::{DETECTABLE, UnkindTruth};

use super::drawn_cause::DrawnCause;
use super::hidden_cause::HiddenCause;
use super::joint::Joint;
use super::sampler::{Sampler, mixed};
use super::truth::Hidden;
use crate::friction::Seal;
use crate::log::{Log, LoggedRun};
use campaign::{Campaign, RunPlan};
use plant::{Machine, Plant, Point, Way};
use reading::{Logged, Reading, begun};
use visible::{Rows, difference, rms, visible};

/// A log and the truth behind it.
#[derive(Clone, Debug)]
pub struct UnkindWorld {
    /// What the machine logged.
    pub log: Log,
    /// What is true of it.
    pub truth: UnkindTruth,
}

/// Share of worlds in which nothing is hidden.
const CLEAN: f64 = 0.2;
/// Share of worlds whose contact is slip elements.
const SLIP_ELEMENTS: f64 = 0.4;
/// RMS an effect is scaled to, over the torque's noise: from far below to far above.
const OVER_NOISE: (f64, f64) = (0.05, 30.0);

/// The seeds of so many worlds; another base gives other worlds throughout.
pub fn seeds(base: u64) -> impl Iterator<Item = u64> {
    // Short enough to be typed again.
    (0u64..).map(move |index| mixed(mixed(base) ^ index) >> 32)
}

/// The kind of sensors a seed's world has.
pub fn sensor_kind(seed: u64) -> SensorKind {
    let kinds = SensorKind::ALL;
    kinds[(mixed(seed ^ 0x5EED) % kinds.len() as u64) as usize]
}

/// Draws a world; the same seed gives the same bits.
pub fn draw(seed: u64) -> UnkindWorld {
    let mut sampler = Sampler::new(seed, 7);
    let slips = sampler.chance(SLIP_ELEMENTS);
    let mut campaign = Campaign::draw(&mut sampler, sensor_kind(seed), slips);
    let plain = rigid(&mut sampler, &campaign);
    let clean = sampler.chance(CLEAN);
    let cause = sampler.pick(&effect::possible(&campaign)).filter(|_| !clean);
    let hidden = cause.map(|cause| effect::draw(&mut sampler, &mut campaign, cause));
    let wanted_nm = campaign.sensing.noise_nm * sampler.log_between(OVER_NOISE.0, OVER_NOISE.1);
    World { campaign, plain, seed }.made(hidden, wanted_nm)
}

/// The joint with its rigid-body parts and nothing hidden.
fn rigid(sampler: &mut Sampler, campaign: &Campaign) -> Joint {
    let mut joint = Joint::plain(campaign.seal);
    let level = campaign.seal.coulomb_nm;
    for part in &campaign.rigid_body {
        let torque_nm = level * sampler.log_between(0.1, 3.0);
        match *part {
            "inertia" => joint.inertia = torque_nm / campaign.drive.steepest_rad_s2,
            "gravity" => {
                let phase = sampler.between(0.0, std::f64::consts::TAU);
                joint.gravity = Some(super::joint::Wave { size: torque_nm, order: 1.0, phase });
            }
            "load" => joint.load_gain = sampler.between(0.2, 1.2),
            _ => joint.offset_nm = sampler.sign() * torque_nm,
        }
    }
    joint
}

/// A world on its way.
struct World {
    campaign: Campaign,
    plain: Joint,
    seed: u64,
}

impl World {
    /// The torque each row would show if its sensor had no noise, Nm.
    fn torques(&self, machine: &Machine, ways: &[Way]) -> Rows {
        let Campaign { sensing, runs, .. } = &self.campaign;
        let inputs = runs.iter().zip(ways).map(|(run, way)| (&run.condition, way, run.held));
        let torques = machine.torques(inputs);
        let read = torques
            .iter()
            .zip(runs)
            .map(|(torque, run)| sensing.torque_channel(&run.times, torque));
        read.collect()
    }

    /// The plant as it truly is, with a joint.
    fn truly<'a>(&'a self, joint: &'a Joint) -> Machine<'a> {
        Machine { plant: &self.campaign.plant, joint, covariate_hz: None }
    }

    /// The true ways; the torque of a joint with a delay is of an earlier time.
    fn ways(&self, delay_s: f64) -> Vec<Way> {
        if delay_s == 0.0 {
            return self.campaign.ways();
        }
        let mut late = self.campaign.clone();
        for run in &mut late.runs {
            run.times.iter_mut().for_each(|t| *t = (*t - delay_s).max(0.0));
        }
        late.ways()
    }

    /// Sizes the effect, simulates, measures how plainly it shows, and logs.
    fn made(self, hidden: Option<DrawnCause>, wanted_nm: f64) -> UnkindWorld {
        let ways = self.ways(0.0);
        let without = self.torques(&self.truly(&self.plain), &ways);
        let acting = |hidden: &DrawnCause| {
            let mut joint = self.plain.clone();
            hidden.act_on(&mut joint);
            joint
        };
        let simulated = |joint: &Joint| {
            if joint.delay_s == 0.0 {
                self.torques(&self.truly(joint), &ways)
            } else {
                self.torques(&self.truly(joint), &self.ways(joint.delay_s))
            }
        };
        let (mut hidden, mut joint, mut torque) = (hidden, self.plain.clone(), without.clone());
        if let Some(hidden) = &mut hidden {
            let (least, most) = effect::limits(hidden, &self.campaign);
            torque = simulated(&acting(hidden));
            for _ in 0..3 {
                let seen_nm = rms(&difference(&torque, &without));
                let close = (seen_nm / wanted_nm - 1.0).abs() < 0.15;
                if close || seen_nm <= 0.0 || !hidden.scales() {
                    break;
                }
                let next = (hidden.size.abs() * wanted_nm / seen_nm).clamp(least, most);
                if next == hidden.size.abs() {
                    break;
                }
                hidden.size = next.copysign(hidden.size);
                torque = simulated(&acting(hidden));
            }
            joint = acting(hidden);
        }
        let logged: Vec<Logged> = self
            .campaign
            .runs
            .iter()
            .zip(&ways)
            .zip(&torque)
            .map(|((run, way), torque)| self.logged(run, way, torque))
            .collect();
        // What a law with one state could do on slip elements: bristles fitted to them, effect included.
        let seal = match self.campaign.plant {
            Plant::Bristles => self.campaign.seal,
            Plant::SlipElements { .. } => {
                let late = self.ways(joint.delay_s);
                bristle_fit::fitted(&self.campaign, &joint, &late, &torque)
            }
        };
        let joint = Joint { seal: with_effect(seal, &joint.seal), ..joint };
        let plain = Joint { seal, ..self.plain.clone() };
        let bristles = |joint: &Joint, ways: &[Way]| self.torques(&Machine::bristles(joint), ways);
        let effect = if joint.delay_s == 0.0 {
            difference(&bristles(&joint, &ways), &bristles(&plain, &ways))
        } else {
            difference(&bristles(&joint, &self.ways(joint.delay_s)), &bristles(&plain, &ways))
        };
        let shown = difference(&torque, &without);
        let errors = self.floor(&joint, &ways, &logged);
        let base = self.base_columns(&plain, &ways);
        let kept = |rows: &Rows| -> Rows {
            let run = |(rows, run): (&Vec<f64>, &RunPlan)| keep(rows, run);
            rows.iter().zip(&self.campaign.runs).map(run).collect()
        };
        let errors = kept(&errors);
        let floor_nm = rms(&errors);
        let (effect, shown) = (kept(&effect), kept(&shown));
        let base: Vec<Rows> = base.iter().map(&kept).collect();
        let seen = visible(&effect, &base, &errors);
        let log = self.log(&logged);
        let truth = self.truth(hidden.as_ref(), &shown);
        UnkindWorld {
            log,
            truth: UnkindTruth {
                effect_in_floors: seen.rms_nm / floor_nm,
                gain_in_errors: seen.gain_in_errors,
                floor_nm,
                floor_errors: errors,
                torque: kept(&torque),
                ..truth
            },
        }
    }

    /// What a refit of the plant can do without the effect: its torque's derivatives, run by run.
    fn base_columns(&self, plain: &Joint, ways: &[Way]) -> Vec<Rows> {
        /// Relative change of a parameter for a difference quotient.
        const STEP: f64 = 0.02;
        let without = self.torques(&Machine::bristles(plain), ways);
        let changed = |change: &dyn Fn(&mut Joint)| {
            let mut joint = plain.clone();
            change(&mut joint);
            difference(&self.torques(&Machine::bristles(&joint), ways), &without)
        };
        let mut columns = vec![
            changed(&|joint| joint.seal.coulomb_nm *= 1.0 + STEP),
            changed(&|joint| joint.seal.static_nm *= 1.0 + STEP),
            changed(&|joint| joint.seal.stribeck_rad_s *= 1.0 + STEP),
            changed(&|joint| joint.seal.k0 *= 1.0 + STEP),
            changed(&|joint| joint.seal.k2 *= 1.0 + STEP),
            changed(&|joint| joint.seal.k1 += STEP * (joint.seal.k1 + 1e-3 * joint.seal.k0)),
        ];
        let level = self.campaign.seal.coulomb_nm;
        for part in &self.campaign.rigid_body {
            match *part {
                "inertia" => columns.push(changed(&|joint| joint.inertia += level)),
                "load" => columns.push(changed(&|joint| joint.load_gain += 1.0)),
                "offset" => columns.push(changed(&|joint| joint.offset_nm += level)),
                _ => {
                    for phase in [0.0, 0.25 * std::f64::consts::TAU] {
                        let wave = super::joint::Wave { size: level, order: 1.0, phase };
                        columns.push(changed(&|joint| joint.torque_ripple.push(wave)));
                    }
                }
            }
        }
        columns
    }

    /// Logged torque less that of bristles with the effect, driven by the best of a few plain readings of the log.
    fn floor(&self, joint: &Joint, ways: &[Way], logged: &[Logged]) -> Rows {
        let sensing = &self.campaign.sensing;
        let machine = Machine { covariate_hz: sensing.covariate_hz, ..Machine::bristles(joint) };
        let errors = |ways: &[Way]| -> Rows {
            let Campaign { runs, .. } = &self.campaign;
            let begun: Vec<(Way, f64)> = runs
                .iter()
                .zip(ways)
                .zip(logged)
                .map(|((run, way), logged)| {
                    begun(&machine, run, way, logged, |torque| {
                        sensing.torque_channel(&run.times[..torque.len()], torque)
                    })
                })
                .collect();
            let inputs =
                runs.iter().zip(&begun).map(|(run, (way, held))| (&run.condition, way, *held));
            let torques = machine.torques(inputs);
            let run = |((torque, run), logged): ((Vec<f64>, &RunPlan), &Logged)| {
                let read = sensing.torque_channel(&run.times, &torque);
                logged.torque.iter().zip(read).map(|(logged, model)| logged - model).collect()
            };
            torques.into_iter().zip(runs).zip(logged).map(run).collect()
        };
        if joint.delay_s != 0.0 || sensing.kind == SensorKind::Exact {
            // Read from the true motion: nothing about it is uncertain.
            return errors(&self.ways(joint.delay_s));
        }
        let runs = || self.campaign.runs.iter().zip(ways).zip(logged);
        let delay_s = sensing.velocity_delay_s(self.campaign.rate_hz);
        let readings = [1, 5, 15]
            .into_iter()
            .flat_map(|smooth| [true, false].map(|angle| Reading { angle, smooth, delay_s }));
        let possible = readings.filter(|reading| !reading.angle || sensing.has_position());
        let tried = possible.map(|reading| {
            let ways: Vec<Way> =
                runs().map(|((run, way), logged)| reading.way(run, way, logged)).collect();
            errors(&ways)
        });
        tried.min_by(|a, b| rms(a).total_cmp(&rms(b))).unwrap_or_default()
    }

    /// What the sensors of a run show.
    fn logged(&self, run: &RunPlan, way: &Way, torque: &[f64]) -> Logged {
        let sensing = &self.campaign.sensing;
        let mut sampler = Sampler::new(run.seed, 1);
        let at: Vec<&Point> = way.rows.iter().map(|row| &way.points[*row]).collect();
        let angles: Vec<f64> = at.iter().map(|point| point.angle).collect();
        let velocities: Vec<f64> = at.iter().map(|point| point.velocity).collect();
        let mut noise = Sampler::new(run.seed, 2);
        // The channel has been applied to the torque already; its noise has not.
        let torque = sensing.with_noise(&mut noise, &run.times, torque);
        Logged {
            position: sensing.angles(&run.times, &angles),
            velocity: sensing.velocities(&mut sampler, &run.times, &angles, &velocities),
            torque,
        }
    }

    fn log(&self, logged: &[Logged]) -> Log {
        let Campaign { sensing, columns, extras, .. } = &self.campaign;
        let mut names = vec!["time_s", "velocity_rad_s", "torque_nm"];
        if sensing.has_position() {
            names.push("position_rad");
        }
        names.extend(columns);
        names.extend(extras.iter().map(|extra| extra.column()));
        let rounded =
            |values: Vec<f64>| -> Vec<f64> { values.into_iter().map(significant).collect() };
        let runs =
            self.campaign.runs.iter().zip(logged).enumerate().map(|(index, (run, logged))| {
                let condition = &run.condition;
                let accelerations =
                    || run.times.iter().map(|t| run.motion.at(*t).acceleration).collect();
                let column = |name: &str| -> Vec<f64> {
                    let read = |of: &dyn Fn(f64) -> f64| sensing.covariate(&run.times, of);
                    match name {
                        "time_s" => run.times.iter().map(|t| condition.start_s + t).collect(),
                        "velocity_rad_s" => logged.velocity.clone(),
                        "torque_nm" => logged.torque.clone(),
                        "position_rad" => logged.position.clone(),
                        "acceleration_rad_s2" => accelerations(),
                        "radial_force_n" => read(&|t| condition.force.at(t)),
                        "pressure_diff_pa" => read(&|t| condition.pressure.at(t)),
                        "temperature_c" => read(&|t| condition.temperature.at(t)),
                        "load_torque_nm" => read(&|t| condition.load.at(t)),
                        _ => {
                            let own =
                                condition.extras.iter().find(|(extra, _)| extra.column() == name);
                            let signal = own.map(|(_, signal)| *signal).unwrap_or_default();
                            read(&|t| signal.at(t))
                        }
                    }
                };
                let columns = names.iter().map(|name| {
                    let values = keep(&column(name), run);
                    if *name == "time_s" { times(values) } else { rounded(values) }
                });
                LoggedRun { name: index.to_string(), columns: columns.collect() }
            });
        let runs = runs.collect();
        Log { columns: names.into_iter().map(str::to_owned).collect(), runs }
    }

    fn truth(&self, hidden: Option<&DrawnCause>, effect: &Rows) -> UnkindTruth {
        let Campaign { sensing, plant, rigid_body, rate_hz, drive, correlation, runs, .. } =
            &self.campaign;
        let periodic =
            |cause| matches!(cause, HiddenCause::PositionRipple | HiddenCause::TorqueRipple);
        let hidden = hidden.map(|hidden| Hidden {
            cause: hidden.effect.name(),
            columns: hidden.columns(),
            size: hidden.size,
            unit: hidden.unit(),
            order: periodic(hidden.effect).then_some(hidden.order),
            visible_rms_nm: rms(effect),
            details: hidden.details(),
            in_words: hidden.words(),
        });
        let plant = if matches!(plant, Plant::Bristles) { "bristles" } else { "slip-elements" };
        let what = hidden.as_ref().map_or("nothing hidden", |hidden| hidden.in_words.as_str());
        let description = format!(
            "{what}; {plant}, {} runs of {:.1} s at {rate_hz} Hz, presliding {:.1e} rad, top {:.1} rad/s, {}",
            runs.len(),
            drive.seconds,
            drive.travel_rad,
            drive.top_rad_s,
            sensing.words()
        );
        UnkindTruth {
            seed: self.seed,
            sensor: sensing.kind,
            plant,
            hidden,
            rigid_body: rigid_body.clone(),
            true_of_the_log: sensing.true_of_the_log(),
            effect_in_floors: 0.0,
            gain_in_errors: 0.0,
            floor_nm: 0.0,
            floor_errors: Rows::new(),
            torque: Rows::new(),
            noise_nm: sensing.noise_nm,
            rate_hz: *rate_hz,
            travel_rad: drive.travel_rad,
            correlation: *correlation,
            description,
        }
    }
}

/// The rows of a run that were not lost.
fn keep(rows: &[f64], run: &RunPlan) -> Vec<f64> {
    let there = |at: &usize| !run.lost.iter().any(|lost| lost.contains(at));
    (0..rows.len()).filter(there).map(|at| rows[at]).collect()
}

/// Nine significant digits: what is in the file is what is in memory.
fn significant(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10f64.powi(8 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale + 0.0
}

/// Microseconds.
fn times(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|t| (t * 1e6).round() / 1e6).collect()
}

/// A seal with what is hidden in another.
fn with_effect(seal: Seal, hidden: &Seal) -> Seal {
    Seal {
        per_pressure: hidden.per_pressure,
        per_force: hidden.per_force,
        eta3: hidden.eta3,
        ..seal
    }
}
