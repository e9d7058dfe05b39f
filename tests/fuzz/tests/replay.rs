//! Every target executes its seeds and a fixed number of changed ones. All runs execute equal inputs.
//!
//! An input that breaks a target is written to `found/NAME` in the folder of temporary files of the build, and its path is
//! printed. Put it into `tests/fuzz/seeds/NAME` when the cause is mended.

use compensator_core::record;
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use fuzz::Target;
use fuzz::mutation::Mutator;
use std::path::{Path, PathBuf};

const SEED: u64 = 42;

/// Targets whose corpus has no files: the program emits their formats, or any bytes are steps.
const WITHOUT_FILES: [&str; 3] = ["driver", "record", "sdo"];

/// Returns the seeds of a target with their content, ordered by name.
fn seeds(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    if WITHOUT_FILES.contains(&name) {
        return Vec::new();
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds").join(name);
    let files = std::fs::read_dir(&folder);
    let files = files.unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = files.map(|file| file.expect("readable").path()).collect();
    files.sort();
    let content = |file: &PathBuf| std::fs::read(file).expect("readable");
    files.iter().map(|file| (file.clone(), content(file))).collect()
}

/// Keeps an input that breaks its target.
struct Executed<'a>(&'static str, &'a [u8]);

impl Drop for Executed<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("found");
            let file = folder.join(self.0);
            let written =
                std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, self.1));
            println!("{}: broken by {} ({written:?})", self.0, file.display());
        }
    }
}

/// Returns the seeds that the program itself emits, for formats with checksums.
fn emitted(name: &str) -> Vec<Vec<u8>> {
    let set = ParameterSet::default();
    match name {
        "record" => vec![
            record::emit(&set.friction).to_vec(),
            set.emit().to_vec(),
            emit_block(&NodeSettings::default(), &set).to_vec(),
        ],
        _ => Vec::new(),
    }
}

fn execute(target: &Target, input: &[u8]) {
    let _executed = Executed(target.name, input);
    (target.run)(input);
}

/// Executes the seeds of a target and `runs` changed inputs.
fn replay(name: &str, runs: usize) {
    let target = Target::find(name).expect("a target");
    let seeds = seeds(name);
    for (file, seed) in &seeds {
        println!("{}", file.display());
        execute(target, seed);
    }
    let mut corpus: Vec<Vec<u8>> = seeds.into_iter().map(|(_, seed)| seed).collect();
    corpus.extend(emitted(name));
    let mut mutator = Mutator::new(&corpus, target.longest, SEED);
    for _ in 0..runs {
        execute(target, &mutator.input());
    }
}

/// One test a target, with the number of its changed inputs: what two seconds of a processor are enough for.
macro_rules! replay {
    ($($name:ident $runs:literal)*) => {
        $(
            #[test]
            fn $name() {
                replay(stringify!($name), $runs);
            }
        )*

        #[test]
        fn every_target_is_replayed() {
            let replayed = [$(stringify!($name)),*];
            let targets: Vec<&str> = fuzz::TARGETS.iter().map(|target| target.name).collect();
            assert_eq!(replayed.as_slice(), targets);
        }
    };
}

replay! {
    candump 30000
    csv 6000
    driver 4000
    dry_side 2000
    package 40000
    params 40000
    program 1500
    program_flash 6000
    record 40000
    scope 20000
    sdo 30000
    slcan 100000
}
