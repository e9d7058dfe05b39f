//! Fits a friction model within the arm, to the angles of all three joints at once.
//!
//! The parameters of the law in each joint are free, for LuGre also the initial deflection of the bristle, as in the paper.
//! Two protocols exist. The paper's uses values between 0.001 and 10 without scaling, all starting at 0.1, and its tool's
//! tolerance of 1e-3. The proper one uses the logarithm of positive values, individual bounds, several starts and a tight
//! tolerance. Residuals are in degrees, as in the paper. Derivatives are exact, by dual numbers through the trajectory.

use super::arm::{Arm, Drive, JOINTS};
use super::bounded::{NormalEquations, NormalSums, SearchOptions, SearchResult, search};
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters};
use friction_fit::Dual;

/// A run to fit or to evaluate.
#[derive(Clone, Debug)]
pub struct Course {
    /// Name of the run.
    pub name: String,
    /// Input pressures.
    pub drive: Drive,
    /// Measured angles, rad.
    pub angles_rad: [Vec<f64>; JOINTS],
}

/// Coordinate in which a value is varied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// The value divided by this size.
    Plain(f64),
    /// The logarithm of the value.
    Logarithmic,
    /// The ratio to the Coulomb torque of the joint, so that a static torque cannot fall below it.
    TimesCoulomb,
}

/// A free value of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeValue {
    /// Joint, from 0.
    pub joint: usize,
    /// Parameter; `None` for the initial deflection of the bristle, rad.
    pub id: Option<Id>,
    /// Coordinate in which it is varied.
    pub axis: Coordinate,
    /// Lower and upper bound.
    pub bounds: (f64, f64),
}

impl FreeValue {
    fn to_axis(self, value: f64) -> f64 {
        match self.axis {
            Coordinate::Plain(size) => value / size,
            Coordinate::Logarithmic => value.ln(),
            Coordinate::TimesCoulomb => value,
        }
    }

    /// Returns the value and its derivative by the coordinate.
    fn value(self, along: f64) -> (f64, f64) {
        match self.axis {
            Coordinate::Plain(size) => (along * size, size),
            Coordinate::Logarithmic => (along.exp(), along.exp()),
            Coordinate::TimesCoulomb => (along, 1.0),
        }
    }
}

/// A model in all joints with its free values.
#[derive(Clone, Debug)]
pub struct ArmFit<'a> {
    /// Known dynamics of the arm.
    pub arm: &'a Arm,
    /// Runs to fit.
    pub courses: &'a [Course],
    /// Parameters of each joint; those that are not free keep these values.
    pub base: [Parameters<f64>; JOINTS],
    /// Free values.
    pub free: Vec<FreeValue>,
    /// Rows per step.
    pub stride: usize,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Parameters of each joint.
    pub parameters: [Parameters<f64>; JOINTS],
    /// Initial deflection of the bristles, rad.
    pub deflection_rad: [f64; JOINTS],
    /// Value of each free parameter.
    pub values: Vec<f64>,
    /// Starting values.
    pub start: Vec<f64>,
    /// Sum of squares over the fitted rows, deg^2.
    pub sum: f64,
    /// Number of simulations with derivatives.
    pub evaluations: usize,
    /// The search ended by its tolerance.
    pub converged: bool,
}

/// Errors of a model in a run, per joint.
#[derive(Clone, Debug)]
pub struct CourseErrors {
    /// Root mean square error, deg.
    pub rmse_deg: [f64; JOINTS],
    /// Sum of squared errors, deg^2.
    pub sse_deg2: [f64; JOINTS],
    /// The simulated angles, rad, a value per row.
    pub angles_rad: [Vec<f64>; JOINTS],
    /// Largest bristle torque, Nm.
    pub largest_held_nm: [f64; JOINTS],
}

/// The paper's bounds of every coefficient.
pub const PRINTED_BOUNDS: (f64, f64) = (0.001, 10.0);
/// The paper's starting value of every coefficient.
pub const PRINTED_START: f64 = 0.1;

/// Free values of the paper's protocol, between its bounds.
pub fn printed_free(law: LawKind) -> Vec<FreeValue> {
    let free = |joint, id: Option<Id>| {
        // The printed deflections lie below the printed bound, so that they cannot have had it.
        let bounds = if id.is_some() { PRINTED_BOUNDS } else { (0.0, PRINTED_BOUNDS.1) };
        FreeValue { joint, id, axis: Coordinate::Plain(1.0), bounds }
    };
    each(law, free)
}

fn each(law: LawKind, free: impl Fn(usize, Option<Id>) -> FreeValue) -> Vec<FreeValue> {
    let deflection = law.has_bristles().then_some(None);
    let ids = || law.parameters().iter().map(|id| Some(*id)).chain(deflection);
    (0..JOINTS)
        .flat_map(|joint| ids().map(move |id| (joint, id)))
        .map(|(joint, id)| free(joint, id))
        .collect()
}

/// Maximum ratio of static to Coulomb torque; a ratio of three is rare.
const MAX_STATIC_RATIO: f64 = 3.0;

/// Free values of the proper protocol: those of the law, and a torque offset in every joint. The offset is needed because
/// the zeros of arm and valves are uncertain, and only the atan law has one of its own. Bounds are physical: a level up to
/// the drive of the muscles, a stiffness up to what the step can follow, an offset or curvature of either sign.
pub fn proper_free(law: LawKind) -> Vec<FreeValue> {
    let of = |joint, id: Option<Id>| {
        let plain =
            |size: f64, bounds| FreeValue { joint, id, axis: Coordinate::Plain(size), bounds };
        let positive = |bounds| FreeValue { joint, id, axis: Coordinate::Logarithmic, bounds };
        match id {
            Some(Id::CoulombTorque) => positive((1e-4, 30.0)),
            Some(Id::StaticTorque) => FreeValue {
                joint,
                id,
                axis: Coordinate::TimesCoulomb,
                bounds: (1.0, MAX_STATIC_RATIO),
            },
            Some(Id::StribeckVelocity) => positive((1e-3, 10.0)),
            Some(Id::BristleStiffness) => positive((1.0, 3e3)),
            Some(Id::BristleDamping) => positive((1e-4, 10.0)),
            Some(Id::AtanSlope) => positive((0.05, 500.0)),
            Some(Id::ViscousFriction) => plain(1.0, (-5.0, 30.0)),
            Some(Id::AtanTorque | Id::TorqueOffset) => plain(1.0, (-30.0, 30.0)),
            Some(_) => plain(1.0, (-50.0, 50.0)),
            None => plain(0.01, (-0.2, 0.2)),
        }
    };
    let has_offset = law.parameters().contains(&Id::TorqueOffset);
    let offsets =
        (0..JOINTS).filter(|_| !has_offset).map(|joint| of(joint, Some(Id::TorqueOffset)));
    each(law, of).into_iter().chain(offsets).collect()
}

/// Degrees per radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

impl ArmFit<'_> {
    fn with_values(&self, values: &[f64]) -> ([Parameters<f64>; JOINTS], [f64; JOINTS]) {
        let (mut parameters, mut deflection) = (self.base.clone(), [0.0; JOINTS]);
        for (free, value) in self.free.iter().zip(values) {
            match free.id {
                Some(id) if free.axis == Coordinate::TimesCoulomb => {
                    let coulomb = parameters[free.joint].get(Id::CoulombTorque);
                    parameters[free.joint].set(id, *value * coulomb);
                }
                Some(id) => parameters[free.joint].set(id, *value),
                None => deflection[free.joint] = *value,
            }
        }
        (parameters, deflection)
    }

    /// Returns the normal equations at a point in the coordinates.
    fn normal<const N: usize>(&self, point: &[f64]) -> NormalEquations {
        let mut parameters = self.base.each_ref().map(|of| of.convert::<Dual<N>>());
        let mut deflection = [Dual::<N>::default(); JOINTS];
        for (index, (free, along)) in self.free.iter().zip(point).enumerate() {
            let (value, slope) = free.value(*along);
            let mut number = Dual::parameter(value, index);
            number.gradient[index] = slope;
            match free.id {
                // The Coulomb torque comes before the static torque in every law.
                Some(id) if free.axis == Coordinate::TimesCoulomb => {
                    let coulomb = parameters[free.joint].get(Id::CoulombTorque);
                    parameters[free.joint].set(id, number * coulomb);
                }
                Some(id) => parameters[free.joint].set(id, number),
                None => deflection[free.joint] = number,
            }
        }
        let held = std::array::from_fn(|i| parameters[i].get(Id::BristleStiffness) * deflection[i]);
        let (mut sums, mut cut) = (NormalSums::<N>::new(), false);
        for course in self.courses {
            cut |= !self.arm.run(&course.drive, &parameters, held, self.stride, |row, q, _| {
                for (angle, measured) in q.iter().zip(&course.angles_rad) {
                    let residual = DEGREES * (angle.value - measured[row]);
                    sums.push(residual, &angle.gradient.map(|slope| DEGREES * slope), 1.0);
                }
            });
        }
        sums.normal(point.len(), cut)
    }

    /// Fits the free values from these starting values.
    ///
    /// # Panics
    /// Panics if the number of free values is not that of one of the four laws.
    pub fn fit(&self, start: &[f64], how: SearchOptions) -> Fitted {
        let from: Vec<f64> = self.free.iter().zip(start).map(|(f, x)| f.to_axis(*x)).collect();
        let bounds: Vec<(f64, f64)> = self
            .free
            .iter()
            .map(|free| (free.to_axis(free.bounds.0), free.to_axis(free.bounds.1)))
            .collect();
        let from: Vec<f64> =
            from.iter().zip(&bounds).map(|(x, (least, most))| x.clamp(*least, *most)).collect();
        // The number of derivatives is part of a dual number's type, so the arm is compiled once for each number. Each takes
        // as long to compile as the rest of this file, so there are two.
        let at = |point: &[f64]| match point.len() {
            0..=12 => self.normal::<12>(point),
            13..=24 => self.normal::<24>(point),
            other => unreachable!("no law of these has {other} values in three joints"),
        };
        let SearchResult { point, normal, evaluations, converged } =
            search(&from, &bounds, how, at);
        let values: Vec<f64> =
            self.free.iter().zip(&point).map(|(free, along)| free.value(*along).0).collect();
        let (parameters, deflection_rad) = self.with_values(&values);
        let sum = normal.sum;
        Fitted {
            parameters,
            deflection_rad,
            values,
            start: start.to_vec(),
            sum,
            evaluations,
            converged,
        }
    }
}

/// Evaluates a model in a run, with one step per row.
pub fn evaluate(
    arm: &Arm,
    course: &Course,
    parameters: &[Parameters<f64>; JOINTS],
    deflection_rad: [f64; JOINTS],
) -> CourseErrors {
    let held = std::array::from_fn(|i| parameters[i].get(Id::BristleStiffness) * deflection_rad[i]);
    let rows = course.angles_rad[0].len();
    let mut angles_rad: [Vec<f64>; JOINTS] = std::array::from_fn(|_| Vec::with_capacity(rows));
    let mut largest_held_nm = [0.0f64; JOINTS];
    arm.run(&course.drive, parameters, held, 1, |_, q, held| {
        for joint in 0..JOINTS {
            angles_rad[joint].push(q[joint]);
            largest_held_nm[joint] = largest_held_nm[joint].max(held[joint].abs());
        }
    });
    let sse_deg2 = std::array::from_fn(|joint| {
        // A diverged trajectory gets a large finite error.
        let missing = (rows - angles_rad[joint].len()) as f64 * 360.0 * 360.0;
        let pairs = angles_rad[joint].iter().zip(&course.angles_rad[joint]);
        missing + pairs.map(|(a, b)| (DEGREES * (a - b)).powi(2)).sum::<f64>()
    });
    let rmse_deg = sse_deg2.map(|sse: f64| (sse / rows as f64).sqrt());
    CourseErrors { rmse_deg, sse_deg2, angles_rad, largest_held_nm }
}
