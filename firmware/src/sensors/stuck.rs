//! Does a sensor of side load or pressure still measure?
//!
//! One that hangs, or a gateway that goes on sending what it last heard, says the same for ever and is young for ever. A
//! sensor whose noise is wider than its steps cannot say the same many times in a row; one whose steps are wider can, and
//! nothing is to be made of it. The two are told apart by what the sensor did before: only noise turns back from one
//! reading to the next by more than a step, again and again. So a sensor has to have flickered first: [`TURNS`] times in a
//! block of [`BLOCK`] readings, by more than one and a half of the smallest change of the block before (a step, or less).
//! That takes a deviation of 0.7 steps and more, at which a reading is the one before in half of all cases, and
//! [`STUCK_AFTER`] in a row are one in 10^56; of a sensor with coarser steps nothing is ever said, nor of one that is
//! smoothed or sent more often than it measures, for such readings do not turn back. A sensor that reads exactly 0 below
//! a threshold of its own is taken for stuck there; its reading then fades to the same 0.

use compensator_core::compensator::Reading;

/// Readings in a row that are the same to the bit, after which a sensor that flickered is stuck: 0.2 s of one read every
/// millisecond, 5 s of the pressure sensor. Half of it tells it in half the time, at one in 10^28.
pub const STUCK_AFTER: u16 = 200;

/// Readings of a block.
pub const BLOCK: u16 = 256;

/// Turns in a block that make a sensor one that flickers. White noise of one step gives 30, of 0.6 steps 5.
pub const TURNS: u16 = 8;

/// A step and a half: one step to and fro is what the edge between two steps gives with hardly any noise.
const MORE_THAN_A_STEP: f32 = 1.5;

/// Readings in a row after which a block waits for the next change: what is stuck says nothing of the noise.
const WAITS_AFTER: u16 = 32;

/// Two readings are at least so far apart, us; an age is rounded to less.
const GRAIN_US: u64 = 100;

/// The watch over one sensor.
#[derive(Clone, Copy, Debug)]
pub struct StuckWatch {
    last: f32,
    last_at_us: u64,
    change: f32,
    same: u16,
    readings: u16,
    turns: u16,
    step: f32,
    known_step: f32,
    flickers: bool,
    stuck_since_us: Option<u64>,
}

impl Default for StuckWatch {
    /// Of a sensor nothing is known of.
    fn default() -> Self {
        Self {
            last: f32::NAN,
            last_at_us: 0,
            change: 0.0,
            same: 0,
            readings: 0,
            turns: 0,
            step: f32::INFINITY,
            known_step: f32::INFINITY,
            flickers: false,
            stuck_since_us: None,
        }
    }
}

impl StuckWatch {
    /// Looks at a reading, which may be the one of the last look. One of a stuck sensor ages from when it was found out,
    /// and so fades as that of a sensor that fell silent.
    pub fn look(&mut self, reading: &mut Reading<f32>, now_us: u64) {
        // Also where there is no sensor: its age is below 0.
        if !(reading.value.is_finite() && reading.age_s >= 0.0) {
            return;
        }
        let at_us = now_us.saturating_sub((reading.age_s * 1e6) as u64);
        if self.last.is_nan() || at_us >= self.last_at_us + GRAIN_US {
            self.take(reading.value, now_us);
            self.last_at_us = at_us;
        }
        if let Some(since_us) = self.stuck_since_us {
            reading.age_s = reading.age_s.max(now_us.saturating_sub(since_us) as f32 * 1e-6);
        }
    }

    /// Whether it says the same where its noise alone would not.
    pub const fn is_stuck(&self) -> bool {
        self.stuck_since_us.is_some()
    }

    fn take(&mut self, value: f32, now_us: u64) {
        let change = if self.last.is_nan() { 0.0 } else { value - self.last };
        self.last = value;
        if change == 0.0 {
            self.same = self.same.saturating_add(1);
            if self.flickers && self.same >= STUCK_AFTER {
                self.stuck_since_us.get_or_insert(now_us);
            }
        } else {
            self.same = 0;
            self.stuck_since_us = None;
            self.step = self.step.min(change.abs());
        }
        if self.same > WAITS_AFTER {
            return;
        }
        let wide = MORE_THAN_A_STEP * self.known_step;
        let turns = change * self.change < 0.0 && change.abs().min(self.change.abs()) > wide;
        self.turns += u16::from(turns);
        self.change = change;
        self.readings += 1;
        if self.readings == BLOCK {
            self.flickers = self.turns >= TURNS;
            self.known_step = self.step;
            (self.readings, self.turns, self.step) = (0, 0, f32::INFINITY);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A sensor of whole counts that is read every millisecond.
    struct Sensor {
        watch: StuckWatch,
        now_us: u64,
        random: u64,
    }

    impl Sensor {
        fn new(seed: u64) -> Self {
            Self { watch: StuckWatch::default(), now_us: 0, random: seed | 1 }
        }

        /// About normal, of deviation 1: twelve even draws (Marsaglia's xorshift).
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

        /// A reading of this many counts; gives its age, s.
        fn read(&mut self, counts: f64) -> f32 {
            self.now_us += 1000;
            // Newtons, with the rounding of a line.
            let value = (counts.round() as f32 / 4096.0 - 0.37) * 800.0;
            let mut reading = Reading { value, age_s: 0.0 };
            self.watch.look(&mut reading, self.now_us);
            reading.age_s
        }

        /// So many readings of something with noise; whether it was ever taken for stuck.
        fn run(&mut self, count: u32, deviation: f64, of: impl Fn(f64) -> f64) -> bool {
            (0..count).fold(false, |found, k| {
                let noise = deviation * self.noise();
                self.read(of(f64::from(k) * 1e-3) + noise);
                found | self.watch.is_stuck()
            })
        }
    }

    #[test]
    fn a_sensor_that_flickered_and_stops_is_stuck_after_0_2_s_and_its_reading_ages() {
        for deviation in [1.0, 3.0, 40.0] {
            let mut sensor = Sensor::new(7);
            assert!(!sensor.run(4000, deviation, |_| 2000.2));
            let mut ages = Vec::new();
            for _ in 0..1000 {
                ages.push(sensor.read(2000.0));
            }
            let first = ages.iter().position(|age| *age > 0.0).expect("it is found out");
            assert!((199..=203).contains(&first), "found after {first} readings");
            assert!((ages[999] - (999 - first) as f32 * 1e-3 - 1e-3).abs() < 2e-3, "{}", ages[999]);
            sensor.read(2003.0);
            assert!(!sensor.watch.is_stuck(), "it measures again");
        }
    }

    #[test]
    fn steps_wider_than_the_noise_are_never_taken_for_stuck() {
        for deviation in [0.0, 0.02, 0.1, 0.2, 0.3, 0.4, 0.5] {
            let mut sensor = Sensor::new(11);
            // From edge to middle of a step, slowly: it flickers at the edge and stands in the middle.
            assert!(!sensor.run(300_000, deviation, |t| 2000.5 + 3.0 * (0.05 * t).sin()));
            // Moves by many steps, then holds still.
            assert!(!sensor.run(5_000, deviation, |t| 2000.0 + 500.0 * (20.0 * t).sin()));
            assert!(!sensor.run(5_000, deviation, |_| 2000.0));
        }
    }

    #[test]
    fn a_reading_looked_at_again_and_one_that_is_missing_are_no_readings() {
        let mut sensor = Sensor::new(3);
        sensor.run(2000, 3.0, |_| 2000.0);
        for k in 0..1000 {
            sensor.now_us += 1000;
            // The last one, older each time.
            let age_s = k as f32 * 1e-3 + 1e-3;
            let mut reading = Reading { value: sensor.watch.last, age_s };
            sensor.watch.look(&mut reading, sensor.now_us);
            assert_eq!(reading.age_s, age_s);
        }
        for mut reading in [Reading::missing(), Reading { value: f32::NAN, age_s: 0.0 }] {
            let before = reading.age_s.to_bits();
            sensor.watch.look(&mut reading, sensor.now_us + 1000);
            assert_eq!(reading.age_s.to_bits(), before);
        }
        assert!(!sensor.watch.is_stuck());
    }

    #[test]
    fn a_reading_sent_ten_times_over_is_never_taken_for_stuck() {
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
        fn a_sensor_that_measures_is_never_taken_for_stuck(
            seed in 1u64.., deviation in 0.0f64..5.0, amplitude in 0.0f64..300.0, rate in 0.0f64..100.0,
        ) {
            let mut sensor = Sensor::new(seed);
            let found = sensor.run(3000, deviation, |t| 2000.3 + amplitude * (rate * t).sin());
            // Without noise a signal may hold still for long after it has moved to and fro.
            prop_assert!(!found || deviation < 0.5, "taken for stuck");
        }
    }
}
