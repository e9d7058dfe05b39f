//! The stored trend of the learnt levels (2047h): what a driver adds to it, when, and what survives a restart.

use super::bench::{Bench, Flash};
use super::drive::{control, state};
use super::parameter_trial::save;
use compensator_core::ParameterId;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use firmware::node_settings::InputSource;
use firmware::store::{TIME_UNIT_S, TrendEntry};

const ON: u8 = 1;
const CST: u8 = 10;
const NO_DATA: u32 = 0x0800_0020;

fn start(flash: Flash) -> Bench {
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.start();
    bench.commission();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    bench
}

/// Returns a joint with a stored set that learns its levels.
fn learning() -> Bench {
    let mut bench = start(Flash::new());
    bench.write(index::ADAPTATION, AdaptationObject::MODE, &[ON]).unwrap();
    save(&mut bench).unwrap();
    // Friction is not compensated with the defaults of a joint without a stored set.
    start(bench.driver.joint.into_flash())
}

/// Reports a joint that strokes to and fro for this time, with the Coulomb friction of its set times `wear`.
fn stroke(bench: &mut Bench, seconds: u64, wear: f32) {
    let get = |bench: &Bench, id| bench.driver.joint.set().friction.model.get(id);
    let coulomb_nm = get(bench, ParameterId::CoulombTorque);
    let viscous_nms = get(bench, ParameterId::ViscousFriction);
    for ms in 0..seconds * 1000 {
        let velocity_rad_s: f32 = if ms % 4000 < 2000 { 1.5 } else { -1.5 };
        let friction_nm =
            velocity_rad_s.signum() * wear * coulomb_nm + viscous_nms * velocity_rad_s;
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            velocity_rad_s,
            position_rad: 0.25,
            motor_torque_nm: friction_nm,
            friction_torque_nm: friction_nm,
            residual_torque_nm: 0.0,
            flags: compensator_core::Flags::empty(),
            ..LoopReport::default()
        });
        if bench.driver.joint.is_armed() {
            control(bench, 0x0F, 0);
        }
        bench.pass_ms(1);
        bench.sent();
    }
}

fn arm(bench: &mut Bench) {
    stroke(bench, 1, 1.0);
    [0x06, 0x07, 0x0F].iter().for_each(|word| control(bench, *word, 0));
    assert!(bench.driver.joint.is_armed(), "{:02x}", state(bench));
}

fn disarm(bench: &mut Bench) {
    bench.write(index::CONTROLWORD, 0, &[0x06, 0]).unwrap();
    bench.pass_ms(2);
    assert!(!bench.driver.joint.is_armed());
}

fn entries(bench: &mut Bench) -> Vec<TrendEntry> {
    match bench.read(index::LEVEL_TREND, 0) {
        Ok(bytes) => bytes.as_chunks().0.iter().map(|at| TrendEntry::parse(at).unwrap()).collect(),
        Err(code) => {
            assert_eq!(code, NO_DATA);
            bench.check_refusal("no trend", &[]);
            vec![]
        }
    }
}

#[test]
fn trend_of_rising_friction_survives_three_restarts() {
    let mut bench = learning();
    let coulomb_nm = bench.driver.joint.set().friction.model.get(ParameterId::CoulombTorque);
    assert_eq!(entries(&mut bench), []);
    let wears = [1.15, 1.3, 1.45];
    for (number, wear) in wears.into_iter().enumerate() {
        bench = start(bench.driver.joint.into_flash());
        assert_eq!(entries(&mut bench).len(), number, "a start adds nothing");
        arm(&mut bench);
        stroke(&mut bench, 240, wear);
        let steps = bench.driver.joint.flash().steps();
        assert_eq!(entries(&mut bench).len(), number, "an armed joint writes nothing");
        disarm(&mut bench);
        assert_eq!(bench.driver.joint.flash().steps(), steps + 2, "one entry, and no erase");
        stroke(&mut bench, 10, wear);
        assert_eq!(
            bench.driver.joint.flash().steps(),
            steps + 2,
            "a level that stays adds nothing"
        );
    }
    bench = start(bench.driver.joint.into_flash());
    assert_eq!(bench.number(index::LEARNT_GAINS, 1), 1f32.to_bits(), "gains start at the set");
    let found = entries(&mut bench);
    assert_eq!(found.len(), wears.len());
    for (entry, wear) in found.iter().zip(wears) {
        let gain = f32::from(entry.level_permille) * 1e-3;
        assert!((gain / wear - 1.0).abs() < 0.05, "{entry:?} at {wear}");
        assert!((entry.level_nm / (gain * coulomb_nm) - 1.0).abs() < 1e-3, "{entry:?}");
    }
    let learnt_s: Vec<f32> = found.iter().map(|entry| entry.learnt as f32 * TIME_UNIT_S).collect();
    assert!(learnt_s[0] > 180.0 && learnt_s[0] < 240.0, "{learnt_s:?}");
    assert!(learnt_s.windows(2).all(|pair| (pair[1] - pair[0] - learnt_s[0]).abs() < 20.0));
}

#[test]
fn trend_of_a_level_that_stays_has_an_entry_per_period() {
    let mut bench = learning();
    for minutes in [1, 3, 3, 3, 10, 10] {
        arm(&mut bench);
        stroke(&mut bench, 60 * minutes, 1.2);
        disarm(&mut bench);
    }
    // The first entry after 180 s; with 0.1 s per reversal left out, 900 s more are over within the last stretch.
    let found = entries(&mut bench);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[1].learnt - found[0].learnt) as f32 * TIME_UNIT_S >= 900.0, "{found:?}");
}

#[test]
fn trend_goes_on_after_adopting_and_saving_what_was_learnt() {
    const ADOPT: u8 = 1;
    let mut bench = learning();
    arm(&mut bench);
    stroke(&mut bench, 240, 1.3);
    disarm(&mut bench);
    bench.write(index::ADAPTATION, AdaptationObject::ORDER, &[ADOPT]).unwrap();
    save(&mut bench).unwrap();
    bench = start(bench.driver.joint.into_flash());
    assert_eq!(entries(&mut bench).len(), 1, "a save keeps the trend");
    arm(&mut bench);
    // The set now has the learnt level: it is the level that counts, and it has risen by 20 %.
    stroke(&mut bench, 240, 1.2);
    disarm(&mut bench);
    let found = entries(&mut bench);
    assert_eq!(found.len(), 2);
    assert!((found[1].level_nm / found[0].level_nm / 1.2 - 1.0).abs() < 0.05, "{found:?}");
}
