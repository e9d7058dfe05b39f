//! Order analysis of the motor torque: its amplitude at a multiple of the electrical angle.

use std::f64::consts::TAU;

/// Sums of a torque over time, weighted with cosine and sine of an order of the electrical angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrderAnalyser {
    order: f64,
    start_rad: Option<f64>,
    turned_rad: f64,
    seconds: f64,
    /// Of the torque, with weights 1, cosine and sine, and of the weights.
    sums: [f64; 3],
    weights: [f64; 2],
    squares: f64,
}

impl OrderAnalyser {
    /// Starts an analysis of an order: 6 for six waves per electrical turn.
    pub fn of(order: f64) -> Self {
        Self { order, ..Self::default() }
    }

    /// Adds a torque (Nm) at an electrical angle (rad) that acts for `dt` (s).
    pub(super) fn add(&mut self, electrical_rad: f64, torque_nm: f64, dt: f64) {
        let start = *self.start_rad.get_or_insert(electrical_rad);
        self.turned_rad = electrical_rad - start;
        let (sine, cosine) = (self.order * electrical_rad).sin_cos();
        self.seconds += dt;
        for (sum, weight) in self.sums.iter_mut().zip([1.0, cosine, sine]) {
            *sum += weight * torque_nm * dt;
        }
        self.weights[0] += cosine * dt;
        self.weights[1] += sine * dt;
        self.squares += torque_nm * torque_nm * dt;
    }

    /// Returns the electrical turns since the start.
    pub fn turns(&self) -> f64 {
        self.turned_rad.abs() / TAU
    }

    /// Returns the mean torque, Nm.
    fn mean_nm(&self) -> f64 {
        self.sums[0] / self.seconds
    }

    /// Returns the RMS deviation of the torque from its mean, Nm.
    pub fn deviation_nm(&self) -> f64 {
        (self.squares / self.seconds - self.mean_nm().powi(2)).max(0.0).sqrt()
    }

    /// Returns the amplitude of the order, Nm, without the share of the mean in a part of a turn. It is exact over whole
    /// electrical turns at constant speed.
    pub fn amplitude_nm(&self) -> f64 {
        let mean = self.mean_nm();
        let [cosine, sine] = [0, 1].map(|at| self.sums[1 + at] - mean * self.weights[at]);
        2.0 * cosine.hypot(sine) / self.seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn analyser_over_whole_turns_returns_amplitude_and_mean() {
        let mut orders = OrderAnalyser::of(6.0);
        for k in 0..20_000 {
            let angle = TAU * 2.0 * f64::from(k) / 20_000.0;
            let torque = 3.0 + 0.2 * (6.0 * angle + 0.7).cos() + 0.5 * angle.sin();
            orders.add(angle, torque, 1e-4);
        }
        assert!((orders.amplitude_nm() - 0.2).abs() < 1e-9, "{orders:?}");
        assert!((orders.mean_nm() - 3.0).abs() < 1e-9 && (orders.turns() - 2.0).abs() < 1e-3);
        assert!((orders.deviation_nm().powi(2) - 0.02 - 0.125).abs() < 1e-9);
    }
}
