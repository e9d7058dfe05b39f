//! Which joints and campaigns a folder holds.
//!
//! | path below the folder | joint | campaign |
//! |---|---|---|
//! | `joint=knee/campaign=2026-03-01/a.csv` | `knee` | `2026-03-01` |
//! | `knee/2026-03-01/a.csv` | `knee` | `2026-03-01` |
//! | `knee/2026-03-01.csv` | `knee` | `2026-03-01` |
//! | `knee.csv` | `knee` | none |
//!
//! Below `joint=knee/`, the other folders are the campaign if none is named `campaign=`. Several forms in one folder are read
//! each as it is, and reported ([`mixed_forms`]).
//!
//! `joint=knee/trend.json`, `knee/trend.json` and `knee.trend.json`, or `.csv`, are the trend of a joint's learnt level
//! ([`find_trends`]), and no log.
//!
//! Files of the same joint and campaign are one log of several runs. Each file is read with its own header: the columns of one
//! file never stand for those of another.

use super::{FleetError, LOG_ENDS};
use crate::ResultError;
use crate::level_trend::FILE_ENDS;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// The log of one joint and campaign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetJob {
    /// Name of the joint.
    pub joint: String,
    /// Name of the campaign; empty if the folder has none.
    pub campaign: String,
    /// Log files, in the order of their names.
    pub files: Vec<PathBuf>,
    /// Where the files come from if they are copies, in the same order, for results and messages; else empty.
    pub addresses: Vec<String>,
}

/// Finds the logs below a folder. Hidden files, and files of other types, are ignored. `out`, the folder of the results, may
/// lie below it.
///
/// # Errors
/// One line, if a folder cannot be read or contains no log.
pub fn find_jobs(root: &Path, out: &Path) -> Result<Vec<FleetJob>, FleetError> {
    let mut files = Vec::new();
    walk(root, &out.canonicalize().unwrap_or_else(|_| out.to_owned()), &mut files)?;
    jobs_of_files(root, files)
}

/// Groups files by joint and campaign. Hidden files, and files of other types, are ignored. No file is opened, so the paths
/// may be those of an object store.
///
/// # Errors
/// One line, if none of the files is a log.
pub fn jobs_of_files(
    root: &Path,
    files: impl IntoIterator<Item = PathBuf>,
) -> Result<Vec<FleetJob>, FleetError> {
    let mut jobs: BTreeMap<(String, String), Vec<PathBuf>> = BTreeMap::new();
    let mut has_trend = false;
    for file in files {
        has_trend |= is_trend(root, &file);
        if is_log(root, &file) {
            jobs.entry(names(root, &file)).or_default().push(file);
        }
    }
    if jobs.is_empty() && !has_trend {
        return Err(FleetError::NoLog(root.to_owned()));
    }
    let job = |((joint, campaign), files)| {
        let addresses = Vec::new();
        FleetJob { joint, campaign, files, addresses }
    };
    Ok(jobs.into_iter().map(job).collect())
}

/// Returns the trends of learnt levels below a folder, with the names of their joints. `out`, the folder of the results, may
/// lie below it.
///
/// # Errors
/// One line, if a folder cannot be read.
pub fn find_trends(root: &Path, out: &Path) -> Result<Vec<(String, PathBuf)>, FleetError> {
    let mut files = Vec::new();
    walk(root, &out.canonicalize().unwrap_or_else(|_| out.to_owned()), &mut files)?;
    let trends = files.into_iter().filter(|file| is_trend(root, file));
    Ok(trends.map(|file| (trend_joint(root, &file), file)).collect())
}

/// Returns true if a file's name is that of a trend, and no part of its path below `root` is hidden.
fn is_trend(root: &Path, file: &Path) -> bool {
    let name = lower_name(file);
    let is_named = |end: &str| name == end || name.ends_with(&format!(".{end}"));
    !is_hidden(root, file) && FILE_ENDS.iter().any(|end| is_named(end))
}

/// Returns the name of the joint of a trend: that of its folder, or the begin of its own name.
fn trend_joint(root: &Path, file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let begin = FILE_ENDS.iter().find_map(|end| {
        let start = name.len().checked_sub(end.len() + 1)?;
        name.get(..start).filter(|_| name.to_lowercase().ends_with(&format!(".{end}")))
    });
    let folders = folders(root, file);
    let keyed = folders.iter().find_map(|name| name.strip_prefix("joint=").map(str::to_owned));
    let in_folder = keyed.or_else(|| folders.first().cloned());
    in_folder.or_else(|| begin.map(str::to_owned)).unwrap_or_else(|| folder_name(root))
}

fn folder_name(folder: &Path) -> String {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn lower_name(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Returns true if a part of a file's path below `root` is hidden.
fn is_hidden(root: &Path, file: &Path) -> bool {
    let below = file.strip_prefix(root).unwrap_or(file);
    below.components().any(|part| part.as_os_str().to_string_lossy().starts_with('.'))
}

/// Returns true if a file's name has the end of a log, and no part of its path below `root` is hidden.
fn is_log(root: &Path, file: &Path) -> bool {
    let name = lower_name(file);
    let has_end = LOG_ENDS.iter().any(|end| name.ends_with(end));
    has_end && !is_hidden(root, file) && !is_trend(root, file)
}

fn walk(folder: &Path, out: &Path, files: &mut Vec<PathBuf>) -> Result<(), FleetError> {
    let failed = ResultError::of_file(folder);
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(&failed)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(failed)?;
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        if name.starts_with('.') || path.canonicalize().is_ok_and(|path| path == out) {
            continue;
        }
        if path.is_dir() {
            walk(&path, out, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

/// Returns a line if the paths of the logs have several of the forms above, so that a wrong one is seen.
pub fn mixed_forms(root: &Path, jobs: &[FleetJob]) -> Option<String> {
    let mut forms: BTreeMap<&str, Vec<&Path>> = BTreeMap::new();
    for file in jobs.iter().flat_map(|job| &job.files) {
        let below = file.strip_prefix(root).unwrap_or(file);
        forms.entry(form(&folders(root, file))).or_default().push(below);
    }
    let each = forms.iter().map(|(form, files)| {
        let count =
            if files.len() == 1 { "1 file".into() } else { format!("{} files", files.len()) };
        format!("{form} ({count}, such as {})", files[0].display())
    });
    let each: Vec<String> = each.collect();
    (each.len() > 1).then(|| {
        format!("{}: found {} forms of paths: {}", root.display(), each.len(), each.join(", "))
    })
}

/// Returns the form of a path with these folders.
fn form(folders: &[String]) -> &'static str {
    let has = |key: &str| folders.iter().any(|name| name.starts_with(key));
    match (folders.len(), has("joint="), has("campaign=")) {
        (_, true, true) => "joint=JOINT/campaign=CAMPAIGN/FILE",
        (1, true, false) => "joint=JOINT/FILE",
        (_, true, false) => "joint=JOINT/CAMPAIGN/FILE",
        (0, ..) => "JOINT.csv",
        (1, ..) => "JOINT/CAMPAIGN.csv",
        _ => "JOINT/CAMPAIGN/FILE",
    }
}

/// Returns the folders between the root and a file.
fn folders(root: &Path, file: &Path) -> Vec<String> {
    let below = file.strip_prefix(root).unwrap_or(file);
    let folders =
        below.parent().into_iter().flat_map(Path::components).filter_map(|part| match part {
            Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        });
    folders.collect()
}

/// Returns the names of joint and campaign of a file.
fn names(root: &Path, file: &Path) -> (String, String) {
    let folders = folders(root, file);
    let keyed = |key: &str| {
        let start = format!("{key}=");
        folders.iter().find_map(|name| name.strip_prefix(&start).map(str::to_owned))
    };
    let stem = file_stem(file);
    if let Some(joint) = keyed("joint") {
        let is_name = |name: &&String| !name.starts_with("joint=");
        let others: Vec<String> = folders.iter().filter(is_name).cloned().collect();
        return (joint, keyed("campaign").unwrap_or_else(|| others.join("/")));
    }
    match folders.as_slice() {
        [] => (stem, String::new()),
        [joint] => (joint.clone(), stem),
        [joint, rest @ ..] => (joint.clone(), rest.join("/")),
    }
}

/// Returns the name of a file without the ends of a log: `a` for `a.csv.gz`.
fn file_stem(file: &Path) -> String {
    let mut name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    while let Some(end) = LOG_ENDS.iter().find(|end| name.to_lowercase().ends_with(**end)) {
        name.truncate(name.len() - end.len());
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot;

    #[test]
    fn find_jobs_reads_joint_and_campaign_from_paths() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for file in [
            "joint=hip/campaign=2026-03-01/b.csv",
            "joint=hip/campaign=2026-03-01/a.parquet",
            "joint=hip/campaign=2026-03-01/.hidden.csv",
            "joint=hip/notes.md",
            "knee/1/x.csv",
            "knee/2.csv.gz",
            "wrist.csv",
            "joint=elbow/3/a.csv",
            "out/joint=hip/rows.parquet",
        ] {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let jobs = find_jobs(root, &root.join("out")).unwrap();
        let found: Vec<(&str, &str, usize)> =
            jobs.iter().map(|job| (&*job.joint, &*job.campaign, job.files.len())).collect();
        assert_eq!(
            found,
            [
                ("elbow", "3", 1),
                ("hip", "2026-03-01", 2),
                ("knee", "1", 1),
                ("knee", "2", 1),
                ("wrist", "", 1)
            ]
        );
        let line = mixed_forms(root, &jobs).unwrap();
        assert!(line.contains("5 ") && line.contains("wrist.csv), "), "{line}");
        snapshot::check("fleet", "paths of several forms", &line);
        let wrist = &jobs[4..];
        assert_eq!(mixed_forms(root, wrist), None);
        let error =
            find_jobs(&root.join("out/joint=hip"), &root.join("out/joint=hip/rows.parquet"));
        assert!(error.unwrap_err().to_string().contains("joint=hip"));
    }

    #[test]
    fn jobs_of_files_with_addresses_ignores_hidden_and_other_files() {
        let root = Path::new("bucket/fleet");
        let files = ["hip/1.csv", "hip/.unfinished-1/rows.parquet", "hip/notes.md", "knee/1/a.csv"];
        let jobs = jobs_of_files(root, files.map(|file| root.join(file))).unwrap();
        let found: Vec<(&str, &str)> =
            jobs.iter().map(|job| (&*job.joint, &*job.campaign)).collect();
        assert_eq!(found, [("hip", "1"), ("knee", "1")]);
        let error = jobs_of_files(root, [root.join("notes.md")]).unwrap_err().to_string();
        assert!(error.starts_with("bucket/fleet: "), "{error}");
        snapshot::check("fleet", "a folder without a log", &error);
    }
}
