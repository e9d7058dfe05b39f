//! One map for all joints of a wide table: `--columns torque_nm=tau_#,velocity_rad_s=dq_#`.
//!
//! The sign `#` stands for the text that differs from joint to joint, a number or a word (`left_knee_effort`). A joint is
//! a text with which every mapped column exists. The velocities and accelerations of the other joints stay in the log
//! under plain names, as their motion may move this joint. Their other columns are left out.

use super::column_pair::ColumnPair;
use super::{guess, unit};
use compensator_core::quantity::Quantity;

/// Stands for the joint in the name of a column.
pub(super) const PLACE: char = '#';

/// Least score of a guess that is suggested: a word of the name is a word of the quantity.
const MIN_SCORE: u32 = 4;

/// A pair of `--columns` with the names that its column has for the joints.
struct Pattern<'a> {
    ours: &'a str,
    theirs: &'a str,
    ends: Ends<'a>,
}

impl Pattern<'_> {
    fn column(&self, joint: &str) -> String {
        format!("{}{joint}{}", self.ends.before, self.ends.after)
    }
}

/// The text before and after the joint in the names of a column.
#[derive(Clone, Copy, Default)]
struct Ends<'a> {
    before: &'a str,
    after: &'a str,
}

impl<'a> Ends<'a> {
    fn of(pattern: &'a str) -> Option<Self> {
        let (before, after) = pattern.split_once(PLACE)?;
        Some(Self { before, after })
    }

    /// Returns the joint in a name.
    fn joint<'n>(&self, name: &'n str) -> Option<&'n str> {
        let joint = name.strip_prefix(self.before)?.strip_suffix(self.after)?;
        (!joint.is_empty()).then_some(joint)
    }
}

/// The joints that a map names, and the parts of the map.
pub(super) struct JointMap<'a> {
    /// The texts in place of the sign, in the order of the file.
    pub joints: Vec<String>,
    pairs: &'a [(String, String)],
    patterns: Vec<Pattern<'a>>,
}

impl<'a> JointMap<'a> {
    /// Finds the joints of a map. `None` if no column of the map has the sign, or a column has it in its own name.
    pub fn find(names: &[String], pairs: &'a [(String, String)]) -> Option<Self> {
        let patterns = pairs.iter().filter_map(|(ours, theirs)| pattern(names, ours, theirs));
        let patterns: Vec<Pattern> = patterns.collect();
        let first = patterns.first()?;
        let has = |column: String| names.contains(&column);
        let joints = names.iter().filter_map(|name| first.ends.joint(name));
        let joints =
            joints.filter(|joint| patterns.iter().all(|pattern| has(pattern.column(joint))));
        Some(Self { joints: joints.map(str::to_owned).collect(), pairs, patterns })
    }

    /// Returns the map of one joint.
    pub fn pairs_of(&self, joint: &str) -> Vec<(String, String)> {
        let of = |(ours, theirs): &(String, String)| {
            let is_pattern = self.patterns.iter().any(|pattern| pattern.theirs == theirs);
            let theirs = if is_pattern { theirs.replacen(PLACE, joint, 1) } else { theirs.clone() };
            (ours.clone(), theirs)
        };
        self.pairs.iter().map(of).collect()
    }

    /// Returns the plain name of another joint's velocity or acceleration; `None` for another column.
    pub fn other_motion(&self, name: &str, joint: &str) -> Option<String> {
        let pattern = self.patterns.iter().find(|pattern| pattern.column(joint) == name)?;
        let (quantity, _) = Quantity::parse(pattern.ours)?;
        let what = match quantity {
            Quantity::Velocity => "velocity",
            Quantity::Acceleration => "acceleration",
            _ => return None,
        };
        Some(format!("{what} of joint {joint}"))
    }

    /// Returns true if a column belongs to another joint: the map names it, or with this joint in place of the other,
    /// it is a column too.
    pub fn is_of(&self, name: &str, other: &str, joint: &str, names: &[String]) -> bool {
        let is_mapped = self.patterns.iter().any(|pattern| pattern.column(other) == name);
        is_mapped
            || occurrences(name, other).any(|at| {
                let twin = format!("{}{joint}{}", &name[..at], &name[at + other.len()..]);
                names.contains(&twin)
            })
    }
}

fn pattern<'a>(names: &[String], ours: &'a str, theirs: &'a str) -> Option<Pattern<'a>> {
    let is_column = |text: &str| names.iter().any(|name| name == text);
    if !theirs.contains(PLACE) || is_column(theirs) {
        return None;
    }
    let ends = |text: &'a str| {
        let ends = Ends::of(text)?;
        names.iter().any(|name| ends.joint(name).is_some()).then_some(ends)
    };
    // A name may hold a colon; else it parts the name from the unit.
    let alone = theirs.rsplit_once(':').map_or(theirs, |(name, _)| name);
    let ends = ends(theirs).or_else(|| ends(alone)).or_else(|| Ends::of(alone))?;
    Some(Pattern { ours, theirs, ends })
}

/// Returns the places of a joint as a word or number of its own in a name.
fn occurrences<'n>(name: &'n str, joint: &str) -> impl Iterator<Item = usize> + 'n {
    let is_number = joint.bytes().all(|byte| byte.is_ascii_digit());
    let length = joint.len();
    let starts: Vec<usize> = name.match_indices(joint).map(|(at, _)| at).collect();
    starts.into_iter().filter(move |at| {
        let beside = [name[..*at].chars().next_back(), name[at + length..].chars().next()];
        let joins = |c: char| if is_number { c.is_ascii_digit() } else { c.is_alphanumeric() };
        beside.into_iter().flatten().all(|c| !joins(c))
    })
}

/// A map that the names of a wide table suggest.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct SuggestedMap {
    /// Contract name and pattern of each quantity.
    pub pairs: Vec<(&'static str, String)>,
    /// The joints.
    pub joints: Vec<String>,
}

impl SuggestedMap {
    /// Returns the pair of a contract name for all joints, in the unit at the end of its names.
    pub fn pair(&self, contract_name: &'static str) -> Option<ColumnPair> {
        let is_same = |ours: &str| guess::is_same_quantity(ours, contract_name);
        let (_, pattern) = self.pairs.iter().find(|(ours, _)| is_same(ours))?;
        Some(ColumnPair::new(contract_name, pattern, unit::in_name(contract_name, pattern)))
    }

    /// Returns the pair that maps a column of the table, for all joints.
    pub fn pair_of(&self, name: &str) -> Option<ColumnPair> {
        let fits = |pattern: &str| {
            let joint = Ends::of(pattern).and_then(|ends| ends.joint(name));
            joint.is_some_and(|joint| self.joints.iter().any(|known| known == joint))
        };
        let (ours, pattern) = self.pairs.iter().find(|(_, pattern)| fits(pattern))?;
        Some(ColumnPair::new(ours, pattern, unit::in_name(ours, pattern)))
    }
}

/// Returns the map that fits a table of several joints: a torque, a velocity or a position, and the others of them that
/// all the joints have. `None` if the names tell of fewer than two joints.
pub(super) fn suggested_map(names: &[&str]) -> Option<SuggestedMap> {
    let patterns = patterns(names);
    let joints_of = |pattern: &str| -> Vec<&str> {
        let ends = Ends::of(pattern).unwrap_or_default();
        names.iter().filter_map(|name| ends.joint(name)).collect()
    };
    let best = |of: &str, joints: Option<&[&str]>| {
        let fits = |pattern: &&String| {
            let found = joints_of(pattern);
            joints.map_or(found.len() > 1, |joints| joints.iter().all(|one| found.contains(one)))
        };
        let scored = patterns.iter().filter(|pattern| guess::score(of, pattern) >= MIN_SCORE);
        let scored = scored.filter(|pattern| guess::quantity(pattern) == Some(of)).filter(fits);
        scored.max_by_key(|pattern| guess::score(of, pattern)).cloned()
    };
    let torque = best("torque_nm", None)?;
    let mut joints = joints_of(&torque);
    let motions = ["velocity_rad_s", "position_rad", "acceleration_rad_s2"];
    joints.retain(|joint| {
        let one = [*joint];
        motions[..2].iter().any(|motion| best(motion, Some(&one)).is_some())
    });
    let mut pairs = vec![("torque_nm", torque)];
    for motion in motions {
        pairs.extend(best(motion, Some(&joints)).map(|pattern| (motion, pattern)));
    }
    let moves = pairs.iter().any(|(ours, _)| motions[..2].contains(ours));
    let is_contract = names.iter().any(|name| {
        let quantity = Quantity::parse(name).map(|(quantity, _)| quantity);
        matches!(quantity, Some(Quantity::Torque | Quantity::Velocity | Quantity::Position))
    });
    (joints.len() > 1 && moves && !is_contract)
        .then(|| SuggestedMap { pairs, joints: joints.into_iter().map(str::to_owned).collect() })
}

/// Returns the names with each of their numbers and words in turn replaced by the sign, without repetition.
fn patterns(names: &[&str]) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for name in names {
        let mut start = None;
        let chars: Vec<(usize, char)> = name.char_indices().chain([(name.len(), '_')]).collect();
        for (place, (at, c)) in chars.iter().enumerate() {
            let differs = place > 0 && chars[place - 1].1.is_ascii_digit() != c.is_ascii_digit();
            if let Some(begin) = start
                && (!c.is_alphanumeric() || differs)
            {
                let pattern = format!("{}{PLACE}{}", &name[..begin], &name[*at..]);
                if !found.contains(&pattern) {
                    found.push(pattern);
                }
                start = None;
            }
            if start.is_none() && c.is_alphanumeric() {
                start = Some(*at);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(names: &str) -> Option<(String, String)> {
        let names: Vec<&str> = names.split(',').collect();
        let found = suggested_map(&names)?;
        let pairs = found.pairs.iter().map(|(ours, theirs)| format!("{ours}={theirs}"));
        Some((pairs.collect::<Vec<_>>().join(","), found.joints.join(" ")))
    }

    #[test]
    fn suggested_map_with_joints_in_any_place_of_the_name() {
        let numbers = map("t,q_1,dq_1,tau_1,q_2,dq_2,tau_2").unwrap();
        assert_eq!(numbers.0, "torque_nm=tau_#,velocity_rad_s=dq_#,position_rad=q_#");
        assert_eq!(numbers.1, "1 2");
        let inside = map(
            "t,arm_1_joint_velocity,arm_1_joint_effort,arm_2_joint_velocity,arm_2_joint_effort",
        );
        assert_eq!(
            inside.unwrap().0,
            "torque_nm=arm_#_joint_effort,velocity_rad_s=arm_#_joint_velocity"
        );
        let words = map("t,hip_pos,hip_torque,knee_pos,knee_torque,knee_note").unwrap();
        assert_eq!(words.0, "torque_nm=#_torque,position_rad=#_pos");
        assert_eq!(words.1, "hip knee");
    }

    #[test]
    fn suggested_map_with_one_joint_or_targets_only_is_none() {
        assert_eq!(map("t,q_1,dq_1,tau_1"), None);
        assert_eq!(map("t,position,position_des,torque"), None);
        assert_eq!(map("t,tau_1,tau_2,temperature_1"), None);
    }

    #[test]
    fn joint_map_with_units_and_colons_finds_the_joints() {
        let names = ["t", "/j1/tau:raw", "/j2/tau:raw", "v1", "v2", "v3", "i1", "i2"];
        let names: Vec<String> = names.map(String::from).into();
        let pairs = [("torque_nm", "/j#/tau:raw:mNm"), ("velocity_rad_s", "v#"), ("time_s", "t")];
        let pairs: Vec<(String, String)> = pairs.map(|(a, b)| (a.into(), b.into())).into();
        let found = JointMap::find(&names, &pairs).unwrap();
        assert_eq!(found.joints, ["1", "2"]);
        let second = found.pairs_of("2");
        assert_eq!(second[0].1, "/j2/tau:raw:mNm");
        assert_eq!(second[2].1, "t");
        let motion = found.other_motion("v1", "1").expect("a motion");
        crate::message::check("headers", "motion of a joint", &motion, &["velocity", "1"]);
        assert_eq!(found.other_motion("/j1/tau:raw", "1"), None);
        assert!(found.is_of("i1", "1", "2", &names) && !found.is_of("t", "1", "2", &names));
    }
}
