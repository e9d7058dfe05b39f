//! What a table of coefficients says of itself, in words: found in the numbers, the paper's and ours alike.
//!
//! A value that is where the search began, or where it was not allowed beyond, is no estimate. A bristle that never
//! reaches the level it is to slip at is a spring. A law whose product with the speed is negative drives. A unit that
//! is not that of a torque when it is multiplied by what it stands beside cannot be. And a body whose inertia about one
//! axis is more than that about the two others together does not exist.

use super::fit::{PRINTED_BOUNDS, PRINTED_START};
use super::printed::Model;
use compensator_core::{Model as Built, ParameterId as Id, Parameters, Sample, State};
use friction_identification::number::significant;
use simulated_machines::manipulator::rigid_body::Links;

/// Where a value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Somewhere between.
    Inside,
    /// Where the search began.
    AtStart,
    /// At the lower or upper bound.
    AtBound,
    /// Beyond the bounds it is said to have had.
    Outside,
}

/// A value within this share of the start has not moved; within this share of a bound it is on it.
const NEAR: f64 = 0.01;

/// Where a value stands beside its start and bounds.
pub fn standing(value: f64, start: f64, (least, most): (f64, f64)) -> Standing {
    let near = |to: f64| (value - to).abs() <= NEAR * to.abs();
    if near(least) || near(most) || value == least {
        Standing::AtBound
    } else if value < least || value > most {
        Standing::Outside
    } else if near(start) {
        Standing::AtStart
    } else {
        Standing::Inside
    }
}

/// What is to be said of values by name: those at their start, at a bound, beyond the bounds.
pub fn of_values<'a>(
    whose: &str,
    values: impl Iterator<Item = (String, f64, f64, (f64, f64))> + 'a,
) -> Vec<String> {
    let mut found: [Vec<String>; 3] = Default::default();
    for (name, value, start, bounds) in values {
        let place = match standing(value, start, bounds) {
            Standing::Inside => continue,
            Standing::AtStart => 0,
            Standing::AtBound => 1,
            Standing::Outside => 2,
        };
        found[place].push(format!("{name} = {}", significant(value, 3)));
    }
    let words = ["at its start", "at its bound", "beyond the bounds stated for it"];
    let told = found.iter().zip(words).filter(|(names, _)| !names.is_empty());
    told.map(|(names, words)| format!("{whose}: {words}: {}", names.join(", "))).collect()
}

/// The printed coefficients of a model beside the printed start and bounds.
pub fn of_printed(model: &Model) -> Vec<String> {
    let each = model.coefficients.iter().flat_map(|of| {
        (0..3).map(|joint| {
            let name = format!("{} (joint {})", of.symbol, joint + 1);
            (name, of.values[joint], PRINTED_START, PRINTED_BOUNDS)
        })
    });
    of_values(&format!("{} as printed", model.name), each)
}

/// The printed coefficients as parameters of a joint.
pub fn printed_parameters(model: &Model, joint: usize, base: &Parameters<f64>) -> Parameters<f64> {
    let known = model.coefficients.iter().filter_map(|of| of.id.map(|id| (id, of.values[joint])));
    known.fold(base.clone(), |parameters, (id, value)| parameters.with(id, value))
}

/// Bristles that hold no more than this share of the Coulomb torque never slip.
const SLIPS: f64 = 0.9;

/// What a bristle does over a run in which it held `largest_nm` at most and the joint turned through `travel_rad`.
pub fn of_bristles(
    whose: &str,
    parameters: &Parameters<f64>,
    largest_nm: f64,
    travel_rad: f64,
) -> Option<String> {
    let (coulomb, stiffness) =
        (parameters.get(Id::CoulombTorque), parameters.get(Id::BristleStiffness));
    let share = largest_nm / coulomb;
    let word = |x: f64| significant(x, 2);
    (share < SLIPS).then(|| {
        format!(
            "{whose}: the bristle never saturates: it holds {} % of the Coulomb torque at most, and would need {} rad of \
             travel one way where the joint has {} rad in all. It is a spring of {} Nm/rad beside a viscous part, not a friction",
            word(100.0 * share),
            word(coulomb / stiffness),
            word(travel_rad),
            word(stiffness)
        )
    })
}

/// Speeds up to which a law is asked whether it drives, rad/s: the arm's.
pub const FASTEST_RAD_S: f64 = 1.0;

/// The speed up to [`FASTEST_RAD_S`] at which a static law drives the most, and the power it gives there, W.
pub fn drives(parameters: &Parameters<f64>) -> Option<(f64, f64)> {
    let model: Built<f64> = parameters.build_unchecked(1e-3);
    let power = |velocity: f64| {
        let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        velocity * model.step(&mut State::default(), &sample)
    };
    let speeds = (1..=200).flat_map(|i| {
        let speed = f64::from(i) / 200.0 * FASTEST_RAD_S;
        [speed, -speed]
    });
    let least = speeds.map(|v| (v, power(v))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    (least.1 < 0.0).then_some((least.0, -least.1))
}

/// Exponents of newton, metre and second; an angle has none.
type Dimension = [i32; 3];

/// The dimension of a unit written as in the paper's tables or in ours: `N m s/rad`, `Nm s^2/rad^2`.
pub fn dimension(unit: &str) -> Option<Dimension> {
    let (above, below) = unit.split_once('/').unwrap_or((unit, ""));
    let mut sum = [0; 3];
    for (part, sign) in [(above, 1), (below, -1)] {
        for word in part.split_whitespace() {
            let (name, power) = word.split_once('^').unwrap_or((word, "1"));
            let power: i32 = power.parse().ok()?;
            let places: &[usize] = match name {
                "N" => &[0],
                "m" => &[1],
                "s" => &[2],
                "Nm" => &[0, 1],
                "rad" | "1" => &[],
                _ => return None,
            };
            places.iter().for_each(|place| sum[*place] += sign * power);
        }
    }
    Some(sum)
}

/// Printed units that are not those a joint's law wants.
pub fn of_units(model: &Model, printed_form: bool) -> Option<String> {
    let wrong = model.coefficients.iter().filter_map(|of| {
        let ours = match of.id {
            // The even term of the printed form multiplies a speed, not its square.
            Some(Id::QuadraticFriction) if printed_form => "Nm s/rad",
            Some(id) => id.info().unit,
            None => "rad",
        };
        (dimension(of.unit)? != dimension(ours)?)
            .then(|| format!("{} in {} (a joint needs {ours})", of.symbol, of.unit))
    });
    let wrong: Vec<String> = wrong.collect();
    (!wrong.is_empty())
        .then(|| format!("{} as printed: units that cannot be: {}", model.name, wrong.join(", ")))
}

/// Bodies of a table that cannot be: one moment of inertia above the sum of the two others.
pub fn of_bodies(links: &Links) -> Vec<String> {
    let bodies = [(2, links.inertia_2_kg_m2), (3, links.inertia_3_kg_m2)];
    let impossible = bodies.into_iter().filter_map(|(link, moments)| {
        let largest = moments.into_iter().fold(f64::MIN, f64::max);
        let others = moments.iter().sum::<f64>() - largest;
        (largest > others).then(|| {
            format!(
                "Table 2, link {link}: no body has these moments of inertia: {largest} kg m^2 about one axis is more than {} \
                 about the two others together",
                significant(others, 3)
            )
        })
    });
    impossible.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::manipulator::printed::MODELS;
    use compensator_core::LawKind;
    use simulated_machines::manipulator::rigid_body::TABLE_2;

    #[test]
    fn a_value_stands_where_it_stands() {
        let at = |value| standing(value, 0.1, (0.001, 10.0));
        assert_eq!(at(0.0999), Standing::AtStart);
        assert_eq!(at(0.001), Standing::AtBound);
        assert_eq!(at(9.999), Standing::AtBound);
        assert_eq!(at(2.6e-6), Standing::Outside);
        assert_eq!(at(0.5), Standing::Inside);
    }

    #[test]
    fn units_are_told_by_their_dimension() {
        assert_eq!(dimension("N m s/rad"), dimension("Nm s/rad"));
        assert_ne!(dimension("N m s/rad"), dimension("Nm"));
        assert_eq!(dimension("Nm s^2/rad^2"), Some([1, 1, 2]));
        assert_eq!(dimension("furlong"), None);
        // The units of a sliding joint in a turning one, and Coulomb's with viscous swapped.
        assert!(MODELS.iter().all(|model| of_units(model, true).is_some()));
    }

    #[test]
    fn a_law_that_drives_is_told_from_one_that_brakes() {
        let mut law = Parameters::new(LawKind::Extended)
            .with(Id::CoulombTorque, 0.1)
            .with(Id::QuadraticFriction, 1.0);
        assert_eq!(drives(&law), None);
        law.choices.printed_extended = true;
        let (speed, power) = drives(&law).expect("0.1 - v below 0 beyond 0.1 rad/s backwards");
        assert!((speed + 1.0).abs() < 1e-9 && (power - 0.9).abs() < 1e-9);
    }

    #[test]
    fn a_spring_is_told_from_a_bristle() {
        let law = Parameters::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::BristleStiffness, 0.0153);
        let said = of_bristles("x", &law, 0.0153 * 0.7, 0.7).expect("it never saturates");
        assert!(said.contains("98 rad") && said.contains("0.71 %"), "{said}");
        assert_eq!(of_bristles("x", &law, 1.49, 0.7), None);
    }

    #[test]
    fn an_inertia_is_no_more_than_the_two_others() {
        assert_eq!(of_bodies(&TABLE_2).len(), 1);
        let mut possible = TABLE_2;
        possible.inertia_2_kg_m2 = [0.08, 0.004, 0.079];
        assert!(of_bodies(&possible).is_empty());
    }
}
