//! Tests that every family of friction must pass.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Sub-step of the plant.
const DT: f64 = 25e-6;
const UNIT_NM: f64 = 12.0;

const PRESSING: Pressing =
    Pressing { unit_nm: UNIT_NM, factor: 1.0, raised_nm: 0.0, viscosity: 1.0 };

fn contact(family: FrictionFamily) -> (Contact, Parameters) {
    let p = Parameters::default();
    (Contact::new(family, &p, UNIT_NM), p)
}

/// Returns the torque at the end of this time at a velocity.
fn slide(contact: &mut Contact, p: &Parameters, velocity: f64, seconds: f64) -> f64 {
    let steps = (seconds / DT) as usize;
    (0..steps).map(|_| contact.step(p, &PRESSING, velocity, velocity, DT)).last().unwrap_or(0.0)
}

/// A motion of several oscillations from presliding to fast sliding, with rests: the velocity at a time.
fn random_motion(random: &mut Pcg64) -> impl Fn(f64) -> f64 + use<> {
    let waves: Vec<[f64; 3]> = (0..4)
        .map(|_| {
            let velocity = 10f64.powf(random.random_range(-4.0..0.7));
            [velocity, random.random_range(0.3..40.0), random.random_range(0.0..TAU)]
        })
        .collect();
    let rest = random.random_range(0.2..0.9);
    move |t: f64| {
        let moves = (3.0 * t).fract() < rest;
        let sum: f64 = waves.iter().map(|[v, hz, phase]| v * (TAU * hz * t + phase).sin()).sum();
        if moves { sum } else { 0.0 }
    }
}

#[test]
fn no_motion_recovers_more_energy_than_it_has_put_in() {
    for family in FrictionFamily::ALL {
        let mut random = Pcg64::seed_from_u64(11);
        for number in 0..20 {
            let (mut contact, p) = contact(family);
            let motion = random_motion(&mut random);
            // The level varies too, as by a side load.
            let [size, hz] = [random.random_range(0.0..0.4), random.random_range(0.5..20.0)];
            let (mut work_j, mut least_j) = (0.0, 0.0f64);
            for step in 0..40_000 {
                let t = f64::from(step) * DT;
                let factor = 1.0 + size * (TAU * hz * t).sin();
                let pressing = Pressing { factor, ..PRESSING };
                let velocity = motion(t);
                work_j += DT * velocity * contact.step(&p, &pressing, velocity, velocity, DT);
                least_j = least_j.min(work_j);
            }
            assert!(least_j >= -1e-9, "{family:?}, motion {number}: {least_j} J");
            assert!(work_j > 0.0, "{family:?}, motion {number}: {work_j} J");
        }
    }
}

#[test]
fn work_exceeds_the_change_of_elastic_energy_in_every_step() {
    for family in [FrictionFamily::RateAndState, FrictionFamily::Iwan] {
        let (mut contact, p) = contact(family);
        let energy_j = |contact: &Contact| match contact {
            Contact::RateAndState(contact) => contact.energy_j(),
            Contact::Iwan(contact) => contact.energy_j(),
            Contact::MaxwellSlip(_) => 0.0,
        };
        let motion = random_motion(&mut Pcg64::seed_from_u64(5));
        for step in 0..80_000 {
            let velocity = motion(f64::from(step) * DT);
            let before = energy_j(&contact);
            let work = DT * velocity * contact.step(&p, &PRESSING, velocity, velocity, DT);
            let gained = energy_j(&contact) - before;
            assert!(work - gained >= -1e-15, "{family:?}: {work} {gained}");
        }
    }
}

#[test]
fn small_stroke_is_mostly_recovered_and_a_large_one_slides() {
    for family in FrictionFamily::ALL {
        let (mut contact, p) = contact(family);
        let kinetic = UNIT_NM * p.friction_kinetic;
        // A stroke of 4e-5 rad on about 4000 Nm/rad.
        let there = slide(&mut contact, &p, 0.004, 0.01);
        assert!((0.04..0.2).contains(&there), "{family:?}: {there} Nm");
        let back = slide(&mut contact, &p, -0.004, 0.01);
        assert!(back.abs() < 0.45 * there, "{family:?}: {back} Nm of {there} Nm");
        let slid = slide(&mut contact, &p, 1.0, 0.5);
        assert!((0.9 * kinetic..1.25 * kinetic).contains(&slid), "{family:?}: {slid} Nm");
        let reversed = slide(&mut contact, &p, -1.0, 0.5);
        assert!((reversed + slid).abs() < 0.02 * slid, "{family:?}: {reversed} Nm");
    }
}

#[test]
fn slow_sliding_and_breakaway_exceed_fast_sliding() {
    for family in FrictionFamily::ALL {
        let (mut contact, p) = contact(family);
        let ratio = p.friction_static / p.friction_kinetic;
        slide(&mut contact, &p, 0.0, 2.0);
        let steps = (0.2 / DT) as usize;
        let breakaway =
            (0..steps).map(|_| contact.step(&p, &PRESSING, 0.05, 0.05, DT)).fold(0.0, f64::max);
        let slow = slide(&mut contact, &p, 0.004, 2.0);
        let fast = slide(&mut contact, &p, 1.0, 2.0);
        assert!(slow > 1.1 * fast && slow < ratio * fast, "{family:?}: {slow} and {fast} Nm");
        assert!(
            breakaway > 1.1 * fast && breakaway < 1.3 * ratio * fast,
            "{family:?}: {breakaway} and {fast} Nm"
        );
    }
}

#[test]
fn hysteresis_remembers_where_its_strokes_turned() {
    // After an inner loop, the contact follows the outer one as if there had been none.
    for family in [FrictionFamily::MaxwellSlip, FrictionFamily::Iwan] {
        let (mut plain, p) = contact(family);
        let velocity = 0.01;
        slide(&mut plain, &p, velocity, 0.02);
        let mut looped = plain.clone();
        slide(&mut looped, &p, -velocity, 0.006);
        let torque = slide(&mut looped, &p, velocity, 0.006);
        let expected = plain.step(&p, &PRESSING, 0.0, 0.0, DT);
        assert!((torque / expected - 1.0).abs() < 0.05, "{family:?}: {torque} {expected}");
        let [outer, inner] =
            [&mut plain, &mut looped].map(|contact| slide(contact, &p, velocity, 0.01));
        assert!((inner / outer - 1.0).abs() < 0.05, "{family:?}: {inner} {outer}");
    }
}

#[test]
fn families_are_found_by_their_names() {
    for family in FrictionFamily::ALL {
        assert_eq!(FrictionFamily::parse(family.name()), Some(family));
    }
    assert_eq!(FrictionFamily::parse("lugre"), None);
}
