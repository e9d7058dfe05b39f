//! The units of columns by the sizes of their values, where neither the name nor the file states one ([`size`]).

use crate::contract::TIME;
use crate::guess::Guess;
use crate::size::{self, ClockedUnits, MotionSample};
use crate::statistics::median;
use crate::survey::SurveyedColumn;
use crate::unit;

/// The only column that may hold a quantity.
struct OnlyColumn<'a> {
    place: usize,
    values: &'a [f64],
    /// The unit that its name or the file states.
    unit: Option<String>,
    is_date: bool,
}

impl<'a> OnlyColumn<'a> {
    /// Returns the column of a quantity, which has a unit in the contract. Of several columns, none is the one.
    fn find(
        columns: &'a [SurveyedColumn],
        found: &[Option<Guess>],
        quantity: &str,
        contract_unit: &str,
    ) -> Option<Self> {
        let mut all =
            columns.iter().zip(found).enumerate().filter_map(|(place, (column, guess))| {
                let guess = guess.as_ref().filter(|guess| guess.quantity == quantity)?;
                Some((place, column, guess))
            });
        let (place, SurveyedColumn { summary, values }, guess) =
            all.next().filter(|_| all.next().is_none())?;
        let of_contract = guess.is_known.then_some(contract_unit);
        let unit = guess.unit.as_deref().or(of_contract).map(str::to_owned);
        (!guess.is_step).then_some(Self { place, values, unit, is_date: summary.is_date })
    }

    /// Returns true if nothing states its unit.
    fn is_open(&self) -> bool {
        self.unit.is_none() && !self.is_date
    }

    /// Returns its times in s, of a unit that nothing states in `unit`. `None` for dates.
    fn seconds(&self, unit: &str) -> Option<Vec<f64>> {
        let conversion = unit::conversion(TIME, self.unit.as_deref().unwrap_or(unit)).ok();
        let seconds = |t: &f64| conversion.map_or(*t, |conversion| conversion.apply(*t));
        (!self.is_date).then(|| self.values.iter().map(seconds).collect())
    }
}

/// Adds the units that the sizes of the values show, where neither the name nor the file states one.
pub(super) fn add_units_by_size(columns: &[SurveyedColumn], found: &mut [Option<Guess>]) {
    for (guess, column) in found.iter_mut().zip(columns) {
        if let Some(guess) = guess.as_mut().filter(|guess| guess.is_step && guess.unit.is_none()) {
            let step = median(&mut column.values.clone());
            guess.set_units(&[step.and_then(size::step_unit)], true);
        }
    }
    let only = |quantity, unit| OnlyColumn::find(columns, found, quantity, unit);
    let time = only(TIME, "s");
    let (position, velocity) = (only("position_rad", "rad"), only("velocity_rad_s", "rad/s"));
    let motion_in = |unit: &str| {
        size::motion_units(MotionSample {
            time_s: time.as_ref().and_then(|time| time.seconds(unit)).as_deref(),
            position: position.as_ref().map(|of| of.values),
            position_unit: position.as_ref().and_then(|of| of.unit.as_deref()),
            velocity: velocity.as_ref().map(|of| of.values),
            velocity_unit: velocity.as_ref().and_then(|of| of.unit.as_deref()),
        })
    };
    let open_time = time.as_ref().filter(|time| time.is_open()).map(|time| time.values);
    let ClockedUnits { times, motion } = size::clocked_units(open_time, motion_in);
    let velocities: Vec<_> = motion.all.iter().map(|of| of.velocity).collect();
    let positions: Vec<_> = motion.all.iter().map(|of| of.position).collect();
    let mut set = |column: Option<OnlyColumn>, units: &[Option<&'static str>], is_shown: bool| {
        let place = column.filter(OnlyColumn::is_open).map(|column| column.place);
        if let Some(guess) = place.and_then(|place| found[place].as_mut()) {
            guess.set_units(units, is_shown);
        }
    };
    set(time, &times, true);
    set(velocity, &velocities, motion.is_unique);
    set(position, &positions, motion.is_unique);
}
