//! The short form of the grading: a few joints, with seeds other than those of the tables.

use drifting_joints::drift::{ADAPTIVE, Drift, OFF, grade_drift, grade_steady};
use drifting_joints::lies::{Lie, PreparedJoint, grade_lie};

/// Largest ratio of a single moment. The tables grade the median and 95 % of many.
const LARGEST_RATIO: f64 = 1.8;

#[test]
fn grade_drift_with_a_new_seal_is_near_the_set_tuned_anew() {
    let grades = grade_drift(52_001, Drift::NewSeal).expect("a grade");
    let [grade] = grades.as_slice() else { panic!("{grades:?}") };
    let [off, fixed, adaptive, anew, _] = grade.rms_rad;
    assert!(adaptive < LARGEST_RATIO * anew && adaptive < 0.5 * off, "{grade:?}");
    assert!(adaptive < fixed, "{grade:?}");
    let level = f64::from(grade.learnt.level);
    assert!((level / grade.true_level - 1.0).abs() < 0.15, "{grade:?}");
}

#[test]
fn grade_steady_keeps_level_and_tracking() {
    let grade = grade_steady(52_002, 1).expect("a grade");
    assert!(grade.level_error < 0.03 && grade.worst_ratio < 1.02, "{grade:?}");
}

#[test]
fn grade_lie_of_every_kind_stays_within_bounds() {
    let joint = PreparedJoint::draw(52_003).expect("a joint");
    for course in 0..Lie::ALL.len() as u64 {
        let grade = grade_lie(&joint, 1600 + course).expect("a grade");
        assert!(grade.torque_share <= 1.000_001, "{grade:?}");
        assert!(!grade.has_limit_cycle(ADAPTIVE) && !grade.stops_by(ADAPTIVE), "{grade:?}");
        assert!(grade.ratio() < 1.05 || grade.is_stopped[OFF], "{grade:?}");
    }
}
