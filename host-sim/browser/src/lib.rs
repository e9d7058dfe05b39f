//! The diagnosis of a log as a WebAssembly module. `page/worker.js` calls it in a worker thread of a browser.
//!
//! The interface is numbers only, so the page needs no generated code:
//!
//! 1. For each input, `reserve` returns a place in memory, into which the caller writes bytes (`Part`).
//! 2. `add_file` ends a file. It takes the name and the content that were written last.
//! 3. `diagnose` returns 0, or 1 if the log is refused. `result` and `result_length` then give each output.
//!
//! The module imports a clock (`now_ms`) and two receivers of text (`report_stage`, `report_failure`) from `host`. Other
//! imports come from libraries that support browsers in other ways. The diagnosis does not call them.
#![cfg(target_family = "wasm")]
#![expect(
    unsafe_code,
    reason = "imports and exported names of a module count as unsafe; no memory is accessed by address"
)]

mod diagnosis;

use diagnosis::{Answer, Request};
use friction_fit::clock;
use joint_log::FileContent;
use std::cell::RefCell;

#[link(wasm_import_module = "host")]
unsafe extern "C" {
    /// Returns milliseconds since the start of 1970, UTC.
    safe fn now_ms() -> f64;
    /// Receives the present stage in words, as UTF-8.
    safe fn report_stage(text: *const u8, length: usize);
    /// Receives the message of a panic, as UTF-8. The module ends afterwards.
    safe fn report_failure(text: *const u8, length: usize);
}

/// An input.
enum Part {
    /// Name of a file.
    Name = 0,
    /// Bytes of a file.
    Content = 1,
    /// Columns, in the syntax of `--columns`.
    Columns = 2,
    /// Selection of rows, in the syntax of `--where`; selections are separated by spaces.
    Rows = 3,
}

thread_local! {
    static INPUTS: RefCell<[Vec<u8>; 4]> = const { RefCell::new([const { Vec::new() }; 4]) };
    static FILES: RefCell<Vec<FileContent>> = const { RefCell::new(Vec::new()) };
    static OUTPUTS: RefCell<[String; 4]> = const { RefCell::new([const { String::new() }; 4]) };
}

/// Takes what was written last for an input.
fn take(part: Part) -> Vec<u8> {
    INPUTS.with_borrow_mut(|inputs| std::mem::take(&mut inputs[part as usize]))
}

fn take_text(part: Part) -> String {
    String::from_utf8_lossy(&take(part)).into_owned()
}

/// Returns the address of `length` bytes, into which the caller writes an input (`Part`).
#[unsafe(no_mangle)]
pub extern "C" fn reserve(part: usize, length: usize) -> *mut u8 {
    INPUTS.with_borrow_mut(|inputs| {
        inputs[part] = vec![0; length];
        inputs[part].as_mut_ptr()
    })
}

/// Adds a file to the log.
#[unsafe(no_mangle)]
pub extern "C" fn add_file() {
    let name = take_text(Part::Name).into();
    let bytes = take(Part::Content);
    FILES.with_borrow_mut(|files| files.push(FileContent { name, bytes }));
}

/// Diagnoses the log. Returns 0, or 1 if the log is refused.
#[unsafe(no_mangle)]
pub extern "C" fn diagnose() -> u32 {
    clock::set_source(|| now_ms());
    std::panic::set_hook(Box::new(|panic| {
        let text = panic.to_string();
        report_failure(text.as_ptr(), text.len());
    }));
    let request = Request {
        files: FILES.take(),
        columns: take_text(Part::Columns),
        rows: take_text(Part::Rows),
    };
    let stage = |text: &str| report_stage(text.as_ptr(), text.len());
    let (code, outputs) = match diagnosis::diagnose_log(request, &stage) {
        Ok(Answer { digest, document, parameters, report }) => {
            (0, [digest, document, parameters, report])
        }
        Err(refusal) => (1, [refusal.to_string(), String::new(), String::new(), String::new()]),
    };
    OUTPUTS.set(outputs);
    code
}

/// Returns the address of a result, as UTF-8: 0 is the error line or the digest, 1 `diagnosis.json`, 2 `params.toml`, 3
/// `report.html`. See `Answer`.
#[unsafe(no_mangle)]
pub extern "C" fn result(output: usize) -> *const u8 {
    OUTPUTS.with_borrow(|outputs| outputs[output].as_ptr())
}

/// Returns the length of a [`result`], bytes.
#[unsafe(no_mangle)]
pub extern "C" fn result_length(output: usize) -> usize {
    OUTPUTS.with_borrow(|outputs| outputs[output].len())
}
