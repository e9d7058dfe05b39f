//! Changed inputs, from a seed of random numbers: equal in every run and on every machine.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Values at the edges of bytes, words and counters.
const EDGES: [u8; 8] = [0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF, 0x40, 0xC0];

/// Most changes of one input.
const MAX_CHANGES: u32 = 8;

/// Source of inputs, which changes and combines those of a corpus.
pub struct Mutator<'a> {
    corpus: &'a [Vec<u8>],
    longest: usize,
    random: Pcg64Mcg,
}

impl<'a> Mutator<'a> {
    /// Builds a source of inputs of up to `longest` bytes. An empty corpus gives random inputs.
    pub fn new(corpus: &'a [Vec<u8>], longest: usize, seed: u64) -> Self {
        Self { corpus, longest, random: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Returns the next input.
    pub fn input(&mut self) -> Vec<u8> {
        let mut input = self.start();
        for _ in 0..self.random.random_range(1..=MAX_CHANGES) {
            self.change(&mut input);
        }
        input.truncate(self.longest);
        input
    }

    /// Returns an input of the corpus; sometimes, or without a corpus, random bytes.
    fn start(&mut self) -> Vec<u8> {
        if self.corpus.is_empty() || self.random.random_range(0..16u8) == 0 {
            let length = self.random.random_range(0..=self.longest);
            return (0..length).map(|_| self.random.random()).collect();
        }
        self.corpus[self.random.random_range(0..self.corpus.len())].clone()
    }

    /// Returns a range of up to 64 places of an input that is not empty.
    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let begin = self.random.random_range(0..length);
        begin..(begin + self.random.random_range(1..=64)).min(length)
    }

    fn change(&mut self, input: &mut Vec<u8>) {
        if input.is_empty() {
            return input.push(self.random.random());
        }
        let place = self.random.random_range(0..input.len());
        match self.random.random_range(0..10u8) {
            0 => input[place] ^= 1 << self.random.random_range(0..8u8),
            1 => input[place] = self.random.random(),
            2 => input[place] = EDGES[self.random.random_range(0..EDGES.len())],
            3 => {
                let step = self.random.random_range(1..=35);
                input[place] = input[place].wrapping_add(step).wrapping_sub(18);
            }
            4 => input.insert(place, self.random.random()),
            5 => drop(input.drain(self.range(input.len()))),
            6 => {
                let copied = input[self.range(input.len())].to_vec();
                input.splice(place..place, copied);
            }
            7 => input.truncate(place),
            8 => self.change_number(input, place),
            _ => self.splice(input, place),
        }
    }

    /// Changes the decimal digits at a place, or the next after it.
    fn change_number(&mut self, input: &mut Vec<u8>, place: usize) {
        let Some(begin) = (place..input.len()).find(|at| input[*at].is_ascii_digit()) else {
            return;
        };
        let length = input[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = match self.random.random_range(0..4u8) {
            0 => u64::from(self.random.random::<u16>()),
            1 => self.random.random(),
            2 => 1u64.unbounded_shl(self.random.random_range(0..64)),
            _ => 0,
        };
        input.splice(begin..begin + length, number.to_string().into_bytes());
    }

    /// Puts a part of another input of the corpus at a place.
    fn splice(&mut self, input: &mut Vec<u8>, place: usize) {
        let filled: Vec<&Vec<u8>> = self.corpus.iter().filter(|other| !other.is_empty()).collect();
        if filled.is_empty() {
            return input.push(self.random.random());
        }
        let other = filled[self.random.random_range(0..filled.len())];
        let part = self.range(other.len());
        input.splice(place..place, other[part].iter().copied());
    }
}
