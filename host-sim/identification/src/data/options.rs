//! Options for reading logs.

/// How files are read.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Pairs of contract name and column name. The latter may be followed by a unit (`dq_3:deg/s`), and by the element
    /// of a list (`velocity[2]`).
    pub columns: Vec<(String, String)>,
    /// Row selection: only rows in which each of these columns holds one of its values are read.
    pub only: Vec<(String, Vec<String>)>,
    /// Number of samples to drop at the start of each run.
    pub skip: usize,
}
