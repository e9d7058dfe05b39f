//! Every field is refused by its name. Accepted parameters build finite coefficients.

use super::*;
use crate::control::PERIOD_S;
use compensator_core::parameters::FieldRange;

fn with(field: &str, value: f32) -> MotorParameters {
    let mut fields = MotorParameters::default().to_array();
    let index = MotorParameters::NAMES.iter().position(|name| *name == field).expect("a field");
    fields[index] = value;
    MotorParameters::from_array(fields)
}

#[test]
fn validate_with_defaults_returns_ok() {
    let parameters = MotorParameters::default();
    assert_eq!(parameters.validate(), Ok(()));
    assert_eq!(parameters.validate_with(&CompensatorParameters::default()), Ok(()));
    assert!(parameters.build(PERIOD_S).is_ok());
}

#[test]
fn validate_with_field_out_of_range_names_the_field() {
    for (field, FieldRange { least, most, why }) in
        MotorParameters::NAMES.iter().zip(&MotorParameters::RANGES)
    {
        let below = least - least.abs().max(1e-3);
        let above = most + most.abs().max(1e-3);
        for (value, bound) in [
            (below, Bound::AtLeast(*least)),
            (above, Bound::AtMost(*most)),
            (f32::NAN, Bound::Finite),
            (f32::INFINITY, Bound::Finite),
        ] {
            let refused = with(field, value).validate().expect_err(field);
            assert_eq!((refused.field.as_str(), refused.bound, refused.why), (*field, bound, *why));
        }
    }
}

#[test]
fn validate_with_inconsistent_fields_returns_the_bound() {
    for (field, value, bound) in [
        ("pole_pairs", 6.5, Bound::Whole),
        ("joint_direction", 0.5, Bound::AtLeast(1.0)),
        ("encoder_direction", -0.5, Bound::AtMost(-1.0)),
        ("overcurrent_a", 27.0, Bound::AtLeast(26.0f32 * OVERCURRENT_MARGIN)),
        ("bus_voltage_max_v", 18.0, Bound::MoreThan(18.0)),
    ] {
        let refused = with(field, value).validate().expect_err(field);
        assert_eq!((refused.field.as_str(), refused.bound), (field, bound));
    }
}

#[test]
fn build_with_period_out_of_range_returns_error() {
    for (field, value) in [
        ("current_bandwidth_hz", 2001.0),
        ("observer_bandwidth_hz", 1001.0),
        ("velocity_max_rad_s", 34.0),
    ] {
        assert_eq!(with(field, value).validate(), Ok(()));
        assert_eq!(with(field, value).build(PERIOD_S).expect_err(field).field, field);
    }
    assert!(with("current_bandwidth_hz", 2000.0).build(PERIOD_S).is_ok());
    let late = with("dead_time_s", 2.5e-6).build(20e-6).expect_err("an eighth of the period");
    assert_eq!(late.field, "dead_time_s");
    for period in [0.0, -1.0, 1e-6, 1.0, f32::NAN, f32::INFINITY] {
        let refused = MotorParameters::default().build(period).expect_err("a period");
        assert_eq!(refused.field, "period_s");
    }
}

#[test]
fn validate_with_inconsistent_torque_constant_returns_error() {
    let parameters = MotorParameters::default();
    for constant in [0.1, 1.2, f32::NAN] {
        let joint = CompensatorParameters {
            torque_constant_nm_per_a: constant,
            ..CompensatorParameters::default()
        };
        let refused = parameters.validate_with(&joint).expect_err("it does not fit");
        assert_eq!(refused.field, "torque_constant_nm_per_a");
    }
}

#[test]
fn array_round_trip_keeps_fields() {
    let parameters = with("encoder_delay_s", 3e-6);
    assert_eq!(MotorParameters::from_array(parameters.to_array()), parameters);
    assert_eq!(parameters.encoder_delay_s, 3e-6);
}

#[test]
fn rotor_angle_applies_encoder_offset_and_direction() {
    let quarter = 1u32 << 30;
    let ahead = with("encoder_offset_rad", core::f32::consts::FRAC_PI_2);
    let built = ahead.build(PERIOD_S).expect("legal");
    assert!((built.rotor_angle(quarter) as i32).abs() < 1000);
    let reversed = MotorParameters { encoder_direction: -1.0, ..ahead };
    let built = reversed.build(PERIOD_S).expect("legal");
    assert!((built.rotor_angle(0).wrapping_sub(quarter) as i32).abs() < 1000);
}

proptest::proptest! {
    #[test]
    fn build_with_accepted_parameters_gives_finite_gains(
        fields in proptest::collection::vec(0.0f32..1.0, MotorParameters::FIELDS),
        period in -5.5f32..-2.8,
    ) {
        // Each field is drawn from its range, on a logarithmic scale if it spans decades.
        let mut written = [0.0; MotorParameters::FIELDS];
        for ((slot, share), FieldRange { least, most, .. }) in
            written.iter_mut().zip(fields).zip(&MotorParameters::RANGES)
        {
            *slot = if *least > 0.0 {
                (least * (most / least).powf(share)).clamp(*least, *most)
            } else {
                least + (most - least) * share
            };
        }
        let mut parameters = MotorParameters::from_array(written);
        parameters.pole_pairs = parameters.pole_pairs.floor();
        parameters.joint_direction = parameters.joint_direction.signum();
        parameters.encoder_direction = parameters.encoder_direction.signum();
        parameters.brake_at_stop = parameters.brake_at_stop.round();
        parameters.overcurrent_a = parameters.overcurrent_a.max(1.2 * parameters.current_limit_a).min(2e4);
        // The fields that bound each other, and those that the period bounds.
        let period_s = 10f32.powf(period);
        parameters.bus_voltage_max_v = parameters.bus_voltage_max_v.max(1.1 * parameters.bus_voltage_min_v).min(1e3);
        parameters.dead_time_s = parameters.dead_time_s.min(DEAD_TIME_SHARE_MAX * period_s);
        parameters.observer_bandwidth_hz = parameters.observer_bandwidth_hz.min(BANDWIDTH_SHARE_ANY / period_s);
        parameters.current_bandwidth_hz =
            parameters.current_bandwidth_hz.min(parameters.current_bandwidth_max_hz(period_s));
        parameters.velocity_max_rad_s = parameters
            .velocity_max_rad_s
            .min(TURN_MAX_RAD / (period_s * parameters.gear_ratio * parameters.pole_pairs));
        let built = parameters.build(period_s);
        proptest::prop_assume!(built.is_ok());
        let motor = built.expect("accepted");
        for number in [
            motor.d.kp, motor.d.ki_t, motor.q.kp, motor.q.ki_t, motor.flux_vs,
            motor.observer.angle, motor.observer.velocity_per_s,
            motor.observer.acceleration_per_s2, motor.observer.units_per_s,
            motor.park_units, motor.drive_units, motor.joint_per_motor,
        ] {
            proptest::prop_assert!(number.is_finite(), "{motor:?}");
        }
        proptest::prop_assert!(motor.d.kp > 0.0 && motor.q.kp > 0.0);
        proptest::prop_assert!(motor.radius_per_bus > 0.0, "{motor:?}");
        proptest::prop_assert!((0.0..=1.0).contains(&motor.observer.angle));
    }
}

#[test]
fn brake_at_stop_of_a_motor_that_would_exceed_its_overcurrent_is_refused() {
    let braking = MotorParameters { brake_at_stop: 1.0, ..MotorParameters::default() };
    assert_eq!(braking.validate(), Ok(()));
    for (motor, value) in [
        (MotorParameters { brake_at_stop: 0.4, ..braking }, 0.4),
        (MotorParameters { inductance_d_h: 20e-6, inductance_q_h: 20e-6, ..braking }, 1.0),
    ] {
        let error = motor.validate().expect_err("refused");
        assert_eq!((error.field.as_str(), error.value), ("brake_at_stop", value));
    }
}

#[test]
fn current_bandwidth_of_a_motor_that_does_not_permit_it_is_refused() {
    // 60 us is about one period; 9 mH makes the noise of the sensors a third of a bus of 18 V.
    for (resistance_ohm, inductance) in [(1.5, 90e-6), (1.0, 9e-3)] {
        let motor = MotorParameters {
            resistance_ohm,
            inductance_d_h: inductance,
            inductance_q_h: inductance,
            current_bandwidth_hz: 1001.0,
            ..MotorParameters::default()
        };
        let refused = motor.build(PERIOD_S).expect_err("more than a twentieth");
        assert_eq!(refused.field, "current_bandwidth_hz");
        let permitted = MotorParameters { current_bandwidth_hz: 1000.0, ..motor };
        assert!(permitted.build(PERIOD_S).is_ok());
    }
}

#[test]
fn modulation_that_the_dead_time_would_use_up_is_refused() {
    let motor =
        MotorParameters { dead_time_s: 2.5e-6, modulation_max: 0.2, ..MotorParameters::default() };
    let refused = motor.build(PERIOD_S).expect_err("the dead time takes more than half of it");
    assert_eq!(refused.field, "modulation_max");
    let built = MotorParameters { modulation_max: 0.24, ..motor }.build(PERIOD_S).expect("legal");
    assert!(built.radius_per_bus > 0.1 * MAX_VECTOR_PER_BUS_V);
}
