//! A joint of one inertia and Coulomb friction under the guard.

use super::*;

const JOINT: PassivityParameters =
    PassivityParameters { inertia_kg_m2: 0.12, velocity_max_rad_s: 12.0, scale: 0.9 };
/// Friction of the set, Nm.
const SET_NM: f32 = 1.5;

/// A joint whose friction is a share of that of the set.
struct Joint {
    guard: PassivityGuard,
    friction_nm: f32,
    velocity_rad_s: f32,
    compensation_nm: f32,
}

impl Joint {
    fn with(friction: f32) -> Self {
        Self {
            guard: PassivityGuard::default(),
            friction_nm: friction * SET_NM,
            velocity_rad_s: 0.0,
            compensation_nm: 0.0,
        }
    }

    /// Runs a report with these torques.
    fn step(&mut self, command_nm: f32, hand_nm: f32) {
        let dt_per_inertia = REPORT_PERIOD_S / JOINT.inertia_kg_m2;
        let driven_nm = command_nm + self.compensation_nm + hand_nm;
        let free_rad_s = self.velocity_rad_s + driven_nm * dt_per_inertia;
        let lost_rad_s = self.friction_nm * dt_per_inertia;
        self.velocity_rad_s = free_rad_s.signum() * (free_rad_s.abs() - lost_rad_s).max(0.0);
        let friction_nm = SET_NM * (self.velocity_rad_s / 1e-2).clamp(-1.0, 1.0);
        let sample = TorqueSample {
            velocity_rad_s: self.velocity_rad_s,
            command_nm,
            compensation_nm: self.compensation_nm,
            friction_nm,
        };
        self.guard.step(&sample, &JOINT);
        self.compensation_nm = self.guard.share() * JOINT.scale * friction_nm;
    }

    /// A hand pulls the joint at this speed, as a stiff spring would, for some reports. Returns its mean torque, Nm.
    fn guide(&mut self, speed_rad_s: f32, reports: usize) -> f32 {
        let mut sum = 0.0;
        for _ in 0..reports {
            let hand_nm = (20.0 * (speed_rad_s - self.velocity_rad_s)).clamp(-6.0, 6.0);
            self.step(0.0, hand_nm);
            sum += hand_nm;
        }
        sum / reports as f32
    }
}

#[test]
fn released_joint_without_command_is_slower_than_the_bound_within_half_a_second() {
    for friction in [0.4, 0.6, 0.85, 0.9, 1.0, 1.3] {
        for speed_rad_s in [0.2, 0.6, 2.0, 5.0] {
            let (mut joint, mut bare) = (Joint::with(friction), Joint::with(friction));
            joint.guide(speed_rad_s, 300);
            bare.velocity_rad_s = joint.velocity_rad_s;
            for _ in 0..500 {
                joint.step(0.0, 0.0);
                bare.compensation_nm = 0.0;
                bare.step(0.0, 0.0);
            }
            let excess = joint.velocity_rad_s - bare.velocity_rad_s;
            assert!(excess <= SPEED_SHARE * 12.0, "x{friction} from {speed_rad_s}: {excess}");
            (0..2000).for_each(|_| joint.step(0.0, 0.0));
            // Half of the set's friction is compensated in any case.
            if friction > 0.45 {
                assert!(joint.velocity_rad_s < 0.03, "x{friction}: {}", joint.velocity_rad_s);
            }
        }
    }
}

#[test]
fn share_follows_the_friction_that_the_joint_shows() {
    let mut joint = Joint::with(0.65);
    (0..4).for_each(|_| {
        joint.guide(0.2, 100);
        (0..2500).for_each(|_| joint.step(0.0, 0.0));
    });
    assert!(joint.guard.is_detected());
    assert!(joint.guard.share() * 0.9 < 0.65, "{}", joint.guard.share());
    // A seal with the friction of the set: the joint is slowed more, and the share returns.
    joint.friction_nm = SET_NM;
    for _ in 0..20 {
        joint.guide(0.2, 100);
        (0..500).for_each(|_| joint.step(0.0, 0.0));
    }
    assert!(joint.guard.share() > 0.95, "{}", joint.guard.share());
}

#[test]
fn hand_keeps_the_compensation_below_the_bound_and_a_master_at_every_speed() {
    let mut joint = Joint::with(1.0);
    let bare_nm = 1.5;
    for way in [1.0, -1.0, 1.0, -1.0] {
        let hand_nm = way * joint.guide(way * 0.25, 800);
        assert!(hand_nm < 0.25 * bare_nm, "{hand_nm}");
    }
    // A velocity loop of the master, sines of 3 rad/s.
    let mut joint = Joint::with(1.0);
    let (mut least, mut reports) = (1.0f32, 0);
    for ms in 0..6000 {
        let (sine, cosine) = (ms as f32 * 3e-3).sin_cos();
        let wanted_rad_s = 3.0 * sine;
        let command_nm = 0.12 * 3.0 * 3.0 * cosine + 3.0 * (wanted_rad_s - joint.velocity_rad_s);
        joint.step(command_nm, 0.0);
        least = least.min(joint.guard.share());
        reports += usize::from(joint.guard.share() < 0.99);
    }
    assert!(reports < 60, "{reports} reports, {least}");
}

#[test]
fn steady_small_command_gives_at_most_four_times_its_work() {
    let mut joint = Joint::with(0.65);
    let (command_nm, mut work_j) = (0.09, 0.0);
    for _ in 0..3000 {
        joint.step(command_nm, 0.0);
        work_j += command_nm * joint.velocity_rad_s * REPORT_PERIOD_S;
        let kinetic_j = 0.06 * joint.velocity_rad_s * joint.velocity_rad_s;
        let bound_j = 0.06 * 0.36 + 4.0 * work_j;
        assert!(kinetic_j <= 1.05 * bound_j, "{kinetic_j} above {bound_j}");
    }
}

#[test]
fn interrupt_keeps_what_the_joint_showed_and_a_report_that_is_not_finite_changes_nothing() {
    let mut joint = Joint::with(0.65);
    joint.guide(0.2, 2500);
    let shown = joint.guard.share();
    assert!(shown < 0.95, "{shown}");
    let sample = TorqueSample {
        velocity_rad_s: f32::NAN,
        command_nm: 0.0,
        compensation_nm: 0.0,
        friction_nm: 0.0,
    };
    joint.guard.step(&sample, &JOINT);
    assert_eq!(joint.guard.share(), shown);
    joint.guard.interrupt();
    assert_eq!(joint.guard.share(), shown);
    assert!(joint.guard.work.is_nan(), "a loop of the driver may move it next");
}

#[test]
fn unknown_or_tiny_inertia_counts_every_command_and_none_without_one() {
    for inertia_kg_m2 in [0.0, 1e-40, 1e-30] {
        let joint = PassivityParameters { inertia_kg_m2, ..JOINT };
        let mut guard = PassivityGuard::default();
        let mut step = |command_nm: f32, reports: usize| {
            for _ in 0..reports {
                let sample = TorqueSample {
                    velocity_rad_s: 3.0,
                    command_nm,
                    compensation_nm: 1.35,
                    friction_nm: SET_NM,
                };
                guard.step(&sample, &joint);
            }
            guard.share()
        };
        assert_eq!(step(0.0, 500), 0.0, "{inertia_kg_m2}");
        assert_eq!(step(0.15, 100), 1.0, "{inertia_kg_m2}");
        assert_eq!(step(0.0, 2000), 0.0, "{inertia_kg_m2}");
    }
}
