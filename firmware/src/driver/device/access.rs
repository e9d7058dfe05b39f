//! The object of the access levels (2041h): challenge, response, lock and key. [`crate::access`] has the rules.

use super::Device;
use crate::access::{Key, Level, Refusal};
use crate::node::dictionary::records::AccessObject;
use crate::node::sdo::Abort;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Returns true if objects of the service level can be written.
    pub(crate) const fn is_service(&self) -> bool {
        !self.base.settings.access.is_locked || self.lock.is_unlocked()
    }

    /// Checks that the joint grants this level.
    ///
    /// # Errors
    /// [`Abort::Locked`].
    pub(crate) fn check_level(&mut self, level: Level) -> Result<(), Abort> {
        if level == Level::Open {
            return Ok(());
        }
        if !self.is_service() {
            let why = text!("the joint is locked: a response to its challenge unlocks it (2041h)");
            return Err(self.base.refuse(Abort::Locked, why));
        }
        Ok(())
    }

    /// Returns the present values.
    pub(crate) fn access_object(&self) -> AccessObject {
        AccessObject {
            level: self.is_service().into(),
            locked_by_default: self.base.settings.access.is_locked.into(),
            wrong_responses: self.lock.failures().into(),
            ..Default::default()
        }
    }

    /// Returns a new challenge.
    #[inline(never)]
    pub(crate) fn challenge(&mut self) -> [u8; Key::RESPONSE_LENGTH] {
        self.lock.challenge(&self.base.settings.access, self.base.now_us)
    }

    pub(crate) fn write_access(&mut self, place: u8, value: &[u8]) -> Result<(), Abort> {
        let length = match place {
            AccessObject::LOCK => {
                self.lock();
                return Ok(());
            }
            AccessObject::RESPONSE => 0,
            AccessObject::NEW_KEY => Key::LENGTH,
            AccessObject::NEW_POLICY => 1,
            _ => return Err(Abort::ReadOnly),
        };
        let (change, proof) = value.split_at_checked(length).ok_or(Abort::TooShort)?;
        if matches!(change, [2..=u8::MAX]) {
            return Err(self.base.refuse_setting(text!("new_policy"), text!("0 or 1")));
        }
        if length > 0 {
            self.refuse_in_trial()?;
        }
        self.check_proof(change, proof)?;
        match *change {
            [] => self.lock.unlock(self.base.now_us),
            [policy] => {
                self.base.settings.access.is_locked = policy != 0;
                if !self.is_service() {
                    // While the policy was open, every node could stage anything.
                    self.base.staging.discard();
                }
            }
            _ => {
                let key = change.try_into().map_err(|_| Abort::TooLong)?;
                self.base.settings.access.key = Key::new(key);
            }
        }
        Ok(())
    }

    /// Checks the proof of a change with the present key; without a change, it is the response to a challenge.
    fn check_proof(&mut self, change: &[u8], proof: &[u8]) -> Result<(), Abort> {
        let proof = proof.try_into().map_err(|_| {
            if proof.len() < Key::RESPONSE_LENGTH { Abort::TooShort } else { Abort::TooLong }
        })?;
        let (key, serial) = (self.base.settings.access.key, self.base.identity.serial);
        let node = self.node_in_use().number();
        let expected = |challenge| key.proof(challenge, serial, node, change);
        self.lock.check(proof, expected, self.base.now_us).map_err(|refusal| match refusal {
            Refusal::Wrong => self.base.refuse(Abort::Value, text!("the response is wrong")),
            Refusal::Wait => {
                self.base.refuse(Abort::State, text!("a response was wrong: wait up to 60 s"))
            }
        })
    }

    /// Ends the service level. What was staged with it is discarded: anyone may commit.
    pub(crate) fn lock(&mut self) {
        if self.lock.lock() && self.base.settings.access.is_locked {
            self.base.staging.discard();
        }
    }

    /// Ends a session that is over.
    #[inline(never)]
    pub(super) fn watch_session(&mut self) {
        if self.lock.is_expired(self.base.now_us) {
            self.lock();
        }
    }
}
