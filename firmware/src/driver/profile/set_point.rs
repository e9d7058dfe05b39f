//! Set-points of mode 1 (profile position) and their handshake (CiA 402-2).
//!
//! A rising bit 4 of the controlword offers a set-point. The drive acknowledges it with bit 12 of the statusword, which
//! stays 1 until bit 4 is 0 and another set-point can be taken. One set-point waits while the drive moves to the one
//! before it. With bit 5 the new set-point replaces both at once. With bit 6 it counts from the last one.

/// Set-points of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetPoint {
    /// Set-point to which the drive moves, 1e-6 rad.
    pub active_micro_rad: Option<i32>,
    next_micro_rad: Option<i32>,
    /// The set-point of the last rising edge was taken.
    is_taken: bool,
    is_reached: bool,
}

/// A set-point that a master offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetPointOffer {
    /// Position, or the way from the set-point before, 1e-6 rad.
    pub target_micro_rad: i32,
    /// The target counts from the set-point before.
    pub is_relative: bool,
    /// It replaces the set-points before at once.
    pub replaces_others: bool,
}

impl SetPoint {
    /// Takes a set-point if there is room. `present_micro_rad` is the demand without a set-point before.
    pub fn take(&mut self, offer: SetPointOffer, present_micro_rad: i32) {
        let SetPointOffer { target_micro_rad, is_relative, replaces_others } = offer;
        let last = self.next_micro_rad.or(self.active_micro_rad).unwrap_or(present_micro_rad);
        let target =
            if is_relative { last.saturating_add(target_micro_rad) } else { target_micro_rad };
        self.is_taken = true;
        if replaces_others || self.active_micro_rad.is_none() || self.is_reached {
            *self = Self { active_micro_rad: Some(target), is_taken: true, ..Self::default() };
        } else if self.next_micro_rad.is_none() {
            self.next_micro_rad = Some(target);
        } else {
            self.is_taken = false;
        }
    }

    /// Runs a step: the move has ended, and the target is reached. Returns true if the next move begins.
    pub fn step(&mut self, has_ended: bool, is_reached: bool) -> bool {
        if has_ended && self.next_micro_rad.is_some() {
            self.active_micro_rad = self.next_micro_rad.take();
            self.is_reached = false;
            return true;
        }
        self.is_reached |= is_reached;
        false
    }

    /// Returns true if the last set-point is reached, or if there is none.
    pub const fn is_reached(&self) -> bool {
        self.is_reached || self.active_micro_rad.is_none()
    }

    /// Returns the acknowledge bit; `is_offered` is bit 4 of the controlword.
    pub const fn is_acknowledged(&self, is_offered: bool) -> bool {
        is_offered && self.is_taken || self.next_micro_rad.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRESENT: i32 = 7;

    fn absolute(target_micro_rad: i32) -> SetPointOffer {
        SetPointOffer { target_micro_rad, is_relative: false, replaces_others: false }
    }

    fn relative(target_micro_rad: i32) -> SetPointOffer {
        SetPointOffer { is_relative: true, ..absolute(target_micro_rad) }
    }

    #[test]
    fn set_point_waits_for_the_one_before_unless_it_changes_at_once() {
        let mut points = SetPoint::default();
        assert!(points.is_reached() && !points.is_acknowledged(false));
        points.take(absolute(100), PRESENT);
        assert_eq!(points.active_micro_rad, Some(100));
        assert!(points.is_acknowledged(true) && !points.is_acknowledged(false));
        points.take(relative(50), PRESENT);
        assert_eq!(points.active_micro_rad, Some(100));
        assert!(points.is_acknowledged(false), "no room for another one");
        points.take(absolute(999), PRESENT);
        assert!(!points.step(false, false) && points.step(true, false));
        assert_eq!(points.active_micro_rad, Some(150), "the third one was not taken");
        points.take(SetPointOffer { replaces_others: true, ..absolute(-5) }, PRESENT);
        assert_eq!(points.active_micro_rad, Some(-5));
        assert!(!points.is_reached());
        assert!(!points.step(true, true) && points.is_reached());
        points.take(relative(10), PRESENT);
        assert_eq!(points.active_micro_rad, Some(5));
        let mut first = SetPoint::default();
        first.take(relative(10), PRESENT);
        assert_eq!(first.active_micro_rad, Some(17));
    }
}
