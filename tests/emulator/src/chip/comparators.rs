//! Overcurrent comparators in the break of TIM1, with the DACs of their levels (RM0440, 22, 24 and 28.6.31).
//!
//! The registers are plain memory. This finds what they mean: for each signal of the power stage, the level below and
//! the level above which the break is activated, in counts of 12 bits. A comparator acts if it is enabled, compares
//! a signal of the board with an enabled channel of a DAC, and is connected to the break. The comparison itself is
//! continuous and belongs to the surroundings: [`crate::world::World::set_break_levels`].

/// Lower and upper level of the signals that a board compares, three of them, counts; `None` if no comparator acts.
pub type BreakLevels = [[Option<u16>; 2]; 3];

/// Offset of TIM1_AF1, whose bit n connects comparator n to the break.
pub const AF1: u32 = 0x60;

/// Address of COMP1_CSR; those of the others follow.
const COMP: u32 = 0x4001_0200;
const ENABLED: u32 = 1;
const INVERTED: u32 = 1 << 15;
/// Present output.
const VALUE: u32 = 1 << 30;

/// Base addresses of the DACs 1 to 4.
const DAC: [u32; 4] = [0x5000_0800, 0x5000_0C00, 0x5000_1000, 0x5000_1400];
const DHR12R: [u32; 2] = [0x08, 0x14];

/// A comparator: its number, the input that the board uses with its signal (0 and 1 for the phases, 2 for the mean), and
/// the DAC channels of its inverting input, as (DAC, channel) from 1, for INMSEL = 4 and 5 (RM0440, table 196).
#[derive(Debug)]
pub struct Comparator {
    number: u32,
    input: u32,
    signal: usize,
    levels: [(usize, usize); 2],
}

const fn comparator(
    number: u32,
    input: u32,
    signal: usize,
    levels: [(usize, usize); 2],
) -> Comparator {
    Comparator { number, input, signal, levels }
}

/// The driver's board: PA0 and PB11 show phase a, PA1 and PA3 phase b, PB13 and PB14 the mean.
pub const G474: [Comparator; 6] = [
    comparator(1, 0, 1, [(3, 1), (1, 1)]),
    comparator(2, 1, 1, [(3, 2), (1, 2)]),
    comparator(3, 0, 0, [(3, 1), (1, 1)]),
    comparator(5, 0, 2, [(4, 1), (1, 2)]),
    comparator(6, 0, 0, [(4, 2), (2, 1)]),
    comparator(7, 0, 2, [(4, 1), (2, 1)]),
];

/// The B-G431B-ESC1: the shunts of the phases a, b and c at PA1, PA7 and PB0.
pub const ESC1: [Comparator; 3] = [
    comparator(1, 0, 0, [(3, 1), (1, 1)]),
    comparator(2, 0, 1, [(3, 2), (1, 2)]),
    comparator(4, 0, 2, [(3, 2), (1, 1)]),
];

/// Returns true if a write to this plain register may change a level.
pub const fn changes_levels(address: u32) -> bool {
    matches!(address, 0x4001_0200..=0x4001_021B | 0x5000_0800..=0x5000_17FF)
}

/// Returns the register of a comparator of the board with its output, for the counts of the signals; `None` for another address.
/// `unwired` is the number of a comparator whose pin has no signal.
pub fn status(
    comparators: &[Comparator],
    plain: &dyn Fn(u32) -> u32,
    address: u32,
    signals: [u16; 3],
    unwired: Option<u32>,
) -> Option<u32> {
    let Comparator { input, signal, levels, number } =
        comparators.iter().find(|comparator| COMP + 4 * (comparator.number - 1) == address)?;
    let csr = plain(address);
    let counts = u32::from(signals[*signal]);
    let source = (csr >> 4 & 0xF).checked_sub(4).and_then(|at| levels.get(at as usize));
    // A pin without a signal is low.
    let is_wired = csr >> 8 & 1 == *input && unwired != Some(*number);
    let shown = if is_wired { counts } else { 0 };
    let level =
        source.map_or(0, |&(dac, channel)| plain(DAC[dac - 1] + DHR12R[channel - 1]) & 0xFFF);
    let is_high = (shown > level) != (csr & INVERTED != 0);
    Some(csr & !VALUE | if is_high && csr & ENABLED != 0 { VALUE } else { 0 })
}

/// Returns true if a comparator that acts signals, for these counts.
pub fn is_active(levels: &BreakLevels, signals: [u16; 3]) -> bool {
    levels.iter().zip(signals).any(|([lower, upper], counts)| {
        lower.is_some_and(|lower| counts < lower) || upper.is_some_and(|upper| counts > upper)
    })
}

/// Returns the levels that these registers mean; `plain` reads one that is plain memory.
pub fn break_levels(
    comparators: &[Comparator],
    plain: &dyn Fn(u32) -> u32,
    af1: u32,
) -> BreakLevels {
    let mut levels = BreakLevels::default();
    for &Comparator { number, input, signal, levels: ref sources } in comparators {
        let csr = plain(COMP + 4 * (number - 1));
        let is_connected = af1 >> number & 1 == 1 && csr & ENABLED != 0 && csr >> 8 & 1 == input;
        let source = (csr >> 4 & 0xF).checked_sub(4).and_then(|at| sources.get(at as usize));
        let Some(&(dac, channel)) = source.filter(|_| is_connected) else { continue };
        let (base, channel) = (DAC[dac - 1], channel - 1);
        if plain(base) >> (16 * channel) & ENABLED == 0 {
            continue;
        }
        // An output that is not inverted signals above its level.
        let is_upper = csr & INVERTED == 0;
        levels[signal][usize::from(is_upper)] =
            Some((plain(base + DHR12R[channel]) & 0xFFF) as u16);
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_need_comparator_converter_and_break() {
        // COMP3 above the level of DAC3, channel 1; COMP6, inverted, below that of DAC4, channel 2.
        let registers = [
            (COMP + 8, ENABLED | 4 << 4),
            (COMP + 20, ENABLED | 4 << 4 | 1 << 15),
            (DAC[2], ENABLED),
            (DAC[2] + DHR12R[0], 3000),
            (DAC[3], ENABLED << 16),
            (DAC[3] + DHR12R[1], 1000),
        ];
        let without = |left_out: Option<usize>| {
            move |address: u32| {
                let kept = registers.iter().enumerate().filter(|(at, _)| Some(*at) != left_out);
                kept.map(|(_, register)| register).find(|(at, _)| *at == address).map_or(0, |r| r.1)
            }
        };
        let (all, connected) = (without(None), 1 << 3 | 1 << 6);
        assert_eq!(
            break_levels(&G474, &all, connected),
            [[Some(1000), Some(3000)], [None; 2], [None; 2]]
        );
        assert_eq!(break_levels(&G474, &all, 1 << 3)[0], [None, Some(3000)]);
        assert_eq!(break_levels(&G474, &without(Some(0)), connected)[0], [Some(1000), None]);
        assert_eq!(break_levels(&G474, &without(Some(4)), connected)[0], [None, Some(3000)]);
    }
}
