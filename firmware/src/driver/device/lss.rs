//! Layer setting services: the joint's part of [`crate::node::lss`].

use super::{Device, Frame, NodeId};
use crate::node::bit_timing::BIT_RATES_KBIT;
use crate::node::lss::{LSS_ANSWER, Lss, LssAction, NO_NODE};
use crate::node_settings::NodeSettings;
use embedded_storage::nor_flash::NorFlash;

/// Error codes of an answer (CiA 305).
const SUCCESS: u8 = 0;
const ILLEGAL: u8 = 1;
const STORAGE_FAILED: u8 = 2;
const REFUSED: u8 = 255;

impl<F: NorFlash> Device<F> {
    /// Processes a frame of the LSS master. Returns true if the joint must restart its communication, because it has
    /// its first node number.
    pub(crate) fn configure(&mut self, frame: &Frame) -> bool {
        let identity = self.base.identity.object().words();
        let node = if self.memory.is_blank { NO_NODE } else { self.node_in_use().number() };
        let request = frame.data().first().copied().unwrap_or_default();
        let code = match self.lss.receive(frame, &identity, node) {
            LssAction::None => return false,
            LssAction::Leave => {
                return self.memory.is_blank && self.settings().node != self.node_in_use();
            }
            LssAction::Answer(answer) => {
                self.send_lss(answer);
                return false;
            }
            // An armed joint has a master that relies on its number, and so has a trial.
            _ if self.is_armed() || self.trial.is_open() => REFUSED,
            // Without a number, nobody relies on it, and a tool cannot reach the objects of one joint.
            _ if !self.memory.is_blank && !self.is_service() => REFUSED,
            LssAction::SetNode(number) => match NodeId::new(number) {
                Some(node) => self.change_setting(|settings| settings.node = node),
                None => ILLEGAL,
            },
            LssAction::SetBitRate(rate) if BIT_RATES_KBIT.contains(&rate) => {
                self.change_setting(|settings| settings.bit_rate_kbit = rate)
            }
            LssAction::SetBitRate(_) => ILLEGAL,
            LssAction::Store => match self.save() {
                Ok(()) => SUCCESS,
                Err(_) => STORAGE_FAILED,
            },
        };
        self.send_lss(Lss::result(request, code));
        false
    }

    #[inline(never)]
    fn change_setting(&mut self, change: impl FnOnce(&mut NodeSettings)) -> u8 {
        let mut settings = *self.settings();
        change(&mut settings);
        if self.set_settings(settings).is_ok() { SUCCESS } else { REFUSED }
    }

    fn send_lss(&mut self, answer: [u8; 8]) {
        if let Some(frame) = Frame::new(LSS_ANSWER, &answer) {
            self.base.outbox.push(frame);
        }
    }
}
