//! Simulation of a track with derivatives by any number of parameters, in passes of a few derivatives each.
//!
//! A dual number with many derivatives does not fit into registers, and every operation copies it. Several passes with a
//! few derivatives are faster: they repeat the arithmetic of the value, and need no copies. A second advantage is that the
//! core's step is compiled for three sizes only.

use super::simulate::{Resolution, simulate, simulate_shaft};
use super::track::Track;
use crate::dual::Dual;
use compensator_core::Parameters;
use std::ops::Range;

/// Derivatives of a pass: the sizes that the core's step is compiled for.
const WIDTHS: [usize; 3] = [4, 6, 8];

/// Derivatives of the widest pass.
const WIDEST: usize = 8;

/// Parameters of a model as functions of the quantities whose derivatives are simulated.
pub trait Differentiable: Sync {
    /// Number of these quantities.
    fn count(&self) -> usize;

    /// Returns the parameters with derivatives by the quantities in this range, of at most `N`.
    fn parameters<const N: usize>(&self, range: Range<usize>) -> Parameters<Dual<N>>;
}

/// Torque held at the start of a track, if it had to be estimated.
pub trait Held: Sync {
    /// Returns the held torque, Nm, with its derivatives; `None` if the track starts sliding.
    fn torque<const N: usize>(
        &self,
        parameters: &Parameters<Dual<N>>,
        track: &Track,
    ) -> Option<Dual<N>>;
}

/// Where a torque is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueAt {
    /// At the shaft.
    Shaft,
    /// After the low-pass of the torque channel.
    Channel,
}

/// A track with its simulation.
pub struct Simulation<'a> {
    /// The track.
    pub track: &'a Track,
    /// Step size.
    pub resolution: Resolution,
    /// Where the torque is simulated.
    pub at: TorqueAt,
}

/// One simulated row.
pub struct GradientRow<'a> {
    /// Its index in the track.
    pub row: usize,
    /// Torque, Nm.
    pub torque: f64,
    /// Bristle torque, Nm.
    pub bristle: f64,
    /// Derivatives of the torque.
    pub gradient: &'a [f64],
}

/// Returns the number of derivatives of each pass for this number in all.
fn width(count: usize) -> usize {
    let passes = count.div_ceil(WIDEST).max(1);
    let least = count.div_ceil(passes);
    WIDTHS.into_iter().find(|width| *width >= least).unwrap_or(WIDEST)
}

impl Simulation<'_> {
    /// Simulates a model and passes each row to `sink`.
    pub fn run(
        &self,
        model: &impl Differentiable,
        held: &impl Held,
        mut sink: impl FnMut(GradientRow),
    ) {
        let count = model.count();
        let width = width(count);
        if count <= width {
            return self.pass_of(width, model, held, 0..count, &mut sink);
        }
        let rows = self.track.len();
        let mut values = vec![(0.0, 0.0); rows];
        let mut gradient = vec![0.0; rows * count];
        for from in (0..count).step_by(width) {
            let range = from..(from + width).min(count);
            let mut store = |part: GradientRow| {
                values[part.row] = (part.torque, part.bristle);
                gradient[part.row * count..][range.clone()].copy_from_slice(part.gradient);
            };
            self.pass_of(width, model, held, range.clone(), &mut store);
        }
        for (row, (torque, bristle)) in values.into_iter().enumerate() {
            let gradient = &gradient[row * count..][..count];
            sink(GradientRow { row, torque, bristle, gradient });
        }
    }

    /// Runs a pass of one of [`WIDTHS`].
    fn pass_of(
        &self,
        width: usize,
        model: &impl Differentiable,
        held: &impl Held,
        range: Range<usize>,
        sink: &mut dyn FnMut(GradientRow),
    ) {
        match width {
            4 => self.pass::<4>(model, held, range, sink),
            6 => self.pass::<6>(model, held, range, sink),
            _ => self.pass::<WIDEST>(model, held, range, sink),
        }
    }

    fn pass<const N: usize>(
        &self,
        model: &impl Differentiable,
        held: &impl Held,
        range: Range<usize>,
        sink: &mut dyn FnMut(GradientRow),
    ) {
        let parameters = model.parameters::<N>(range.clone());
        let held = held.torque(&parameters, self.track);
        let row = |row: usize, torque: Dual<N>, bristle: Dual<N>| {
            let gradient = &torque.gradient[..range.len()];
            sink(GradientRow { row, torque: torque.value, bristle: bristle.value, gradient });
            true
        };
        match self.at {
            TorqueAt::Shaft => simulate_shaft(&parameters, self.track, held, self.resolution, row),
            TorqueAt::Channel => simulate(&parameters, self.track, held, self.resolution, row),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::term::LOOKUP_TORQUES;
    use compensator_core::{LawKind, ParameterId, Sample, TermKind};

    struct Law {
        parameters: Parameters<f64>,
        ids: Vec<ParameterId>,
    }

    impl Differentiable for Law {
        fn count(&self) -> usize {
            self.ids.len()
        }

        fn parameters<const N: usize>(&self, range: Range<usize>) -> Parameters<Dual<N>> {
            let mut dual = self.parameters.convert::<Dual<N>>();
            for (index, id) in self.ids[range].iter().enumerate() {
                dual.set(*id, Dual::parameter(self.parameters.get(*id), index));
            }
            dual
        }
    }

    struct Sliding;

    impl Held for Sliding {
        fn torque<const N: usize>(&self, _: &Parameters<Dual<N>>, _: &Track) -> Option<Dual<N>> {
            None
        }
    }

    #[test]
    fn width_of_any_count_needs_few_passes() {
        for (count, expected) in [(0, 4), (4, 4), (5, 6), (8, 8), (9, 6), (12, 6), (13, 8), (21, 8)]
        {
            assert_eq!(width(count), expected, "{count}");
        }
    }

    #[test]
    fn run_in_passes_has_derivatives_of_one_pass() {
        let mut parameters = Parameters::new(LawKind::Lugre)
            .with(ParameterId::CoulombTorque, 1.0)
            .with(ParameterId::StaticTorque, 1.5);
        assert!(parameters.add_term(TermKind::LookupTable));
        let levels = LawKind::Lugre.parameters().iter().chain(&LOOKUP_TORQUES);
        let law = Law { ids: levels.copied().collect(), parameters };
        let sample =
            |row: usize| Sample { velocity_rad_s: (0.05 * row as f64).sin(), ..Sample::default() };
        let track = Track::even((0..200).map(sample).collect(), vec![0.0; 200], 0.01);
        let at = TorqueAt::Channel;
        let simulation = Simulation { track: &track, resolution: Resolution::PLAIN, at };
        let mut rows = Vec::new();
        simulation.run(&law, &Sliding, |row| rows.push((row.torque, row.gradient.to_vec())));
        let whole = law.parameters::<20>(0..law.count());
        simulate(&whole, &track, None, Resolution::PLAIN, |row, torque, _| {
            assert!((torque.value - rows[row].0).abs() < 1e-12);
            for (one, other) in torque.gradient.iter().zip(&rows[row].1) {
                assert!((one - other).abs() <= 1e-9 * (1.0 + one.abs()), "{row}: {one} {other}");
            }
            true
        });
        assert!(law.count() > WIDEST && rows.len() == 200);
    }
}
