//! What the kernel is asked for, so that frames leave in time.
//!
//! Unasked, Linux puts off a thread's timers by up to 50 us to wake once for several, and gives the
//! processor in turns: on a busy machine with one processor, the driver that a frame wakes runs before
//! the next frame is sent. Timers of their own anybody may have. Priority is for root, or for whom
//! `limits.conf` grants `nice`; a replay that gets none goes on without, and its report says so. It sleeps
//! between frames, so nobody starves.

/// Highest priority below real time.
const HIGHEST: i32 = -20;

/// Asks for punctual timers and priority, for this thread; says whether it got priority.
#[cfg(target_os = "linux")]
pub fn request_real_time() -> bool {
    // 1 ns is as good as none; 0 would be the default.
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    rustix::process::setpriority_process(None, HIGHEST).is_ok()
}

/// Asks for nothing, and got none.
#[cfg(not(target_os = "linux"))]
pub fn request_real_time() -> bool {
    false
}
