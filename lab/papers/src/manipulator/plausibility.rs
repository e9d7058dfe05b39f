//! Checks the coefficients of a table, printed or ours, for signs of a failed fit or an impossible model.
//!
//! A value at its start or at a bound is no estimate. A bristle that never reaches its sliding level is a spring. A law whose
//! power is negative drives the joint. A coefficient's unit must give a torque. A body's moment of inertia about one axis
//! cannot exceed the sum of the other two.

use super::fit::{PRINTED_BOUNDS, PRINTED_START};
use super::printed::PrintedModel;
use compensator_core::{
    FrictionModel as BuiltModel, ModelState, ParameterId as Id, Parameters, Sample,
};
use joint_log::number::significant;
use paper_machines::manipulator::rigid_body::Links;

/// Position of a value relative to its start and bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValuePosition {
    /// Inside the bounds and off the start.
    Inside,
    /// At the start of the search.
    AtStart,
    /// At the lower or upper bound.
    AtBound,
    /// Outside the stated bounds.
    Outside,
}

/// Relative distance within which a value counts as at its start or bound.
const POSITION_TOLERANCE: f64 = 0.01;

/// A value of a search, in the unit of its coefficient.
#[derive(Clone, Debug)]
pub struct SearchedValue {
    /// Name in a sentence.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Start of the search; `None` if it had several.
    pub start: Option<f64>,
    /// Lower and upper bound.
    pub bounds: (f64, f64),
}

impl SearchedValue {
    /// Returns the position of the value.
    pub fn position(&self) -> ValuePosition {
        let Self { value, start, bounds: (least, most), .. } = *self;
        let near = |to: f64| (value - to).abs() <= POSITION_TOLERANCE * to.abs();
        if near(least) || near(most) || value == least {
            ValuePosition::AtBound
        } else if value < least || value > most {
            ValuePosition::Outside
        } else if start.is_some_and(near) {
            ValuePosition::AtStart
        } else {
            ValuePosition::Inside
        }
    }
}

/// Lists the values, by name, that are at their start, at a bound, or outside the bounds.
pub fn check_values(whose: &str, values: impl Iterator<Item = SearchedValue>) -> Vec<String> {
    let mut found: [Vec<String>; 3] = Default::default();
    for searched in values {
        let place = match searched.position() {
            ValuePosition::Inside => continue,
            ValuePosition::AtStart => 0,
            ValuePosition::AtBound => 1,
            ValuePosition::Outside => 2,
        };
        found[place].push(format!("{} = {}", searched.name, significant(searched.value, 3)));
    }
    let words = ["at its start", "at its bound", "beyond the bounds stated for it"];
    let reported = found.iter().zip(words).filter(|(names, _)| !names.is_empty());
    reported.map(|(names, words)| format!("{whose}: {words}: {}", names.join(", "))).collect()
}

/// Checks the printed coefficients of a model against the printed start and bounds.
pub fn check_printed(model: &PrintedModel) -> Vec<String> {
    let each = model.coefficients.iter().flat_map(|of| {
        (0..3).map(|joint| {
            let name = format!("{} (joint {})", of.symbol, joint + 1);
            let (start, bounds) = (Some(PRINTED_START), PRINTED_BOUNDS);
            SearchedValue { name, value: of.values[joint], start, bounds }
        })
    });
    check_values(&format!("{} as printed", model.name), each)
}

/// Returns the printed coefficients as parameters of a joint.
pub fn printed_parameters(
    model: &PrintedModel,
    joint: usize,
    base: &Parameters<f64>,
) -> Parameters<f64> {
    let known = model.coefficients.iter().filter_map(|of| of.id.map(|id| (id, of.values[joint])));
    known.fold(base.clone(), |parameters, (id, value)| parameters.with(id, value))
}

/// Share of the Coulomb torque that a bristle must reach to count as sliding.
const MIN_SLIDING_SHARE: f64 = 0.9;

/// Checks whether a bristle slides in a run with this largest bristle torque and this travel.
pub fn check_bristle(
    whose: &str,
    parameters: &Parameters<f64>,
    largest_nm: f64,
    travel_rad: f64,
) -> Option<String> {
    let (coulomb, stiffness) =
        (parameters.get(Id::CoulombTorque), parameters.get(Id::BristleStiffness));
    let share = largest_nm / coulomb;
    let word = |x: f64| significant(x, 2);
    (share < MIN_SLIDING_SHARE).then(|| {
        format!(
            "{whose}: the bristle never saturates: it holds {} % of the Coulomb torque at most, and would need {} rad of \
             travel one way where the joint has {} rad in all. It is a spring of {} Nm/rad beside a viscous part, not friction",
            word(100.0 * share),
            word(coulomb / stiffness),
            word(travel_rad),
            word(stiffness)
        )
    })
}

/// Highest speed at which a law is checked for driving, rad/s: that of the arm.
pub const MAX_CHECKED_SPEED_RAD_S: f64 = 1.0;

/// Power that a law supplies instead of dissipating it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivingPower {
    /// Speed at which it supplies most, rad/s.
    pub speed_rad_s: f64,
    /// The power there, W.
    pub power_w: f64,
}

/// Returns the most power that a static law supplies up to [`MAX_CHECKED_SPEED_RAD_S`]; `None` if it always dissipates.
pub fn max_driving_power(parameters: &Parameters<f64>) -> Option<DrivingPower> {
    let model: BuiltModel<f64> = parameters.build_unchecked(1e-3);
    let power = |velocity: f64| {
        let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        velocity * model.step(&mut ModelState::default(), &sample)
    };
    let speeds = (1..=200).flat_map(|i| {
        let speed = f64::from(i) / 200.0 * MAX_CHECKED_SPEED_RAD_S;
        [speed, -speed]
    });
    let all = speeds.map(|speed_rad_s| DrivingPower { speed_rad_s, power_w: -power(speed_rad_s) });
    let most = all.min_by(|a, b| b.power_w.total_cmp(&a.power_w))?;
    (most.power_w > 0.0).then_some(most)
}

/// Exponents of newton, metre and second; an angle has no dimension.
type Dimension = [i32; 3];

/// Returns the dimension of a unit written as in the paper or in the core: `N m s/rad`, `Nm s^2/rad^2`.
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

/// Checks the printed units against those that the law of a joint needs.
pub fn check_units(model: &PrintedModel, printed_form: bool) -> Option<String> {
    let wrong = model.coefficients.iter().filter_map(|of| {
        let ours = match of.id {
            // The even term of the printed form multiplies a speed, not its square.
            Some(Id::QuadraticFriction) if printed_form => "Nm s/rad",
            Some(id) => id.unit(),
            None => "rad",
        };
        (dimension(of.unit)? != dimension(ours)?)
            .then(|| format!("{} in {} (a joint needs {ours})", of.symbol, of.unit))
    });
    let wrong: Vec<String> = wrong.collect();
    (!wrong.is_empty())
        .then(|| format!("{} as printed: impossible units: {}", model.name, wrong.join(", ")))
}

/// Checks bodies for a moment of inertia above the sum of the other two.
pub fn check_bodies(links: &Links) -> Vec<String> {
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
    use crate::manipulator::printed::MODELS;
    use compensator_core::LawKind;
    use paper_machines::manipulator::rigid_body::TABLE_2;

    #[test]
    fn position_of_value_depends_on_start_and_bounds() {
        let searched = |value, start| SearchedValue {
            name: String::new(),
            value,
            start,
            bounds: (0.001, 10.0),
        };
        let at = |value| searched(value, Some(0.1)).position();
        assert_eq!(searched(0.1, None).position(), ValuePosition::Inside);
        assert_eq!(at(0.0999), ValuePosition::AtStart);
        assert_eq!(at(0.001), ValuePosition::AtBound);
        assert_eq!(at(9.999), ValuePosition::AtBound);
        assert_eq!(at(2.6e-6), ValuePosition::Outside);
        assert_eq!(at(0.5), ValuePosition::Inside);
    }

    #[test]
    fn dimension_of_units_ignores_spelling() {
        assert_eq!(dimension("N m s/rad"), dimension("Nm s/rad"));
        assert_ne!(dimension("N m s/rad"), dimension("Nm"));
        assert_eq!(dimension("Nm s^2/rad^2"), Some([1, 1, 2]));
        assert_eq!(dimension("furlong"), None);
        // Units of a sliding joint in a rotating one, and Coulomb and viscous units exchanged.
        assert!(MODELS.iter().all(|model| check_units(model, true).is_some()));
    }

    #[test]
    fn driving_power_is_found_only_for_active_law() {
        let mut law = Parameters::new(LawKind::Extended)
            .with(Id::CoulombTorque, 0.1)
            .with(Id::QuadraticFriction, 1.0);
        assert_eq!(max_driving_power(&law), None);
        law.choices.printed_extended = true;
        let most = max_driving_power(&law).expect("0.1 - v below 0 beyond 0.1 rad/s backwards");
        assert!((most.speed_rad_s + 1.0).abs() < 1e-9 && (most.power_w - 0.9).abs() < 1e-9);
    }

    #[test]
    fn bristle_check_reports_spring_only() {
        let law = Parameters::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::BristleStiffness, 0.0153);
        let sentence = check_bristle("x", &law, 0.0153 * 0.7, 0.7).expect("it never saturates");
        assert!(sentence.contains("98 rad") && sentence.contains("0.71 %"), "{sentence}");
        assert_eq!(check_bristle("x", &law, 1.49, 0.7), None);
    }

    #[test]
    fn inertia_check_reports_impossible_body() {
        assert_eq!(check_bodies(&TABLE_2).len(), 1);
        let mut possible = TABLE_2;
        possible.inertia_2_kg_m2 = [0.08, 0.004, 0.079];
        assert!(check_bodies(&possible).is_empty());
    }
}
