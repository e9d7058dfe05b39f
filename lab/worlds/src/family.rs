//! Families of worlds: their plants, sensors and effects.

use simulated_machines::sampler::Sampler;

/// A family of worlds with its own plants and sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// Bristles or slip elements. A diagnosis may be calibrated on these worlds.
    Training,
    /// Elasto-plastic contact elements with a lubricant film, and sensors of a second maker.
    LubricatedSeal,
    /// All plants and both makers, with every cause that a world can have, one or two at once.
    ///
    /// A diagnosis may be calibrated on these worlds. Worlds for grading have seeds that were drawn after its last change.
    Mixed,
}

/// Share of the training worlds whose plant consists of slip elements.
const SLIP_ELEMENT_SHARE: f64 = 0.4;

/// Effort of the models of a world, beside that of its true plant.
#[derive(Clone, Copy, Debug)]
pub(super) struct ModelEffort {
    /// Number of integration points of the true plant for one of a model.
    pub stride: usize,
    /// Number of runs to which a model is fitted, at most.
    pub fitted_runs: usize,
}

/// Kinds of plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlantKind {
    Bristles,
    SlipElements,
    LubricatedSeal,
}

impl Family {
    /// All families.
    pub const ALL: [Family; 3] = [Family::Training, Family::LubricatedSeal, Family::Mixed];

    /// Returns the name of the family.
    pub const fn name(self) -> &'static str {
        match self {
            Family::Training => "training",
            Family::LubricatedSeal => "lubricated-seal",
            Family::Mixed => "mixed",
        }
    }

    /// Returns the family with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }

    /// Returns the sampler of a world.
    ///
    /// The families use different samplers, so that worlds of one seed share neither motions nor effects.
    pub(super) fn sampler(self, seed: u64) -> Sampler {
        match self {
            Family::Training => Sampler::new(seed, 7),
            Family::LubricatedSeal => Sampler::new(seed, 11),
            Family::Mixed => Sampler::new(seed, 13),
        }
    }

    /// Draws the kind of plant of a world.
    pub(super) fn draw_plant_kind(self, sampler: &mut Sampler) -> PlantKind {
        match self {
            Family::Training if sampler.chance(SLIP_ELEMENT_SHARE) => PlantKind::SlipElements,
            Family::Training => PlantKind::Bristles,
            Family::LubricatedSeal => PlantKind::LubricatedSeal,
            Family::Mixed => {
                [PlantKind::Bristles, PlantKind::SlipElements, PlantKind::LubricatedSeal]
                    [sampler.below(3)]
            }
        }
    }

    /// Returns the range of the total number of rows of a log.
    pub(super) const fn row_range(self) -> (f64, f64) {
        match self {
            Family::Training | Family::LubricatedSeal => (3_000.0, 20_000.0),
            Family::Mixed => (2_500.0, 14_000.0),
        }
    }

    /// Returns the effort of the models. Thousands of mixed worlds are drawn, and most of their time is that of the models.
    pub(super) const fn model_effort(self) -> ModelEffort {
        match self {
            Family::Training | Family::LubricatedSeal => ModelEffort { stride: 1, fitted_runs: 6 },
            Family::Mixed => ModelEffort { stride: 4, fitted_runs: 3 },
        }
    }

    /// Draws whether the devices are those of the second maker.
    pub(super) fn draw_second_maker(self, sampler: &mut Sampler) -> bool {
        match self {
            Family::Training => false,
            Family::LubricatedSeal => true,
            Family::Mixed => sampler.chance(0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{UnkindWorld, draw, draw_family};
    use super::*;

    /// Asserts that two numbers agree, except for the rounding of another computer's functions.
    fn assert_near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
    }

    /// Returns the sum of the magnitudes of a column.
    fn column_sum(world: &UnkindWorld, column: usize) -> f64 {
        let values = world.log.runs.iter().flat_map(|run| &run.columns[column]);
        values.map(|value| value.abs()).sum()
    }

    // A calibration is valid only for the worlds it was fitted to, so these worlds must not change.
    #[test]
    fn draw_of_known_seeds_gives_the_recorded_worlds() {
        let known = [
            (1120578704, "bristles", "backlash", 7011, [1788.559563746, 840.417405445]),
            (799075276, "slip-elements", "quadratic-drag", 3917, [3680.234609220, 190.801291156]),
            (740646060, "bristles", "warm-up", 6376, [4102.803020267, 3284.490657689]),
        ];
        let floors_nm = [7.5428346406e-4, 3.2122205517e-3, 2.8958581778e-2];
        for ((seed, plant, cause, rows, sums), floor_nm) in known.into_iter().zip(floors_nm) {
            let world = draw(seed);
            assert_eq!((world.truth.plant, world.truth.cause()), (plant, cause));
            assert_eq!(world.log.rows(), rows);
            assert_near(column_sum(&world, 1), sums[0]);
            assert_near(column_sum(&world, 2), sums[1]);
            assert_near(world.truth.floor_nm, floor_nm);
        }
    }

    #[test]
    fn draw_family_of_training_gives_the_world_of_draw() {
        let (one, other) = (draw(1120578704), draw_family(1120578704, Family::Training));
        assert_eq!(one.log, other.log);
        assert_eq!(one.truth.json(), other.truth.json());
    }

    #[test]
    fn draw_family_with_same_seed_gives_same_lubricated_seal() {
        let drawn = || draw_family(3625809617, Family::LubricatedSeal);
        let (one, other) = (drawn(), drawn());
        assert_eq!(one.log, other.log);
        assert_eq!(one.truth.json(), other.truth.json());
        assert_eq!(one.truth.plant, "lubricated-seal");
        assert!(one.truth.floor_nm.is_finite() && one.truth.floor_nm > 0.0);
        assert_ne!(one.log, draw(3625809617).log);
    }
}
