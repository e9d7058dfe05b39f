//! Random sampler of the scenarios.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Seeded source of all random numbers of a scenario.
///
/// The same seed gives the same scenario on every computer: the generator is value-stable, and no draw depends on
/// the order of threads.
#[derive(Clone, Debug)]
pub struct Sampler(Pcg64);

/// Lower bound of a logarithm's argument.
const MIN_LOG_ARGUMENT: f64 = 1e-12;

impl Sampler {
    /// Creates an independent sampler for each pair of a seed and a purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self::of(mixed(seed ^ mixed(purpose)))
    }

    /// Creates a sampler of a mixed seed.
    pub fn of(mixed_seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(mixed_seed))
    }

    /// Draws from a uniform distribution between two numbers.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.random::<f64>()
    }

    /// Draws from a log-uniform distribution: each decade is equally likely.
    pub fn log_between(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.max(MIN_LOG_ARGUMENT).ln(), most.max(MIN_LOG_ARGUMENT).ln()).exp()
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    /// Draws 1 or -1 with equal probability.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Draws an integer from 0 to `end - 1`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    /// Draws an item of a slice. Returns `None` if the slice is empty.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        from.get(self.below(from.len())).copied()
    }

    /// Draws from the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Shuffles a list.
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for end in (1..list.len()).rev() {
            list.swap(end, self.below(end + 1));
        }
    }

    /// Draws a seed for another sampler.
    pub fn seed(&mut self) -> u64 {
        self.0.random()
    }
}

/// Mixes the bits of a seed, so that consecutive seeds give unrelated values (finaliser of splitmix64).
pub fn mixed(seed: u64) -> u64 {
    let mut x = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
