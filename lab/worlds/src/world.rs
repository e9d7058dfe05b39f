//! Simulation of a drawn world: scaled effects, torque, error floor and detectability.

use super::campaign::{Campaign, RunPlan};
use super::hidden_effect::HiddenEffect;
use super::mechanism::Mechanism;
use super::plant::{Machine, Plant, RunInput};
use super::reading::{Reading, Started, estimate_start};
use super::sensing::SensorKind;
use super::trajectory::thinned;
use super::visible::{Rows, difference, evaluate_visibility, rms};
use super::{UnkindWorld, bristle_fit, truth};
use simulated_machines::effects::Wave;
use simulated_machines::friction::Seal;
use simulated_machines::imposed::Trajectory;
use simulated_machines::joint::Joint;
use simulated_machines::sampling::Readings;

/// A drawn world before its simulation.
pub(super) struct World {
    pub campaign: Campaign,
    /// The mechanism without a hidden effect.
    pub plain: Mechanism,
    pub seed: u64,
}

/// An effect to hide, and the torque to which it is scaled.
pub(super) struct Target {
    pub effect: HiddenEffect,
    /// RMS of its torque alone, Nm.
    pub torque_nm: f64,
}

/// A simulated world: its true torque with and without its effects, and the seal of its models.
struct Simulation<'a> {
    effects: &'a [HiddenEffect],
    without: Rows,
    torque: Rows,
    trajectories: Vec<Trajectory>,
    seal: Seal,
}

/// What an effect adds to the torque beside the other effects, Nm, without lost rows.
struct EffectRows {
    /// In the true plant.
    in_plant: Rows,
    /// In the model that knows the others.
    modelled: Rows,
}

impl World {
    /// Returns the torque of each row after the sensor channel and without noise, Nm.
    fn torques(&self, machine: &Machine, trajectories: &[Trajectory]) -> Rows {
        let Campaign { sensing, runs, .. } = &self.campaign;
        let inputs = runs.iter().zip(trajectories);
        let torques = machine.torques(inputs.map(|(plan, trajectory)| plan.input(trajectory)));
        let read = torques
            .iter()
            .zip(runs)
            .map(|(torque, plan)| sensing.torque_channel(&plan.run.times, torque));
        read.collect()
    }

    /// Returns the torques of the true plant. With a delay, each row refers to the state `delay_s` earlier.
    fn true_torques(&self, mechanism: &Mechanism, trajectories: &[Trajectory]) -> Rows {
        let machine = Machine { plant: &self.campaign.plant, mechanism, covariate_hz: None };
        if mechanism.joint.delay_s == 0.0 {
            return self.torques(&machine, trajectories);
        }
        self.torques(&machine, &self.trajectories(mechanism.joint.delay_s))
    }

    /// Returns the trajectories of the models, `delay_s` earlier.
    fn model_trajectories(&self, delay_s: f64) -> Vec<Trajectory> {
        let stride = self.campaign.family.model_effort().stride;
        self.trajectories(delay_s).iter().map(|whole| thinned(whole, stride)).collect()
    }

    /// Returns the torque of bristles as a model computes it from the log. `knows_encoder` is false for a model that takes an
    /// erroneous angle for the true one.
    fn model(
        &self,
        mechanism: &Mechanism,
        trajectories: &[Trajectory],
        knows_encoder: bool,
    ) -> Rows {
        let machine = Machine::bristles(mechanism);
        if mechanism.encoder.is_some() && !knows_encoder {
            let read = trajectories.iter().map(|trajectory| mechanism.read_trajectory(trajectory));
            return self.torques(&machine, &read.collect::<Vec<Trajectory>>());
        }
        if mechanism.joint.delay_s == 0.0 {
            return self.torques(&machine, trajectories);
        }
        self.torques(&machine, &self.model_trajectories(mechanism.joint.delay_s))
    }

    /// Returns the true trajectories, `delay_s` earlier.
    fn trajectories(&self, delay_s: f64) -> Vec<Trajectory> {
        if delay_s == 0.0 {
            return self.campaign.trajectories();
        }
        let mut late = self.campaign.clone();
        for plan in &mut late.runs {
            plan.run.times.iter_mut().for_each(|t| *t = (*t - delay_s).max(0.0));
        }
        late.trajectories()
    }

    fn with_effects<'a>(&self, effects: impl Iterator<Item = &'a HiddenEffect>) -> Mechanism {
        let mut mechanism = self.plain.clone();
        effects.for_each(|effect| effect.apply_to(&mut mechanism));
        mechanism
    }

    /// Returns the torque that an effect alone adds to the log or takes from the model, Nm.
    fn effect_alone(
        &self,
        mechanism: &Mechanism,
        trajectories: &[Trajectory],
        without: &Rows,
    ) -> Rows {
        if mechanism.encoder.is_some() {
            return difference(without, &self.model(mechanism, trajectories, false));
        }
        difference(&self.true_torques(mechanism, trajectories), without)
    }

    /// Scales an effect so that it alone changes the torque by about `target_nm` RMS.
    fn scale_effect(
        &self,
        effect: &mut HiddenEffect,
        target_nm: f64,
        trajectories: &[Trajectory],
        without: &Rows,
    ) {
        let (least, most) = effect.limits(&self.campaign);
        if effect.is_scalable() {
            effect.set_size(effect.size().abs().clamp(least, most).copysign(effect.size()));
        }
        for _ in 0..3 {
            let mechanism = self.with_effects(std::iter::once(&*effect));
            let seen_nm = rms(&self.effect_alone(&mechanism, trajectories, without));
            let close = (seen_nm / target_nm - 1.0).abs() < 0.15;
            if close || seen_nm <= 0.0 || !effect.is_scalable() {
                break;
            }
            let next = (effect.size().abs() * target_nm / seen_nm).clamp(least, most);
            if next == effect.size().abs() {
                break;
            }
            effect.set_size(next.copysign(effect.size()));
        }
    }

    /// Scales the effects to their targets, simulates the torque, determines the detectability, and creates the log.
    pub fn simulate(self, targets: Vec<Target>) -> UnkindWorld {
        let trajectories = self.trajectories(0.0);
        let without = self.true_torques(&self.plain, &trajectories);
        let effects: Vec<HiddenEffect> = targets
            .into_iter()
            .map(|Target { mut effect, torque_nm }| {
                self.scale_effect(&mut effect, torque_nm, &trajectories, &without);
                effect
            })
            .collect();
        let all = self.with_effects(effects.iter());
        let torque = match effects.is_empty() {
            true => without.clone(),
            false => self.true_torques(&all, &trajectories),
        };
        let logged = self.read_runs(&all, &trajectories, &torque);
        let corrected = all.encoder.map(|_| {
            let corrected = Mechanism { encoder: None, ..all.clone() };
            self.read_runs(&corrected, &trajectories, &torque)
        });
        let seal = self.modelled_seal(&all, &torque);
        let model = with_seal(&all, seal);
        let errors = self.floor(&model, &trajectories, corrected.as_ref().unwrap_or(&logged));
        let errors = self.kept(&errors);
        let simulation = Simulation { effects: &effects, without, torque, trajectories, seal };
        let hidden = self.visible_effects(&simulation, &model, &errors);
        let (log, floor_nm) = (self.log(&logged), rms(&errors));
        let truth = self.truth(hidden, floor_nm, errors, self.kept(&simulation.torque));
        UnkindWorld { log, truth }
    }

    /// Returns the readings of all runs.
    fn read_runs(
        &self,
        mechanism: &Mechanism,
        trajectories: &[Trajectory],
        torque: &Rows,
    ) -> Vec<Readings> {
        let runs = self.campaign.runs.iter().zip(trajectories).zip(torque);
        runs.map(|((plan, trajectory), torque)| self.read(&plan.run, mechanism, trajectory, torque))
            .collect()
    }

    /// Returns the seal of a model with bristles: that of the plant, or bristles fitted to the other plants with their
    /// effects, which is the best result of a law with one state.
    fn modelled_seal(&self, all: &Mechanism, torque: &Rows) -> Seal {
        match self.campaign.plant {
            Plant::Bristles => self.campaign.seal,
            Plant::SlipElements { .. } | Plant::LubricatedSeal(_) => {
                let late = self.model_trajectories(all.joint.delay_s);
                bristle_fit::fit(&self.campaign, all, &late, torque)
            }
        }
    }

    /// Returns the values of the rows that are not lost.
    fn kept(&self, rows: &Rows) -> Rows {
        let runs = rows.iter().zip(&self.campaign.runs);
        runs.map(|(rows, plan)| plan.run.keep(rows)).collect()
    }

    /// Returns the effects with their detectability, the most visible first. `errors` are those of a model of everything.
    fn visible_effects(
        &self,
        simulation: &Simulation,
        model: &Mechanism,
        errors: &Rows,
    ) -> Vec<truth::HiddenEffect> {
        let thinned = self.model_trajectories(0.0);
        let modelled = self.model(model, &thinned, true);
        let parts: Vec<EffectRows> = (0..simulation.effects.len())
            .map(|place| self.effect_rows(simulation, place, &thinned, &modelled))
            .collect();
        let plain = with_seal(&self.plain, simulation.seal);
        let base: Vec<Rows> =
            self.base_columns(&plain, &thinned).iter().map(|rows| self.kept(rows)).collect();
        let floor_nm = rms(errors);
        let mut hidden: Vec<truth::HiddenEffect> = (0..parts.len())
            .map(|place| {
                let others = (0..parts.len()).filter(|other| *other != place);
                let mut base = base.clone();
                base.extend(others.map(|other| parts[other].modelled.clone()));
                let visible = evaluate_visibility(&parts[place].modelled, &base, errors);
                let torque_nm = rms(&parts[place].in_plant);
                truth::HiddenEffect {
                    hidden: simulation.effects[place].describe(&self.campaign, torque_nm),
                    effect_in_floors: visible.rms_nm / floor_nm,
                    gain_in_errors: visible.gain_in_errors,
                }
            })
            .collect();
        hidden.sort_by(|a, b| b.effect_in_floors.total_cmp(&a.effect_in_floors));
        hidden
    }

    /// Returns what an effect adds beside the others. `modelled` is the torque of the model of all effects.
    fn effect_rows(
        &self,
        simulation: &Simulation,
        place: usize,
        thinned: &[Trajectory],
        modelled: &Rows,
    ) -> EffectRows {
        let effects = simulation.effects;
        let others = effects.iter().enumerate().filter(|(other, _)| *other != place);
        let rest = self.with_effects(others.map(|(_, effect)| effect));
        let model_without = if matches!(effects[place], HiddenEffect::Encoder(_)) {
            let all = with_seal(&self.with_effects(effects.iter()), simulation.seal);
            self.model(&all, thinned, false)
        } else {
            self.model(&with_seal(&rest, simulation.seal), thinned, true)
        };
        let plant_without = match effects.len() {
            1 => simulation.without.clone(),
            _ => self.true_torques(&rest, &simulation.trajectories),
        };
        EffectRows {
            in_plant: self.kept(&difference(&simulation.torque, &plant_without)),
            modelled: self.kept(&difference(modelled, &model_without)),
        }
    }

    /// Returns the derivatives of the plant's torque by its parameters, run by run.
    ///
    /// They span what a refit without the effect can explain.
    fn base_columns(&self, plain: &Mechanism, trajectories: &[Trajectory]) -> Vec<Rows> {
        /// Relative change of a parameter in a difference quotient.
        const RELATIVE_STEP: f64 = 0.02;
        let without = self.torques(&Machine::bristles(plain), trajectories);
        let changed = |change: &dyn Fn(&mut Joint)| {
            let mut mechanism = plain.clone();
            change(&mut mechanism.joint);
            difference(&self.torques(&Machine::bristles(&mechanism), trajectories), &without)
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
                        let wave = Wave { size: level, order: 1.0, phase };
                        columns.push(changed(&|joint| joint.torque_ripple.push(wave)));
                    }
                }
            }
        }
        columns
    }

    /// Returns the logged torque minus the torque of bristles with the effects, Nm.
    ///
    /// The motion is the best of several simple reconstructions from the log.
    fn floor(
        &self,
        mechanism: &Mechanism,
        trajectories: &[Trajectory],
        logged: &[Readings],
    ) -> Rows {
        let sensing = &self.campaign.sensing;
        let machine =
            Machine { covariate_hz: sensing.covariate_hz, ..Machine::bristles(mechanism) };
        let errors = |trajectories: &[Trajectory]| -> Rows {
            let Campaign { runs, .. } = &self.campaign;
            let started: Vec<Started> = runs
                .iter()
                .zip(trajectories)
                .zip(logged)
                .map(|((plan, trajectory), logged)| {
                    estimate_start(&machine, plan, trajectory, logged, |torque| {
                        sensing.torque_channel(&plan.run.times[..torque.len()], torque)
                    })
                })
                .collect();
            let inputs = runs.iter().zip(&started).map(|(plan, start)| RunInput {
                held: start.held,
                ..plan.input(&start.trajectory)
            });
            let torques = machine.torques(inputs);
            let run = |((torque, plan), logged): ((Vec<f64>, &RunPlan), &Readings)| {
                let read = sensing.torque_channel(&plan.run.times, &torque);
                logged.torque.iter().zip(read).map(|(logged, model)| logged - model).collect()
            };
            torques.into_iter().zip(runs).zip(logged).map(run).collect()
        };
        let delay_s = mechanism.joint.delay_s;
        if delay_s != 0.0 || sensing.kind == SensorKind::Exact {
            // The true motion is used: its uncertainty is zero.
            return errors(&self.model_trajectories(delay_s));
        }
        let runs = || self.campaign.runs.iter().zip(trajectories).zip(logged);
        let delay_s = sensing.velocity_delay_s(self.campaign.rate_hz);
        let readings = [1, 5, 15]
            .into_iter()
            .flat_map(|smooth| [true, false].map(|angle| Reading { angle, smooth, delay_s }));
        let possible = readings.filter(|reading| !reading.angle || sensing.has_position());
        let tried = possible.map(|reading| {
            let trajectories: Vec<Trajectory> = runs()
                .map(|((plan, trajectory), logged)| {
                    reading.trajectory(&plan.run.times, trajectory, logged)
                })
                .collect();
            errors(&trajectories)
        });
        tried.min_by(|a, b| rms(a).total_cmp(&rms(b))).unwrap_or_default()
    }
}

/// Returns a mechanism with another seal, which keeps the effects of load and pressure.
fn with_seal(mechanism: &Mechanism, seal: Seal) -> Mechanism {
    let seal = with_effect(seal, &mechanism.joint.seal);
    Mechanism { joint: Joint { seal, ..mechanism.joint.clone() }, ..mechanism.clone() }
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
