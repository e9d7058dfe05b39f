//! Access levels: what every node of the bus may write, and what needs an unlock.
//!
//! Reading, arming and motion are open, as every CANopen master expects. What decides how much harm they can do
//! is not: wiring, limits, watches, stop reactions, node number, stored settings and the update need the *service*
//! level ([`crate::node::dictionary::Entry::level`]). A tool reads a challenge (2041h:2), and answers it with
//! [`Key::response`] (2041h:3). Every challenge is valid once. The level ends by a lock (2041h:4), a reset, or
//! [`SESSION_US`] after the unlock.
//!
//! A frame has no sender, so an unlock is valid for the whole bus. Key and policy therefore need a [`Key::proof`] besides:
//! whoever uses the session of another node cannot keep it. The default key is public: with it the lock prevents mistakes,
//! not attacks. The page docs/src/explanation/bus-security.md lists what stays possible.

use siphasher::sip::SipHasher24;

/// Time after an unlock until the joint locks itself, us.
pub const SESSION_US: u64 = 600_000_000;

/// Wait after the first wrong response, us. It doubles with every further one.
pub const FIRST_WAIT_US: u64 = 1_000_000;
/// Longest wait after a wrong response, us.
pub const LONGEST_WAIT_US: u64 = 60_000_000;
/// Number of doublings until the longest wait.
const DOUBLINGS: u16 = 6;

/// Level that a write needs, or that a joint grants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Every node of the bus.
    Open,
    /// After an unlock.
    Service,
}

/// Key of a joint, for SipHash-2-4 (Aumasson and Bernstein, "SipHash: a fast short-input PRF").
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key([u8; Key::LENGTH]);

impl Key {
    /// Length of a key, bytes.
    pub const LENGTH: usize = 16;
    /// Length of a challenge and of a response, bytes.
    pub const RESPONSE_LENGTH: usize = 8;
    /// The public key of a joint that has no other.
    pub const DEFAULT: Self = Self(*b"friction default");

    /// Returns the key with these bytes.
    pub const fn new(bytes: [u8; Self::LENGTH]) -> Self {
        Self(bytes)
    }

    /// Returns the bytes of the key.
    pub const fn bytes(&self) -> [u8; Self::LENGTH] {
        self.0
    }

    /// Returns the response to a challenge: SipHash-2-4 of challenge, serial number (1018h:4) and node number, as
    /// 13 little-endian bytes. A response is thus of no use at another joint.
    pub fn response(
        &self,
        challenge: [u8; Self::RESPONSE_LENGTH],
        serial: u32,
        node: u8,
    ) -> [u8; Self::RESPONSE_LENGTH] {
        self.proof(challenge, serial, node, &[])
    }

    /// Returns the proof of a new key or policy, of up to [`Key::LENGTH`] bytes: the response, with these bytes at the end of
    /// the hashed ones. Their length differs, so a proof is no response, and the proof of one is none of the other.
    pub fn proof(
        &self,
        challenge: [u8; Self::RESPONSE_LENGTH],
        serial: u32,
        node: u8,
        change: &[u8],
    ) -> [u8; Self::RESPONSE_LENGTH] {
        let mut message = [0; Self::RESPONSE_LENGTH + 5 + Self::LENGTH];
        let parts = challenge.into_iter().chain(serial.to_le_bytes()).chain([node]);
        let parts = parts.chain(change.iter().copied());
        let length = message.iter_mut().zip(parts).map(|(to, from)| *to = from).count();
        self.hash(message.get(..length).unwrap_or(&message)).to_le_bytes()
    }

    // Not inlined, so that there is one copy of its 64-bit arithmetic.
    #[inline(never)]
    fn hash(&self, message: &[u8]) -> u64 {
        SipHasher24::new_with_key(&self.0).hash(message)
    }
}

impl core::fmt::Debug for Key {
    /// Does not print the key.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if *self == Self::DEFAULT { "Key(default)" } else { "Key(..)" })
    }
}

/// Stored settings of the access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessSettings {
    /// Key of the joint.
    pub key: Key,
    /// The joint starts locked. Otherwise every node has the service level.
    pub is_locked: bool,
}

impl Default for AccessSettings {
    fn default() -> Self {
        Self { key: Key::DEFAULT, is_locked: true }
    }
}

impl AccessSettings {
    /// Length of the encoded settings, bytes.
    pub const LENGTH: usize = 20;

    /// Returns the settings as bytes: the policy as a little-endian word, then the key.
    pub fn emit(&self) -> [u8; Self::LENGTH] {
        let mut bytes = [0; Self::LENGTH];
        bytes[0] = self.is_locked.into();
        if let Some(key) = bytes.last_chunk_mut() {
            *key = self.key.0;
        }
        bytes
    }

    /// Parses settings; `None` for an unknown policy.
    pub fn parse(bytes: &[u8; Self::LENGTH]) -> Option<Self> {
        let is_locked = match bytes.first_chunk()? {
            [0, 0, 0, 0] => false,
            [1, 0, 0, 0] => true,
            _ => return None,
        };
        Some(Self { key: Key(*bytes.last_chunk()?), is_locked })
    }
}

/// Why a response was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// No challenge is open, or the response to it is wrong.
    Wrong,
    /// A wait after a wrong response has not ended.
    Wait,
}

/// State of the lock.
#[derive(Debug, Default)]
pub struct Lock {
    /// Secret of the challenges; `None` if the board has no random numbers.
    seed: Option<Key>,
    /// Number of challenges since the start.
    challenges: u32,
    /// The challenge that was read last, until a response has used it.
    open: Option<[u8; Key::RESPONSE_LENGTH]>,
    /// End of the session, us; `None` while the joint is locked.
    ends_us: Option<u64>,
    /// Wrong responses since the last right one.
    failures: u16,
    /// End of the wait after a wrong response, us.
    wait_until_us: u64,
    /// The key is lost: no response is right.
    is_sealed: bool,
}

impl Lock {
    /// Sets the secret of the challenges: random, and new at every start.
    pub const fn seed(&mut self, seed: [u8; Key::LENGTH]) {
        self.seed = Some(Key(seed));
    }

    /// Refuses every response from now on, because the key is lost.
    pub const fn seal(&mut self) {
        self.is_sealed = true;
    }

    /// Returns a new challenge. It replaces the previous one.
    ///
    /// Without random numbers the key replaces the secret. The time makes challenges of another run differ.
    pub fn challenge(&mut self, settings: &AccessSettings, now_us: u64) -> [u8; 8] {
        self.challenges = self.challenges.wrapping_add(1);
        let secret = self.seed.unwrap_or(settings.key);
        let mut message = [0; 12];
        let parts = now_us.to_le_bytes().into_iter().chain(self.challenges.to_le_bytes());
        message.iter_mut().zip(parts).for_each(|(to, from)| *to = from);
        let challenge = secret.hash(&message).to_le_bytes();
        self.open = Some(challenge);
        challenge
    }

    /// Unlocks the joint until the end of the session.
    pub const fn unlock(&mut self, now_us: u64) {
        self.ends_us = Some(now_us.saturating_add(SESSION_US));
    }

    /// Checks a response to the open challenge, or a proof.
    ///
    /// # Errors
    /// Returns why it is refused.
    pub fn check(
        &mut self,
        response: [u8; 8],
        expected: impl FnOnce([u8; 8]) -> [u8; 8],
        now_us: u64,
    ) -> Result<(), Refusal> {
        if now_us < self.wait_until_us {
            return Err(Refusal::Wait);
        }
        // The time of a comparison as one number does not depend on the bytes.
        let is_right = self.open.take().is_some_and(|challenge| {
            u64::from_le_bytes(expected(challenge)) == u64::from_le_bytes(response)
                && !self.is_sealed
        });
        if !is_right {
            let wait_us = (FIRST_WAIT_US << self.failures.min(DOUBLINGS)).min(LONGEST_WAIT_US);
            self.failures = self.failures.saturating_add(1);
            self.wait_until_us = now_us.saturating_add(wait_us);
            return Err(Refusal::Wrong);
        }
        self.failures = 0;
        Ok(())
    }

    /// Locks the joint. Returns true if it was unlocked.
    pub const fn lock(&mut self) -> bool {
        self.ends_us.take().is_some()
    }

    /// Returns true if the joint is unlocked.
    pub const fn is_unlocked(&self) -> bool {
        self.ends_us.is_some()
    }

    /// Returns true if the session is over.
    pub fn is_expired(&self, now_us: u64) -> bool {
        self.ends_us.is_some_and(|ends_us| now_us >= ends_us)
    }

    /// Returns the number of wrong responses since the last right one.
    pub const fn failures(&self) -> u16 {
        self.failures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn response_is_siphash_2_4_of_challenge_serial_and_node() {
        // As the function of docs/src/explanation/bus-security.md computes it.
        let key = Key::new(core::array::from_fn(|place| place as u8));
        let response = key.response([0, 1, 2, 3, 4, 5, 6, 7], 0x0B0A_0908, 0x0C);
        assert_eq!(u64::from_le_bytes(response), 0x14EA_5627_C084_3D90);
    }

    /// Excluded: use a response of another joint.
    #[test]
    fn response_depends_on_challenge_serial_node_and_key() {
        let (key, challenge) = (Key::DEFAULT, [1, 2, 3, 4, 5, 6, 7, 8]);
        let response = key.response(challenge, 7, 1);
        assert_eq!(response, key.response(challenge, 7, 1));
        assert_ne!(response, key.response([0; 8], 7, 1));
        assert_ne!(response, key.response(challenge, 8, 1));
        assert_ne!(response, key.response(challenge, 7, 2));
        assert_ne!(response, Key::new([0; 16]).response(challenge, 7, 1));
    }

    #[test]
    fn proof_depends_on_what_it_proves() {
        let (key, challenge) = (Key::DEFAULT, [1, 2, 3, 4, 5, 6, 7, 8]);
        let proof = |change: &[u8]| key.proof(challenge, 7, 1, change);
        let seen = [&[][..], &[0], &[1], &[0; 2], &[0; 16], &[1; 16]].map(proof);
        let distinct: std::collections::HashSet<_> = seen.iter().collect();
        assert_eq!(distinct.len(), seen.len());
    }

    #[test]
    fn challenge_without_a_seed_never_repeats() {
        let (mut lock, settings) = (Lock::default(), AccessSettings::default());
        let mut seen = std::collections::HashSet::new();
        assert!((0..10_000).all(|read| seen.insert(lock.challenge(&settings, read / 100))));
        let mut seeded = Lock::default();
        seeded.seed([7; 16]);
        assert!(seen.insert(seeded.challenge(&settings, 0)), "another secret, another challenge");
    }

    #[test]
    fn unlock_after_wrong_responses_waits_twice_as_long_up_to_a_minute() {
        let (mut lock, settings) = (Lock::default(), AccessSettings::default());
        let mut now_us = 0;
        for wait_s in [1, 2, 4, 8, 16, 32, 60, 60] {
            lock.challenge(&settings, now_us);
            assert_eq!(lock.check([0; 8], |_| [1; 8], now_us), Err(Refusal::Wrong));
            now_us += wait_s * 1_000_000;
            assert_eq!(lock.check([1; 8], |_| [1; 8], now_us - 1), Err(Refusal::Wait));
        }
        assert_eq!(lock.failures(), 8);
        lock.challenge(&settings, now_us);
        assert_eq!(lock.check([1; 8], |_| [1; 8], now_us), Ok(()));
        assert_eq!(lock.failures(), 0);
    }

    /// Sends wrong responses as soon as they are taken; returns the times of the first, us. All waits are changed by the
    /// factor `numerator / 2`, which is the same as another unit of time.
    fn times_of_guesses(numerator: u64, until_us: u64) -> std::vec::Vec<u64> {
        let (mut lock, settings) = (Lock::default(), AccessSettings::default());
        let (mut times, mut at_us) = (std::vec::Vec::new(), 0);
        while at_us * numerator / 2 < until_us {
            lock.challenge(&settings, at_us);
            assert_eq!(lock.check([0; 8], |_| [1; 8], at_us), Err(Refusal::Wrong));
            times.push(at_us * numerator / 2);
            at_us = lock.wait_until_us;
        }
        times
    }

    /// No wait protects a response of 64 bits: guesses of a century do not reach it. The waits bound the guesses of keys
    /// that a person chose: some thousand a day with half of them. Twice the waits lock out for 14 s who mistyped thrice.
    #[test]
    fn waits_halved_and_doubled_change_guesses_of_a_day_and_the_wait_of_a_user() {
        let day_us = 86_400_000_000;
        for (numerator, guesses, wait_us) in
            [(1, 2885, 3_500_000), (2, 1445, 7_000_000), (4, 725, 14_000_000)]
        {
            let times = times_of_guesses(numerator, day_us);
            assert_eq!((times.len(), times[3]), (guesses, wait_us), "waits times {numerator} / 2");
            let century = 36_525.0 * times.len() as f64;
            assert!(century / 2f64.powi(64) < 1e-10);
        }
    }

    #[test]
    fn parse_of_emitted_settings_returns_them_and_refuses_an_unknown_policy() {
        let settings = AccessSettings { key: Key::new([9; 16]), is_locked: false };
        assert_eq!(AccessSettings::parse(&settings.emit()), Some(settings));
        let mut bytes = settings.emit();
        bytes[0] = 2;
        assert_eq!(AccessSettings::parse(&bytes), None);
        assert_eq!(format!("{:?}", settings.key), "Key(..)");
    }
}
