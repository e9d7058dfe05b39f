//! Which extension terms of the model are live: their quantity is measured or received now.
//!
//! A term whose quantity is missing has no effect, and the model is then another one than was identified.

use super::Device;
use crate::log::log;
use crate::node_settings::InputSource;
use compensator_core::TermKind;
use compensator_core::quantity::Quantity;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Returns the live terms of the model in use, a bit per term by its number.
    ///
    /// A term that needs only the motion is always live. So is one whose column is selected by a parameter.
    pub(crate) fn live_terms(&self) -> u32 {
        let terms = self.set().friction.model.terms.iter();
        terms.filter(|kind| self.is_live(**kind)).fold(0, |bits, kind| bits | 1 << *kind as u8)
    }

    fn is_live(&self, kind: TermKind) -> bool {
        let Some(quantity) = kind.reads() else { return true };
        if quantity == Quantity::Position {
            return self.base.is_position_known();
        }
        let mut covariates = match self.base.settings.source {
            InputSource::Sensors => self.base.seal_sensors.covariates,
            InputSource::Bus => self.base.received.covariates(0.0, self.base.now_us),
        };
        let hold_s = self.set().friction.compensator.hold_s;
        covariates.get_mut(quantity).is_none_or(|reading| {
            reading.value.is_finite() && reading.age_s >= 0.0 && reading.age_s <= hold_s
        })
    }

    /// Logs the law and its terms.
    pub(crate) fn log_model(&self) {
        let model = &self.set().friction.model;
        log!(info, "law {=u8}, terms: {=usize}", model.law as u8, model.terms.len());
        for _kind in &model.terms {
            let _state = if self.is_live(*_kind) { "live" } else { "without its input" };
            log!(info, "term {=u8}: {=str}", *_kind as u8, _state);
        }
    }
}
