//! A friction model fitted inside the arm: the angles of all three joints at once.
//!
//! Free are the parameters of the law in each joint, for LuGre also the bristles' deflection at first, as in the
//! paper. Two protocols: the paper's (each value between 0.001 and 10 and as it stands, all from 0.1, its tool's tolerance of 1e-3),
//! and a proper one (values that must be positive by their logarithm between bounds of their own, several starts,
//! a tight tolerance). Residuals are in degrees, as the paper's are. Derivatives are exact: dual numbers through the whole
//! trajectory.

use super::arm::{Arm, Drive, JOINTS};
use super::bounded::{End, Normal, Search, Sums, search};
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters};
use friction_identification::dual::Dual;

/// A log to fit on or to judge by.
#[derive(Clone, Debug)]
pub struct Course {
    /// Its name.
    pub name: String,
    /// What drove the arm.
    pub drive: Drive,
    /// The measured angles, rad.
    pub angles_rad: [Vec<f64>; JOINTS],
}

/// How a value is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// As it stands, beside this size.
    Plain(f64),
    /// By its logarithm.
    Logarithmic,
    /// As a multiple of the same joint's Coulomb torque: a static torque that cannot fall below it.
    TimesCoulomb,
}

/// One value of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// The joint, from 0.
    pub joint: usize,
    /// Which parameter; `None` is the bristles' deflection at first, rad.
    pub id: Option<Id>,
    /// How it is moved.
    pub axis: Axis,
    /// Lower and upper bound.
    pub bounds: (f64, f64),
}

impl Free {
    fn to_axis(self, value: f64) -> f64 {
        match self.axis {
            Axis::Plain(size) => value / size,
            Axis::Logarithmic => value.ln(),
            Axis::TimesCoulomb => value,
        }
    }

    /// The value and its slope along the axis.
    fn value(self, along: f64) -> (f64, f64) {
        match self.axis {
            Axis::Plain(size) => (along * size, size),
            Axis::Logarithmic => (along.exp(), along.exp()),
            Axis::TimesCoulomb => (along, 1.0),
        }
    }
}

/// A model in all joints, what of it is free, and how it is sought.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// What is known of the arm.
    pub arm: &'a Arm,
    /// What is fitted on.
    pub courses: &'a [Course],
    /// The model of each joint; what is not free stays.
    pub base: [Parameters<f64>; JOINTS],
    /// What is free.
    pub free: Vec<Free>,
    /// Rows to a step.
    pub stride: usize,
}

/// What a fit ended with.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model of each joint.
    pub parameters: [Parameters<f64>; JOINTS],
    /// The bristles' deflection at first, rad.
    pub deflection_rad: [f64; JOINTS],
    /// A value for each of the free ones.
    pub values: Vec<f64>,
    /// Where the search began.
    pub start: Vec<f64>,
    /// Sum of squares, deg^2, on the rows of the fit.
    pub sum: f64,
    /// Simulations with derivatives.
    pub evaluations: usize,
    /// Whether it ended by its tolerance.
    pub converged: bool,
}

/// How a model does on a course: per joint the root mean square error in degrees and the sum of squares.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Root mean square error, deg.
    pub rmse_deg: [f64; JOINTS],
    /// Sum of squared errors, deg^2.
    pub sse_deg2: [f64; JOINTS],
    /// The simulated angles, rad, a value per row.
    pub angles_rad: [Vec<f64>; JOINTS],
    /// The largest torque the bristles held, Nm.
    pub largest_held_nm: [f64; JOINTS],
}

/// The printed bounds and start of every coefficient.
pub const PRINTED_BOUNDS: (f64, f64) = (0.001, 10.0);
/// The start.
pub const PRINTED_START: f64 = 0.1;

/// What the paper's protocol frees, as it stands between the printed bounds.
pub fn printed_free(law: LawKind) -> Vec<Free> {
    let free = |joint, id: Option<Id>| {
        // The deflections it prints lie below the bound it prints: they cannot have had that bound.
        let bounds = if id.is_some() { PRINTED_BOUNDS } else { (0.0, PRINTED_BOUNDS.1) };
        Free { joint, id, axis: Axis::Plain(1.0), bounds }
    };
    each(law, free)
}

fn each(law: LawKind, free: impl Fn(usize, Option<Id>) -> Free) -> Vec<Free> {
    let deflection = law.has_bristles().then_some(None);
    let ids = || law.parameters().iter().map(|id| Some(*id)).chain(deflection);
    (0..JOINTS)
        .flat_map(|joint| ids().map(move |id| (joint, id)))
        .map(|(joint, id)| free(joint, id))
        .collect()
}

/// A static torque is seldom three times the Coulomb torque.
const MOST_STATIC: f64 = 3.0;

/// What a proper fit frees: the law, and an offset in every joint (the arm's zero and its valves' are not known better than
/// that, and only the atan law would have one of its own). Bounds are of the thing: a level up to what the muscles could ever drive, a stiffness
/// up to what this step can follow, an offset or a curvature either way.
pub fn proper_free(law: LawKind) -> Vec<Free> {
    let of = |joint, id: Option<Id>| {
        let plain = |size: f64, bounds| Free { joint, id, axis: Axis::Plain(size), bounds };
        let positive = |bounds| Free { joint, id, axis: Axis::Logarithmic, bounds };
        match id {
            Some(Id::CoulombTorque) => positive((1e-4, 30.0)),
            Some(Id::StaticTorque) => {
                Free { joint, id, axis: Axis::TimesCoulomb, bounds: (1.0, MOST_STATIC) }
            }
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
    let own = law.parameters().contains(&Id::TorqueOffset);
    let offsets = (0..JOINTS).filter(|_| !own).map(|joint| of(joint, Some(Id::TorqueOffset)));
    each(law, of).into_iter().chain(offsets).collect()
}

/// What a derivative of degrees is made of.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

impl Problem<'_> {
    fn with_values(&self, values: &[f64]) -> ([Parameters<f64>; JOINTS], [f64; JOINTS]) {
        let (mut parameters, mut deflection) = (self.base.clone(), [0.0; JOINTS]);
        for (free, value) in self.free.iter().zip(values) {
            match free.id {
                Some(id) if free.axis == Axis::TimesCoulomb => {
                    let coulomb = parameters[free.joint].get(Id::CoulombTorque);
                    parameters[free.joint].set(id, *value * coulomb);
                }
                Some(id) => parameters[free.joint].set(id, *value),
                None => deflection[free.joint] = *value,
            }
        }
        (parameters, deflection)
    }

    /// The problem at a point of the axes.
    fn normal<const N: usize>(&self, point: &[f64]) -> Normal {
        let mut parameters = self.base.each_ref().map(|of| of.convert::<Dual<N>>());
        let mut deflection = [Dual::<N>::default(); JOINTS];
        for (index, (free, along)) in self.free.iter().zip(point).enumerate() {
            let (value, slope) = free.value(*along);
            let mut number = Dual::parameter(value, index);
            number.gradient[index] = slope;
            match free.id {
                // The Coulomb torque comes before it in every law.
                Some(id) if free.axis == Axis::TimesCoulomb => {
                    let coulomb = parameters[free.joint].get(Id::CoulombTorque);
                    parameters[free.joint].set(id, number * coulomb);
                }
                Some(id) => parameters[free.joint].set(id, number),
                None => deflection[free.joint] = number,
            }
        }
        let held = std::array::from_fn(|i| parameters[i].get(Id::BristleStiffness) * deflection[i]);
        let (mut sums, mut cut) = (Sums::<N>::new(), false);
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

    /// Searches from some values.
    ///
    /// # Panics
    /// If the law has another number of values than the four this is for.
    pub fn fit(&self, start: &[f64], how: Search) -> Fitted {
        let from: Vec<f64> = self.free.iter().zip(start).map(|(f, x)| f.to_axis(*x)).collect();
        let bounds: Vec<(f64, f64)> = self
            .free
            .iter()
            .map(|free| (free.to_axis(free.bounds.0), free.to_axis(free.bounds.1)))
            .collect();
        let from: Vec<f64> =
            from.iter().zip(&bounds).map(|(x, (least, most))| x.clamp(*least, *most)).collect();
        // The number of derivatives is part of a dual number's type, and each has an arm and all laws compiled for it.
        let at = |point: &[f64]| match point.len() {
            0..=6 => self.normal::<6>(point),
            7..=12 => self.normal::<12>(point),
            13..=16 => self.normal::<16>(point),
            17..=24 => self.normal::<24>(point),
            other => unreachable!("no law of these has {other} values in three joints"),
        };
        let End { point, normal, evaluations, converged } = search(&from, &bounds, how, at);
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

/// Judges a model on a course, a step per row.
pub fn judge(
    arm: &Arm,
    course: &Course,
    parameters: &[Parameters<f64>; JOINTS],
    deflection_rad: [f64; JOINTS],
) -> Judged {
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
        // A trajectory that ran away is as wrong as can be told: a number all the same.
        let missing = (rows - angles_rad[joint].len()) as f64 * 360.0 * 360.0;
        let pairs = angles_rad[joint].iter().zip(&course.angles_rad[joint]);
        missing + pairs.map(|(a, b)| (DEGREES * (a - b)).powi(2)).sum::<f64>()
    });
    let rmse_deg = sse_deg2.map(|sse: f64| (sse / rows as f64).sqrt());
    Judged { rmse_deg, sse_deg2, angles_rad, largest_held_nm }
}
