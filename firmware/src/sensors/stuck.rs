//! Detects a side-load or pressure sensor whose reading is stuck.
//!
//! A sensor that hangs, or a gateway that repeats its last value, sends the same fresh value for ever. If
//! the noise of a sensor exceeds its resolution, many identical readings in a row are practically
//! impossible. If its steps are wider than the noise, identical readings are normal and nothing can be
//! concluded.
//!
//! The history of the sensor separates the two cases: only noise reverses direction by more than one step
//! again and again. The watch therefore requires [`MIN_REVERSALS`] reversals in a block of
//! [`BLOCK_READINGS`] readings, each wider than one and a half of the smallest change in the previous block
//! (one step or less). This takes a standard deviation of at least 0.7 steps, at which half of all readings
//! equal the previous one, and [`STUCK_AFTER_READINGS`] identical ones have a probability of 1e-56. Sensors
//! with coarser steps are never reported. Neither are smoothed values or values sent more often than
//! measured, because they do not reverse. A sensor that reads exactly 0 below an internal threshold is
//! reported as stuck there; its reading then fades to the same 0.

use compensator_core::compensator::Reading;

/// Number of identical readings after which a sensor with sufficient noise is stuck: 0.2 s at one reading
/// per millisecond, 5 s for the pressure sensor. Half the number would detect it in half the time, with a
/// false-alarm probability of 1e-28.
pub const STUCK_AFTER_READINGS: u16 = 200;

/// Number of readings in a block.
pub const BLOCK_READINGS: u16 = 256;

/// Minimum number of reversals in a block that proves sufficient noise. White noise with a standard
/// deviation of one step gives 30, of 0.6 steps 5.
pub const MIN_REVERSALS: u16 = 8;

/// Minimum width of a reversal, in steps. At the edge between two steps, even little noise causes reversals
/// of one step.
const MIN_REVERSAL_STEPS: f32 = 1.5;

/// Number of identical readings after which a block pauses until the next change: a stuck sensor shows no
/// noise.
const PAUSE_AFTER_READINGS: u16 = 32;

/// Minimum time between two readings, us; ages are rounded to less.
const MIN_READING_GAP_US: u64 = 100;

with_defaults! {
    /// Stuck detection for one sensor.
    #[derive(Clone, Copy, Debug)]
    pub struct StuckWatch {
        last: f32 = f32::NAN,
        last_at_us: u64,
        change: f32,
        identical_readings: u16,
        readings: u16,
        reversals: u16,
        step: f32 = f32::INFINITY,
        previous_step: f32 = f32::INFINITY,
        has_noise: bool,
        stuck_since_us: Option<u64>,
    }
    /// The state before the first reading.
}

impl StuckWatch {
    /// Evaluates a reading, which may be the same one as in the last call. The reading of a stuck sensor
    /// ages from the time of detection, so it fades like that of a silent sensor.
    pub fn update(&mut self, reading: &mut Reading<f32>, now_us: u64) {
        // An age below 0 marks a missing sensor.
        if !(reading.value.is_finite() && reading.age_s >= 0.0) {
            return;
        }
        let at_us = now_us.saturating_sub((reading.age_s * 1e6) as u64);
        if self.last.is_nan() || at_us >= self.last_at_us + MIN_READING_GAP_US {
            self.add_reading(reading.value, now_us);
            self.last_at_us = at_us;
        }
        if let Some(since_us) = self.stuck_since_us {
            reading.age_s = reading.age_s.max(now_us.saturating_sub(since_us) as f32 * 1e-6);
        }
    }

    /// Returns true if the reading is stuck although the sensor has sufficient noise.
    pub const fn is_stuck(&self) -> bool {
        self.stuck_since_us.is_some()
    }

    fn add_reading(&mut self, value: f32, now_us: u64) {
        let change = if self.last.is_nan() { 0.0 } else { value - self.last };
        self.last = value;
        if change == 0.0 {
            self.identical_readings = self.identical_readings.saturating_add(1);
            if self.has_noise && self.identical_readings >= STUCK_AFTER_READINGS {
                self.stuck_since_us.get_or_insert(now_us);
            }
        } else {
            self.identical_readings = 0;
            self.stuck_since_us = None;
            self.step = self.step.min(change.abs());
        }
        if self.identical_readings > PAUSE_AFTER_READINGS {
            return;
        }
        let min_width = MIN_REVERSAL_STEPS * self.previous_step;
        let reversals =
            change * self.change < 0.0 && change.abs().min(self.change.abs()) > min_width;
        self.reversals += u16::from(reversals);
        self.change = change;
        self.readings += 1;
        if self.readings == BLOCK_READINGS {
            self.has_noise = self.reversals >= MIN_REVERSALS;
            self.previous_step = self.step;
            (self.readings, self.reversals, self.step) = (0, 0, f32::INFINITY);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A simulated sensor with integer counts, read every millisecond.
    struct Sensor {
        watch: StuckWatch,
        now_us: u64,
        random: u64,
    }

    impl Sensor {
        fn new(seed: u64) -> Self {
            Self { watch: StuckWatch::default(), now_us: 0, random: seed | 1 }
        }

        /// Approximately normal with standard deviation 1: the sum of twelve uniform draws (Marsaglia's
        /// xorshift).
        fn noise(&mut self) -> f64 {
            let sum: f64 = (0..12)
                .map(|_| {
                    self.random ^= self.random << 13;
                    self.random ^= self.random >> 7;
                    self.random ^= self.random << 17;
                    (self.random >> 11) as f64 / (1u64 << 53) as f64
                })
                .sum();
            sum - 6.0
        }

        /// Feeds a reading of this many counts; returns its age, s.
        fn read(&mut self, counts: f64) -> f32 {
            self.now_us += 1000;
            // In newtons, with the rounding of a linear scale.
            let value = (counts.round() as f32 / 4096.0 - 0.37) * 800.0;
            let mut reading = Reading { value, age_s: 0.0 };
            self.watch.update(&mut reading, self.now_us);
            reading.age_s
        }

        /// Runs this number of readings with noise; returns true if the sensor was ever reported as stuck.
        fn run(&mut self, count: u32, deviation: f64, of: impl Fn(f64) -> f64) -> bool {
            (0..count).fold(false, |found, k| {
                let noise = deviation * self.noise();
                self.read(of(f64::from(k) * 1e-3) + noise);
                found | self.watch.is_stuck()
            })
        }
    }

    #[test]
    fn noisy_sensor_that_stops_is_stuck_after_0_2_s_and_ages() {
        for deviation in [1.0, 3.0, 40.0] {
            let mut sensor = Sensor::new(7);
            assert!(!sensor.run(4000, deviation, |_| 2000.2));
            let mut ages = Vec::new();
            for _ in 0..1000 {
                ages.push(sensor.read(2000.0));
            }
            let first =
                ages.iter().position(|age| *age > 0.0).expect("the sensor is reported as stuck");
            assert!((199..=203).contains(&first), "found after {first} readings");
            assert!((ages[999] - (999 - first) as f32 * 1e-3 - 1e-3).abs() < 2e-3, "{}", ages[999]);
            sensor.read(2003.0);
            assert!(!sensor.watch.is_stuck(), "the reading changes again");
        }
    }

    #[test]
    fn steps_wider_than_the_noise_are_never_stuck() {
        for deviation in [0.0, 0.02, 0.1, 0.2, 0.3, 0.4, 0.5] {
            let mut sensor = Sensor::new(11);
            // A slow signal from the edge to the middle of a step: it flickers at the edge and is constant
            // in the middle.
            assert!(!sensor.run(300_000, deviation, |t| 2000.5 + 3.0 * (0.05 * t).sin()));
            // A signal over many steps, then constant.
            assert!(!sensor.run(5_000, deviation, |t| 2000.0 + 500.0 * (20.0 * t).sin()));
            assert!(!sensor.run(5_000, deviation, |_| 2000.0));
        }
    }

    #[test]
    fn repeated_or_missing_reading_is_not_counted() {
        let mut sensor = Sensor::new(3);
        sensor.run(2000, 3.0, |_| 2000.0);
        for k in 0..1000 {
            sensor.now_us += 1000;
            // The same reading, older each time.
            let age_s = k as f32 * 1e-3 + 1e-3;
            let mut reading = Reading { value: sensor.watch.last, age_s };
            sensor.watch.update(&mut reading, sensor.now_us);
            assert_eq!(reading.age_s, age_s);
        }
        for mut reading in [Reading::missing(), Reading { value: f32::NAN, age_s: 0.0 }] {
            let before = reading.age_s.to_bits();
            sensor.watch.update(&mut reading, sensor.now_us + 1000);
            assert_eq!(reading.age_s.to_bits(), before);
        }
        assert!(!sensor.watch.is_stuck());
    }

    #[test]
    fn reading_repeated_ten_times_is_never_stuck() {
        let mut sensor = Sensor::new(5);
        let mut held = 2000.0;
        for k in 0..200_000 {
            if k % 10 == 0 {
                held = 2000.0 + 5.0 * sensor.noise();
            }
            sensor.read(held);
            assert!(!sensor.watch.is_stuck());
        }
        for _ in 0..1000 {
            sensor.read(held);
            assert!(!sensor.watch.is_stuck());
        }
    }

    proptest! {
        #[test]
        fn changing_sensor_is_never_stuck(
            seed in 1u64.., deviation in 0.0f64..5.0, amplitude in 0.0f64..300.0, rate in 0.0f64..100.0,
        ) {
            let mut sensor = Sensor::new(seed);
            let found = sensor.run(3000, deviation, |t| 2000.3 + amplitude * (rate * t).sin());
            // Without noise a signal may be constant for long after it has reversed.
            prop_assert!(!found || deviation < 0.5, "reported as stuck");
        }
    }
}
