//! Motions of a joint: angle, velocity and acceleration as functions of time.
//!
//! The integrator uses the travel as the independent variable. A motion therefore gives its angle in
//! closed form, not as a sum of velocities. Every motion starts at rest.

use std::f64::consts::TAU;

/// Angle, velocity and acceleration of a joint at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instant {
    /// Angle since the start of the run, rad.
    pub angle: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Acceleration, rad/s^2.
    pub acceleration: f64,
}

/// One sine of a motion: velocity `peak sin(2 pi hz t)`.
#[derive(Clone, Copy, Debug)]
pub struct Wave {
    /// Amplitude of the velocity, rad/s.
    pub peak: f64,
    /// Frequency, Hz.
    pub hz: f64,
}

/// A time with its velocity and angle. Ramps connect two knots.
#[derive(Clone, Copy, Debug)]
struct Knot {
    t: f64,
    velocity: f64,
    angle: f64,
}

/// A motion from the start of a run.
#[derive(Clone, Debug)]
pub enum Motion {
    /// A sum of sines.
    Waves(Vec<Wave>),
    /// Oscillations about a point, with a growing amplitude.
    Presliding {
        /// Amplitude at the end of the growth, rad.
        travel: f64,
        /// Frequency, Hz.
        hz: f64,
        /// Time over which the amplitude grows from 0, s.
        growth: f64,
    },
    /// Constant speeds and ramps.
    Speeds(Speeds),
}

/// A sequence of speeds with ramps between them.
#[derive(Clone, Debug)]
pub struct Speeds {
    knots: Vec<Knot>,
    /// True if ramps start and end with zero acceleration, false if they are linear.
    is_smooth: bool,
}

impl Speeds {
    /// Creates a sequence that starts at rest at time 0.
    pub fn from_rest(is_smooth: bool) -> Self {
        Self { knots: vec![Knot { t: 0.0, velocity: 0.0, angle: 0.0 }], is_smooth }
    }

    /// Returns the last knot.
    fn last(&self) -> Knot {
        self.knots.last().copied().unwrap_or(Knot { t: 0.0, velocity: 0.0, angle: 0.0 })
    }

    /// Returns the time of the last knot, s.
    pub fn end(&self) -> f64 {
        self.last().t
    }

    /// Returns the velocity at the last knot, rad/s.
    pub fn velocity(&self) -> f64 {
        self.last().velocity
    }

    /// Appends a ramp to `velocity` that takes `seconds`.
    ///
    /// The mean velocity of both kinds of ramp is the mean of their ends.
    pub fn ramp(&mut self, velocity: f64, seconds: f64) {
        let last = self.last();
        let angle = last.angle + 0.5 * (last.velocity + velocity) * seconds;
        self.knots.push(Knot { t: last.t + seconds, velocity, angle });
    }

    /// Holds the velocity for `seconds`.
    pub fn hold(&mut self, seconds: f64) {
        self.ramp(self.velocity(), seconds);
    }

    /// Evaluates the sequence at a time, s. After the last knot the velocity is constant.
    fn at(&self, t: f64) -> Instant {
        let next = self.knots.partition_point(|knot| knot.t <= t);
        let Some(from) = next.checked_sub(1).and_then(|at| self.knots.get(at)) else {
            return Instant::default();
        };
        let Some(to) = self.knots.get(next) else {
            let angle = from.angle + from.velocity * (t - from.t);
            return Instant { angle, velocity: from.velocity, acceleration: 0.0 };
        };
        let (seconds, rise) = (to.t - from.t, to.velocity - from.velocity);
        let x = (t - from.t) / seconds;
        // Share of the velocity change, its integral and its slope.
        let (share, integral, slope) = if self.is_smooth {
            (x * x * (3.0 - 2.0 * x), x * x * x * (1.0 - 0.5 * x), 6.0 * x * (1.0 - x))
        } else {
            (x, 0.5 * x * x, 1.0)
        };
        Instant {
            angle: from.angle + seconds * (from.velocity * x + rise * integral),
            velocity: from.velocity + rise * share,
            acceleration: rise * slope / seconds,
        }
    }
}

impl Motion {
    /// Evaluates the motion at a time from the start of the run, s.
    pub fn at(&self, t: f64) -> Instant {
        if t <= 0.0 {
            return Instant::default();
        }
        match self {
            Motion::Waves(waves) => waves.iter().fold(Instant::default(), |sum, wave| {
                let w = TAU * wave.hz;
                let (sine, cosine) = (w * t).sin_cos();
                Instant {
                    angle: sum.angle + wave.peak / w * (1.0 - cosine),
                    velocity: sum.velocity + wave.peak * sine,
                    acceleration: sum.acceleration + wave.peak * w * cosine,
                }
            }),
            Motion::Presliding { travel, hz, growth } => {
                // angle = travel s(t/growth) sin(w t) with s = x^2 up to 1, then 1.
                let w = TAU * hz;
                let (sine, cosine) = (w * t).sin_cos();
                let x = (t / growth).min(1.0);
                let (size, rise, bend) = if t < *growth {
                    (x * x, 2.0 * x / growth, 2.0 / (growth * growth))
                } else {
                    (1.0, 0.0, 0.0)
                };
                Instant {
                    angle: travel * size * sine,
                    velocity: travel * (rise * sine + size * w * cosine),
                    acceleration: travel
                        * (bend * sine + 2.0 * rise * w * cosine - size * w * w * sine),
                }
            }
            Motion::Speeds(speeds) => speeds.at(t),
        }
    }

    /// Returns the largest speed up to a time, evaluated on a grid of 401 points, rad/s.
    pub fn peak(&self, seconds: f64) -> f64 {
        (0..=400)
            .map(|step| self.at(seconds * f64::from(step) / 400.0).velocity.abs())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramps(soft: bool) -> Motion {
        let mut speeds = Speeds::from_rest(soft);
        speeds.ramp(2.0, 0.5);
        speeds.hold(0.3);
        speeds.ramp(-1.0, 0.7);
        speeds.ramp(0.0, 0.2);
        speeds.hold(1.0);
        Motion::Speeds(speeds)
    }

    #[test]
    fn at_returns_consistent_derivatives() {
        let waves = Motion::Waves(vec![Wave { peak: 1.0, hz: 0.7 }, Wave { peak: 0.4, hz: 1.9 }]);
        let presliding = Motion::Presliding { travel: 1e-2, hz: 3.0, growth: 2.0 };
        for motion in [waves, presliding, ramps(false), ramps(true)] {
            let h = 1e-6;
            for step in 1..300 {
                let t = f64::from(step) * 0.01 + 0.0037;
                let (before, now, after) = (motion.at(t - h), motion.at(t), motion.at(t + h));
                let slope = (after.angle - before.angle) / (2.0 * h);
                assert!((slope - now.velocity).abs() < 1e-6, "{motion:?} at {t}");
                let slope = (after.velocity - before.velocity) / (2.0 * h);
                assert!((slope - now.acceleration).abs() < 1e-4, "{motion:?} at {t}");
            }
        }
    }

    #[test]
    fn at_before_and_at_start_returns_rest() {
        for motion in [ramps(true), Motion::Presliding { travel: 1e-3, hz: 3.0, growth: 2.0 }] {
            assert_eq!(motion.at(-0.1), Instant::default());
            assert_eq!(motion.at(0.0), Instant::default());
        }
    }

    #[test]
    fn at_after_last_knot_keeps_the_velocity() {
        let mut speeds = Speeds::from_rest(false);
        speeds.ramp(3.0, 1.0);
        let motion = Motion::Speeds(speeds);
        assert_eq!(motion.at(3.0).velocity, 3.0);
        assert!((motion.at(3.0).angle - 7.5).abs() < 1e-12);
    }
}
