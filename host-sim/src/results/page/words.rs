//! The page's title and the texts beside its charts and tables.

use super::View;
use friction_identification::data::{JointKind, Part};
use friction_identification::number::{count, significant};

/// Above the parameter tables.
pub(in crate::results) const PARAMETERS: &str = "A value is given with one standard error. Only a parameter that is \"determined\" says \
     something about the machine; the others are numbers with which the model predicts as it does, \
     and others would do as well. The best model comes first.";

/// The page's title: the files, and the model if it is one.
pub(in crate::results) fn title(view: &View) -> String {
    let files = &view.study.data.files;
    let name = |file: &std::path::PathBuf| {
        file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
    };
    let on = listed(&files.iter().map(name).collect::<Vec<_>>(), 3);
    let of = match view.study.fits {
        [one] => format!("Friction model {}", one.spec),
        _ => "Friction models".to_owned(),
    };
    if on.is_empty() { of } else { format!("{of} on {on}") }
}

/// What was logged, and how much of it.
pub(in crate::results) fn logged(view: &View) -> String {
    let data = view.study.data;
    let joint = match data.joint {
        JointKind::Revolute => "Revolute joint (torque in Nm",
        JointKind::Prismatic => "Prismatic joint (force in N",
    };
    // A renamed column may be in any unit; whoever reads the page must know.
    let renamed = view.study.columns.iter().filter_map(|pair| pair.split_once('='));
    let mut renamed = renamed.map(|(ours, theirs)| (ours.trim(), theirs.trim()));
    let target = renamed.rfind(|(ours, _)| ["torque_nm", "force_n"].contains(ours));
    let source = target.map_or("as logged".to_owned(), |(_, theirs)| format!("logged as {theirs}"));
    format!(
        "{joint}, {source}). {} rows in {}.",
        count(data.rows as u64),
        counted(data.runs.len(), "run")
    )
}

/// The same, and what was held out.
pub(in crate::results) fn subtitle(view: &View) -> String {
    let (data, split) = (view.study.data, view.study.split);
    let held: usize = split.test.iter().map(|part| part.rows.len()).sum();
    let (fitted, held_runs) = (split.train_runs(data), split.test_runs(data));
    let is_tail = |part: &Part| part.rows.start > 0 && part.rows.end == data.runs[part.run].len();
    let what = match held_runs.iter().any(|run| fitted.contains(run)) {
        true if split.test.iter().all(is_tail) => "the end of ",
        true => "stretches of ",
        false => "",
    };
    format!(
        "{} Held out, {} rows: {what}{} {}.",
        logged(view),
        count(held as u64),
        if held_runs.len() == 1 { "run" } else { "runs" },
        listed(&held_runs, fitting(&held_runs))
    )
}

/// Above the clouds.
pub(in crate::results) fn over_velocity(view: &View) -> String {
    let all = view.study.fits.len();
    let which = match all {
        1 => String::new(),
        _ if view.shown_and_rest().1.is_empty() => String::new(),
        _ => format!(
            " Shown are the best three{}.",
            if view.ranking[..super::SHOWN].contains(&view.simplest) {
                String::new()
            } else {
                format!(" and {}, the simplest", view.name(view.simplest))
            }
        ),
    };
    format!(
        "All rows here are held out: no fit has seen them. Each model is driven by the logged motion \
         and never by the logged {0}, except that what bristles hold where a stretch begins at rest \
         is taken from that stretch.{which} Clouds are thinned in proportion to their density, with \
         every outlying place kept.",
        view.torque()
    )
}

/// Above the residuals.
pub(in crate::results) fn left_over(view: &View) -> String {
    let starts = &view.held_out.starts;
    let start = |(run, time): &(String, f64)| format!("{run} from {} s", significant(*time, 3));
    let order = match starts.len() {
        0 | 1 => String::new(),
        _ => {
            let all: Vec<String> = starts.iter().map(start).collect();
            let all = listed(&all, fitting(&all));
            format!(" Held-out stretches stand one after another (run {all}).")
        }
    };
    format!(
        "The residual is the logged minus the simulated {}; all charts have the same axis. Noise is a \
         band of even height, and whatever has a shape is something the model lacks.{order} Thinned \
         curves keep the lowest and the highest value of each stretch of rows.",
        view.torque()
    )
}

/// What a reader should know of the data.
pub(in crate::results) fn data(view: &View) -> Vec<String> {
    let mut said = sources(view);
    let covariates = &view.study.data.covariates;
    if !covariates.is_empty() {
        let names = listed(covariates, 12);
        said.push(format!("Read, but used by no model here: {names}."));
    }
    said
}

/// The same without what the models use of it.
pub(in crate::results) fn sources(view: &View) -> Vec<String> {
    let study = &view.study;
    let data = study.data;
    let mut said = vec![match data.bad_rows.count {
        0 => format!("Of {} rows none was left out.", count(data.rows_read as u64)),
        bad => format!(
            "Of {} rows {} could not be believed and were left out.",
            count(data.rows_read as u64),
            count(bad as u64)
        ),
    }];
    said.extend(data.bad_rows.first.iter().map(|cell| format!("Left out: {cell}.")));
    if study.skip > 0 {
        said.push(format!("The first {} rows of each run were dropped.", count(study.skip as u64)));
    }
    if study.test.decimate > 1 {
        said.push(format!(
            "Residuals are judged at one row in {}, after an anti-aliasing filter; the simulation \
             runs at the full rate.",
            study.test.decimate
        ));
    }
    if !study.columns.is_empty() {
        said.push(format!(
            "Columns are read as --columns says ({}); values are in the units of the names on the left.",
            study.columns.join(", ")
        ));
    }
    let rigid = study.fits.iter().flat_map(|fit| &fit.spec.rigid_body);
    let mut rigid: Vec<&str> = rigid.map(|term| term.name()).collect();
    rigid.sort_unstable();
    rigid.dedup();
    if !rigid.is_empty() {
        said.push(format!(
            "The {} is not friction alone; every model also carries {}.",
            view.torque(),
            listed(&rigid, 8)
        ));
    }
    let left_out = data.left_out_columns.iter();
    said.extend(
        left_out.map(|column| format!("Column {} was left out: {}.", column.name, column.why)),
    );
    said.extend(data.notes.iter().cloned());
    said
}

/// How many of these names a sentence can bear: eight, fewer if they are long.
fn fitting(names: &[String]) -> usize {
    const CHARACTERS: usize = 120;
    let mut length = 0;
    let bearable = |name: &&String| {
        length += name.chars().count() + 2;
        length <= CHARACTERS
    };
    names.iter().take(8).take_while(bearable).count().max(1)
}

/// A number with its unit, not to be torn apart at the end of a line.
pub(in crate::results) fn quantity(value: f64, unit: &str) -> String {
    format!("{}\u{a0}{unit}", significant(value, 3))
}

/// "1 run", "2 runs".
pub(in crate::results) fn counted(number: usize, thing: &str) -> String {
    format!("{} {thing}{}", count(number as u64), if number == 1 { "" } else { "s" })
}

/// Names in a sentence; of many the first and how many more there are.
pub(in crate::results) fn listed<S: AsRef<str>>(names: &[S], most: usize) -> String {
    let shown: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    match (names.len().saturating_sub(most), shown.as_slice()) {
        (0, [first @ .., last]) if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        (0, _) => shown.join(", "),
        (more, _) => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_as_in_a_sentence() {
        assert_eq!(listed::<&str>(&[], 3), "");
        assert_eq!(listed(&["a"], 3), "a");
        assert_eq!(listed(&["a", "b", "c"], 3), "a, b and c");
        assert_eq!(listed(&["a", "b", "c", "d"], 2), "a, b and 2 more");
    }
}
