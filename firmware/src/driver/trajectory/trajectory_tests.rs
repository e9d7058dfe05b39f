//! Tests of moves and interpolations.

use super::*;

fn at(rad: f64) -> Angle {
    Angle::from_micro_rad((1e6 * rad).round() as i32)
}

fn rad(reference: Reference) -> f64 {
    1e-6 * f64::from(reference.position.micro_rad())
}

const DT: f32 = 1e-3;
const LIMITS: MoveLimits =
    MoveLimits { speed_rad_s: 2.0, acceleration_rad_s2: 10.0, deceleration_rad_s2: 20.0 };

/// Moves to a target; returns the time, s, and checks the limits in every step.
fn travel(mut reference: Reference, target_rad: f64, may_overshoot: bool) -> f32 {
    let way = target_rad - rad(reference);
    for step in 0..20_000 {
        let before = reference;
        if reference.move_towards(at(target_rad), &LIMITS, DT) {
            return step as f32 * DT;
        }
        let change = reference.velocity_rad_s - before.velocity_rad_s;
        assert!(change.abs() <= 1.02 * LIMITS.deceleration_rad_s2 * DT, "{before:?} {reference:?}");
        assert!(reference.velocity_rad_s.abs() <= LIMITS.speed_rad_s * 1.001);
        let left = (target_rad - rad(reference)) * way.signum();
        assert!(may_overshoot || left > -1e-4, "{reference:?} beyond {target_rad}");
    }
    panic!("it does not arrive: {reference:?}");
}

#[test]
fn move_takes_the_time_of_its_trapezoid() {
    // 0.2 s to 2 rad/s, 0.1 s from it: 0.3 rad; the rest at 2 rad/s.
    for (target_rad, expected_s) in [(2.0, 1.15), (-2.0, 1.15), (0.3, 0.3), (0.075, 0.15)] {
        let found_s = travel(Reference::at(at(0.0)), target_rad, false);
        assert!((found_s - expected_s).abs() < 0.02, "{target_rad} rad: {found_s} s");
    }
    assert_eq!(travel(Reference::at(at(0.5)), 0.5, false), 0.0);
    // From a velocity that overshoots the target, it comes back.
    travel(Reference { position: at(0.0), velocity_rad_s: 2.0 }, 0.05, true);
}

#[test]
fn interpolation_of_constant_acceleration_is_exact_one_period_later() {
    for steps in [1u32, 2, 10] {
        let course = |ms: u32| 2e-6 * f64::from(ms) * f64::from(ms);
        let mut curve = Interpolation::begin(Reference::at(at(0.0)));
        let mut most = 0.0f64;
        for ms in 0..1000 {
            if ms % steps == 0 {
                assert!(curve.set_target(at(course(ms)), steps, 12.0, DT));
            }
            let found = curve.step(&LIMITS, DT);
            if ms > 5 * steps {
                let at = ms + 1 - steps;
                most = most.max((rad(found) - course(at)).abs());
                let velocity = 4.0 * at as f32 * DT;
                assert!((found.velocity_rad_s - velocity).abs() < 0.02, "{found:?} {velocity}");
            }
        }
        assert!(most < 2e-5, "{most} rad at {steps} ms");
    }
}

#[test]
fn interpolation_without_new_targets_stops_at_the_last_one() {
    let mut curve = Interpolation::begin(Reference::at(at(0.0)));
    for k in 1..=20 {
        curve.set_target(at(0.02 * f64::from(k)), 10, 12.0, DT);
        for _ in 0..10 {
            let _ = curve.step(&LIMITS, DT);
        }
    }
    let mut before = curve.step(&LIMITS, DT);
    for _ in 0..1000 {
        let now = curve.step(&LIMITS, DT);
        assert!((now.velocity_rad_s - before.velocity_rad_s).abs() < 0.021);
        before = now;
    }
    assert!((rad(before) - 0.4).abs() < 1e-5 && before.velocity_rad_s == 0.0, "{before:?}");
}

#[test]
fn interpolation_of_a_jump_is_limited_in_speed() {
    let mut curve = Interpolation::begin(Reference::at(at(0.0)));
    assert!(!curve.set_target(at(1.0), 10, 2.0, DT));
    let mut most = 0.0f32;
    for _ in 0..10 {
        most = most.max(curve.step(&LIMITS, DT).velocity_rad_s);
    }
    let end_rad = rad(curve.reference);
    assert!((0.012..=0.02).contains(&end_rad) && most <= 2.0, "{end_rad} rad, {most} rad/s");
}

/// Follows a sine with targets whose delivery is given: for each step, the number of targets that arrive before it.
/// Returns the largest change of the velocity in a step, rad/s, after the first targets, and the largest distance from
/// the course one period before, rad.
fn follow(period: u32, steps: u32, mut arrivals: impl FnMut(u32) -> Vec<u32>) -> (f32, f64) {
    let course = |ms: f64| 0.5 * (1.0 - (core::f64::consts::PI * 1e-3 * ms).cos());
    let mut curve = Interpolation::begin(Reference::at(at(0.0)));
    let (mut jump, mut far, mut before) = (0.0f32, 0.0f64, Reference::default());
    for step in 0..steps {
        for target in arrivals(step) {
            curve.set_target(at(course(f64::from(target * period))), period, 12.0, DT);
        }
        let now = curve.step(&LIMITS, DT);
        if step > 100 {
            jump = jump.max((now.velocity_rad_s - before.velocity_rad_s).abs());
            let expected = course(f64::from(step + 1) - f64::from(period));
            far = far.max((rad(now) - expected).abs());
        }
        before = now;
    }
    (jump, far)
}

/// Delivers target k at step `k * period + late(k)`, each after those before it.
fn delayed(period: u32, late: impl Fn(u32) -> u32) -> impl FnMut(u32) -> Vec<u32> {
    let mut next = 0;
    move |step| {
        let mut found = Vec::new();
        while next * period + late(next) <= step {
            found.push(next);
            next += 1;
        }
        found
    }
}

#[test]
fn interpolation_with_late_targets_has_no_steps_of_velocity() {
    for period in [1, 2, 5, 10] {
        // The course accelerates by 0.005 rad/s in a step.
        let (on_time, near) = follow(period, 4000, delayed(period, |_| 0));
        assert!(on_time < 0.025 && near < 2e-4, "{period}: {on_time} rad/s, {near} rad");
        let patterns: [fn(u32) -> u32; 5] = [
            |k| u32::from(k % 20 == 7),
            |k| if k % 50 == 7 { 3 } else { 0 },
            |k| k * 7 % 3,
            |k| u32::from(k > 1000),
            |k| u32::from(k < 200) * 2,
        ];
        for (number, late) in patterns.into_iter().enumerate() {
            let (jump, far) = follow(period, 4000, delayed(period, late));
            let what = format!("period {period}, pattern {number}");
            assert!(jump < 0.045, "{what}: {jump} rad/s");
            assert!(far < 4e-3, "{what}: {far} rad");
        }
    }
}

#[test]
fn interpolation_with_lost_targets_has_no_steps_of_velocity() {
    for period in [1, 2, 10] {
        let mut delivered = delayed(period, |_| 0);
        let (jump, far) = follow(period, 4000, |step| {
            delivered(step).into_iter().filter(|target| target % 37 != 5).collect()
        });
        assert!(jump < 0.06, "{period}: {jump} rad/s");
        assert!(far < 4e-3, "{period}: {far} rad");
    }
}

#[test]
fn interpolation_with_another_clock_follows_it() {
    // The clock of the master is 0.13 % slower or faster.
    for per_mille in [-1.3, 1.3] {
        let mut next = 0u32;
        let (jump, far) = follow(1, 4000, |step| {
            let mut found = Vec::new();
            while f64::from(next) * (1.0 + 1e-3 * per_mille) <= f64::from(step) {
                found.push(next);
                next += 1;
            }
            found
        });
        assert!(jump < 0.03, "{jump} rad/s");
        // The course itself then is up to 5 ms away.
        assert!(far < 1.6e-3 * 6.0, "{far} rad");
    }
}

/// A course of straight lines with up to 3 rad/s, drawn by a number: time, s, and position, rad, of its corners.
fn corners(mut random: u64) -> Vec<(f64, f64)> {
    let mut draw = |least: f64, most: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040);
        least + (most - least) * (random >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut found = vec![(0.0, 0.0)];
    while let Some(&(t, at)) = found.last()
        && t < 5.0
    {
        let seconds = draw(0.1, 0.6);
        found.push((t + seconds, at + seconds * draw(-3.0, 3.0)));
    }
    found
}

fn on_line(corners: &[(f64, f64)], t: f64) -> f64 {
    let line = corners.windows(2).find(|line| t < line[1].0).expect("within the course");
    let ((from_s, from), (to_s, to)) = (line[0], line[1]);
    from + (to - from) * (t - from_s) / (to_s - from_s)
}

/// Delivery of target k: its delay in steps, or `None` if it is lost; the period in steps is given.
type Delivery = (&'static str, fn(u32, u32) -> Option<f64>);

const DELIVERIES: [Delivery; 8] = [
    ("on time", |_, _| Some(0.0)),
    ("up to 3 ms late", |k, _| Some(f64::from(k * 7 % 13 % 4))),
    ("every twentieth 3 ms late", |k, _| Some(if k % 20 == 7 { 3.0 } else { 0.0 })),
    ("every twentieth 8 ms late", |k, _| Some(if k % 20 == 7 { 8.0 } else { 0.0 })),
    ("every 37th lost", |k, _| (k % 37 != 5).then_some(0.0)),
    ("three of 50 lost", |k, _| (k < 10 || k % 50 > 2).then_some(0.0)),
    ("a clock that differs by 0.1 %", |k, period| Some(1e-3 * f64::from(k * period))),
    ("a clock that differs by 0.5 %", |k, period| Some(5e-3 * f64::from(k * period))),
];

/// Returns the step at which each of the targets of 4.5 s arrives, none before the one before it.
fn arrivals(period: u32, delivery: fn(u32, u32) -> Option<f64>) -> Vec<(u32, u32)> {
    let mut last = 0;
    (0..4500 / period)
        .filter_map(|k| {
            last = last.max(k * period + delivery(k, period)? as u32);
            Some((k, last))
        })
        .collect()
}

#[test]
fn interpolation_is_at_most_half_faster_than_its_course_and_arrives_at_its_end() {
    for period in [1, 2, 4, 10, 20] {
        for (name, delivery) in DELIVERIES {
            for seed in 0..20 {
                let corners = corners(seed);
                let slopes = corners.windows(2).map(|l| (l[1].1 - l[0].1) / (l[1].0 - l[0].0));
                let fastest = slopes.fold(0.0, |most: f64, slope| most.max(slope.abs()));
                let what = format!("period {period}, {name}, course {seed}");
                let mut targets = arrivals(period, delivery).into_iter().peekable();
                let mut curve = Interpolation::begin(Reference::at(at(0.0)));
                let (mut most, mut end) = (0.0f64, 0.0);
                for step in 0..6000 {
                    while let Some((k, _)) = targets.next_if(|(_, at)| *at <= step) {
                        end = on_line(&corners, 1e-3 * f64::from(k * period));
                        curve.set_target(at(end), period, 12.0, DT);
                    }
                    let before = rad(curve.reference);
                    let now = curve.step(&LIMITS, DT);
                    if targets.peek().is_some() {
                        most = most.max(f64::from(now.velocity_rad_s.abs()));
                        most = most.max((rad(now) - before).abs() * 1e3);
                    }
                }
                // The way past a lost target at a corner may count as that of one period.
                let limit = if name.ends_with("lost") { 4.0 } else { 1.501 };
                assert!(most <= limit * fastest, "{what}: {most} rad/s, course {fastest} rad/s");
                let left_rad = (rad(curve.reference) - end).abs();
                assert!(left_rad < 1e-5, "{what}: {left_rad} rad from its end");
            }
        }
    }
}

#[test]
fn interpolation_of_a_smooth_course_with_a_clock_of_half_a_percent_has_no_steps_of_velocity() {
    for period in [1, 2, 4, 10, 20] {
        for per_mille in [-5.0, 5.0] {
            let mut next = 0u32;
            let (jump, _) = follow(period, 4000, |step| {
                let mut found = Vec::new();
                while f64::from(next * period) * (1.0 + 1e-3 * per_mille) <= f64::from(step) {
                    found.push(next);
                    next += 1;
                }
                found
            });
            assert!(jump < 0.14, "period {period}, {per_mille} per mille: {jump} rad/s");
        }
    }
}

/// Follows a sine of 2 rad/s at 1 Hz. Returns the largest change of the reference in a step, and its largest distance from
/// the course a period before, rad/s.
fn follow_velocity(period: u32, delivery: fn(u32, u32) -> Option<f64>) -> (f32, f32) {
    let course = |ms: u32| 2.0 * (core::f32::consts::TAU * 1e-3 * ms as f32).sin();
    let mut targets = arrivals(period, delivery).into_iter().peekable();
    let mut line = VelocityInterpolation::begin(0.0);
    let (mut jump, mut far, mut before) = (0.0f32, 0.0f32, 0.0);
    for step in 0..4000 {
        while let Some((k, _)) = targets.next_if(|(_, at)| *at <= step) {
            line.set_target(course(k * period), period);
        }
        let now = line.step().unwrap_or(line.to_rad_s);
        if step > 100 {
            jump = jump.max((now - before).abs());
            far = far.max((now - course(step + 1 - period)).abs());
        }
        before = now;
    }
    (jump, far)
}

#[test]
fn velocity_between_targets_follows_the_course_without_steps() {
    // The course changes by 0.0126 rad/s in a step.
    for period in [1, 2, 4, 10, 20] {
        for (name, delivery) in DELIVERIES {
            let (jump, far) = follow_velocity(period, delivery);
            let what =
                format!("period {period}, {name}: {jump} rad/s, {far} rad/s from the course");
            println!("{what}");
        }
    }
}

#[test]
fn velocity_targets_without_a_course_are_taken_as_they_are() {
    let mut line = VelocityInterpolation::begin(0.0);
    assert_eq!(line.step(), None, "no target");
    // A master that sends at another rate than 60C2h says: neither continued nor interpolated.
    for k in 1..50 {
        line.set_target(0.1 * k as f32, 1);
        for step in 0..10 {
            assert_eq!(line.step().unwrap_or(line.to_rad_s), 0.1 * k as f32, "{k}, {step}");
        }
    }
    // A step, then a constant velocity.
    let mut line = VelocityInterpolation::begin(0.0);
    for _ in 0..20 {
        line.set_target(3.0, 10);
        for step in 0..10 {
            let now = line.step().unwrap();
            assert!((0.0..=3.0).contains(&now), "{step}: {now}");
        }
    }
    assert_eq!(line.step(), Some(3.0));
}
