//! Joints that are mounted as mirror images of the others.
//!
//! A mirror inverts position, velocity and torque together. Friction stays; a zero error of the torque, the cosine part of gravity
//! and a difference between the directions change their sign. Such a quantity has two signs in the fleet, and one size.

use super::Level;
use super::statistics::{middle, natural_key};
use std::collections::BTreeMap;

/// A signed quantity of a joint.
pub(super) struct SignedValue<'a> {
    /// Name of the joint.
    pub joint: &'a str,
    /// The quantity.
    pub level: Level,
}

/// Minimum number of joints of each sign. A single joint of the other sign may have a fault.
const MIN_OF_A_SIGN: usize = 2;

/// Minimum distance of a value from 0 at which its sign is known, in standard errors.
const CLEAR_ERRORS: f64 = 3.0;

/// Largest median deviation of the sizes of mirrored joints from their median, as a share of it. Values around 0 have 0.6.
const MAX_SIZE_DEVIATION: f64 = 0.2;

impl SignedValue<'_> {
    /// Returns the sign; 0 if the error of the value may change it.
    fn sign(&self) -> f64 {
        let Level { value, std_error } = self.level;
        if value.abs() > CLEAR_ERRORS * std_error { value.signum() } else { 0.0 }
    }
}

/// Returns true if a quantity has two signs and one size.
fn has_mirrored_signs(values: &[SignedValue]) -> bool {
    let of_sign = |wanted: f64| values.iter().filter(|of| of.sign() == wanted).count();
    if of_sign(1.0).min(of_sign(-1.0)) < MIN_OF_A_SIGN {
        return false;
    }
    let sizes = values.iter().map(|of| of.level.value.abs());
    let size = middle(sizes.clone());
    middle(sizes.map(|of| (of - size).abs())) <= MAX_SIZE_DEVIATION * size
}

/// Adds up, over the joints of known sides, how far the signs of a quantity follow them: a mirrored quantity gives their number.
fn agreement(values: &[SignedValue], sides: &BTreeMap<&str, f64>) -> f64 {
    values.iter().filter_map(|of| Some(of.sign() * sides.get(of.joint)?)).sum()
}

/// Returns the names of the joints that are mirrored, in natural order: the smaller half, or that without the first joint.
pub(super) fn mirrored<'a>(quantities: &[Vec<SignedValue<'a>>]) -> Vec<&'a str> {
    let mut found: Vec<&Vec<SignedValue>> =
        quantities.iter().filter(|of| has_mirrored_signs(of)).collect();
    found.sort_by_key(|of| std::cmp::Reverse(of.iter().filter(|of| of.sign() != 0.0).count()));
    // Each quantity votes on the side of each joint. The first one decides between equal votes.
    let mut votes: BTreeMap<&str, f64> = BTreeMap::new();
    for (place, values) in found.into_iter().enumerate() {
        let turned = if agreement(values, &votes) < 0.0 { -1.0 } else { 1.0 };
        let weight = if place == 0 { 1.5 } else { 1.0 };
        for of in values {
            *votes.entry(of.joint).or_default() += weight * turned * of.sign();
        }
    }
    let mut names: Vec<&str> = votes.keys().copied().collect();
    names.sort_by_cached_key(|name| natural_key(name));
    let of_side = |wanted: f64| -> Vec<&str> {
        names.iter().filter(|name| votes[**name] * wanted > 0.0).copied().collect()
    };
    let [positive, negative] = [1.0, -1.0].map(of_side);
    let is_first = |side: &[&str]| side.first() == names.first();
    match positive.len().cmp(&negative.len()) {
        std::cmp::Ordering::Less => positive,
        std::cmp::Ordering::Equal if is_first(&negative) => positive,
        _ => negative,
    }
}

/// Returns true if a quantity changes its sign with the mirror: its signs agree better with each other after they are turned.
pub(super) fn is_turned(values: &[SignedValue], mirrored: &[&str]) -> bool {
    let side = |name: &str| if mirrored.contains(&name) { -1.0 } else { 1.0 };
    let sides: BTreeMap<&str, f64> = values.iter().map(|of| (of.joint, side(of.joint))).collect();
    let plain: BTreeMap<&str, f64> = values.iter().map(|of| (of.joint, 1.0)).collect();
    agreement(values, &sides).abs() > agreement(values, &plain).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 8] =
        ["leg-1", "leg-2", "leg-3", "leg-4", "leg-5", "leg-6", "leg-7", "leg-10"];

    fn values(of: [f64; 8]) -> Vec<SignedValue<'static>> {
        let named = NAMES.into_iter().zip(of);
        let value = |(joint, value)| SignedValue { joint, level: Level { value, std_error: 0.01 } };
        named.map(value).collect()
    }

    const OFFSETS: [f64; 8] = [0.5, -0.52, 0.48, -0.5, 0.51, -0.49, 0.5, -0.47];

    #[test]
    fn mirrored_with_alternating_signs_returns_the_half_without_the_first_joint() {
        let offsets = values(OFFSETS);
        let even = ["leg-2", "leg-4", "leg-6", "leg-10"];
        assert_eq!(mirrored(std::slice::from_ref(&offsets)), even);
        assert!(is_turned(&offsets, &even));
        assert!(!is_turned(&values([0.3; 8]), &even), "the sine part of gravity");
        let inverted = values(OFFSETS.map(|of| -0.2 * of));
        assert_eq!(mirrored(&[offsets, inverted]), even, "of two quantities");
    }

    #[test]
    fn mirrored_without_two_sides_of_one_size_returns_none() {
        for of in [
            // One joint has another sign.
            [0.5, 0.52, 0.48, -0.5, 0.51, 0.49, 0.5, 0.47],
            // Zero errors of any size.
            [0.5, -0.1, 0.9, -1.4, 0.05, -0.4, 1.1, -0.2],
            // Values within their errors.
            [0.02, -0.02, 0.02, -0.02, 0.02, -0.02, 0.02, -0.02],
        ] {
            assert!(mirrored(&[values(of)]).is_empty(), "{of:?}");
        }
    }

    #[test]
    fn mirrored_with_one_wrong_sign_follows_the_other_quantities() {
        let mut offsets = OFFSETS;
        offsets[2] *= -1.0;
        let gravity = OFFSETS.map(|of| 4.0 * of);
        let found = mirrored(&[values(offsets), values(gravity), values(gravity)]);
        assert_eq!(found, ["leg-2", "leg-4", "leg-6", "leg-10"]);
    }
}
