//! The joint of all scenarios, its parameters, and its bus master.

use super::driver::power_up;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, Parameters as Friction};
use firmware::control::MotorParameters;
use firmware::driver::Boot;
use firmware::parameter_set::ParameterSet;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, identify, tracks};
use joint_rig::simulated::dataset;
use joint_rig::{JointRig, PowerUp, RigError, RigFaults};
use paper_machines::bench::{Amount, Bench};
use simulated_machines::joint_plant::parameters::PHASE_RAD;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::f64::consts::TAU;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};

/// Crossover of the master's velocity loop, Hz, and its integral time, s: as in the paper's tasks.
const VELOCITY_HZ: f64 = 2.0;
const INTEGRAL_S: f64 = 1.0;

/// Constants of the joint, with the board's converter resolution.
pub fn constants() -> Parameters {
    Parameters { current_step_a: 1e-9, ..Parameters::default() }
}

/// Returns the model that `identify` finds on bench runs of this machine.
fn identified() -> &'static Friction<f32> {
    static MODEL: LazyLock<Friction<f32>> = LazyLock::new(|| {
        let parameters = Parameters::default();
        let temperature_c = [parameters.water_temperature_c; 2];
        let bench = Bench { parameters, phase_rad: PHASE_RAD, temperature_c, seed: 3 };
        let amount = Amount { seconds: 4.0, both_motions: false, learned: 1, held_out: 0 };
        let measured = bench.measure(&amount);
        let (unloaded, learned) = (dataset(&measured.unloaded), dataset(&measured.learned));
        let spec = Spec::parse("improved-lugre").expect("a model");
        let start = spec.parameters().expect("parameters");
        let tracks: Vec<_> = [&unloaded, &learned].into_iter().flat_map(tracks).collect();
        let rows = Rows { tracks: &tracks, decimate: 4 };
        let options = FitOptions { passive: true, starts: 1, ..FitOptions::default() };
        let fit = identify(&spec, &start, rows, rows, &options);
        fit.for_driver().parameters.convert()
    });
    &MODEL
}

/// Returns the driver's set with this compensated share of the identified friction.
pub fn set(share: f32) -> ParameterSet {
    let compensator = CompensatorParameters { scale: share, ..CompensatorParameters::default() };
    let model = if share > 0.0 { identified().clone() } else { Friction::new(LawKind::Lugre) };
    let mut set = ParameterSet {
        friction: Configuration { model, compensator },
        motor: MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() },
        ..ParameterSet::default()
    };
    let envelope = &mut set.friction.model.envelope;
    *envelope = compensator_core::parameters::Envelope::default();
    envelope.radial_force_max_n = 400.0;
    envelope.pressure_diff_max_pa = 4e5;
    set
}

/// A joint and its driver.
#[derive(Clone)]
pub struct Joint {
    pub constants: Parameters,
    pub load: Load,
    pub set: Option<ParameterSet>,
    pub commissioned: bool,
    pub boot: Boot<'static>,
    pub faults: RigFaults,
    /// Overcurrent comparators at the shunts, as on the board.
    pub comparators: bool,
}

impl Joint {
    /// A commissioned joint with a bare shaft and this set.
    pub fn with(set: ParameterSet) -> Self {
        Self {
            constants: constants(),
            load: Load::Free,
            set: Some(set),
            commissioned: true,
            boot: Boot::default(),
            faults: RigFaults::default(),
            comparators: true,
        }
    }

    /// Powers the joint up.
    pub fn run<R>(&self, work: impl FnOnce(&mut Master) -> R) -> R {
        self.run_plant(|_| {}, work)
    }

    /// Powers the joint up after a change of the plant.
    pub fn run_plant<R>(
        &self,
        prepare: impl FnOnce(&mut JointPlant),
        work: impl FnOnce(&mut Master) -> R,
    ) -> R {
        let mut plant = self.plant();
        prepare(&mut plant);
        let inertia = plant.inertia_kg_m2();
        power_up(&self.start(), plant, self.faults, |rig| work(&mut Master::new(rig, inertia)))
            .expect("a set that builds")
    }

    /// Returns its plant.
    pub fn plant(&self) -> JointPlant {
        let mut plant = JointPlant::with_phase(&self.constants, self.load, PHASE_RAD, 5);
        if self.comparators {
            plant.watch_overcurrent();
        }
        plant
    }

    /// Returns the state of its driver at power-up.
    pub fn start(&self) -> PowerUp<'_> {
        PowerUp {
            set: self.set.as_ref(),
            commissioned: self.commissioned,
            boot: self.boot,
            ..PowerUp::default()
        }
    }
}

/// Returns the result of each input, in order, computed on all processors: a row of a long scenario takes minutes.
pub fn compute_in_parallel<I: Sync, R: Send>(
    inputs: &[I],
    compute: impl Fn(&I) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..processors.min(inputs.len()) {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(input) = inputs.get(at) else { break };
                    let result = compute(input);
                    results.lock().expect("no thread has panicked").push((at, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no thread has panicked");
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

/// The bus master, which commands at 1 kHz.
pub struct Master<'a> {
    pub rig: &'a mut JointRig,
    gain: f64,
    inertia: f64,
    integral_a: f64,
}

impl<'a> Master<'a> {
    /// Creates a master that assumes this inertia of the joint, kg m^2.
    pub fn new(rig: &'a mut JointRig, inertia: f64) -> Self {
        Self { rig, gain: inertia * TAU * VELOCITY_HZ, inertia, integral_a: 0.0 }
    }

    /// Arms the joint at 0 A.
    pub fn arm(&mut self) -> Result<(), RigError> {
        let at = self.rig.plant().position_rad();
        self.rig.arm(at)
    }

    /// Scales the inertia that the master assumes.
    pub fn scale_inertia(&mut self, factor: f64) {
        self.gain *= factor;
        self.inertia *= factor;
    }

    /// Commands this current for this time, A.
    pub fn current(&mut self, milliseconds: usize, current_a: f64) {
        for _ in 0..milliseconds {
            self.rig.step_with_command(current_a as f32, 0.0);
        }
    }

    /// Runs the velocity loop for 1 ms, with reference velocity (rad/s) and acceleration (rad/s^2).
    pub fn follow(&mut self, velocity: f64, acceleration: f64) {
        let error = velocity - f64::from(self.rig.master_view().velocity_rad_s);
        let wanted = self.inertia * acceleration + self.gain * error + self.integral_a;
        if wanted.abs() < 26.0 {
            self.integral_a += self.gain * error * 1e-3 / INTEGRAL_S;
        }
        self.rig.step_with_command(wanted.clamp(-26.0, 26.0) as f32, velocity as f32);
    }

    /// Runs the position loop for 1 ms; its crossover is half that of the velocity loop.
    pub fn hold(&mut self, position: f64) {
        let behind = position - f64::from(self.rig.master_view().position_rad);
        self.follow(TAU * 0.5 * VELOCITY_HZ * behind, 0.0);
    }

    /// Holds a position for 8 s and returns the swing in the last 4 s, rad from end to end.
    pub fn swing_rad(&mut self, position: f64) -> f64 {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..8000 {
            self.hold(position);
            if k >= 4000 {
                let at = self.rig.plant().position_rad();
                (least, most) = (least.min(at), most.max(at));
            }
        }
        most - least
    }

    /// Accelerates to a speed in 0.5 s and holds it for this time.
    pub fn spin(&mut self, velocity: f64, milliseconds: usize) {
        let from = self.rig.plant().velocity_rad_s();
        for k in 0..500 {
            let share = f64::from(k) / 500.0;
            self.follow(from + (velocity - from) * share, (velocity - from) / 0.5);
        }
        (0..milliseconds).for_each(|_| self.follow(velocity, 0.0));
    }

    /// Names of the present faults.
    pub fn faults(&mut self) -> Vec<&'static str> {
        self.rig.latched_faults().iter().map(|code| code.info().name).collect()
    }

    /// Returns 1 if this fault is present, otherwise 0.
    pub fn has(&mut self, fault: &str) -> f64 {
        f64::from(u8::from(self.faults().contains(&fault)))
    }
}
