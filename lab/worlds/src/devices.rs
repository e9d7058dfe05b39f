//! Measuring devices of a second maker: strain gauge, resolver and tracking observer.
//!
//! ```text
//! torque     second-order low-pass of the bridge ─► noise ─► mains hum ─► ADC
//! angle      resolver: errors once and twice per turn ─► lines
//! velocity   second-order tracking observer on the resolver's angle, instead of differences
//! ```
//!
//! They replace the devices of [`super::sensing`] with the same kind of defect, so that a result on them does not
//! depend on the filters and encoders of that module. Filters run at the log's rate. The
//! low-pass holds the mean of both ends between two rows, which also takes from noise what is near half the rate; the
//! observer takes the angle as linear.

use simulated_machines::effects::Wave;
use simulated_machines::sampler::Sampler;
use std::f64::consts::TAU;

/// A damped second-order system that decays towards its input.
#[derive(Clone, Copy, Debug)]
pub(super) struct SecondOrder {
    /// Natural frequency, Hz.
    pub natural_hz: f64,
    /// Damping ratio, between 0 and 1.
    pub damping: f64,
}

/// Response of a [`SecondOrder`] over a time: the free decay `e'' + 2 d w e' + w^2 e = 0`.
struct Decay {
    /// `w`, rad/s.
    natural: f64,
    /// `exp(-d w t) (cos + d w sin / w_d)`: the part of `e` that a unit of `e` leaves.
    error_share: f64,
    /// `exp(-d w t) (cos - d w sin / w_d)`: the part of `e'` that a unit of `e'` leaves.
    rate_share: f64,
    /// `exp(-d w t) sin / w_d`: the part of `e` that a unit of `e'` adds, s.
    rate_to_error_s: f64,
}

impl Decay {
    /// Returns the rate that a unit of `e` takes away, 1/s.
    fn pull(&self) -> f64 {
        self.natural * self.natural * self.rate_to_error_s
    }
}

impl SecondOrder {
    /// Returns the group delay at low frequency, s.
    pub fn delay_s(&self) -> f64 {
        2.0 * self.damping / (TAU * self.natural_hz)
    }

    fn decay(&self, seconds: f64) -> Decay {
        let natural = TAU * self.natural_hz;
        let damped = natural * (1.0 - self.damping * self.damping).sqrt();
        let (sin, cos) = (damped * seconds).sin_cos();
        let left = (-self.damping * natural * seconds).exp();
        let skew = self.damping * natural * sin / damped;
        Decay {
            natural,
            error_share: left * (cos + skew),
            rate_share: left * (cos - skew),
            rate_to_error_s: left * sin / damped,
        }
    }

    /// Returns the low-passed values at uneven times. The initial state is rest at the first value.
    pub fn low_pass(&self, times: &[f64], values: &[f64]) -> Vec<f64> {
        let mut output = values.first().copied().unwrap_or(0.0);
        let mut rate = 0.0;
        let mut passed = Vec::with_capacity(values.len());
        for (at, value) in values.iter().enumerate() {
            if at > 0 {
                // The mean of both ends delays the input by no part of a row.
                let input = 0.5 * (value + values[at - 1]);
                let step = self.decay(times[at] - times[at - 1]);
                let error = output - input;
                output = input + error * step.error_share + rate * step.rate_to_error_s;
                rate = rate * step.rate_share - step.pull() * error;
            }
            passed.push(output);
        }
        passed
    }

    /// Returns the velocity of a tracking observer on an angle, rad/s: `a' = w + 2 d w_n e, w' = w_n^2 e, e = angle - a`.
    ///
    /// The observer starts locked on the first angle, at the velocity `start`.
    pub fn track(&self, times: &[f64], angles: &[f64], start: f64) -> Vec<f64> {
        let (mut velocity, mut error) = (start, 0.0);
        let mut tracked = Vec::with_capacity(angles.len());
        for at in 0..angles.len() {
            if at > 0 {
                let seconds = (times[at] - times[at - 1]).max(1e-9);
                let input = (angles[at] - angles[at - 1]) / seconds;
                let step = self.decay(seconds);
                let behind = input - velocity;
                velocity = input - (behind * step.error_share - step.pull() * error);
                error = error * step.rate_share + behind * step.rate_to_error_s;
            }
            tracked.push(velocity);
        }
        tracked
    }
}

/// Periodic error of a resolver.
#[derive(Clone, Copy, Debug)]
pub(super) struct AngleError {
    /// Errors once and twice per turn, rad.
    waves: [Wave; 2],
}

impl AngleError {
    /// Draws an error of the size of usual resolvers: each wave up to 10 arcmin.
    pub fn draw(sampler: &mut Sampler) -> Self {
        let mut draw = |order: f64, most_rad: f64| {
            let size = sampler.log_between(1e-4, most_rad);
            Wave { size, order, phase: sampler.between(0.0, TAU) }
        };
        Self { waves: [draw(1.0, 3e-3), draw(2.0, 2e-3)] }
    }

    /// Returns the angle with the error, rad.
    pub fn read(&self, angle: f64) -> f64 {
        let [once, twice] = self.waves;
        angle + once.at(angle) + twice.at(angle)
    }

    /// Returns the amplitudes of the errors once and twice per turn, rad.
    pub fn amplitudes(&self) -> [f64; 2] {
        self.waves.map(|wave| wave.size)
    }
}

/// Amplifier of a strain gauge after its low-pass: mains hum and analogue-digital converter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Amplifier {
    /// Amplitude of the hum, Nm.
    pub hum_nm: f64,
    /// Frequency of the hum, Hz.
    pub hum_hz: f64,
    /// Step of the converter, Nm.
    pub resolution_nm: f64,
}

impl Amplifier {
    /// Draws an amplifier for a torque noise and a Coulomb torque, Nm. The hum stays below the noise.
    pub fn draw(sampler: &mut Sampler, noise_nm: f64, coulomb_nm: f64) -> Self {
        let mains_hz = if sampler.chance(0.5) { 50.0 } else { 60.0 };
        // The range holds the additive torques too. 13 to 16 bits cover it from end to end.
        let range_nm = 2.0 * coulomb_nm * sampler.log_between(5.0, 20.0);
        let bits = 13 + sampler.below(4);
        Self {
            hum_nm: noise_nm * sampler.log_between(0.05, 0.6),
            // The mains deviate by up to 0.1 %. An exact multiple of a log's rate would become an offset.
            hum_hz: mains_hz * (1.0 + 1e-3 * sampler.between(-1.0, 1.0)),
            resolution_nm: range_nm / f64::from(1u32 << bits),
        }
    }

    /// Adds the hum to the torque of a run and converts it, Nm. The run starts at any phase of the mains.
    pub fn convert(&self, sampler: &mut Sampler, times: &[f64], torque: &[f64]) -> Vec<f64> {
        let phase = sampler.between(0.0, TAU);
        let hum = |t: f64| self.hum_nm * (TAU * self.hum_hz * t + phase).sin();
        let convert = |(t, torque): (&f64, &f64)| {
            ((torque + hum(*t)) / self.resolution_nm).round() * self.resolution_nm
        };
        times.iter().zip(torque).map(convert).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTER: SecondOrder = SecondOrder { natural_hz: 8.0, damping: 0.7 };

    fn times(rate_hz: f64, seconds: f64) -> Vec<f64> {
        (0..(seconds * rate_hz) as usize).map(|at| at as f64 / rate_hz).collect()
    }

    #[test]
    fn low_pass_at_its_natural_frequency_has_gain_of_half_the_inverse_damping() {
        let times = times(500.0, 4.0);
        let wave: Vec<f64> = times.iter().map(|t| (TAU * FILTER.natural_hz * t).sin()).collect();
        let passed = FILTER.low_pass(&times, &wave);
        let late = &passed[1000..];
        let power = late.iter().map(|x| x * x).sum::<f64>() / late.len() as f64;
        let gain = (2.0 * power).sqrt();
        assert!((gain - 1.0 / (2.0 * FILTER.damping)).abs() < 0.01, "{gain}");
    }

    #[test]
    fn low_pass_of_ramp_lags_by_its_delay() {
        let times = times(100.0, 3.0);
        let passed = FILTER.low_pass(&times, &times);
        let late_s = times.last().unwrap() - passed.last().unwrap();
        assert!((late_s - FILTER.delay_s()).abs() < 1e-4, "{late_s}");
    }

    #[test]
    fn track_of_constant_acceleration_lags_by_its_delay() {
        let times = times(200.0, 3.0);
        let angles: Vec<f64> = times.iter().map(|t| 0.5 * t * t).collect();
        let velocity = FILTER.track(&times, &angles, 0.0);
        let late_s = times.last().unwrap() - velocity.last().unwrap();
        assert!((late_s - FILTER.delay_s()).abs() < 1e-3, "{late_s}");
    }

    #[test]
    fn track_of_constant_velocity_keeps_the_velocity() {
        let times = times(200.0, 0.5);
        let angles: Vec<f64> = times.iter().map(|t| 3.0 * t).collect();
        assert!(FILTER.track(&times, &angles, 3.0).iter().all(|v| (v - 3.0).abs() < 1e-9));
    }

    #[test]
    fn angle_error_of_any_resolver_is_below_its_amplitudes() {
        let mut sampler = Sampler::new(4, 0);
        for _ in 0..20 {
            let error = AngleError::draw(&mut sampler);
            let most = error.amplitudes().iter().sum::<f64>();
            let worst = (0..100)
                .map(|at| f64::from(at) * 0.1)
                .map(|angle| (error.read(angle) - angle).abs())
                .fold(0.0, f64::max);
            assert!(worst > 0.3 * most && worst <= most && most <= 5e-3, "{worst} {most}");
        }
    }

    #[test]
    fn convert_adds_at_most_hum_and_half_a_step() {
        let amplifier = Amplifier { hum_nm: 0.01, hum_hz: 50.0, resolution_nm: 0.004 };
        let times = times(700.0, 0.2);
        let torque: Vec<f64> = times.iter().map(|t| t.sin()).collect();
        let read = amplifier.convert(&mut Sampler::new(1, 1), &times, &torque);
        let worst = read.iter().zip(&torque).map(|(r, t)| (r - t).abs()).fold(0.0, f64::max);
        assert!(worst > 0.009 && worst <= 0.012 + 1e-12, "{worst}");
        let steps = read.iter().map(|r| r / amplifier.resolution_nm);
        assert!(steps.map(|s| (s - s.round()).abs()).all(|off| off < 1e-6));
    }
}
