//! Measures one complete cycle of the current loop: from currents to duties, including the compensator.
//!
//! The loop branches on its data (an active limit, an open bridge), so the smallest and the largest count
//! differ. The largest must fit the period. The sequence settles the observer first. It then turns the
//! joint at every velocity of the list, with valid samples and, in every 20, some that are missing, out of
//! range or not finite. It covers two and three shunts, set-points that saturate current and voltage, and
//! stale ones.

#[cfg(feature = "terms")]
use super::TWO_TERMS;
use super::{Arguments, Clock, UPDATES_PER_VELOCITY, address, inputs, measure, velocities};
use compensator_core::LawKind;
use compensator_core::TermKind;
use core::f32::consts::TAU;
use firmware::control::PERIOD_S;
use firmware::control::transform::binary_angle;
use firmware::control::{
    Compensate, Covariates, CurrentLoop, CycleResult, Motor, MotorParameters, NoCompensation,
    Setpoint, StageSample, ValidChannels,
};
use firmware::loop_parts::LimitedCompensator;
use firmware::reference_joint::configuration;

/// The loop whose size is printed.
pub type Loop = CurrentLoop<LimitedCompensator>;

/// Cycles until the observer has settled.
pub const SETTLING_CYCLES: usize = 1000;

/// Inputs of one cycle.
#[derive(Clone)]
pub struct Inputs {
    pub sample: StageSample,
    pub setpoint: Setpoint,
    pub covariates: Covariates,
}

/// Runs one cycle as an interrupt would.
fn cycle<C: Compensate>(control: &mut CurrentLoop<C>, inputs: &Inputs, cycle: &mut CycleResult) {
    *cycle = control.step(&inputs.sample, &inputs.setpoint, &inputs.covariates);
}

extern "C" fn with_compensator(control: &mut Loop, inputs: &Inputs, out: &mut CycleResult) {
    cycle(control, inputs, out);
}

extern "C" fn without_compensator(
    control: &mut CurrentLoop<NoCompensation>,
    inputs: &Inputs,
    out: &mut CycleResult,
) {
    cycle(control, inputs, out);
}

/// Returns valid inputs with the motor at this angle.
pub fn healthy(angle_rad: f32) -> Inputs {
    let readings = inputs::<f32>(0, 0.0);
    Inputs {
        sample: StageSample {
            currents_a: [1.0, -0.4, -0.6],
            bus_v: 48.0,
            encoder: binary_angle(angle_rad),
            valid: ValidChannels::all(),
        },
        setpoint: Setpoint { current_a: 2.0, velocity_reference_rad_s: 0.5, age_s: 1e-3 },
        covariates: Covariates {
            radial_force_n: readings.radial_force_n,
            pressure_diff_mpa: readings.pressure_diff_mpa,
            temperature_c: readings.temperature_c,
            load_torque_nm: readings.load_torque_nm,
            auxiliary: readings.auxiliary,
            campaign_time_h: readings.campaign_time_h,
        },
    }
}

/// Returns inputs at every velocity in range, with invalid ones among them.
pub fn sequence() -> impl Iterator<Item = Inputs> {
    let gear = MotorParameters::default().gear_ratio;
    let mut angle = 0.0;
    velocities().filter(|v| v.abs() < 12.0).enumerate().map(move |(update, velocity)| {
        angle = (angle + velocity * gear * PERIOD_S) % TAU;
        let mut now = healthy(angle);
        let (sample, setpoint) = (&mut now.sample, &mut now.setpoint);
        // The noise of an encoder: without it, a sudden stop would look like a frozen one.
        sample.encoder ^= (update as u32 & 1) << 18;
        match update % UPDATES_PER_VELOCITY {
            1 => sample.valid.remove(ValidChannels::CURRENT_C),
            2 => sample.valid.remove(ValidChannels::ENCODER),
            3 => sample.encoder ^= 1 << 31,
            4 => setpoint.current_a = 100.0,
            5 => sample.currents_a = [-30.0, 15.0, 15.0],
            6 => sample.currents_a = [f32::NAN, 0.0, 0.0],
            7 => sample.valid.remove(ValidChannels::BUS),
            8 => sample.bus_v = 18.0,
            9 => setpoint.age_s = 1.0,
            10 => setpoint.current_a = f32::NAN,
            11 => now.covariates.radial_force_n.value = f32::NAN,
            12 => now.covariates.temperature_c.age_s = 0.3,
            13 => setpoint.velocity_reference_rad_s = f32::NAN,
            14 => sample.valid.remove(ValidChannels::CURRENT_A),
            _ => {}
        }
        now
    })
}

fn settled<C: Compensate>(compensator: C) -> CurrentLoop<C> {
    let mut control = CurrentLoop::new(motor(), compensator);
    control.set_driving(true);
    control.set_compensating(true);
    let still = healthy(0.0);
    for _ in 0..SETTLING_CYCLES {
        control.step(&still.sample, &still.setpoint, &still.covariates);
    }
    control.set_position(0.3);
    control
}

fn motor() -> Motor {
    match MotorParameters::default().build(PERIOD_S) {
        Ok(motor) => motor,
        Err(refused) => panic!("{refused}"),
    }
}

fn measure_loop<C: Compensate + Clone>(
    clock: &mut Clock,
    name: &str,
    function: *const (),
    compensator: C,
) {
    let control = settled(compensator);
    let still = healthy(0.0);
    let mut out = control.clone().step(&still.sample, &still.setpoint, &still.covariates);
    measure(clock, name, function, control, sequence(), |control, inputs| Arguments {
        words: [address(control), address(inputs), &raw mut out as usize],
        float: 0.0,
    });
}

/// Measures the loop without and with each compensator.
pub fn measure_loops(clock: &mut Clock) {
    let none = NoCompensation { current_limit_a: 26.0, torque_constant_nm_per_a: 1.0 };
    measure_loop(clock, "current loop, no compensator", without_compensator as *const (), none);
    let rows: &[(&str, LawKind, &[TermKind])] = &[
        ("current loop, plain LuGre, f32", LawKind::Lugre, &[]),
        ("current loop, improved LuGre, f32", LawKind::ImprovedLugre, &[]),
        #[cfg(feature = "terms")]
        (
            "current loop, improved LuGre + temperature + ripple, f32",
            LawKind::ImprovedLugre,
            TWO_TERMS,
        ),
    ];
    for (name, law, terms) in rows {
        // The compensator of the shipped loop, with the limits from temperature and over-compensation.
        match LimitedCompensator::build(&configuration(*law, terms), 26.0, PERIOD_S) {
            Ok(compensator) => {
                measure_loop(clock, name, with_compensator as *const (), compensator)
            }
            Err(refused) => panic!("{refused}"),
        }
    }
}
