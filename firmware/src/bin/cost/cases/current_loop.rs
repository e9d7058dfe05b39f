//! One whole cycle of the current loop, everything in it: currents to duties, with the compensator.
//!
//! The loop branches on its data (a limit that acts, an open bridge), so least and largest count differ;
//! what counts is that the largest fits the period. The sequence settles the observer first, then turns the
//! joint at every velocity of the list, with healthy samples and, in every 20, some that are missing, out of
//! range or no number, two shunts and three, set-points that saturate current and voltage, and old ones.

#[cfg(feature = "terms")]
use super::TWO_TERMS;
use super::{Arguments, Clock, UPDATES, address, inputs, measure, velocities};
use compensator_core::LawKind;
use compensator_core::TermKind;
use core::f32::consts::TAU;
use firmware::control::PERIOD_S;
use firmware::control::transform::binary_angle;
use firmware::control::{
    Compensate, Covariates, CurrentLoop, Cycle, Motor, MotorParameters, NoCompensation, Setpoint,
    StageSample, Valid,
};
use firmware::loop_parts::Model;
use firmware::reference_joint::configuration;

/// The loop whose memory is told.
pub type Loop = CurrentLoop<Model>;

/// Cycles until the observer has settled.
pub const SETTLE: usize = 1000;

/// What one cycle is given.
#[derive(Clone)]
pub struct Inputs {
    pub sample: StageSample,
    pub setpoint: Setpoint,
    pub covariates: Covariates,
}

/// One cycle, as an interrupt would call it.
fn cycle<C: Compensate>(control: &mut CurrentLoop<C>, inputs: &Inputs, cycle: &mut Cycle) {
    *cycle = control.step(&inputs.sample, &inputs.setpoint, &inputs.covariates);
}

extern "C" fn joint(control: &mut Loop, inputs: &Inputs, out: &mut Cycle) {
    cycle(control, inputs, out);
}

extern "C" fn alone(control: &mut CurrentLoop<NoCompensation>, inputs: &Inputs, out: &mut Cycle) {
    cycle(control, inputs, out);
}

/// A cycle in which all is well, the motor at this angle.
pub fn healthy(angle_rad: f32) -> Inputs {
    let readings = inputs::<f32>(0, 0.0);
    Inputs {
        sample: StageSample {
            currents_a: [1.0, -0.4, -0.6],
            bus_v: 48.0,
            encoder: binary_angle(angle_rad),
            valid: Valid::all(),
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

/// Every velocity a joint can have, with what may go wrong.
pub fn sequence() -> impl Iterator<Item = Inputs> {
    let gear = MotorParameters::default().gear_ratio;
    let mut angle = 0.0;
    velocities().filter(|v| v.abs() < 12.0).enumerate().map(move |(update, velocity)| {
        angle = (angle + velocity * gear * PERIOD_S) % TAU;
        let mut now = healthy(angle);
        let (sample, setpoint) = (&mut now.sample, &mut now.setpoint);
        match update % UPDATES {
            1 => sample.valid.remove(Valid::CURRENT_C),
            2 => sample.valid.remove(Valid::ENCODER),
            3 => sample.encoder ^= 1 << 31,
            4 => setpoint.current_a = 100.0,
            5 => sample.currents_a = [-30.0, 15.0, 15.0],
            6 => sample.currents_a = [f32::NAN, 0.0, 0.0],
            7 => sample.valid.remove(Valid::BUS),
            8 => sample.bus_v = 18.0,
            9 => setpoint.age_s = 1.0,
            10 => setpoint.current_a = f32::NAN,
            11 => now.covariates.radial_force_n.value = f32::NAN,
            12 => now.covariates.temperature_c.age_s = 0.3,
            13 => setpoint.velocity_reference_rad_s = f32::NAN,
            14 => sample.valid.remove(Valid::CURRENT_A),
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
    for _ in 0..SETTLE {
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

/// The loop alone and with each compensator.
pub fn measure_loops(clock: &mut Clock) {
    let none = NoCompensation { current_limit_a: 26.0, torque_constant_nm_per_a: 1.0 };
    measure_loop(clock, "current loop, no compensator", alone as *const (), none);
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
        // What the shipped loop holds: the compensator within what temperature and over-compensation leave of it.
        match Model::build(&configuration(*law, terms), 26.0, PERIOD_S) {
            Ok(compensator) => measure_loop(clock, name, joint as *const (), compensator),
            Err(refused) => panic!("{refused}"),
        }
    }
}
