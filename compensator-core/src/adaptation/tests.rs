use super::*;
use crate::law::LawKind;
use crate::number::Fixed;
use crate::parameter::ParameterId as Id;
use crate::term::TermKind;
use proptest::prelude::*;
use std::vec::Vec;

const PERIOD_S: f32 = 5e-3;

fn joint(terms: &[TermKind]) -> Parameters<f32> {
    let mut parameters = Parameters::new(LawKind::Lugre)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.0)
        .with(Id::StribeckVelocity, 0.1)
        .with(Id::BristleStiffness, 2e3)
        .with(Id::ViscousFriction, 0.4);
    parameters.choices.damping_fades = true;
    terms.iter().for_each(|kind| assert!(parameters.add_term(*kind)));
    parameters
}

fn build(parameters: &Parameters<f32>) -> Adaptation {
    let settings = AdaptationParameters { noise_nm: 0.05, ..AdaptationParameters::default() };
    Adaptation::build(parameters, &settings, PERIOD_S).unwrap()
}

/// A velocity that reverses, with slow and fast parts in both directions.
fn velocity(time_s: f32) -> f32 {
    libm::sinf(0.9 * time_s) * (0.8 + 0.6 * libm::sinf(0.23 * time_s))
}

/// Steps with a true model for this time, s; `disturb` changes observations.
fn run(
    adaptation: &mut Adaptation,
    truth: &Parameters<f32>,
    seconds: f32,
    mut disturb: impl FnMut(f32, &mut Observation),
) {
    let model = truth.build::<f32>(PERIOD_S).unwrap();
    let mut state = ModelState::default();
    for index in 0..(seconds / PERIOD_S) as usize {
        let time_s = index as f32 * PERIOD_S;
        let sample = Sample {
            velocity_rad_s: velocity(time_s),
            pressure_diff_mpa: 1.0 + libm::sinf(0.05 * time_s),
            ..Sample::default()
        };
        let torque_nm = model.step(&mut state, &sample);
        let mut observation = Observation { sample, torque_nm, followed: [None; 3], blocked: None };
        disturb(time_s, &mut observation);
        adaptation.step(&observation);
    }
}

fn unchanged(_: f32, _: &mut Observation) {}

#[test]
fn set_gains_of_every_law_and_term_matches_build_of_scaled_parameters() {
    let value = |id: Id| {
        let [lower, upper] = id.range();
        (id.info().default as f32 + 0.3).clamp(lower, upper)
    };
    for law in LawKind::ALL {
        for term in TermKind::ALL {
            let mut written = Parameters::<f32>::new(*law);
            written.add_term(*term);
            let ids: Vec<_> = written.active().collect();
            ids.iter().for_each(|id| written.set(*id, value(*id)));
            let mut gains = Gains { level: 1.5, viscous: 0.5, ..Gains::default() };
            gains.terms[0] = 0.75;
            let source = written.build_unchecked::<f32>(PERIOD_S);
            let mut scaled = source.clone();
            scaled.set_gains(&source, &gains);
            let built = written.with_gains(&gains).build_unchecked::<f32>(PERIOD_S);
            let (mut a, mut b) = (ModelState::default(), ModelState::default());
            for step in 0..200 {
                let angle = step as f32 * 0.05;
                let sample = Sample {
                    velocity_rad_s: libm::sinf(angle),
                    position_rad: angle,
                    acceleration_rad_s2: libm::cosf(angle),
                    radial_force_n: 3.0,
                    radial_force_change_n: 0.01,
                    pressure_diff_mpa: 0.2,
                    temperature_c: 30.0,
                    load_torque_nm: 0.7,
                    ..Sample::default()
                };
                let (x, y) = (scaled.step(&mut a, &sample), built.step(&mut b, &sample));
                let difference = (x - y).abs() / (1.0 + y.abs());
                assert!(difference < 1e-4, "{} {}: {x} {y}", law.name(), term.name());
            }
        }
    }
}

#[test]
fn sizes_of_terms_are_parameters_of_the_term() {
    for kind in TermKind::ALL {
        assert!(kind.sizes().iter().all(|id| kind.parameters().contains(id)), "{}", kind.name());
    }
}

#[test]
fn step_with_other_levels_learns_them_within_one_percent() {
    let tuned = joint(&[]);
    let mut adaptation = build(&tuned);
    let truth = Gains { level: 1.4, viscous: 1.9, ..Gains::default() };
    run(&mut adaptation, &tuned.with_gains(&truth), 200.0, unchanged);
    let gains = adaptation.gains();
    assert!((gains.level - 1.4).abs() < 0.014 && (gains.viscous - 1.9).abs() < 0.03, "{gains:?}");
    assert_eq!(adaptation.frozen(), Frozen::None);
    assert!(adaptation.deviations()[0] < 0.01, "{:?}", adaptation.deviations());
}

#[test]
fn step_with_errors_of_the_structure_keeps_the_tuned_set() {
    let tuned = joint(&[]);
    let mut adaptation = build(&tuned);
    // Another Stribeck curve, and a torque that the law does not have: some percent at every speed.
    let truth = tuned.clone().with(Id::StribeckVelocity, 0.06);
    run(&mut adaptation, &truth, 600.0, |_, observation| {
        let velocity = observation.sample.velocity_rad_s;
        observation.torque_nm -= 0.06 * velocity * Real::abs(velocity);
    });
    assert_eq!(*adaptation.gains(), Gains::default());
}

#[test]
fn step_with_a_change_beyond_the_dead_zone_learns_all_of_it() {
    let tuned = joint(&[]);
    for level in [0.88, 1.06] {
        let mut adaptation = build(&tuned);
        let truth = Gains { level, ..Gains::default() };
        run(&mut adaptation, &tuned.with_gains(&truth), 200.0, unchanged);
        let gains = adaptation.gains();
        assert!((gains.level - level).abs() < 0.01, "{gains:?}");
        assert_eq!(gains.viscous, 1.0);
    }
}

#[test]
fn step_with_levels_that_double_in_minutes_lags_by_seconds() {
    let tuned = joint(&[]);
    let mut adaptation = build(&tuned);
    let mut level = 1.0;
    while level < 2.0 {
        level += 0.02;
        let truth = Gains { level, ..Gains::default() };
        run(&mut adaptation, &tuned.with_gains(&truth), 10.0, unchanged);
    }
    // 0.2 % per second, and 10 s of memory.
    let lag = level - adaptation.gains().level;
    assert!(Real::abs(lag) < 0.05, "{lag}");
}

#[test]
fn step_with_enabled_term_learns_its_gain() {
    let mut tuned = joint(&[TermKind::PressureCoulomb]);
    tuned.set(Id::PressureCoulomb, 5e-7);
    let mut adaptation = build(&tuned);
    let mut truth = Gains::default();
    truth.terms[0] = 1.6;
    run(&mut adaptation, &tuned.with_gains(&truth), 400.0, unchanged);
    let gains = adaptation.gains();
    assert!((gains.terms[0] - 1.6).abs() < 0.05 && (gains.level - 1.0).abs() < 0.02, "{gains:?}");
}

#[test]
fn step_with_constant_torque_keeps_levels() {
    let tuned = joint(&[]);
    let mut adaptation = build(&tuned);
    run(&mut adaptation, &tuned, 200.0, |_, observation| observation.torque_nm += 0.8);
    let gains = adaptation.gains();
    assert!((gains.level - 1.0).abs() < 0.02, "{gains:?}");
    assert!((adaptation.constant_torque_nm() - 0.8).abs() < 0.05);
}

#[test]
fn step_of_a_slow_log_learns_the_level() {
    let tuned = joint(&[]);
    let settings = AdaptationParameters { settle_s: 0.0, ..AdaptationParameters::default() };
    // A sample is longer than a window, and twice as long as the memory allows for.
    let period_s = 20.0;
    let mut adaptation = Adaptation::build(&tuned, &settings, period_s).unwrap();
    for index in 0..400 {
        let direction = if index % 8 < 4 { 1.0 } else { -1.0 };
        let sample = Sample { velocity_rad_s: 0.5 * direction, ..Sample::default() };
        let torque_nm = 1.3 * direction * 1.5 + 0.2 * direction;
        adaptation.step(&Observation { sample, torque_nm, followed: [None; 3], blocked: None });
    }
    let gains = adaptation.gains();
    assert!((gains.level - 1.3).abs() < 0.03, "{gains:?}");
}

#[test]
fn resume_after_a_gap_keeps_gains_and_waits_for_sliding() {
    let tuned = joint(&[]);
    let mut adaptation = build(&tuned);
    let truth = Gains { level: 1.4, ..Gains::default() };
    run(&mut adaptation, &tuned.with_gains(&truth), 100.0, unchanged);
    let before = *adaptation.gains();
    adaptation.resume(ModelState::default());
    let sample = Sample { velocity_rad_s: 1.0, ..Sample::default() };
    // The torque of another run is no step of a contact.
    let observation = Observation { sample, torque_nm: 9.0, followed: [None; 3], blocked: None };
    for _ in 0..4 {
        assert!(!adaptation.step(&observation));
    }
    assert_eq!(adaptation.frozen(), Frozen::Settling);
    assert_eq!(*adaptation.gains(), before);
}

#[test]
fn step_that_is_not_excited_keeps_what_was_learnt() {
    let tuned = joint(&[TermKind::PressureCoulomb]).with(Id::PressureCoulomb, 5e-7);
    let mut adaptation = build(&tuned);
    let mut truth = Gains::default();
    truth.terms[0] = 1.6;
    let truth = tuned.with_gains(&truth);
    run(&mut adaptation, &truth, 400.0, unchanged);
    let before = *adaptation.gains();
    // At a constant pressure, level and term cannot be told apart for an hour.
    run(&mut adaptation, &truth, 3600.0, |time_s, observation| {
        let pressure = observation.sample.pressure_diff_mpa;
        observation.sample.pressure_diff_mpa = 1.0;
        let direction = velocity(time_s).signum();
        observation.torque_nm -= 1.6 * 0.5 * (pressure - 1.0) * direction;
    });
    let after = *adaptation.gains();
    assert!((before.terms[0] - after.terms[0]).abs() < 0.05, "{before:?} {after:?}");
    assert!((before.level - after.level).abs() < 0.03, "{before:?} {after:?}");
}

#[test]
fn step_with_lying_inputs_stays_frozen_or_in_the_box() {
    let tuned = joint(&[]);
    for case in 0..5 {
        let mut adaptation = build(&tuned);
        run(&mut adaptation, &tuned, 100.0, |time_s, observation| match case {
            0 => observation.torque_nm = f32::NAN,
            1 => observation.sample.velocity_rad_s = f32::INFINITY,
            2 => observation.torque_nm = 1e30,
            3 => observation.blocked = Some(Frozen::Saturated),
            _ => observation.torque_nm += if (time_s % 7.0) < 1.0 { 5.0 } else { 0.0 },
        });
        let gains = adaptation.gains();
        if [0, 1, 3].contains(&case) {
            assert_eq!(*gains, Gains::default(), "case {case}");
        }
        if case == 4 {
            assert!((gains.level - 1.0).abs() < 0.1, "{gains:?}");
        }
        assert!(gains.to_array().iter().all(|gain| (0.4..=2.5).contains(gain)), "{gains:?}");
    }
}

/// Learns a level of 1.5 times the tuned one.
fn learnt(tuned: &Parameters<f32>) -> Adaptation {
    let mut adaptation = build(tuned);
    let truth = Gains { level: 1.5, ..Gains::default() };
    run(&mut adaptation, &tuned.with_gains(&truth), 120.0, unchanged);
    assert!((adaptation.gains().level - 1.5).abs() < 0.02, "{:?}", adaptation.gains());
    adaptation
}

/// Steps a joint that slides back and forth with this level, s. `each` receives the level's gain after each step.
fn slide(adaptation: &mut Adaptation, level_nm: f32, seconds: f32, mut each: impl FnMut(f32)) {
    for index in 0..(seconds / PERIOD_S) as usize {
        let direction = if index % 400 < 200 { 1.0 } else { -1.0 };
        let sample = Sample { velocity_rad_s: direction, ..Sample::default() };
        let torque_nm = level_nm * direction;
        adaptation.step(&Observation { sample, torque_nm, followed: [None; 3], blocked: None });
        each(adaptation.gains().level);
    }
}

#[test]
fn gains_rise_by_their_slew_and_fall_ten_times_as_fast() {
    let mut adaptation = learnt(&joint(&[]));
    let step = AdaptationParameters::default().slew_per_s * WINDOW_S;
    let mut last = adaptation.gains().level;
    for (level_nm, bound) in [(4.5f32, step), (1.0, -FALL_FACTOR * step)] {
        let mut fastest = 0.0f32;
        slide(&mut adaptation, level_nm, 60.0, |level| {
            let change = level - last;
            last = level;
            assert!((-1.001 * FALL_FACTOR * step..=1.001 * step).contains(&change), "{change}");
            fastest = if bound > 0.0 { fastest.max(change) } else { fastest.min(change) };
        });
        assert!(fastest / bound > 0.5, "{fastest} {bound}");
    }
}

#[test]
fn gains_above_the_set_fall_beyond_its_speeds_and_in_a_contact_that_needs_less_torque() {
    let mut tuned = joint(&[]);
    tuned.envelope.velocity_max_rad_s = 2.0;
    let level_after = |torque_nm: f32, velocity_rad_s: f32, blocked| {
        let mut adaptation = learnt(&tuned);
        let before = adaptation.gains().level;
        let sample = Sample { velocity_rad_s, ..Sample::default() };
        // A second of sliding, then the torque steps.
        for index in 0..1000 {
            let torque_nm = if index < 200 { 1.5 * 1.5 + 0.4 * velocity_rad_s } else { torque_nm };
            let observation = Observation { sample, torque_nm, followed: [None; 3], blocked };
            adaptation.step(&observation);
        }
        adaptation.gains().level - before
    };
    assert!(level_after(0.0, 3.0, None) < -0.4, "too fast");
    assert!(level_after(0.0, 3.0, Some(Frozen::Saturated)) < -0.4, "too fast, and at a limit");
    assert_eq!(level_after(0.0, 3.0, Some(Frozen::Hold)), 0.0);
    assert!(level_after(0.9, 1.0, None) < -0.4, "a drag has ended");
    assert!(level_after(4.0, 1.0, None).abs() < 0.02, "a contact");
}

#[test]
fn gains_that_make_a_set_invalid_are_not_used() {
    // A lower level allows for less bristle damping.
    let mut tuned = joint(&[]).with(Id::BristleDamping, 1e3).with(Id::ViscousFriction, 0.05);
    tuned.envelope.velocity_max_rad_s = 3.0;
    tuned.choices.damping_fades = false;
    let lower = Gains { level: 0.6, ..Gains::default() };
    let limit = tuned.with_gains(&lower).active_damping().unwrap();
    tuned.set(Id::BristleDamping, 1.1 * limit);
    let half = tuned.with_gains(&lower);
    assert!(half.validate().is_err());
    assert_eq!(tuned.validate(), Ok(()));
    let mut adaptation = build(&tuned);
    slide(&mut adaptation, 0.6 * 1.55, 200.0, |_| {});
    assert!(adaptation.gains().level < 0.97, "{:?}", adaptation.gains());
    assert!(adaptation.learnt_parameters().validate().is_ok());
    assert_eq!(adaptation.frozen(), Frozen::Refused);
}

/// The recursion in double precision, by the matrix itself.
struct Reference {
    information: Vec<Vec<f64>>,
    estimate: Vec<f64>,
}

impl Reference {
    fn step(&mut self, phi: &[f64], measured: f64, retained: f64) {
        let n = phi.len();
        let a = &mut self.information;
        let along: Vec<f64> = (0..n).map(|i| (0..n).map(|j| a[i][j] * phi[j]).sum()).collect();
        let whole: f64 = along.iter().zip(phi).map(|(a, p)| a * p).sum();
        for i in 0..n {
            for j in 0..n {
                a[i][j] += phi[i] * phi[j] - (1.0 - retained) * along[i] * along[j] / whole;
            }
        }
        let error = measured - self.estimate.iter().zip(phi).map(|(x, p)| x * p).sum::<f64>();
        let step = solved(a, &phi.iter().map(|p| p * error).collect::<Vec<_>>());
        self.estimate.iter_mut().zip(step).for_each(|(x, s)| *x += s);
    }
}

fn solved(matrix: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let n = right.len();
    let mut rows: Vec<Vec<f64>> =
        matrix.iter().zip(right).map(|(r, b)| r.iter().copied().chain([*b]).collect()).collect();
    for pivot in 0..n {
        for row in 0..n {
            if row != pivot {
                let above = rows[pivot].clone();
                let factor = rows[row][pivot] / above[pivot];
                rows[row].iter_mut().zip(above).for_each(|(entry, above)| *entry -= factor * above);
            }
        }
    }
    (0..n).map(|row| rows[row][n] / rows[row][row]).collect()
}

#[test]
fn information_root_over_a_week_matches_double_precision() {
    let n = 5;
    let mut root = InformationRoot::of_deviations(&[0.3; 5]);
    let mut estimate = [0.0f32; DIMENSIONS];
    let information =
        (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 / 0.09 } else { 0.0 }).collect()).collect();
    let mut reference = Reference { information, estimate: std::vec![0.0; n] };
    let truth = [1.0, 0.5, -0.3, 2.0, 0.1];
    // 20 windows per second of sliding, a quarter of a week: what grows with the root of the time would show.
    for step in 0..3_000_000u32 {
        let t = f64::from(step) * 0.05;
        let mut phi64 = [0.0; 5];
        phi64[0] = 10.0 * (0.7 * t).sin().signum();
        phi64[1] = 10.0 * (0.7 * t).sin();
        phi64[2] = 6.0;
        // Two directions are excited in the first hour only.
        if step < 72_000 {
            phi64[3] = 3.0 * (0.11 * t).cos();
            phi64[4] = 4.0 * (0.031 * t).sin();
        }
        let noise = 0.5 * (12.9898 * t).sin();
        let measured: f64 = phi64.iter().zip(truth).map(|(p, x)| p * x).sum::<f64>() + noise;
        let mut phi = [0.0f32; DIMENSIONS];
        phi.iter_mut().zip(phi64).for_each(|(to, from)| *to = from as f32);
        let predicted: f32 = phi.iter().zip(estimate).map(|(p, x)| p * x).sum();
        root.forget(&phi, 0.9975);
        let change = root.update(&phi, measured as f32 - predicted);
        estimate.iter_mut().zip(change).for_each(|(x, c)| *x += c);
        if step < 200_000 {
            reference.step(&phi64, measured, 0.9975);
            if step % 20_000 == 19_999 {
                for (single, double) in estimate.iter().zip(&reference.estimate) {
                    assert!((f64::from(*single) - double).abs() < 2e-3, "{step}: {estimate:?}");
                }
            }
        }
    }
    assert!(root.is_regular());
    for (single, truth) in estimate.iter().zip(truth) {
        assert!((f64::from(*single) - truth).abs() < 0.05, "{estimate:?}");
    }
}

/// Walks a random path of gains and inputs. Returns the largest bristle torque and friction, Nm.
fn walk<T: Real<Setting = f32>>(written: &Parameters<f32>, seed: u64) -> [f64; 2] {
    let base = written.build::<T>(50e-6).unwrap();
    let mut model = base.clone();
    let mut state = ModelState::default();
    let mut random = seed;
    let mut uniform = || {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 40) as f64 / f64::from(1u32 << 24)
    };
    let mut largest = [0.0f64; 2];
    for _ in 0..4000 {
        let gain = |share: f64| T::from_f64(0.4 + 2.1 * share);
        let mut gains =
            Gains { level: gain(uniform()), viscous: gain(uniform()), ..Gains::default() };
        gains.terms[0] = gain(uniform());
        model.set_gains(&base, &gains);
        let sample = Sample {
            velocity_rad_s: T::from_f64((uniform() - 0.5) * 6.0),
            pressure_diff_mpa: T::from_f64(uniform()),
            ..Sample::default()
        };
        for _ in 0..(uniform() * 10.0) as usize {
            let friction = model.step(&mut state, &sample);
            let bristle = state.bristle_torque_nm.value().abs();
            largest = [largest[0].max(bristle), largest[1].max(friction.value().abs())];
        }
    }
    largest
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]
    #[test]
    fn state_and_torque_on_random_paths_stay_within_bounds_of_the_box(seed in any::<u64>()) {
        let mut written = joint(&[TermKind::PressureCoulomb]).with(Id::PressureCoulomb, 5e-7);
        written.set(Id::BristleDamping, 1.0);
        written.envelope.velocity_max_rad_s = 3.0;
        written.envelope.pressure_diff_max_pa = 1e6;
        let mut most = Gains { level: 2.5, viscous: 2.5, ..Gains::default() };
        most.terms[0] = 2.5;
        let [level, torque] = written.with_gains(&most).largest_torques_nm(50e-6).unwrap();
        // The earlier state adds at most one more level to the rate (step 2 of the proof).
        for [bristle, friction] in [walk::<f32>(&written, seed), walk::<Fixed>(&written, seed)] {
            prop_assert!(bristle <= f64::from(level) * 1.0001, "{bristle} {level}");
            prop_assert!(friction <= f64::from(torque) * 1.0001, "{friction} {torque}");
        }
    }
}
