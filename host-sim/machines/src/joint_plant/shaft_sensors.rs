//! Sensors on the motor's shaft besides the magnetic encoder: an encoder with lines, and Hall sensors.
//!
//! Both are functions of the shaft's angle, with the errors of real parts: edges off their place, an index with a width, and
//! Hall sensors with placement errors and hysteresis.

/// An encoder with two lines of edges in quadrature and an index.
#[derive(Clone, Copy, Debug)]
pub struct LineEncoder {
    /// Edges of both lines in a turn.
    pub edges_per_turn: i64,
    /// Largest deviation of an edge from its place, as a share of the distance of two edges, below 0.5.
    pub jitter: f64,
    /// Edges for which the index is high, from the angle 0 on.
    pub index_width_edges: i64,
}

impl Default for LineEncoder {
    /// 1024 lines; edges off by a quarter of their distance; an index of two edges.
    fn default() -> Self {
        Self { edges_per_turn: 4096, jitter: 0.25, index_width_edges: 2 }
    }
}

impl LineEncoder {
    /// Returns the place of an edge, as a number of edges: its number and its deviation, which is fixed by the disc.
    fn place(&self, edge: i64) -> f64 {
        let number = edge.rem_euclid(self.edges_per_turn) as u64;
        let hash = number.wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(31) ^ number;
        let share = (hash.wrapping_mul(0xD6E8_FEB8_6659_FD93) >> 11) as f64 / (1u64 << 53) as f64;
        edge as f64 + self.jitter * (2.0 * share - 1.0)
    }

    /// Returns the number of the last edge below this angle, turns.
    pub fn edges(&self, turns: f64) -> i64 {
        let exact = turns * self.edges_per_turn as f64;
        let edge = exact.floor() as i64;
        if exact < self.place(edge) {
            edge - 1
        } else if exact >= self.place(edge + 1) {
            edge + 1
        } else {
            edge
        }
    }

    /// Returns the edge at which the index rose on the way between two edges; the last one if there were several.
    pub fn index_rise(&self, from: i64, to: i64) -> Option<i64> {
        let turn = self.edges_per_turn;
        if to > from {
            let rise = to.div_euclid(turn) * turn;
            (rise > from).then_some(rise)
        } else {
            // Downwards it rises at its other end.
            let last = self.index_width_edges - 1;
            let rise = (to - last + turn - 1).div_euclid(turn) * turn + last;
            (rise < from && rise >= to).then_some(rise)
        }
    }
}

/// Three Hall sensors, a third of an electrical turn apart.
#[derive(Clone, Copy, Debug)]
pub struct HallSensors {
    /// Pole pairs of the motor.
    pub pole_pairs: f64,
    /// Deviation of each sensor from its place, electrical turns.
    pub placement: [f64; 3],
    /// Width of the hysteresis, electrical turns.
    pub hysteresis: f64,
    levels: [bool; 3],
}

impl HallSensors {
    /// Sensors 3, -2 and 2.5 degrees (electrical) off, with a hysteresis of 2 degrees.
    pub fn new(pole_pairs: f64) -> Self {
        let placement = [3.0, -2.0, 2.5].map(|degrees| degrees / 360.0);
        Self { pole_pairs, placement, hysteresis: 2.0 / 360.0, levels: [false; 3] }
    }

    /// Returns the levels at this angle of the motor, turns: bits 0 to 2. The first sensor is high from -60 to 120 degrees.
    pub fn levels(&mut self, turns: f64) -> u8 {
        for (sensor, level) in self.levels.iter_mut().enumerate() {
            let middle = 1.0 / 12.0 + sensor as f64 / 3.0 + self.placement[sensor];
            let field = (std::f64::consts::TAU * (turns * self.pole_pairs - middle)).cos();
            let width = (std::f64::consts::PI * self.hysteresis).sin();
            if field.abs() > width {
                *level = field > 0.0;
            }
        }
        self.levels.iter().rev().fold(0, |word, level| word << 1 | u8::from(*level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_of_a_turn_are_each_passed_once_in_both_directions() {
        let encoder = LineEncoder::default();
        let at = |k: i64| encoder.edges(k as f64 / 100_000.0);
        let mut last = at(-100_000);
        for k in -100_000..=100_000 {
            let now = at(k);
            assert!((0..=1).contains(&(now - last)), "{k}");
            last = now;
        }
        assert!((at(100_000) - at(-100_000) - 8192).abs() <= 1);
    }

    #[test]
    fn index_rises_at_its_lower_end_upwards_and_at_its_upper_end_downwards() {
        let encoder = LineEncoder::default();
        assert_eq!(encoder.index_rise(-5, 5), Some(0));
        assert_eq!(encoder.index_rise(5, -5), Some(1));
        assert_eq!((encoder.index_rise(2, 8), encoder.index_rise(-1, -9)), (None, None));
        assert_eq!(encoder.index_rise(4090, 4100), Some(4096));
        assert_eq!(encoder.index_rise(4100, 4090), Some(4097));
        assert_eq!((encoder.index_rise(0, 5), encoder.index_rise(1, 1)), (None, None));
    }

    #[test]
    fn hall_sensors_have_six_levels_in_a_turn() {
        let mut sensors = HallSensors::new(1.0);
        let mut passed = Vec::new();
        for k in 0..720 {
            let levels = sensors.levels(f64::from(k) / 720.0 + 0.02);
            if passed.last() != Some(&levels) {
                passed.push(levels);
            }
        }
        assert_eq!(passed, [0b001, 0b011, 0b010, 0b110, 0b100, 0b101, 0b001]);
    }
}
