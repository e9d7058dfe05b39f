//! The motion of a run: its integration points, and those of them that are rows of the log.

/// An integration point of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Time since the start of the run, s.
    pub t: f64,
    /// Angle of the shaft, rad.
    pub angle: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
}

/// Trajectory of a run: its points, the indices of those that are rows of the log, and the acceleration of each row,
/// rad/s^2.
#[derive(Clone, Debug, Default)]
pub(super) struct Trajectory {
    pub points: Vec<Point>,
    pub rows: Vec<usize>,
    pub accelerations: Vec<f64>,
}

impl Trajectory {
    /// Returns the trajectory with every row and every `stride`-th of the points between rows.
    pub fn thinned(&self, stride: usize) -> Self {
        if stride == 1 {
            return self.clone();
        }
        let mut thin = Self { accelerations: self.accelerations.clone(), ..Self::default() };
        let mut rows = self.rows.iter().peekable();
        for (at, point) in self.points.iter().enumerate() {
            let is_row = rows.peek() == Some(&&at);
            if is_row || at % stride == 0 {
                thin.points.push(*point);
            }
            while rows.next_if(|row| **row == at).is_some() {
                thin.rows.push(thin.points.len() - 1);
            }
        }
        thin
    }
}
