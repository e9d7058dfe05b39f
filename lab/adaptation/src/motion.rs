//! Motions: the everyday motion of a joint, and the one that identifies it.
//!
//! Every part is a stroke with smooth ramps, or a rest. The everyday motion is drawn without regard to the estimator.

use crate::plant::{Purpose, course_sampler};
use simulated_machines::sampler::Sampler;

/// Demand of the position loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Position, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
}

/// Habits of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Largest distance from the middle, rad. A stroke that would exceed it is reversed, and ends inside it.
    pub range_rad: f64,
    /// Slowest and fastest stroke, rad/s.
    pub speed_rad_s: [f64; 2],
    /// Shortest and longest stroke, rad.
    pub stroke_rad: [f64; 2],
    /// Largest acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Probability of a rest after a stroke.
    pub rest_probability: f64,
    /// Longest rest, s; at least 0.1.
    pub longest_rest_s: f64,
    /// Probability of a one-sided stretch: several strokes in one direction.
    pub one_sided_probability: f64,
}

impl Habits {
    /// Draws the habits of a joint.
    pub fn draw(random: &mut Sampler) -> Self {
        Self {
            range_rad: random.log_between(0.6, 4.0),
            speed_rad_s: [random.log_between(0.04, 0.3), random.log_between(0.6, 2.0)],
            stroke_rad: [random.log_between(0.01, 0.1), random.log_between(0.3, 1.2)],
            acceleration_rad_s2: random.log_between(3.0, 15.0),
            rest_probability: random.between(0.1, 0.6),
            longest_rest_s: random.log_between(0.5, 5.0),
            one_sided_probability: random.between(0.0, 0.2),
        }
    }
}

/// A stroke or a rest.
#[derive(Clone, Copy, Debug)]
struct Part {
    velocity_rad_s: f64,
    ramp_s: f64,
    duration_s: f64,
}

impl Part {
    fn rest(duration_s: f64) -> Self {
        Self { velocity_rad_s: 0.0, ramp_s: 1.0, duration_s }
    }

    /// Creates a stroke of this speed, or of a lower one if the acceleration requires it.
    fn stroke(way_rad: f64, speed_rad_s: f64, acceleration_rad_s2: f64) -> Self {
        let way = way_rad.abs().max(1e-6);
        let speed = speed_rad_s.min((way * acceleration_rad_s2 / 1.5).sqrt());
        let ramp_s = 1.5 * speed / acceleration_rad_s2;
        Self { velocity_rad_s: speed.copysign(way_rad), ramp_s, duration_s: way / speed + ramp_s }
    }

    /// Sets velocity and acceleration of a demand to those at a time of the part, s.
    fn apply(&self, time_s: f64, demand: &mut Demand) {
        let left_s = self.duration_s - time_s;
        let (near_s, sign) = if left_s < time_s { (left_s, -1.0) } else { (time_s, 1.0) };
        let u = (near_s / self.ramp_s).clamp(0.0, 1.0);
        let v = self.velocity_rad_s;
        demand.velocity_rad_s = v * u * u * (3.0 - 2.0 * u);
        demand.acceleration_rad_s2 = sign * v * 6.0 * u * (1.0 - u) / self.ramp_s;
    }
}

/// A motion and its state.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Parts before the everyday motion, in reversed order.
    planned: Vec<Part>,
    habits: Habits,
    random: Sampler,
    part: Part,
    time_s: f64,
    demand: Demand,
    middle_rad: f64,
    /// Strokes that remain in one direction, and the direction.
    stretch_strokes: usize,
    stretch_direction: f64,
    /// The joint turns in one direction only.
    is_one_sided: bool,
    is_stopped: bool,
}

impl Motion {
    /// Creates the everyday motion around this position, rad.
    pub fn everyday(habits: Habits, seed: u64, middle_rad: f64) -> Self {
        Self {
            planned: Vec::new(),
            habits,
            random: course_sampler(seed, Purpose::Motion),
            part: Part::rest(0.5),
            time_s: 0.0,
            demand: Demand { position_rad: middle_rad, ..Demand::default() },
            middle_rad,
            stretch_strokes: 0,
            stretch_direction: 1.0,
            is_one_sided: false,
            is_stopped: false,
        }
    }

    /// Creates the motion of an identification: slow and fast strokes both ways, small ones, and rests.
    pub fn identification(middle_rad: f64) -> Self {
        let mut parts = vec![Part::rest(1.0)];
        for round in 0..2 {
            for speed in [0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 1.8] {
                let way = (speed * 1.2f64).clamp(0.02, 0.9) * (1.0 - 0.2 * f64::from(round));
                for direction in [1.0, -1.0, -1.0, 1.0] {
                    parts.push(Part::stroke(direction * way, speed, 10.0));
                }
                parts.push(Part::rest(0.2));
            }
            for way in [1e-3, -1e-3, 3e-3, -3e-3, 1e-2, -1e-2] {
                parts.push(Part::stroke(way, 0.1, 10.0));
                parts.push(Part::rest(0.1));
            }
        }
        let habits = Habits {
            range_rad: 1.0,
            speed_rad_s: [0.1, 1.0],
            stroke_rad: [0.1, 0.5],
            acceleration_rad_s2: 10.0,
            rest_probability: 0.0,
            longest_rest_s: 1.0,
            one_sided_probability: 0.0,
        };
        let mut motion = Self::everyday(habits, 0, middle_rad);
        parts.reverse();
        motion.planned = parts;
        motion.part = Part::rest(0.0);
        motion
    }

    /// Returns the time of the parts before the everyday motion, s.
    pub fn planned_s(&self) -> f64 {
        self.planned.iter().rev().map(|part| part.duration_s).sum()
    }

    /// Lets the joint turn in one direction only, without a range, or as usual around the position it has reached.
    pub fn set_one_sided(&mut self, is_one_sided: bool) {
        if self.is_one_sided && !is_one_sided {
            self.middle_rad = self.demand.position_rad;
        }
        self.is_one_sided = is_one_sided;
    }

    /// Keeps the joint at rest after the present stroke, or lets it move again. Planned parts are not affected.
    pub fn set_stopped(&mut self, is_stopped: bool) {
        self.is_stopped = is_stopped;
    }

    /// Advances by `dt` (s) and returns the demand.
    pub fn step(&mut self, dt: f64) -> Demand {
        self.time_s += dt;
        if self.time_s >= self.part.duration_s {
            self.time_s = 0.0;
            self.part = self.next();
        }
        self.part.apply(self.time_s, &mut self.demand);
        self.demand.position_rad += dt * self.demand.velocity_rad_s;
        self.demand
    }

    /// Returns true if the demand rests.
    pub fn is_resting(&self) -> bool {
        self.part.velocity_rad_s == 0.0
    }

    fn next(&mut self) -> Part {
        if let Some(part) = self.planned.pop() {
            return part;
        }
        if self.is_stopped {
            return Part::rest(0.5);
        }
        let (habits, random) = (&self.habits, &mut self.random);
        if self.part.velocity_rad_s != 0.0 && random.chance(habits.rest_probability) {
            return Part::rest(random.log_between(0.1, habits.longest_rest_s));
        }
        if self.stretch_strokes == 0 && random.chance(habits.one_sided_probability) {
            self.stretch_strokes = 4 + random.below(6);
            self.stretch_direction = random.sign();
        }
        let mut way = random.log_between(habits.stroke_rad[0], habits.stroke_rad[1]);
        let mut direction = random.sign();
        if self.stretch_strokes > 0 {
            self.stretch_strokes -= 1;
            direction = self.stretch_direction;
        }
        let from = self.demand.position_rad - self.middle_rad;
        if (from + direction * way).abs() > habits.range_rad {
            direction = -from.signum();
            way = way.min(habits.range_rad + from.abs());
        }
        if self.is_one_sided {
            direction = 1.0;
        }
        let speed = random.log_between(habits.speed_rad_s[0], habits.speed_rad_s[1]);
        Part::stroke(direction * way, speed, habits.acceleration_rad_s2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_of_drawn_motion_stays_within_speed_and_range() {
        for seed in 0..60 {
            let drawn = Habits::draw(&mut course_sampler(seed, Purpose::Joint));
            // Every other joint has a range shorter than its strokes.
            let range_rad = if seed % 2 == 0 { drawn.range_rad } else { 0.25 };
            let habits = Habits { range_rad, ..drawn };
            let mut motion = Motion::everyday(habits, seed, 0.0);
            for _ in 0..60_000 {
                let demand = motion.step(1e-3);
                assert!(demand.velocity_rad_s.abs() <= habits.speed_rad_s[1] * 1.001);
                assert!(demand.acceleration_rad_s2.abs() <= habits.acceleration_rad_s2 * 1.01);
                assert!(demand.position_rad.abs() <= habits.range_rad + 0.01, "{demand:?}");
            }
        }
    }
}
