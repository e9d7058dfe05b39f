//! The record of the home in flash: see [`crate::store::HomeRecord`].
//!
//! A record is written when the joint has been disarmed and at rest for [`REST_US`]. It is marked in the tick in which the joint
//! is armed, before the loop gets its commands, so that the bridge is still open. It is also marked when the motor leaves the
//! place by [`crate::driver::home::RECORD_RANGE_TURNS`], when the angle is missing, and when the joint is homed.
//!
//! So a turn needs no write, and a joint that stays in its place none either. A disarmed joint that is moved again and again,
//! as by waves, is limited to one record in [`REFILL_US`].
//!
//! A cut supply opens the bridge of an armed joint, too. While the bus capacitors still feed the board, the record of a joint
//! that stands is written after [`FAILING_REST_US`], without an erase. Only a holding brake makes it stand without power: a joint
//! without one may begin to fall, by any number of turns.

use super::Device;
use super::kept_home::HomeState;
use crate::driver::home::{KeptHome, has_turns, is_absolute, shaft_number};
use crate::node::sdo::Abort;
use crate::store::{FoundHome, HomeRecord, StoreHealth};
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Time at rest after which a record is due, us: a joint that is armed again at once needs none.
const REST_US: u64 = 1_000_000;
/// The same while the supply fails, us: the bus capacitors feed the board for tens of milliseconds.
const FAILING_REST_US: u64 = 10_000;
/// Time in which one more record may be written, us: 35,000 in a year, of which 20 fit into a slot between two erases.
const REFILL_US: u64 = 15 * 60 * 1_000_000;
/// Records that may be written without a pause.
const BURST: u64 = 24;

/// What is known of the record.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StoredHome {
    /// The valid record.
    recorded: Option<KeptHome>,
    /// The joint was homed since.
    is_outdated: bool,
    /// Begin of the rest, us.
    rest_us: u64,
    /// Time at which as many records as ever may be written without a pause, us.
    refilled_us: u64,
}

impl<F: NorFlash> Device<F> {
    /// Takes the home that the start found in flash. It is used if the board has kept none.
    pub(super) fn begin_stored_home(&mut self, found: FoundHome) {
        let shaft = shaft_number(self.base.set());
        let home = match found {
            FoundHome::None => return,
            // A program on trial may follow an older one, which has moved the joint without a mark.
            FoundHome::At(record) if !self.program.is_on_trial() => KeptHome {
                position_rad: record.position_rad,
                encoder: record.encoder,
                shaft: record.shaft,
                may_move: false,
                turns: has_turns(self.base.set()).then_some(record.turns),
            },
            _ => KeptHome { position_rad: 0.0, encoder: 0, shaft, may_move: true, turns: None },
        };
        if home.may_move {
            // A second record that became valid again would be wrong.
            let _ = self.memory.store.mark_home();
        } else {
            self.stored_home.recorded = Some(home);
        }
        let is_absolute_joint = !self.base.settings.is_in_hil() && is_absolute(self.base.set());
        if is_absolute_joint && matches!(self.home, HomeState::Settled) {
            self.begin_home(Some(home));
        }
    }

    /// Notes that the joint is homed.
    pub(super) const fn outdate_stored_home(&mut self) {
        self.stored_home.is_outdated = true;
    }

    /// Marks the record if the joint may move or has moved, and writes the next one once it is at rest. Called at the end of a
    /// tick.
    #[inline(never)]
    pub(super) fn record_home(&mut self) {
        // Before the first angle, the joint is where the previous run left it.
        let present =
            if let HomeState::Kept(kept) = self.home { Some(kept) } else { self.measured_home() };
        let is_outdated = core::mem::take(&mut self.stored_home.is_outdated);
        if let Some(recorded) = self.stored_home.recorded {
            let is_near = present.is_some_and(|present| recorded.is_near(&present));
            if is_near && !is_outdated && !self.base.is_bridge_in_use() {
                return;
            }
            self.mark_stored_home();
        }
        let is_powered = self.base.is_powered();
        let is_held = self.base.settings.drive.brake_output != 0;
        let rest_us = if is_powered || !is_held { REST_US } else { FAILING_REST_US };
        let (now_us, stored) = (self.base.now_us, &mut self.stored_home);
        let is_settled = matches!(self.home, HomeState::Settled);
        let is_stored =
            matches!(self.memory.store.health(), StoreHealth::Sound | StoreHealth::Reduced);
        let home = present.filter(|home| {
            !home.may_move
                && home.position_rad.is_finite()
                && is_settled
                && !is_outdated
                && (home.turns.is_some() || !has_turns(self.base.set()))
        });
        let Some(home) = home.filter(|_| is_stored) else {
            stored.rest_us = now_us;
            return;
        };
        let filled_us = stored.refilled_us.max(now_us) + REFILL_US;
        if now_us - stored.rest_us < rest_us || filled_us > now_us + BURST * REFILL_US {
            return;
        }
        stored.refilled_us = filled_us;
        let record = HomeRecord {
            position_rad: home.position_rad,
            encoder: home.encoder,
            shaft: home.shaft,
            turns: home.turns.unwrap_or_default(),
        };
        let may_erase = is_powered && !self.memory.is_undone;
        // With a worn flash, the next attempt follows after another rest.
        let written = self.memory.store.append_home(&record, may_erase);
        self.stored_home.recorded = written.ok().map(|()| home);
        self.stored_home.rest_us = now_us;
        self.base.supervisor.set_store_health(self.memory.store.health());
    }

    /// Marks the record. If the flash fails, the joint is not armed: after a power cut its home would be wrong.
    fn mark_stored_home(&mut self) {
        if self.memory.store.mark_home().is_ok() {
            self.stored_home.recorded = None;
        } else if self.base.is_bridge_in_use() {
            self.disarm();
            let why =
                text!("the flash cannot mark the stored home as lost: the joint is not armed");
            let _ = self.base.refuse(Abort::Refused, why);
        }
    }
}
