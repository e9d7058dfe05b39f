//! Adverse worlds: simulated logs with imperfect sensors, unplanned motions and different plants.
//!
//! The scenarios of [`simulated_machines::scenarios`] test whether a diagnosis finds an effect in a well-planned log.
//! These worlds test it on logs with the defects of field data: a velocity differentiated
//! from an encoder, no angle, a low-pass filtered torque, correlated covariates, a contact stiffer than
//! the log can resolve, or an effect far below the noise.
//!
//! [`draw`] creates a world from its seed alone. [`draw_family`] also creates worlds with a plant and sensors that no
//! calibration may use ([`Family::LubricatedSeal`]). [`SensorKind`] selects the sensor defect.
//! [`UnkindTruth`] holds the hidden effect and its detectability, so that a score can be plotted over
//! the effect's size.
//!
//! ```text
//! seed ─► campaign (plant, motions, covariates, sensors) ─► scaled effect ─► torque ─► sensors ─► log
//!                                                                 └─► visible (gain of a refit with the true structure) ─► truth
//! ```

mod bristle_fit;
mod campaign;
mod devices;
mod effect;
mod family;
mod lubricated;
#[cfg(test)]
mod lubricated_tests;
mod motions;
mod plant;
mod reading;
mod sensing;
mod truth;
mod visible;

pub use family::Family;
pub use sensing::SensorKind;
pub use truth::{MIN_DETECTABLE_GAIN, UnkindTruth};

use campaign::{Campaign, RunPlan};
use plant::{Machine, Plant, Point, Trajectory};
use reading::{Logged, Reading, estimate_start};
use simulated_machines::friction::Seal;
use simulated_machines::scenarios::Hidden;
use simulated_machines::scenarios::HiddenCause;
use simulated_machines::scenarios::drawn_cause::DrawnCause;
use simulated_machines::scenarios::joint::Joint;
use simulated_machines::scenarios::sampler::{Sampler, mixed};
use simulated_machines::{Log, LoggedRun};
use visible::{Rows, difference, evaluate_visibility, rms};

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct UnkindWorld {
    /// The log of the machine.
    pub log: Log,
    /// The ground truth of the log.
    pub truth: UnkindTruth,
}

/// Share of worlds without a hidden effect.
const CLEAN_SHARE: f64 = 0.2;
/// Range of the effect's target RMS, as a multiple of the torque noise. It extends from far below to far above
/// the noise.
const EFFECT_TO_NOISE: (f64, f64) = (0.05, 30.0);

/// Returns an endless sequence of world seeds. Different bases give different sequences.
pub fn seeds(base: u64) -> impl Iterator<Item = u64> {
    // 32 bits, so that a seed is short enough to be typed.
    (0u64..).map(move |index| mixed(mixed(base) ^ index) >> 32)
}

/// Returns the sensor kind of the world with this seed.
pub fn sensor_kind(seed: u64) -> SensorKind {
    let kinds = SensorKind::ALL;
    kinds[(mixed(seed ^ 0x5EED) % kinds.len() as u64) as usize]
}

/// Draws a world of the training family. The same seed gives bit-identical results.
pub fn draw(seed: u64) -> UnkindWorld {
    draw_family(seed, Family::Training)
}

/// Draws a world of a family. The same seed and family give bit-identical results.
pub fn draw_family(seed: u64, family: Family) -> UnkindWorld {
    let mut sampler = family.sampler(seed);
    let plant = family.draw_plant_kind(&mut sampler);
    let mut campaign = Campaign::draw(&mut sampler, sensor_kind(seed), plant);
    let plain = draw_rigid_joint(&mut sampler, &campaign);
    let clean = sampler.chance(CLEAN_SHARE);
    let cause = sampler.pick(&effect::possible(&campaign)).filter(|_| !clean);
    let hidden = cause.map(|cause| effect::draw(&mut sampler, &mut campaign, cause));
    let target_nm =
        campaign.sensing.noise_nm * sampler.log_between(EFFECT_TO_NOISE.0, EFFECT_TO_NOISE.1);
    World { campaign, plain, seed }.simulate(hidden, target_nm)
}

/// Draws the joint with its rigid-body parts and without a hidden effect.
fn draw_rigid_joint(sampler: &mut Sampler, campaign: &Campaign) -> Joint {
    let mut joint = Joint::plain(campaign.seal);
    let level = campaign.seal.coulomb_nm;
    for part in &campaign.rigid_body {
        let torque_nm = level * sampler.log_between(0.1, 3.0);
        match *part {
            "inertia" => joint.inertia = torque_nm / campaign.drive.steepest_rad_s2,
            "gravity" => {
                let phase = sampler.between(0.0, std::f64::consts::TAU);
                joint.gravity = Some(simulated_machines::scenarios::joint::Wave {
                    size: torque_nm,
                    order: 1.0,
                    phase,
                });
            }
            "load" => joint.load_gain = sampler.between(0.2, 1.2),
            _ => joint.offset_nm = sampler.sign() * torque_nm,
        }
    }
    joint
}

/// A drawn world before its simulation.
struct World {
    campaign: Campaign,
    plain: Joint,
    seed: u64,
}

impl World {
    /// Returns the torque of each row after the sensor channel and without noise, Nm.
    fn torques(&self, machine: &Machine, trajectories: &[Trajectory]) -> Rows {
        let Campaign { sensing, runs, .. } = &self.campaign;
        let inputs = runs
            .iter()
            .zip(trajectories)
            .map(|(run, trajectory)| (&run.condition, trajectory, run.held));
        let torques = machine.torques(inputs);
        let read = torques
            .iter()
            .zip(runs)
            .map(|(torque, run)| sensing.torque_channel(&run.times, torque));
        read.collect()
    }

    /// Returns the true plant with the given joint.
    fn true_machine<'a>(&'a self, joint: &'a Joint) -> Machine<'a> {
        Machine { plant: &self.campaign.plant, joint, covariate_hz: None }
    }

    /// Returns the true trajectories. With a delay, each row refers to the state `delay_s` earlier.
    fn trajectories(&self, delay_s: f64) -> Vec<Trajectory> {
        if delay_s == 0.0 {
            return self.campaign.trajectories();
        }
        let mut late = self.campaign.clone();
        for run in &mut late.runs {
            run.times.iter_mut().for_each(|t| *t = (*t - delay_s).max(0.0));
        }
        late.trajectories()
    }

    /// Scales the hidden effect so that it changes the torque by about `target_nm` RMS.
    ///
    /// Returns the scaled effect, the joint with it, and the torque of that joint, Nm. `without` is the torque of
    /// the joint without the effect.
    fn scale_effect(
        &self,
        hidden: Option<DrawnCause>,
        target_nm: f64,
        trajectories: &[Trajectory],
        without: &Rows,
    ) -> (Option<DrawnCause>, Joint, Rows) {
        let acting = |hidden: &DrawnCause| {
            let mut joint = self.plain.clone();
            hidden.apply_to(&mut joint);
            joint
        };
        let simulated = |joint: &Joint| {
            if joint.delay_s == 0.0 {
                self.torques(&self.true_machine(joint), trajectories)
            } else {
                self.torques(&self.true_machine(joint), &self.trajectories(joint.delay_s))
            }
        };
        let (mut hidden, mut joint, mut torque) = (hidden, self.plain.clone(), without.clone());
        if let Some(hidden) = &mut hidden {
            let (least, most) = effect::limits(hidden, &self.campaign);
            torque = simulated(&acting(hidden));
            for _ in 0..3 {
                let seen_nm = rms(&difference(&torque, without));
                let close = (seen_nm / target_nm - 1.0).abs() < 0.15;
                if close || seen_nm <= 0.0 || !hidden.is_scalable() {
                    break;
                }
                let next = (hidden.size.abs() * target_nm / seen_nm).clamp(least, most);
                if next == hidden.size.abs() {
                    break;
                }
                hidden.size = next.copysign(hidden.size);
                torque = simulated(&acting(hidden));
            }
            joint = acting(hidden);
        }
        (hidden, joint, torque)
    }

    /// Scales the effect, simulates the torque, determines the detectability, and creates the log.
    fn simulate(self, hidden: Option<DrawnCause>, target_nm: f64) -> UnkindWorld {
        let trajectories = self.trajectories(0.0);
        let without = self.torques(&self.true_machine(&self.plain), &trajectories);
        let (hidden, joint, torque) = self.scale_effect(hidden, target_nm, &trajectories, &without);
        let logged: Vec<Logged> = self
            .campaign
            .runs
            .iter()
            .zip(&trajectories)
            .zip(&torque)
            .map(|((run, trajectory), torque)| self.log_run(run, trajectory, torque))
            .collect();
        // Bristles fitted to the other plants, effect included: the best result of a law with one state.
        let seal = match self.campaign.plant {
            Plant::Bristles => self.campaign.seal,
            Plant::SlipElements { .. } | Plant::LubricatedSeal(_) => {
                let late = self.trajectories(joint.delay_s);
                bristle_fit::fit(&self.campaign, &joint, &late, &torque)
            }
        };
        let joint = Joint { seal: with_effect(seal, &joint.seal), ..joint };
        let plain = Joint { seal, ..self.plain.clone() };
        let bristles = |joint: &Joint, trajectories: &[Trajectory]| {
            self.torques(&Machine::bristles(joint), trajectories)
        };
        let effect = if joint.delay_s == 0.0 {
            difference(&bristles(&joint, &trajectories), &bristles(&plain, &trajectories))
        } else {
            difference(
                &bristles(&joint, &self.trajectories(joint.delay_s)),
                &bristles(&plain, &trajectories),
            )
        };
        let visible_torque = difference(&torque, &without);
        let errors = self.floor(&joint, &trajectories, &logged);
        let base = self.base_columns(&plain, &trajectories);
        let kept = |rows: &Rows| -> Rows {
            let run = |(rows, run): (&Vec<f64>, &RunPlan)| keep(rows, run);
            rows.iter().zip(&self.campaign.runs).map(run).collect()
        };
        let errors = kept(&errors);
        let floor_nm = rms(&errors);
        let (effect, visible_torque) = (kept(&effect), kept(&visible_torque));
        let base: Vec<Rows> = base.iter().map(&kept).collect();
        let visible = evaluate_visibility(&effect, &base, &errors);
        let log = self.log(&logged);
        let truth = self.truth(hidden.as_ref(), &visible_torque);
        UnkindWorld {
            log,
            truth: UnkindTruth {
                effect_in_floors: visible.rms_nm / floor_nm,
                gain_in_errors: visible.gain_in_errors,
                floor_nm,
                floor_errors: errors,
                torque: kept(&torque),
                ..truth
            },
        }
    }

    /// Returns the derivatives of the plant's torque by its parameters, run by run.
    ///
    /// They span what a refit without the effect can explain.
    fn base_columns(&self, plain: &Joint, trajectories: &[Trajectory]) -> Vec<Rows> {
        /// Relative change of a parameter in a difference quotient.
        const RELATIVE_STEP: f64 = 0.02;
        let without = self.torques(&Machine::bristles(plain), trajectories);
        let changed = |change: &dyn Fn(&mut Joint)| {
            let mut joint = plain.clone();
            change(&mut joint);
            difference(&self.torques(&Machine::bristles(&joint), trajectories), &without)
        };
        let mut columns = vec![
            changed(&|joint| joint.seal.coulomb_nm *= 1.0 + RELATIVE_STEP),
            changed(&|joint| joint.seal.static_nm *= 1.0 + RELATIVE_STEP),
            changed(&|joint| joint.seal.stribeck_rad_s *= 1.0 + RELATIVE_STEP),
            changed(&|joint| joint.seal.k0 *= 1.0 + RELATIVE_STEP),
            changed(&|joint| joint.seal.k2 *= 1.0 + RELATIVE_STEP),
            changed(&|joint| {
                joint.seal.k1 += RELATIVE_STEP * (joint.seal.k1 + 1e-3 * joint.seal.k0)
            }),
        ];
        let level = self.campaign.seal.coulomb_nm;
        for part in &self.campaign.rigid_body {
            match *part {
                "inertia" => columns.push(changed(&|joint| joint.inertia += level)),
                "load" => columns.push(changed(&|joint| joint.load_gain += 1.0)),
                "offset" => columns.push(changed(&|joint| joint.offset_nm += level)),
                _ => {
                    for phase in [0.0, 0.25 * std::f64::consts::TAU] {
                        let wave = simulated_machines::scenarios::joint::Wave {
                            size: level,
                            order: 1.0,
                            phase,
                        };
                        columns.push(changed(&|joint| joint.torque_ripple.push(wave)));
                    }
                }
            }
        }
        columns
    }

    /// Returns the logged torque minus the torque of bristles with the effect, Nm.
    ///
    /// The motion is the best of several simple reconstructions from the log.
    fn floor(&self, joint: &Joint, trajectories: &[Trajectory], logged: &[Logged]) -> Rows {
        let sensing = &self.campaign.sensing;
        let machine = Machine { covariate_hz: sensing.covariate_hz, ..Machine::bristles(joint) };
        let errors = |trajectories: &[Trajectory]| -> Rows {
            let Campaign { runs, .. } = &self.campaign;
            let started: Vec<(Trajectory, f64)> = runs
                .iter()
                .zip(trajectories)
                .zip(logged)
                .map(|((run, trajectory), logged)| {
                    estimate_start(&machine, run, trajectory, logged, |torque| {
                        sensing.torque_channel(&run.times[..torque.len()], torque)
                    })
                })
                .collect();
            let inputs = runs
                .iter()
                .zip(&started)
                .map(|(run, (trajectory, held))| (&run.condition, trajectory, *held));
            let torques = machine.torques(inputs);
            let run = |((torque, run), logged): ((Vec<f64>, &RunPlan), &Logged)| {
                let read = sensing.torque_channel(&run.times, &torque);
                logged.torque.iter().zip(read).map(|(logged, model)| logged - model).collect()
            };
            torques.into_iter().zip(runs).zip(logged).map(run).collect()
        };
        if joint.delay_s != 0.0 || sensing.kind == SensorKind::Exact {
            // The true motion is used: its uncertainty is zero.
            return errors(&self.trajectories(joint.delay_s));
        }
        let runs = || self.campaign.runs.iter().zip(trajectories).zip(logged);
        let delay_s = sensing.velocity_delay_s(self.campaign.rate_hz);
        let readings = [1, 5, 15]
            .into_iter()
            .flat_map(|smooth| [true, false].map(|angle| Reading { angle, smooth, delay_s }));
        let possible = readings.filter(|reading| !reading.angle || sensing.has_position());
        let tried = possible.map(|reading| {
            let trajectories: Vec<Trajectory> = runs()
                .map(|((run, trajectory), logged)| reading.trajectory(run, trajectory, logged))
                .collect();
            errors(&trajectories)
        });
        tried.min_by(|a, b| rms(a).total_cmp(&rms(b))).unwrap_or_default()
    }

    /// Returns the sensor readings of a run.
    fn log_run(&self, run: &RunPlan, trajectory: &Trajectory, torque: &[f64]) -> Logged {
        let sensing = &self.campaign.sensing;
        let mut sampler = Sampler::new(run.seed, 1);
        let at: Vec<&Point> = trajectory.rows.iter().map(|row| &trajectory.points[*row]).collect();
        let angles: Vec<f64> = at.iter().map(|point| point.angle).collect();
        let velocities: Vec<f64> = at.iter().map(|point| point.velocity).collect();
        let mut noise = Sampler::new(run.seed, 2);
        // `torque` already passed the sensor channel. Only the noise is missing.
        let torque = sensing.with_noise(&mut noise, &run.times, torque);
        Logged {
            position: sensing.angles(&run.times, &angles),
            velocity: sensing.velocities(&mut sampler, &run.times, &angles, &velocities),
            torque,
        }
    }

    /// Assembles the log from the sensor readings and the covariates.
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

    /// Assembles the ground truth, except for the quantities that [`World::simulate`] computes.
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
        let plant = plant.name();
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

/// Returns the rows of a run that were not lost.
fn keep(rows: &[f64], run: &RunPlan) -> Vec<f64> {
    let there = |at: &usize| !run.lost.iter().any(|lost| lost.contains(at));
    (0..rows.len()).filter(there).map(|at| rows[at]).collect()
}

/// Rounds to nine significant digits, so that values in memory equal those read back from the file.
fn significant(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10f64.powi(8 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale + 0.0
}

/// Rounds times to microseconds.
fn times(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|t| (t * 1e6).round() / 1e6).collect()
}

/// Returns `seal` with the hidden effect of `hidden`.
fn with_effect(seal: Seal, hidden: &Seal) -> Seal {
    Seal {
        per_pressure: hidden.per_pressure,
        per_force: hidden.per_force,
        eta3: hidden.eta3,
        ..seal
    }
}
