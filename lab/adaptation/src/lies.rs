//! Courses in which a sensor or the machine is other than the adaptation assumes.

use crate::GradeError;
use crate::drift::{ADAPTIVE, OFF};
use crate::drive::{Aid, TORQUE_LIMIT_NM, TunedSet};
use crate::joint::{Joint, Run};
use crate::plant::{Measured, PERIOD_S, Purpose, World, course_sampler};
use compensator_core::adaptation::Gains;
use compensator_core::{ParameterId, TermKind};
use simulated_machines::joint_plant::Load;
use simulated_machines::sampler::Sampler;

/// Duration of a course, s.
const COURSE_S: f64 = 60.0;

/// Share of the true dependence on the pressure that the set has: a model is never exact.
const KNOWN_PRESSURE_SHARE: f64 = 0.88;

/// Time after the first arm has stopped in which the others may stop too, s.
const GRACE_S: f64 = 1.0;

macro_rules! lies {
    ($($(#[$about:meta])* $lie:ident = $name:literal;)*) => {
        /// What is other than assumed.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Lie {
            $($(#[$about])* $lie,)*
        }

        impl Lie {
            /// Every lie.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$lie),*];

            /// Returns the name in tables.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$lie => $name,)* }
            }
        }
    };
}

lies! {
    /// The encoder repeats a reading.
    EncoderStuck = "encoder stuck";
    /// The encoder has 20 times the noise.
    EncoderNoisy = "encoder noisy";
    /// The encoder jumps now and then.
    EncoderJumps = "encoder jumps";
    /// The encoder shows NaN.
    EncoderNan = "encoder NaN";
    /// The current repeats a reading.
    CurrentStuck = "current stuck";
    /// The current has 20 times the noise.
    CurrentNoisy = "current noisy";
    /// The current has a wrong gain and offset.
    CurrentWrong = "current wrong";
    /// The current shows NaN.
    CurrentNan = "current NaN";
    /// The pressure repeats a reading.
    PressureStuck = "pressure stuck";
    /// The pressure jumps.
    PressureJumps = "pressure jumps";
    /// The pressure shows NaN.
    PressureNan = "pressure NaN";
    /// A coupling becomes loose.
    Slack = "slack";
    /// The output meets a spring.
    Contact = "contact";
    /// A constant load appears or falls.
    Payload = "payload";
    /// Gravity acts.
    Gravity = "gravity";
    /// The joint turns in one direction only.
    OneSided = "one-sided";
}

/// A joint with its set, for many courses.
#[derive(Clone, Debug)]
pub struct PreparedJoint {
    joint: Joint,
    set: TunedSet,
}

impl PreparedJoint {
    /// Draws and identifies a joint. Its friction depends on the pressure, and its set has a term of it.
    ///
    /// # Errors
    /// Returns an error if the set cannot be identified.
    pub fn draw(seed: u64) -> Result<Self, GradeError> {
        let mut joint = Joint::draw(seed)?;
        let mut random = course_sampler(seed, Purpose::Pressure);
        joint.constants.pressure_share = random.between(0.2, 0.7);
        let mut set = joint.identify(&joint.plant(false), &joint.world(), None)?;
        let seal_nm = joint.level_nm() - joint.constants.gear_no_load_nm;
        let slope =
            KNOWN_PRESSURE_SHARE * joint.constants.pressure_share / joint.constants.seal_preload_pa;
        set.model.add_term(TermKind::PressureCoulomb);
        set.model.set(ParameterId::PressureCoulomb, (seal_nm * slope) as f32);
        set.model.validate()?;
        Ok(Self { joint, set })
    }
}

/// Grade of a course.
#[derive(Clone, Debug)]
pub struct LieGrade {
    /// Number of the course.
    pub course: u64,
    /// What was other than assumed.
    pub lies: Vec<Lie>,
    /// RMS errors of the first three arms of [`ARMS`](crate::drift::ARMS), rad.
    pub rms_rad: [f64; 3],
    /// Largest torque of the compensation relative to its bound.
    pub torque_share: f64,
    /// Times of oscillation at rest of these arms, s.
    pub ringing_s: [f64; 3],
    /// A following error has stopped these arms.
    pub is_stopped: [bool; 3],
    /// Learnt gains at the end.
    pub learnt: Gains<f32>,
}

impl LieGrade {
    /// Returns true if the joint oscillates at rest in this arm for more than one window longer than without a compensation.
    pub fn has_limit_cycle(&self, arm: usize) -> bool {
        self.ringing_s[arm] > self.ringing_s[OFF] + 1.5 * WINDOW_S
    }

    /// Returns true if the joint stops in this arm, but not without a compensation.
    pub fn stops_by(&self, arm: usize) -> bool {
        self.is_stopped[arm] && !self.is_stopped[OFF]
    }

    /// Returns the RMS error with the adaptation relative to that without a compensation.
    pub fn ratio(&self) -> f64 {
        self.rms_rad[ADAPTIVE] / self.rms_rad[OFF]
    }
}

/// A lie with its time and size.
#[derive(Clone, Copy, Debug)]
struct DrawnLie {
    lie: Lie,
    from_s: f64,
    until_s: f64,
    /// 0 to 1.
    size: f64,
    sign: f64,
}

impl DrawnLie {
    fn draw(random: &mut Sampler, lie: Lie) -> Self {
        let from_s = random.between(3.0, 40.0);
        let until_s = from_s + random.log_between(0.5, 40.0);
        Self { lie, from_s, until_s, size: random.between(0.0, 1.0), sign: random.sign() }
    }

    fn acts(&self, time_s: f64) -> bool {
        (self.from_s..self.until_s).contains(&time_s)
    }

    fn change_world(&self, world: &mut World, friction_nm: f64) {
        match self.lie {
            Lie::Slack => world.slack_rad = 1e-3 + 0.02 * self.size,
            Lie::Contact => {
                world.load = Load::Wall {
                    position_rad: 0.3 * self.size - 0.15,
                    stiffness_nm_per_rad: 20.0 + 200.0 * self.size,
                };
            }
            Lie::Payload => world.constant_nm += self.sign * friction_nm * (0.3 + 1.7 * self.size),
            Lie::Gravity => world.gravity_nm += self.sign * friction_nm * (0.3 + 1.7 * self.size),
            _ => {}
        }
    }

    fn change_measured(&self, measured: &mut Measured, held: &Measured, random: &mut Sampler) {
        let is_moment = random.chance(0.01);
        match self.lie {
            Lie::EncoderStuck => measured.encoder_rad = held.encoder_rad,
            Lie::EncoderNoisy => measured.encoder_rad += 7.5e-5 * random.normal(),
            Lie::EncoderJumps if is_moment => {
                measured.encoder_rad += self.sign * 0.1 * self.size;
            }
            Lie::EncoderNan => measured.encoder_rad = f64::NAN,
            Lie::CurrentStuck => measured.torque_nm = held.torque_nm,
            Lie::CurrentNoisy => measured.torque_nm += random.normal(),
            Lie::CurrentWrong => {
                measured.torque_nm = measured.torque_nm * (0.4 + 1.6 * self.size) + 0.3 * self.sign;
            }
            Lie::CurrentNan => measured.torque_nm = f64::NAN,
            Lie::PressureStuck => measured.pressure_pa = held.pressure_pa,
            Lie::PressureJumps if is_moment => measured.pressure_pa += 3e6 * self.size,
            Lie::PressureNan => measured.pressure_pa = f64::NAN,
            _ => {}
        }
    }
}

/// Watches for an oscillation while the target rests.
///
/// It is one if the velocity alternates beyond a least speed at least four times in two seconds.
#[derive(Clone, Debug, Default)]
struct RingingWatch {
    rested_s: f64,
    window_s: f64,
    alternations: u32,
    direction: f64,
    ringing_s: f64,
}

/// Window in which alternations are counted, s.
const WINDOW_S: f64 = 2.0;

/// Least speed of an oscillation, rad/s.
const RINGING_RAD_S: f64 = 0.02;

impl RingingWatch {
    fn step(&mut self, is_resting: bool, velocity_rad_s: f64) {
        self.rested_s = if is_resting { self.rested_s + PERIOD_S } else { 0.0 };
        if self.rested_s < 1.0 {
            (self.window_s, self.alternations) = (0.0, 0);
            return;
        }
        if velocity_rad_s.abs() > RINGING_RAD_S && velocity_rad_s.signum() != self.direction {
            self.direction = velocity_rad_s.signum();
            self.alternations += 1;
        }
        self.window_s += PERIOD_S;
        if self.window_s >= WINDOW_S {
            if self.alternations >= 4 {
                self.ringing_s += self.window_s;
            }
            (self.window_s, self.alternations) = (0.0, 0);
        }
    }
}

/// Grades a course of a joint.
///
/// # Errors
/// Returns an error if the driver would refuse the set.
pub fn grade_lie(prepared: &PreparedJoint, course: u64) -> Result<LieGrade, GradeError> {
    let PreparedJoint { joint, set } = prepared;
    let mut random = course_sampler(course, Purpose::Lies);
    let mut lies = vec![Lie::ALL[(course % Lie::ALL.len() as u64) as usize]];
    if random.chance(0.3) {
        lies.push(Lie::ALL[random.below(Lie::ALL.len())]);
    }
    let drawn: Vec<DrawnLie> = lies.iter().map(|lie| DrawnLie::draw(&mut random, *lie)).collect();
    let aids = [Aid::Off, Aid::fixed(set)?, Aid::adaptive(set)?];
    let has_coupling = lies.contains(&Lie::Slack);
    let mut arms = aids.map(|aid| Arm {
        run: joint.start(aid, course ^ joint.seed, has_coupling),
        random: course_sampler(course, Purpose::LieNoise),
        held: vec![None; drawn.len()],
        watch: RingingWatch::default(),
        rms_rad: 0.0,
        aid_max_nm: 0.0,
        torque_max_nm: 0.0,
    });
    let mut end_s = COURSE_S;
    let mut is_scored = false;
    while arms[0].run.time_s < end_s {
        arms.iter_mut().for_each(|arm| arm.period(joint, &drawn));
        let is_stopped = arms.iter().any(|arm| arm.run.drive.is_stopped());
        let is_end = arms[0].run.time_s >= COURSE_S - PERIOD_S;
        if !is_scored && (is_stopped || is_end) {
            // The errors of all arms count until the first one stops.
            arms.iter_mut().for_each(|arm| arm.rms_rad = arm.run.take_rms());
            is_scored = true;
            end_s = end_s.min(arms[0].run.time_s + GRACE_S);
        }
    }
    let bound_nm = f64::from(set.torque_limit_nm());
    let shares = arms[1..]
        .iter()
        .map(|arm| (arm.aid_max_nm / bound_nm).max(arm.torque_max_nm / TORQUE_LIMIT_NM));
    Ok(LieGrade {
        course,
        lies,
        torque_share: shares.fold(0.0, f64::max),
        learnt: arms[ADAPTIVE].run.drive.gains(),
        rms_rad: arms.each_ref().map(|arm| arm.rms_rad),
        ringing_s: arms.each_ref().map(|arm| arm.watch.ringing_s),
        is_stopped: arms.each_ref().map(|arm| arm.run.drive.is_stopped()),
    })
}

/// A run of a course, and what is recorded of it.
struct Arm {
    run: Run,
    random: Sampler,
    /// Measurements at the begin of each lie.
    held: Vec<Option<Measured>>,
    watch: RingingWatch,
    rms_rad: f64,
    /// Largest torque of the aid, Nm.
    aid_max_nm: f64,
    /// Largest torque in all, Nm.
    torque_max_nm: f64,
}

impl Arm {
    fn period(&mut self, joint: &Joint, drawn: &[DrawnLie]) {
        let time_s = self.run.time_s;
        let mut world = joint.world();
        world.pressure_pa = 5e5 * (1.0 - (0.2 * time_s).cos());
        for lie in drawn.iter().filter(|lie| lie.acts(time_s)) {
            lie.change_world(&mut world, joint.level_nm());
        }
        for drawn_lie in drawn.iter().filter(|drawn_lie| drawn_lie.lie == Lie::OneSided) {
            self.run.motion.set_one_sided(drawn_lie.acts(time_s));
        }
        let (held, random) = (&mut self.held, &mut self.random);
        self.run.period(&world, |mut measured| {
            for (drawn_lie, held) in drawn.iter().zip(held) {
                if drawn_lie.acts(time_s) {
                    let first = *held.get_or_insert(measured);
                    drawn_lie.change_measured(&mut measured, &first, random);
                }
            }
            measured
        });
        let run = &self.run;
        self.watch.step(run.motion.is_resting(), run.plant.velocity_rad_s());
        // What is not finite counts as beyond every bound.
        let larger = |most: f64, torque_nm: f64| {
            if torque_nm.is_finite() { most.max(torque_nm.abs()) } else { f64::INFINITY }
        };
        self.aid_max_nm = larger(self.aid_max_nm, run.drive.aid_nm);
        self.torque_max_nm = larger(self.torque_max_nm, run.torque_nm());
    }
}
