//! Lookup tables and formulas over a column, inside and outside the range of their knots.

use super::*;

pub(super) const TORQUES: [f64; LOOKUP_KNOTS] = [0.5, -0.25, 0.125, 0.375, -0.125, 0.25];
pub(super) const LEVELS: [f64; LOOKUP_KNOTS] = [-0.25, 0.125, 0.5, 0.25, -0.5, 0.0625];

/// Returns the parameters of the knots above, over a range of a column.
pub(super) fn table_over(column: Quantity, lower: f64, upper: f64) -> Vec<(Id, f64)> {
    let mut values = vec![
        (Id::LookupColumn, f64::from(column.info().column.unwrap())),
        (Id::LookupLower, lower),
        (Id::LookupUpper, upper),
    ];
    values.extend(LOOKUP_TORQUES.into_iter().zip(TORQUES));
    values.extend(LOOKUP_LEVELS.into_iter().zip(LEVELS));
    values
}

/// Returns the torque and the relative change of the level at a share of the range, by linear interpolation.
pub(super) fn table_at(share: f64) -> (f64, f64) {
    let along = share.clamp(0.0, 1.0) * 5.0;
    let interpolate = |knots: [f64; LOOKUP_KNOTS]| {
        knots
            .iter()
            .enumerate()
            .fold(0.0, |sum, (at, knot)| sum + knot * (1.0 - (along - at as f64).abs()).max(0.0))
    };
    (interpolate(TORQUES), interpolate(LEVELS))
}

#[test]
fn lookup_table_follows_every_column_inside_and_outside_its_range() {
    /// Column, its range in the unit of the log, and the function that sets its value in a sample.
    type ColumnCase = (Quantity, f64, f64, fn(&mut Sample<f64>, f64));
    let cases: [ColumnCase; 8] = [
        (Quantity::Velocity, -2.0, 3.0, |s, x| s.velocity_rad_s = x),
        (Quantity::Position, -1.0, 4.0, |s, x| s.position_rad = x),
        (Quantity::CampaignTime, 3600.0, 360_000.0, |s, x| s.campaign_time_h = x / 3600.0),
        (Quantity::RadialForce, 20.0, 80.0, |s, x| s.radial_force_n = x),
        (Quantity::Pressure, 5e4, 2.5e5, |s, x| s.pressure_diff_mpa = x * 1e-6),
        (Quantity::Temperature, 5.0, 25.0, |s, x| s.temperature_c = x),
        (Quantity::LoadTorque, -20.0, 10.0, |s, x| s.load_torque_nm = x),
        (Quantity::Auxiliary, -300.0, 700.0, |s, x| s.auxiliary = x),
    ];
    let columns = Quantity::ALL.iter().filter(|of| of.info().column.is_some());
    assert!(cases.iter().map(|case| case.0).eq(columns.copied()));
    for (column, lower, upper, put) in cases {
        let values = table_over(column, lower, upper);
        for share in [-1.0, -0.125, 0.0, 0.0625, 0.2, 0.45, 0.6, 0.75, 0.9375, 1.0, 1.25] {
            let mut sample = Sample { velocity_rad_s: 1.0, ..Sample::default() };
            put(&mut sample, lower + (upper - lower) * share);
            let (torque, change) = table_at(share);
            let v = sample.velocity_rad_s;
            for trust in [1.0, 0.5, 0.0] {
                let sample = Sample { lookup_weight: trust, ..sample };
                let scaled = 1.0 + change * trust;
                let friction = level(COULOMB, STATIC, v.abs()) * scaled * v.signum() + VISCOUS * v;
                let expected = friction + torque * trust;
                let built = (
                    with_term(TermKind::LookupTable, &values),
                    with_term(TermKind::LookupTable, &values),
                );
                for (found, tolerance) in [
                    (settled::<f64>(&built.0, &sample), 5e-5),
                    (settled::<f32>(&built.1, &sample), 1e-4),
                    (settled::<Fixed>(&built.1, &sample), 3e-3),
                ] {
                    let error = (found - expected).abs();
                    assert!(error < tolerance, "{column:?} at {share}: {found}, table {expected}");
                }
            }
        }
    }
}

#[test]
fn lookup_formula_matches_its_equation_at_the_knots() {
    let (lower, upper) = (20.0, 80.0);
    for (number, rise, scale) in
        [(1.0, 0.5, 1.0), (2.0, 1.25, 15.0), (3.0, 1.5, 1.0), (3.0, -0.5, 1.0)]
    {
        let values = [
            (Id::LookupColumn, f64::from(Quantity::RadialForce.info().column.unwrap())),
            (Id::LookupLower, lower),
            (Id::LookupUpper, upper),
            (Id::LookupFormula, number),
            (Id::LookupRise, rise),
            (Id::LookupScale, scale),
        ];
        for knot in 0..LOOKUP_KNOTS {
            let x = lower + (upper - lower) * knot as f64 / 5.0;
            let u = knot as f64 / 5.0;
            let change = match number {
                1.0 => rise * u,
                // Michaelis-Menten, scaled to the rise at the end of the range.
                2.0 => {
                    rise * (x - lower) / (x - lower + scale) * (upper - lower + scale)
                        / (upper - lower)
                }
                _ => (1.0f64 + rise).powf(u) - 1.0,
            };
            let sample = Sample { velocity_rad_s: -1.0, radial_force_n: x, ..Sample::default() };
            let expected = -level(COULOMB, STATIC, 1.0) * (1.0 + change) - VISCOUS;
            let parameters = with_term(TermKind::LookupTable, &values);
            let found = settled::<f64>(&parameters, &sample);
            assert!(
                (found - expected).abs() < 5e-5,
                "{number} at {x}: {found}, formula {expected}"
            );
        }
    }
}
