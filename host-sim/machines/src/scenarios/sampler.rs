//! Random numbers with names: what a scenario is drawn with.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// A seeded source of everything random in a scenario. The same seed gives the same scenario on every
/// machine, for the generator is value-stable and nothing depends on the order of threads.
pub(super) struct Sampler(Pcg64);

/// A logarithm needs a positive number.
const TINY: f64 = 1e-12;

impl Sampler {
    /// A source of its own for each pair of a seed and a purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self(Pcg64::seed_from_u64(mixed(seed ^ mixed(purpose))))
    }

    /// Evenly between two numbers.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.random::<f64>()
    }

    /// Evenly in the logarithm: each decade is as likely as the next.
    pub fn log_between(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.max(TINY).ln(), most.max(TINY).ln()).exp()
    }

    /// True in so many of all cases.
    pub fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    /// Plus or minus one.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    /// One of several; none is given for none.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        from.get(self.below(from.len())).copied()
    }

    /// Of a standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Puts a list into random order.
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for end in (1..list.len()).rev() {
            list.swap(end, self.below(end + 1));
        }
    }

    /// A seed for another source.
    pub fn seed(&mut self) -> u64 {
        self.0.random()
    }
}

/// Spreads seeds that lie close together (the finaliser of splitmix64).
pub(super) fn mixed(seed: u64) -> u64 {
    let mut x = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
