//! Terms with a state: side-load rate, dwell time, backlash, channel delay and warm-up.

use super::*;

#[test]
fn radial_force_change_bends_bristles_by_stiffness_times_eta3() {
    const ETA3: f64 = 2e-6;
    let model = build::<f64>(&with_term(TermKind::RadialForceRate, &[(Id::RadialForceRate, ETA3)]));
    let mut state = ModelState::holding(0.5);
    let sample = Sample { radial_force_change_n: 30.0, ..Sample::default() };
    let friction = model.step(&mut state, &sample);
    let bending_nm = STIFFNESS * ETA3 * 30.0;
    assert!((state.bristle_torque_nm - (0.5 + bending_nm)).abs() < 1e-12);
    // At rest the damping acts only on the bending.
    let damping_nm = DAMPING * ETA3 * 30.0 / PERIOD;
    assert!((friction - (0.5 + bending_nm + damping_nm)).abs() < 1e-12);
}

/// Breakaway speed, rad/s: slow compared with the Stribeck velocity, fast compared with the renewal of the contact.
const BREAKAWAY_SPEED: f64 = 0.05;

/// Returns the peak friction at breakaway after a rest of `seconds`, Nm.
fn breakaway<T: Real>(parameters: &Parameters<T::Setting>, seconds: f64) -> f64 {
    let model = build::<T>(parameters);
    let mut state = ModelState::default();
    let at = |velocity: f64| Sample { velocity_rad_s: T::from_f64(velocity), ..Sample::default() };
    for _ in 0..2000 {
        model.step(&mut state, &at(1.0));
    }
    for _ in 0..(seconds / PERIOD) as u32 {
        model.step(&mut state, &at(0.0));
    }
    let starting = (0..300).map(|_| model.step(&mut state, &at(BREAKAWAY_SPEED)).value());
    starting.fold(0.0, f64::max)
}

#[test]
fn dwell_time_raises_breakaway_logarithmically() {
    // The travel is long compared with the bristle deflection of 2 mrad, so the contact is still old at the peak.
    let values = [(Id::DwellGain, 0.25), (Id::DwellTime, 0.5), (Id::DwellTravel, 1.0)];
    fn rise<T: Real>(values: &[(Id, f64)]) -> f64 {
        let parameters = with_term(TermKind::DwellTimeStatic, values);
        breakaway::<T>(&parameters, 100.0) - breakaway::<T>(&parameters, 5.0)
    }
    // The preceding sliding leaves a contact age of travel over speed, 1 s. The Stribeck curve reduces the rise of
    // the static level at the breakaway speed.
    let aged = 0.25 * ((1.0f64 + 101.0 / 0.5) / (1.0 + 6.0 / 0.5)).ln();
    let formula = level(0.0, aged, BREAKAWAY_SPEED);
    for found in [rise::<f64>(&values), rise::<f32>(&values), rise::<Fixed>(&values)] {
        assert!((found / formula - 1.0).abs() < 0.05, "{found}, formula {formula}");
    }
    let plain = breakaway::<f64>(&base(), 100.0) - breakaway::<f64>(&base(), 5.0);
    assert!(plain.abs() < 1e-6, "without the term, rest has no effect: {plain}");
}

#[test]
fn backlash_after_reversal_softens_bristles_over_its_travel() {
    const TRAVEL: f64 = 2e-3;
    const SHARE: f64 = 0.125;
    const SPEED: f64 = 0.05;
    fn reversed<T: Real>() -> Vec<f64> {
        let values = [(Id::BacklashTravel, TRAVEL), (Id::BacklashStiffnessRatio, SHARE)];
        // With one level and no damping, the reversal has a closed form.
        let one_level = [(Id::StaticTorque, COULOMB), (Id::BristleDamping, 0.0)];
        let values = [values, one_level].concat();
        let period = <T::Setting as Real>::from_f64(50e-6);
        let model: FrictionModel<T> =
            with_term(TermKind::Backlash, &values).build(period).expect("legal");
        let mut state = ModelState::default();
        let mut bristle = |velocity| {
            let velocity_rad_s = T::from_f64(velocity);
            model.step(&mut state, &Sample { velocity_rad_s, ..Sample::default() });
            state.bristle_torque_nm.value()
        };
        (0..8_000).for_each(|_| assert!(bristle(SPEED) <= COULOMB));
        (0..2_400).map(|_| bristle(-SPEED)).collect()
    }
    // dy/dx = -sigma(x) (1 + y/g) from y = g: y = g (2 exp(-int sigma dx / g) - 1).
    let closed_form = |travel: f64| {
        let bent = STIFFNESS * (SHARE * travel.min(TRAVEL) + (travel - TRAVEL).max(0.0));
        COULOMB * (2.0 * (-bent / COULOMB).exp() - 1.0)
    };
    for (found, tolerance) in
        [(reversed::<f64>(), 5e-3), (reversed::<f32>(), 5e-3), (reversed::<Fixed>(), 2e-2)]
    {
        for (step, found) in found.into_iter().enumerate() {
            let expected = closed_form((step + 1) as f64 * SPEED * 50e-6);
            let error = (found - expected).abs();
            assert!(error < tolerance, "{step}: {found}, closed form {expected}");
        }
    }
    // Without the term, the torque would change its sign within the same travel.
    let stiff = COULOMB * (2.0 * (-STIFFNESS * TRAVEL / COULOMB).exp() - 1.0);
    assert!(closed_form(TRAVEL) - stiff > 1.0);
}

#[test]
fn backlash_with_unloaded_option_is_crossed_at_zero_torque() {
    const TRAVEL: f64 = 2e-3;
    const SPEED: f64 = 0.05;
    let period = 50e-6;
    fn reversed<T: Real>(period: f64) -> Vec<f64> {
        let values = [
            (Id::BacklashTravel, TRAVEL),
            (Id::BacklashStiffnessRatio, 0.0),
            (Id::BacklashUnloaded, 1.0),
            (Id::StaticTorque, COULOMB),
            (Id::BristleDamping, 0.0),
        ];
        let period = <T::Setting as Real>::from_f64(period);
        let model: FrictionModel<T> =
            with_term(TermKind::Backlash, &values).build(period).expect("legal");
        let mut state = ModelState::default();
        let mut bristle = |velocity| {
            let velocity_rad_s = T::from_f64(velocity);
            model.step(&mut state, &Sample { velocity_rad_s, ..Sample::default() });
            state.bristle_torque_nm.value()
        };
        (0..8_000).for_each(|_| assert!(bristle(SPEED) <= COULOMB));
        (0..3_200).map(|_| bristle(-SPEED)).collect()
    }
    // The bristles unwind over ln 2 of g/sigma0: dy/dx = -sigma0 (1 + y/g) from y = g. Then the joint crosses the
    // backlash. Then the bristles bend in the other direction.
    let unwound = COULOMB / STIFFNESS * 2f64.ln();
    let closed_form = |travel: f64| {
        let bent = travel.min(unwound) + (travel - unwound - TRAVEL).max(0.0);
        COULOMB * (2.0 * (-STIFFNESS * bent / COULOMB).exp() - 1.0)
    };
    for (found, tolerance) in [
        (reversed::<f64>(period), 1e-2),
        (reversed::<f32>(period), 1e-2),
        (reversed::<Fixed>(period), 2e-2),
    ] {
        for (step, found) in found.into_iter().enumerate() {
            let expected = closed_form((step + 1) as f64 * SPEED * period);
            let error = (found - expected).abs();
            assert!(error < tolerance, "{step}: {found}, closed form {expected}");
        }
    }
    assert!(closed_form(unwound + 0.5 * TRAVEL).abs() < 1e-9 && closed_form(8e-3) < -1.3);
}

#[test]
fn channel_delay_uses_delayed_velocity() {
    // Integer and fractional numbers of samples, up to the length of the delay line.
    for samples in [1.0, 7.0, 2.5, 0.25, 30.75, 31.0] {
        let delay = [(Id::ChannelDelay, samples * PERIOD)];
        let delayed = build::<f64>(&with_term(TermKind::ChannelDelay, &delay));
        let plain = build::<f64>(&base());
        let velocity = |step: i32| (0.02 * f64::from(step.max(0))).sin();
        let (mut a, mut b) = (ModelState::default(), ModelState::default());
        for step in 0..2000 {
            let sample = Sample { velocity_rad_s: velocity(step), ..Sample::default() };
            let found = delayed.step(&mut a, &sample);
            let (whole, share) = (samples.floor() as i32, samples.fract());
            let then = velocity(step - whole) * (1.0 - share) + velocity(step - whole - 1) * share;
            let sample = Sample { velocity_rad_s: then, ..Sample::default() };
            let expected = plain.step(&mut b, &sample);
            assert!((found - expected).abs() < 1e-9, "{samples} at {step}: {found} {expected}");
        }
    }
}

#[test]
fn channel_delay_beyond_its_line_in_a_shorter_period_is_that_of_the_line() {
    // 20 samples become 200, of which the line holds 31.
    let delay = [(Id::ChannelDelay, 20.0 * PERIOD)];
    let delayed = build::<f64>(&with_term(TermKind::ChannelDelay, &delay)).rescaled(0.1);
    let plain = build::<f64>(&base()).rescaled(0.1);
    let velocity = |step: i32| (0.02 * f64::from(step.max(0))).sin();
    let (mut a, mut b) = (ModelState::default(), ModelState::default());
    for step in 0..500 {
        let at = |step| Sample { velocity_rad_s: velocity(step), ..Sample::default() };
        let found = delayed.step(&mut a, &at(step));
        let expected = plain.step(&mut b, &at(step - 31));
        assert!((found - expected).abs() < 1e-9, "step {step}: {found} {expected}");
    }
}

#[test]
fn warm_up_lowers_friction_and_cooling_restores_it() {
    let values = [(Id::WarmUpFall, 0.5), (Id::WarmUpEnergy, 500.0), (Id::WarmUpCooling, 40.0)];
    fn run<T: Real>(values: &[(Id, f64)]) -> Vec<f64> {
        let model = build::<T>(&with_term(TermKind::WarmUp, values));
        let mut state = ModelState::default();
        let mut step = |v: f64| {
            let sample = Sample { velocity_rad_s: T::from_f64(v), ..Sample::default() };
            model.step(&mut state, &sample).value()
        };
        let mut friction: Vec<f64> = (0..30_000).map(|_| step(4.0)).collect();
        // At rest for 10 s, then 0.2 s of sliding.
        (0..10_000).for_each(|_| _ = step(0.0));
        friction.extend((0..200).map(|_| step(4.0)));
        friction
    }
    // Reference: the same equations, integrated in steps of 1 ms.
    let (mut heat, mut expected) = (0.0f64, Vec::new());
    let mut reference = |v: f64| {
        let left = 1.0 - 0.5 * (1.0 - (-heat).exp());
        let friction = if v > 0.0 { level(COULOMB, STATIC, v) * left + VISCOUS * v } else { 0.0 };
        heat += PERIOD * (friction * v / 500.0 - heat / 40.0);
        friction
    };
    expected.extend((0..30_000).map(|_| reference(4.0)));
    (0..10_000).for_each(|_| _ = reference(0.0));
    expected.extend((0..200).map(|_| reference(4.0)));
    assert!(expected[29_999] < 0.92 * expected[0] && expected[30_199] > 1.01 * expected[29_999]);
    for (found, tolerance) in
        [(run::<f64>(&values), 1e-2), (run::<f32>(&values), 1e-2), (run::<Fixed>(&values), 2e-2)]
    {
        // During the first milliseconds the bristles bend.
        for step in (20..30_000).chain(30_020..30_200) {
            let (found, expected) = (found[step], expected[step]);
            assert!((found - expected).abs() < tolerance, "{step}: {found}, reference {expected}");
        }
    }
}
