//! Tests of the drawn joints: what they hide is there, and they have the size of a sealed joint.

use super::*;

/// Longer than that of the drive: these motions are slow.
const PERIOD_S: f64 = 100e-6;

fn hide(text: &str) -> Hide {
    Hide::parse(text).expect("a cause")
}

fn draw(seed: u64, hidden: &[&str]) -> DrawnJoint {
    let hidden: Vec<Hide> = hidden.iter().map(|text| hide(text)).collect();
    DrawnJoint::draw(seed, &hidden, None).expect("a joint")
}

/// Returns the torque of an ideal drive that follows a motion with reversals, dwells and two speeds, Nm, a value per 10 ms.
fn drive(joint: &DrawnJoint, seconds: f64) -> Vec<f64> {
    drive_with(joint, joint.plant(), seconds)
}

fn drive_with(joint: &DrawnJoint, mut plant: JointPlant, seconds: f64) -> Vec<f64> {
    let constants = &joint.constants;
    let per_ampere = constants.motor_torque_constant_nm_per_a
        * constants.gear_ratio
        * (1.0 + constants.torque_constant_error);
    let inertia = constants.rotor_inertia_kg_m2 * constants.gear_ratio * constants.gear_ratio
        + constants.output_inertia_kg_m2;
    // The velocity of the motor, as a drive measures it: feedback across a compliant coupling is not stable.
    let per_turn = constants.encoder_direction * TAU / constants.gear_ratio;
    let (mut integral, mut torques) = (0.0, Vec::new());
    for step in 0..(seconds / PERIOD_S) as usize {
        let t = step as f64 * PERIOD_S;
        // A dwell of two seconds follows each pair of strokes.
        let phase = t % 8.0;
        let target = match phase {
            0.0..6.0 => 0.35 * (TAU * phase / 3.0).sin() + 0.05 * (TAU * phase).sin(),
            _ => 0.0,
        };
        let error = joint.start_rad + target - plant.position_rad();
        let velocity = per_turn * plant.motor_turns_in(1.0);
        integral += 400.0 * inertia * error * PERIOD_S;
        let torque = inertia * (900.0 * error - 60.0 * velocity) + 10.0 * integral;
        plant.period_at_current(PERIOD_S, torque / per_ampere);
        if step % 100 == 99 {
            torques.push(torque);
        }
    }
    torques
}

#[test]
fn draw_with_equal_seed_is_equal_and_differs_from_other_seeds() {
    assert_eq!(draw(7, &["pressure-coulomb"]), draw(7, &["pressure-coulomb"]));
    assert_ne!(draw(7, &[]).constants, draw(8, &[]).constants);
    // The hidden effect leaves the rest of the joint alone.
    let (clean, hidden) = (draw(7, &["none"]), draw(7, &["torque-offset"]));
    assert_eq!((clean.constants, clean.known), (hidden.constants, hidden.known));
    assert_eq!(clean.hidden, []);
}

#[test]
fn draw_with_given_size_keeps_it_and_a_drawn_size_is_within_bounds() {
    assert_eq!(draw(3, &["pressure-coulomb:2e-6"]).hidden[0].size, 2e-6);
    for seed in 0..20 {
        for cause in HiddenCause::ALL {
            let Ok(joint) =
                DrawnJoint::draw(seed, &[Hide { effect: Some(cause), size: None }], None)
            else {
                continue;
            };
            let (least, most) = cause.bounds();
            let size = joint.hidden[0].size;
            assert!((least..=most).contains(&size) && size != cause.neutral(), "{cause:?} {size}");
        }
    }
}

#[test]
fn draw_of_an_effect_that_the_plant_cannot_have_is_refused_with_its_name() {
    for text in ["channel-delay", "load-torque-coulomb", "unknown", "unmodelled-inertia:-0.1"] {
        let error = DrawnJoint::draw(1, &[hide(text)], None).expect_err("a refusal").to_string();
        let name = text.split(':').next().unwrap_or_default();
        assert!(error.starts_with(name) && error.lines().count() == 1, "{error}");
    }
    let twice = [hide("backlash"), hide("torque-offset"), hide("backlash")];
    assert!(
        DrawnJoint::draw(1, &twice, None).expect_err("twice").to_string().contains("given twice")
    );
    let none = [hide("none"), hide("backlash")];
    assert!(
        DrawnJoint::draw(1, &none, None)
            .expect_err("none and one")
            .to_string()
            .contains("by itself")
    );
}

#[test]
fn every_hidden_effect_changes_the_torque_of_a_motion() {
    let deviation = |a: &[f64], b: &[f64]| {
        let squares: f64 = a.iter().zip(b).skip(100).map(|(a, b)| (a - b) * (a - b)).sum();
        (squares / (a.len() - 100) as f64).sqrt()
    };
    for (at, cause) in HiddenCause::ALL.into_iter().enumerate() {
        let has_shape = cause == HiddenCause::StribeckShape;
        let family = (!has_shape).then_some(FrictionFamily::ALL[at % 3]);
        let hide = [Hide { effect: Some(cause), size: None }];
        let Ok(joint) = DrawnJoint::draw(5, &hide, family) else { continue };
        // The same joint in the same surroundings, but with the neutral size.
        let hide = [Hide { effect: Some(cause), size: Some(cause.neutral()) }];
        let neutral = DrawnJoint::draw(5, &hide, family).expect("a neutral size");
        let share = deviation(&drive(&joint, 24.0), &drive(&neutral, 24.0)) / joint.friction_nm;
        let least = match cause {
            // Presliding alone, and a twentieth of the drift's time.
            HiddenCause::RadialForceRate | HiddenCause::Backlash | HiddenCause::TimeDrift => 0.005,
            HiddenCause::StribeckShape => 0.01,
            _ => 0.03,
        };
        assert!(share > least && share < 1.0, "{}: {share}", cause.name());
    }
}

#[test]
fn friction_of_drawn_joints_has_the_size_of_a_sealed_joint() {
    for seed in 0..12 {
        let joint = draw(seed, &[]);
        let torques = drive(&joint, 8.0);
        let most = torques.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
        assert!((0.5..7.0).contains(&most), "seed {seed}: {most} Nm");
        assert!((0.6..=3.0).contains(&joint.friction_nm));
        // A tenth of the level only strains the contact.
        let mut plant = joint.plant();
        let per_ampere = joint.known.torque_constant_nm_per_a * joint.constants.gear_ratio;
        let push = |plant: &mut JointPlant, torque: f64| {
            (0..4000).for_each(|_| plant.period_at_current(PERIOD_S, torque / per_ampere));
            plant.position_rad() - joint.start_rad
        };
        let strained = push(&mut plant, 0.3 * joint.friction_nm);
        assert!((1e-6..3e-3).contains(&strained), "seed {seed}: {strained} rad");
        let slid = push(&mut plant, 2.5 * joint.friction_nm);
        assert!(slid > 0.02, "seed {seed}: {slid} rad");
    }
}

#[test]
fn stribeck_shape_belongs_to_one_family() {
    let hide = [hide("stribeck-shape")];
    for family in FrictionFamily::ALL {
        let joint = DrawnJoint::draw(1, &hide, Some(family));
        assert_eq!(joint.is_ok(), family == FrictionFamily::MaxwellSlip, "{family:?}");
    }
    for seed in 0..6 {
        let joint = DrawnJoint::draw(seed, &hide, None).expect("a joint");
        assert_eq!(joint.family, FrictionFamily::MaxwellSlip);
    }
}

#[test]
fn drawn_plant_with_the_usual_substeps_agrees_with_fine_ones() {
    for family in FrictionFamily::ALL {
        for seed in [2, 3] {
            let joint = DrawnJoint::draw(seed, &[], Some(family)).expect("a joint");
            let with = |substeps: usize| {
                let mut plant = joint.plant();
                plant.set_substeps(substeps);
                drive_with(&joint, plant, 6.0)
            };
            let (usual, fine) = (with(4), with(20));
            let squares: f64 = usual.iter().zip(&fine).map(|(a, b)| (a - b) * (a - b)).sum();
            let share = (squares / usual.len() as f64).sqrt() / joint.friction_nm;
            assert!(share < 0.02, "{family:?} seed {seed}: {share}");
        }
    }
}
