//! Trajectories for models, with fewer points than those of the true plant.

use simulated_machines::imposed::Trajectory;

/// Returns the trajectory with every row and every `stride`-th of the points between rows.
pub(super) fn thinned(whole: &Trajectory, stride: usize) -> Trajectory {
    if stride == 1 {
        return whole.clone();
    }
    let mut thin =
        Trajectory { accelerations: whole.accelerations.clone(), ..Trajectory::default() };
    let mut rows = whole.rows.iter().peekable();
    for (at, point) in whole.points.iter().enumerate() {
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
