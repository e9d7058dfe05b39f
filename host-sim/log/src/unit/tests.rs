use super::*;
use crate::message;
use crate::setting::plain;
use std::f64::consts::TAU as TURN_RAD;

fn in_si(contract_name: &str, symbol: &str, value: f64) -> f64 {
    conversion(contract_name, symbol).unwrap().apply(value)
}

#[test]
fn conversion_with_common_units_returns_si_values() {
    for (name, symbol, value, expected) in [
        ("time_s", "ms", 1.0, 0.001),
        ("time_s", "µs", 3.0, 3e-6),
        ("time_s", "min", 2.0, 120.0),
        ("velocity_rad_s", "rpm", 60.0, TURN_RAD),
        ("velocity_rad_s", "tr/min", 60.0, TURN_RAD),
        ("velocity_rad_s", "min⁻¹", 60.0, TURN_RAD),
        ("velocity_rad_s", "deg/sec", 180.0, TURN_RAD / 2.0),
        ("velocity_rad_s", "°/s", 180.0, TURN_RAD / 2.0),
        ("velocity_rad_s", "deg/s", 180.0, TURN_RAD / 2.0),
        ("velocity_m_s", "mm/s", 5.0, 0.005),
        ("position_rad", "deg", 90.0, TURN_RAD / 4.0),
        ("position_m", "mm", 7.0, 0.007),
        ("acceleration_rad_s2", "deg/s²", 360.0, TURN_RAD),
        ("torque_nm", "N·mm", 1500.0, 1.5),
        ("torque_nm", "mNm", 1500.0, 1.5),
        ("torque_nm", "-Nm", 2.0, -2.0),
        ("force_n", "kN", 2.0, 2000.0),
        ("pressure_diff_pa", "bar", 3.0, 3e5),
        ("pressure_diff_pa", "MPa", 3.0, 3e6),
        ("pressure_diff_pa", "psi", 1.0, 6_894.757_293_168_361),
        ("temperature_c", "K", 300.0, 26.850_000_000_000_023),
        ("temperature_c", "degF", 212.0, 100.0),
        ("time_s", "days", 0.5, 43_200.0),
        ("velocity_rad_s", "0.229rpm", 100.0, 22.9 * TURN_RAD / 60.0),
        ("velocity_rad_s", "0.5 1/min", 100.0, 50.0 * TURN_RAD / 60.0),
        ("velocity_rad_s", "-4096counts/s", 4096.0, -TURN_RAD),
        ("position_rad", "4096counts", 1024.0, TURN_RAD / 4.0),
        ("position_rad", "360cpr-1.5", 0.0, -1.5 * TURN_RAD),
        ("torque_nm", "4.2/1000Nm", 500.0, 2.1),
        ("torque_nm", "-1e-3Nm", 500.0, -0.5),
        ("pressure_diff_pa", "0.0122bar-1.5", 1000.0, 1.07e6),
        ("temperature_c", "0.1degC-40", 650.0, 25.0),
        ("torque_nm", "int16 0.01Nm", 65_436.0, -1.0),
        ("torque_nm", "int16", 3.0, 3.0),
        ("velocity_rad_s", "sign10 0.111rpm", 1124.0, -11.1 * TURN_RAD / 60.0),
        ("velocity_rad_s", "sign15", 7.0, 7.0),
        ("temperature_c", "0.01K", 30_000.0, 26.850_000_000_000_023),
    ] {
        let found = in_si(name, symbol, value);
        assert!((found / expected - 1.0).abs() < 1e-12, "{name} {symbol}: {found}");
    }
}

#[test]
fn conversion_ignores_case_unless_ambiguous() {
    assert_eq!(in_si("pressure_diff_pa", "mpa", 1.0), 1e6);
    assert_eq!(in_si("velocity_rad_s", "RPM", 60.0), in_si("velocity_rad_s", "rpm", 60.0));
    assert_eq!(in_si("force_n", "MN", 1.0), 1e6);
    assert_eq!(in_si("force_n", "mN", 1.0), 1e-3);
    assert!(conversion("force_n", "mn").is_err(), "a millinewton or a meganewton");
}

#[test]
fn conversion_with_other_dimension_lists_valid_units() {
    let error = conversion("velocity_rad_s", "Nm").unwrap_err().to_string();
    message::check(
        "units",
        "unit of another dimension",
        &error,
        &["rad/s, mrad/s, deg/s, rpm, rps"],
    );
    let error = conversion("run", "s").unwrap_err().to_string();
    message::check("units", "unit of a name", &error, &[]);
}

#[test]
fn conversion_with_invalid_scale_says_what_is_expected() {
    let expected = |name, symbol| plain(&conversion(name, symbol).unwrap_err().to_string());
    message::check("units", "counts alone", &expected("position_rad", "counts"), &["4096counts"]);
    for symbol in ["0counts", "1/0deg", "infdeg"] {
        let units = expected("position_rad", symbol);
        message::check("units", "invalid scale", &units, &["rad, mrad, deg, rev"]);
    }
    for symbol in ["%", "0.1%"] {
        let share = expected("torque_nm", symbol);
        message::check("units", "share without rated torque", &share, &["rated torque", "100 %"]);
    }
}

#[test]
fn in_name_with_unit_suffix_returns_unit() {
    for (name, foreign, unit) in [
        ("velocity_rad_s", "speed_rpm", Some("rpm")),
        ("velocity_rad_s", "speed [1/min]", Some("rpm")),
        ("velocity_rad_s", "omega_deg_s", Some("deg/s")),
        ("velocity_rad_s", "omega_deg_per_s", Some("deg/s")),
        ("velocity_rad_s", "omega_rad_s", None),
        ("velocity_rad_s", "dq_3", None),
        ("time_s", "t (ms)", Some("ms")),
        ("time_s", "t_s", None),
        ("time_s", "%time", Some("ns")),
        ("torque_nm", "motor_force_N", None),
        ("torque_nm", "drive_voltage_v", None),
        ("torque_nm", "tau_mNm", Some("mNm")),
        ("pressure_diff_pa", "p_bar", Some("bar")),
        ("temperature_c", "oil [°F]", Some("degF")),
        ("run", "trial_s", None),
    ] {
        assert_eq!(in_name(name, foreign), unit, "{foreign}");
    }
}

#[test]
fn is_ambiguous_with_case_of_two_units_returns_true() {
    for (of, name, expected) in [
        ("force_n", "force_mn", true),
        ("force_n", "force_mN", false),
        ("torque_nm", "tau [MNM]", true),
        ("pressure_diff_pa", "p_mpa", false),
        ("run", "exp", false),
    ] {
        assert_eq!(is_ambiguous(of, name), expected, "{name}");
    }
}
