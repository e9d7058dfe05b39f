//! Sensor models: each kind of log has one defect of random size.
//!
//! | kind | defect |
//! |---|---|
//! | exact | torque noise only |
//! | encoder | angle of 12 to 21 bits, velocity from its filtered differences |
//! | velocity-noise | velocity noise of 0.3 to 10 mrad/s, also at rest |
//! | no-position | no angle; velocity with noise, or from the differences of an angle that is not logged |
//! | torque-filtered | torque after a low-pass of 5 to 200 Hz: first order, second order, or moving average |
//! | held | covariates updated at 0.2 to 20 Hz; in some logs torque or motion held over several rows |
//!
//! Filters run at the log's rate. A low-pass and held rows delay a channel. A diagnosis that reports this delay is
//! right, whatever effect is hidden ([`Sensing::true_of_the_log`]).
//!
//! [`Sensing::draw_second_maker`] replaces the devices by those of [`super::devices`] and keeps the kind of defect.

use super::devices::{Amplifier, AngleError, SecondOrder};
use super::filters::{FilterShape, differences, hold, low_pass};
use simulated_machines::sampler::Sampler;
use simulated_machines::sampling::{CovariateErrors, Sensors, TrueRows};
use std::f64::consts::TAU;

/// Kinds of sensor defect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SensorKind {
    /// Exact, except for torque noise.
    Exact,
    /// Angle from an encoder, velocity from its differences.
    Encoder,
    /// Velocity with noise, also at rest.
    VelocityNoise,
    /// No angle.
    NoPosition,
    /// Torque after a low-pass.
    TorqueFiltered,
    /// Channels held over several rows.
    Held,
}

impl SensorKind {
    /// All kinds, in the order of the tables.
    pub const ALL: [SensorKind; 6] = [
        SensorKind::Exact,
        SensorKind::Encoder,
        SensorKind::VelocityNoise,
        SensorKind::NoPosition,
        SensorKind::TorqueFiltered,
        SensorKind::Held,
    ];

    /// Returns the name of the kind.
    pub const fn name(self) -> &'static str {
        match self {
            SensorKind::Exact => "exact",
            SensorKind::Encoder => "encoder",
            SensorKind::VelocityNoise => "velocity-noise",
            SensorKind::NoPosition => "no-position",
            SensorKind::TorqueFiltered => "torque-filtered",
            SensorKind::Held => "held",
        }
    }

    /// Returns the kind with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Source of the logged velocity.
#[derive(Clone, Copy, Debug)]
enum Velocity {
    /// True velocity with white noise of this standard deviation, rad/s.
    Noisy(f64),
    /// Differences of the encoder's angle after a first-order low-pass with this corner frequency, Hz.
    LowPassed(f64),
    /// Moving average of this many differences of the encoder's angle.
    Averaged(usize),
    /// Tracking observer on the logged angle.
    Tracked(SecondOrder),
}

/// Clock of the log.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// Resolution, s; at least a microsecond.
    pub step_s: f64,
    /// Random error of a time stamp, s.
    pub error_s: f64,
}

/// The sensors of a campaign.
#[derive(Clone, Debug)]
pub(super) struct Sensing {
    pub kind: SensorKind,
    velocity: Velocity,
    /// Encoder lines per radian. `None` if the angle is exact.
    lines_per_rad: Option<f64>,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: f64,
    /// Corner frequency of the torque's low-pass, Hz, and its type.
    torque_corner_hz: Option<f64>,
    torque_shape: FilterShape,
    /// True if the noise enters before the low-pass, so that it is coloured.
    noise_before: bool,
    /// Number of rows over which the torque is held. 1 if it is not held.
    torque_rows: usize,
    /// Number of rows over which angle and velocity are held. 1 if they are not held.
    motion_rows: usize,
    /// Update rate of the covariates, Hz.
    pub covariate_hz: Option<f64>,
    /// Noise and resolution of the covariates.
    pub covariate_errors: CovariateErrors,
    /// Delay of the covariates, s.
    pub covariate_delay_s: f64,
    /// Periodic error of the angle. `None` if the angle has no such error.
    angle_error: Option<AngleError>,
    /// Hum and converter of the torque. `None` if the torque has neither.
    amplifier: Option<Amplifier>,
    /// Clock of the log.
    pub clock: Clock,
}

impl Sensing {
    /// Returns sensors without a defect besides this torque noise, Nm.
    fn exact(kind: SensorKind, noise_nm: f64) -> Self {
        Self {
            kind,
            velocity: Velocity::Noisy(0.0),
            lines_per_rad: None,
            noise_nm,
            torque_corner_hz: None,
            torque_shape: FilterShape::First,
            noise_before: false,
            torque_rows: 1,
            motion_rows: 1,
            covariate_hz: None,
            covariate_errors: CovariateErrors::default(),
            covariate_delay_s: 0.0,
            angle_error: None,
            amplifier: None,
            clock: Clock::default(),
        }
    }

    /// Draws sensors of a kind for a joint with this Coulomb torque.
    pub fn draw(sampler: &mut Sampler, kind: SensorKind, rate_hz: f64, coulomb_nm: f64) -> Self {
        let noise_nm = coulomb_nm * sampler.log_between(0.003, 0.06);
        let mut sensing = Self::exact(kind, noise_nm);
        let lines = |sampler: &mut Sampler, least: usize| {
            f64::from(1u32 << (least + sampler.below(22 - least))) / TAU
        };
        let noise_rad_s = sampler.log_between(3e-4, 1e-2);
        let differences = if sampler.chance(0.5) {
            Velocity::LowPassed(rate_hz * sampler.log_between(0.02, 0.3))
        } else {
            Velocity::Averaged(2 + sampler.below(15))
        };
        match kind {
            SensorKind::Exact => {}
            SensorKind::Encoder => {
                sensing.lines_per_rad = Some(lines(sampler, 12));
                sensing.velocity = differences;
            }
            SensorKind::VelocityNoise => {
                sensing.velocity = Velocity::Noisy(noise_rad_s);
                sensing.lines_per_rad = sampler.chance(0.6).then(|| lines(sampler, 15));
            }
            SensorKind::NoPosition => {
                sensing.lines_per_rad = Some(lines(sampler, 14));
                sensing.velocity =
                    if sampler.chance(0.5) { Velocity::Noisy(noise_rad_s) } else { differences };
            }
            SensorKind::TorqueFiltered => {
                let highest = (0.4 * rate_hz).clamp(6.0, 200.0);
                sensing.torque_corner_hz = Some(sampler.log_between(5.0, highest));
                sensing.noise_before = sampler.chance(0.5);
                sensing.lines_per_rad = sampler.chance(0.5).then(|| lines(sampler, 17));
                sensing.torque_shape =
                    [FilterShape::First, FilterShape::Second, FilterShape::Mean][sampler.below(3)];
            }
            SensorKind::Held => {
                sensing.covariate_hz = Some(sampler.log_between(0.2, (0.5 * rate_hz).min(20.0)));
                match sampler.below(4) {
                    0 => sensing.torque_rows = 2 + sampler.below(4),
                    1 => sensing.motion_rows = 2 + sampler.below(4),
                    _ => {}
                }
                sensing.velocity = if sampler.chance(0.5) {
                    Velocity::Noisy(noise_rad_s)
                } else {
                    sensing.velocity
                };
            }
        }
        sensing
    }

    /// Draws sensors of a kind with the devices of a second maker, for a joint with this Coulomb torque.
    ///
    /// The velocity is tracked where it would be differentiated. In kinds other than `exact`, the angle has a periodic
    /// error and the strain gauge may be slow enough to matter at the log's rate.
    pub fn draw_second_maker(
        sampler: &mut Sampler,
        kind: SensorKind,
        rate_hz: f64,
        coulomb_nm: f64,
    ) -> Self {
        /// Corner of a gauge as a share of the log's rate, above which the log cannot resolve it.
        const MAX_CORNER_SHARE: f64 = 0.4;
        let mut sensing = Self::draw(sampler, kind, rate_hz, coulomb_nm);
        sensing.amplifier = Some(Amplifier::draw(sampler, sensing.noise_nm, coulomb_nm));
        let observer = SecondOrder {
            natural_hz: rate_hz * sampler.log_between(0.04, 0.3),
            damping: sampler.between(0.6, 0.95),
        };
        let corner_hz = rate_hz * sampler.log_between(0.1, 4.0);
        let damping = sampler.between(0.5, 0.9);
        let angle_error = AngleError::draw(sampler);
        if kind == SensorKind::Exact {
            return sensing;
        }
        sensing.angle_error = Some(angle_error);
        sensing.torque_shape = FilterShape::Gauge(damping);
        if sensing.torque_corner_hz.is_none() && corner_hz < MAX_CORNER_SHARE * rate_hz {
            sensing.torque_corner_hz = Some(corner_hz);
        }
        if !matches!(sensing.velocity, Velocity::Noisy(_)) {
            sensing.velocity = Velocity::Tracked(observer);
        }
        sensing
    }

    /// Returns the delay of the logged velocity, s: the group delay of its filter.
    pub fn velocity_delay_s(&self, rate_hz: f64) -> f64 {
        let held = 0.5 * (self.motion_rows - 1) as f64 / rate_hz;
        held + match self.velocity {
            Velocity::Noisy(_) => 0.0,
            Velocity::LowPassed(hz) => 0.5 / rate_hz + 1.0 / (TAU * hz),
            Velocity::Averaged(count) => 0.5 * count as f64 / rate_hz,
            Velocity::Tracked(observer) => observer.delay_s(),
        }
    }

    /// Returns true if the log has an angle.
    pub fn has_position(&self) -> bool {
        self.kind != SensorKind::NoPosition
    }

    /// Returns the causes that hold for the log whatever effect is hidden: a delayed channel.
    pub fn true_of_the_log(&self) -> Vec<&'static str> {
        let is_delayed = self.torque_corner_hz.is_some()
            || self.torque_rows > 1
            || self.motion_rows > 1
            || !matches!(self.velocity, Velocity::Noisy(_));
        if is_delayed { vec!["channel-delay"] } else { Vec::new() }
    }

    /// Returns true if the angle has a periodic error.
    pub fn has_angle_error(&self) -> bool {
        self.angle_error.is_some() && self.has_position()
    }

    /// Returns the output of the torque sensor without noise, Nm.
    pub fn torque_channel(&self, times: &[f64], torque: &[f64]) -> Vec<f64> {
        let passed = match self.torque_corner_hz {
            Some(corner_hz) => self.torque_shape.filter(times, torque, corner_hz),
            None => torque.to_vec(),
        };
        hold(&passed, self.torque_rows)
    }

    /// Returns a description of the sensors in one sentence.
    pub fn words(&self) -> String {
        let mut parts = vec![format!("torque noise {:.2e} Nm", self.noise_nm)];
        match self.velocity {
            Velocity::Noisy(0.0) => {}
            Velocity::Noisy(noise) => parts.push(format!("velocity noise {noise:.1e} rad/s")),
            Velocity::LowPassed(hz) => parts.push(format!("differences through {hz:.1} Hz")),
            Velocity::Averaged(n) => parts.push(format!("mean of {n} differences")),
            Velocity::Tracked(observer) => {
                parts.push(format!("tracking observer of {:.1} Hz", observer.natural_hz));
            }
        }
        if let Some(lines) = self.lines_per_rad {
            parts.push(format!("encoder of {} bits", (lines * TAU).log2().round()));
        }
        if let Some([once, twice]) = self.angle_error.map(|error| error.amplitudes()) {
            parts.push(format!("angle errors {once:.1e} and {twice:.1e} rad"));
        }
        if let Some(Amplifier { hum_nm, hum_hz, resolution_nm }) = self.amplifier {
            let hum = format!("hum {hum_nm:.1e} Nm at {hum_hz:.2} Hz");
            parts.push(format!("{hum}, torque steps of {resolution_nm:.1e} Nm"));
        }
        if let Some(hz) = self.torque_corner_hz {
            parts.push(format!("torque through {hz:.1} Hz{}", self.torque_shape.words()));
        }
        for (what, rows) in [("torque", self.torque_rows), ("motion", self.motion_rows)] {
            if rows > 1 {
                parts.push(format!("{what} held over {rows} rows"));
            }
        }
        if let Some(hz) = self.covariate_hz {
            parts.push(format!("covariates at {hz:.2} Hz"));
        }
        parts.join(", ")
    }
}

impl Sensors for Sensing {
    fn angles(&self, rows: &TrueRows) -> Vec<f64> {
        let lines = |angle: f64| match self.lines_per_rad {
            Some(lines) => (angle * lines).floor() / lines,
            None => angle,
        };
        let turned = |angle: f64| self.angle_error.map_or(angle, |error| error.read(angle));
        let read: Vec<f64> = rows.angles.iter().map(|angle| lines(turned(*angle))).collect();
        hold(&read, self.motion_rows)
    }

    fn velocities(&self, sampler: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        let start = rows.velocities.first().copied().unwrap_or(0.0);
        let read = match self.velocity {
            Velocity::Noisy(noise) => {
                rows.velocities.iter().map(|v| v + noise * sampler.normal()).collect()
            }
            Velocity::Tracked(observer) => observer.track(rows.times, &self.angles(rows), start),
            Velocity::LowPassed(corner_hz) => {
                low_pass(rows.times, &differences(rows.times, &self.angles(rows), start), corner_hz)
            }
            Velocity::Averaged(count) => {
                let raw = differences(rows.times, &self.angles(rows), start);
                let mean = |row: usize| {
                    let from = (row + 1).saturating_sub(count);
                    raw[from..=row].iter().sum::<f64>() / (row + 1 - from) as f64
                };
                (0..raw.len()).map(mean).collect()
            }
        };
        hold(&read, self.motion_rows)
    }

    /// Adds sensor noise to a torque that passed [`Sensing::torque_channel`], Nm.
    fn torques(&self, sampler: &mut Sampler, rows: &TrueRows) -> Vec<f64> {
        let mut noise: Vec<f64> =
            rows.torques.iter().map(|_| self.noise_nm * sampler.normal()).collect();
        if self.noise_before || self.torque_rows > 1 {
            noise = self.torque_channel(rows.times, &noise);
        }
        let noisy: Vec<f64> = rows.torques.iter().zip(&noise).map(|(t, n)| t + n).collect();
        match self.amplifier {
            // A held torque is converted once.
            Some(amplifier) => {
                hold(&amplifier.convert(sampler, rows.times, &noisy), self.torque_rows)
            }
            None => noisy,
        }
    }

    /// Each reading is at most one update period older than its delay.
    fn covariate_time_s(&self, time_s: f64) -> f64 {
        let refreshed_s = self.covariate_hz.map_or(time_s, |hz| (time_s * hz).floor() / hz);
        refreshed_s - self.covariate_delay_s
    }

    fn covariate_errors(&self) -> CovariateErrors {
        self.covariate_errors
    }

    fn stamp_s(&self, sampler: &mut Sampler, campaign_s: f64) -> f64 {
        let Clock { step_s, error_s } = self.clock;
        let error = if error_s > 0.0 { error_s * sampler.between(-0.5, 0.5) } else { 0.0 };
        let stamp = campaign_s + error;
        if step_s > 0.0 { (stamp / step_s).round() * step_s } else { stamp }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draw_second_maker_of_each_kind_keeps_the_defect() {
        for (seed, kind) in (0..60).zip(SensorKind::ALL.into_iter().cycle()) {
            let sensing = Sensing::draw_second_maker(&mut Sampler::new(seed, 3), kind, 400.0, 2.0);
            assert_eq!(sensing.has_position(), kind != SensorKind::NoPosition);
            assert_eq!(sensing.angle_error.is_some(), kind != SensorKind::Exact);
            assert!(matches!(sensing.velocity, Velocity::Noisy(_) | Velocity::Tracked(_)));
            let is_slow = sensing.torque_corner_hz.is_some_and(|hz| (5.0..=200.0).contains(&hz));
            assert!(is_slow || kind != SensorKind::TorqueFiltered, "{sensing:?}");
            assert!(
                sensing.true_of_the_log().is_empty() || kind != SensorKind::Exact,
                "{sensing:?}"
            );
            let amplifier = sensing.amplifier.expect("every strain gauge has an amplifier");
            assert!(amplifier.hum_nm < sensing.noise_nm, "{sensing:?}");
        }
    }
}
