//! Properties of the lubricated seal, and of the worlds that contain it.

use super::campaign::Campaign;
use super::family::{Family, PlantKind};
use super::lubricated::{ContactElement, LubricatedSeal};
use super::mechanism::{Beside, Mechanism};
use super::plant::{Machine, Plant, RunInput};
use super::{seeds, sensor_kind};
use simulated_machines::conditions::{Condition, Signal};
use simulated_machines::effects::{Drift, Thinning, Wave};
use simulated_machines::friction::Seal;
use simulated_machines::imposed::{Point, Trajectory};
use simulated_machines::joint::{Joint, Play};
use simulated_machines::outside::{Flavour, Outside};
use simulated_machines::sampler::Sampler;

pub(super) const SEAL: Seal = Seal {
    k0: 2.0e4,
    k1: 0.0,
    k2: 0.05,
    coulomb_nm: 1.5,
    static_nm: 2.2,
    stribeck_rad_s: 0.1,
    per_pressure: 0.0,
    per_force: 0.0,
    eta3: 0.0,
};

/// Presliding travel of [`SEAL`] at the Coulomb level, rad.
const TRAVEL_RAD: f64 = SEAL.coulomb_nm / SEAL.k0;

fn lubricated() -> LubricatedSeal {
    let element = |share, travel, stribeck_ratio, elastic_share| ContactElement {
        share,
        travel,
        stribeck_ratio,
        elastic_share,
    };
    LubricatedSeal {
        elements: vec![
            element(0.4, 0.2, 2.0, 0.3),
            element(0.25, 0.6, 0.7, 0.6),
            element(0.2, 1.1, 1.0, 0.8),
            element(0.15, 2.0, 0.5, 0.5),
        ],
        build_up_s: 0.01,
        collapse_s: 0.03,
        viscous_exponent: 0.7,
        viscous_reference_rad_s: 2.0,
    }
}

/// Returns the trajectory of a motion. Each point is a row.
fn trajectory(step_s: f64, seconds: f64, motion: impl Fn(f64) -> (f64, f64)) -> Trajectory {
    let count = (seconds / step_s).round() as usize;
    let point = |at: usize| {
        let t = at as f64 * step_s;
        let (angle, velocity) = motion(t);
        Point { t, angle, velocity }
    };
    Trajectory {
        points: (0..=count).map(point).collect(),
        rows: (0..=count).collect(),
        accelerations: vec![0.0; count + 1],
    }
}

/// Returns the torque of each point of a trajectory, Nm.
fn torques(joint: &Joint, condition: &Condition, run: &Trajectory, held: f64) -> Vec<f64> {
    let plant = Plant::LubricatedSeal(lubricated());
    let mechanism = Mechanism::plain(joint.clone());
    let machine = Machine { plant: &plant, mechanism: &mechanism, covariate_hz: None };
    rows(&machine, condition, run, held)
}

fn rows(machine: &Machine, condition: &Condition, trajectory: &Trajectory, held: f64) -> Vec<f64> {
    let input = RunInput { condition, beside: &Beside::default(), trajectory, held };
    machine.torques(std::iter::once(input)).remove(0)
}

/// Returns the torque at the end of a long motion at constant velocity, Nm.
fn steady_torque(joint: &Joint, condition: &Condition, velocity: f64) -> f64 {
    let run = trajectory(5e-4, 0.5, |t| (velocity * t, velocity));
    *torques(joint, condition, &run, 0.0).last().unwrap()
}

/// Returns the level of the plain plant in steady sliding, by its definition, Nm.
fn expected_level(speed: f64) -> f64 {
    let curve = |one: &ContactElement| {
        one.share * (-(speed / (one.stribeck_ratio * SEAL.stribeck_rad_s)).powi(2)).exp()
    };
    let curve: f64 = lubricated().elements.iter().map(curve).sum();
    SEAL.coulomb_nm + (SEAL.static_nm - SEAL.coulomb_nm) * curve
}

/// Returns the viscous torque of the plain plant, by its definition, Nm.
fn expected_viscous(speed: f64) -> f64 {
    SEAL.k2 * 2.0 * (speed / 2.0).powf(0.7)
}

#[test]
fn torque_in_presliding_is_at_most_the_static_level() {
    let joint = Joint::plain(Seal { k2: 0.0, ..SEAL });
    for (size, hz) in [(0.3, 3.0), (1.0, 1.0), (3.0, 7.0), (20.0, 0.5)] {
        let (size, w) = (size * TRAVEL_RAD, std::f64::consts::TAU * hz);
        let run = trajectory(1e-3, 2.0, |t| {
            let growth = t / 2.0;
            let (sin, cos) = (w * t).sin_cos();
            (size * growth * sin, size * (growth * w * cos + sin / 2.0))
        });
        for held in [-0.9, 0.0, 0.5] {
            let found = torques(&joint, &Condition::default(), &run, held);
            let most = found.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            assert!(most <= SEAL.static_nm * (1.0 + 1e-12), "{size} {hz} {held}: {most}");
            assert!(size < TRAVEL_RAD || most > 0.5 * SEAL.coulomb_nm, "{size} {hz}: {most}");
        }
    }
}

#[test]
fn small_oscillation_below_breakaway_does_not_drift() {
    let joint = Joint::plain(Seal { k2: 0.0, ..SEAL });
    // The narrowest element stays below its breakaway of 0.3 of the level: 0.1 + 0.1 of a travel of 0.2.
    let (held, size) = (0.1, 0.02 * TRAVEL_RAD);
    let w = std::f64::consts::TAU * 10.0;
    let run = trajectory(1e-3, 5.0, |t| (size * (w * t).sin(), size * w * (w * t).cos()));
    let found = torques(&joint, &Condition::default(), &run, held);
    let period = 100;
    for at in period..found.len() {
        let drift = found[at] - found[at - period];
        assert!(drift.abs() < 1e-9, "{at}: {drift}");
    }
    // Bristles drift from the same state.
    let mechanism = Mechanism::plain(joint);
    let found = rows(&Machine::bristles(&mechanism), &Condition::default(), &run, held);
    assert!((found[5000] - found[0]).abs() > 0.01 * SEAL.coulomb_nm, "{}", found[5000]);
}

#[test]
fn torque_over_speed_has_hysteresis_only_for_fast_changes() {
    let joint = Joint::plain(SEAL);
    let most = 0.3;
    // Difference of the torques at the same speed, in acceleration and in deceleration, Nm.
    let opening = |seconds: f64| {
        let w = std::f64::consts::TAU / seconds;
        let (mean, swing) = (0.5 * most + 0.01, 0.5 * most);
        let run = trajectory(seconds / 8000.0, 2.0 * seconds, |t| {
            (mean * t - swing / w * (w * t).sin(), mean - swing * (w * t).cos())
        });
        let found = torques(&joint, &Condition::default(), &run, 0.0);
        found[8000 + 2000] - found[8000 + 6000]
    };
    assert!(opening(0.2) > 0.1, "{}", opening(0.2));
    assert!(opening(20.0).abs() < 0.02, "{}", opening(20.0));
}

#[test]
fn film_in_deceleration_follows_with_its_own_time_constant() {
    let seal = lubricated();
    let left = (-1f64).exp();
    assert!((seal.film_after(0.0, 2.0, 0.01) - 2.0 * (1.0 - left)).abs() < 1e-12);
    assert!((seal.film_after(2.0, 0.0, 0.03) - 2.0 * left).abs() < 1e-12);
}

#[test]
fn torque_with_half_the_step_gives_the_same_result() {
    let joint = Joint::plain(SEAL);
    let w = std::f64::consts::TAU * 2.0;
    let found = |step_s: f64| {
        let run = trajectory(step_s, 1.0, |t| (0.02 * (w * t).sin(), 0.02 * w * (w * t).cos()));
        let every = (1e-3 / step_s).round() as usize;
        let rows = torques(&joint, &Condition::default(), &run, 0.3);
        rows.into_iter().step_by(every).collect::<Vec<f64>>()
    };
    for (at, (a, b)) in found(1e-4).iter().zip(&found(5e-5)).enumerate() {
        assert!((a - b).abs() < 0.02 * SEAL.coulomb_nm, "{at}: {a} {b}");
    }
}

#[test]
fn torque_in_steady_sliding_is_level_plus_power_law() {
    let joint = Joint::plain(SEAL);
    for speed in [0.02, 0.1, 0.4, 2.0] {
        let expected = expected_level(speed) + expected_viscous(speed);
        for side in [-1.0, 1.0] {
            let found = steady_torque(&joint, &Condition::default(), side * speed);
            assert!((found - side * expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}

/// Time from the start of the campaign to the end of [`steady_torque`] under [`condition`], s.
const END_S: f64 = 100.5;

/// Returns constant conditions, so that the effect of each covariate is known.
fn condition() -> Condition {
    let constant = |level: f64| Signal { level, ..Signal::default() };
    Condition {
        force: constant(40.0),
        pressure: constant(1e5),
        temperature: constant(30.0),
        load: constant(-3.0),
        start_s: 100.0,
        ..Condition::default()
    }
}

/// Asserts that a joint slides at the level and the viscous and additive torque that `expected` returns, Nm.
///
/// `expected` receives the velocity, and the level and viscous torque of the plain plant.
fn assert_steady(joint: &Joint, expected: impl Fn(f64, f64, f64) -> (f64, f64, f64)) {
    for velocity in [0.05f64, -0.05, 0.4, -0.3] {
        let speed = velocity.abs();
        let (level, viscous, added) =
            expected(velocity, expected_level(speed), expected_viscous(speed));
        let expected = velocity.signum() * (level + viscous) + added;
        let found = steady_torque(joint, &condition(), velocity);
        assert!((found - expected).abs() < 1e-4, "{velocity} rad/s: {found} {expected} {joint:?}");
    }
}

#[test]
fn load_in_steady_sliding_adds_to_the_level() {
    let plain = Joint::plain(SEAL);
    let adds = |nm: f64| move |_, level: f64, viscous| (level + nm, viscous, 0.0);
    assert_steady(&plain, adds(0.0));
    assert_steady(&Joint::plain(Seal { per_force: 0.01, ..SEAL }), adds(0.4));
    assert_steady(&Joint::plain(Seal { per_pressure: 2e-6, ..SEAL }), adds(0.2));
    assert_steady(&Joint { per_load: 0.1, ..plain.clone() }, adds(0.3));
    let flavour = Flavour::Band { speed: 0.3, width: 0.1 };
    let joint = Joint { outside: Some(Outside { flavour, size: 0.4 }), ..plain };
    assert_steady(&joint, |velocity, level, viscous| {
        let bump = (-((velocity.abs() - 0.3) / 0.1).powi(2)).exp();
        (level + 0.4 * bump, viscous, 0.0)
    });
}

#[test]
fn factor_of_the_level_in_steady_sliding_scales_the_torque() {
    let plain = Joint::plain(SEAL);
    let thinning = Some(Thinning { per_k: 0.02, reference_c: 20.0 });
    let fall = (-0.02f64 * 10.0).exp();
    assert_steady(&Joint { stiffening: thinning, ..plain.clone() }, |_, level, viscous| {
        (level * fall, viscous, 0.0)
    });
    assert_steady(&Joint { thinning, ..plain.clone() }, |_, level, viscous| {
        (level, viscous * fall, 0.0)
    });
    assert_steady(&Joint { asymmetry: 0.1, ..plain.clone() }, |velocity, level, viscous| {
        let factor = 1.0 + 0.1 * velocity.signum();
        (level * factor, viscous * factor, 0.0)
    });
    let drift = Some(Drift::Wear { per_s: 1e-3 });
    assert_steady(&Joint { drift, ..plain.clone() }, |_, level, viscous| {
        (level * (1.0 + 1e-3 * END_S), viscous, 0.0)
    });
    let ripple = Some(Wave { size: 0.2, order: 3.0, phase: 0.4 });
    // The contact follows the ripple within a fraction of its presliding travel.
    assert_steady(&Joint { ripple, ..plain }, |velocity, level, viscous| {
        let angle = 0.5 * velocity - TRAVEL_RAD * velocity.signum();
        (level * (1.0 + 0.2 * (3.0 * angle + 0.4).sin()), viscous, 0.0)
    });
}

#[test]
fn additive_effect_in_steady_sliding_leaves_the_level() {
    let plain = Joint::plain(SEAL);
    assert_steady(&Joint { offset_nm: 0.3, ..plain.clone() }, |_, level, viscous| {
        (level, viscous, 0.3)
    });
    assert_steady(&Joint { drag: 0.5, ..plain.clone() }, |velocity, level, viscous| {
        (level, viscous, 0.5 * velocity * velocity.abs())
    });
    let play = Some(Play { travel_rad: 0.005, leak: 0.0 });
    assert_steady(&Joint { play, ..plain }, |_, level, viscous| (level, viscous, 0.0));
}

#[test]
fn draw_of_lubricated_seal_has_plausible_parameters() {
    for seed in 0..200 {
        let seal = LubricatedSeal::draw(&mut Sampler::new(seed, 1), 3.0);
        assert!((4..=8).contains(&seal.elements.len()), "{seed}");
        let shares: f64 = seal.elements.iter().map(|one| one.share).sum();
        assert!((shares - 1.0).abs() < 1e-12, "{seed}: {shares}");
        for one in &seal.elements {
            assert!((0.04..=2.01).contains(&one.travel), "{seed}: {one:?}");
            assert!((0.4..=2.5).contains(&one.stribeck_ratio), "{seed}: {one:?}");
            assert!((0.3..=0.85).contains(&one.elastic_share), "{seed}: {one:?}");
        }
        let (fast, slow) = (seal.build_up_s, seal.collapse_s);
        assert!(5e-3 <= fast && 1.2 * fast < slow && slow <= 8e-2, "{seed}: {fast} {slow}");
        assert!((0.6..=0.95).contains(&seal.viscous_exponent), "{seed}");
    }
}

#[test]
fn draw_of_campaign_with_lubricated_seal_and_same_seed_gives_same_torque() {
    for seed in seeds(7).take(6) {
        let drawn = || {
            let mut sampler = Family::LubricatedSeal.sampler(seed);
            let plant = Family::LubricatedSeal.draw_plant_kind(&mut sampler);
            assert_eq!(plant, PlantKind::LubricatedSeal);
            Campaign::draw(&mut sampler, sensor_kind(seed), plant, Family::LubricatedSeal)
        };
        let (one, other) = (drawn(), drawn());
        assert_eq!(format!("{:?}", one.plant), format!("{:?}", other.plant));
        assert_eq!(format!("{:?}", one.sensing), format!("{:?}", other.sensing));
        assert_eq!(one.plant.name(), "lubricated-seal");
    }
}
