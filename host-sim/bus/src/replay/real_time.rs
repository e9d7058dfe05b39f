//! Kernel settings for sending frames on time.
//!
//! By default, Linux delays the timers of a thread by up to 50 us to combine wake-ups. It also schedules threads in turn:
//! on a busy processor, the driver that a frame wakes may run before the next frame is sent. Every user may set precise
//! timers. A higher priority needs root, or `nice` in `limits.conf`. Without it the replay continues, and its report
//! says so. The replay sleeps between frames, so other threads still run.

/// Nice value of the highest priority below real time.
const HIGHEST_PRIORITY_NICE: i32 = -20;

/// Requests precise timers and priority for this thread. Returns true if the priority was granted.
#[cfg(target_os = "linux")]
pub fn request_real_time() -> bool {
    // 1 ns is effectively no slack; 0 would select the default.
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    rustix::process::setpriority_process(None, HIGHEST_PRIORITY_NICE).is_ok()
}

/// Does nothing on other systems. Returns false.
#[cfg(not(target_os = "linux"))]
pub fn request_real_time() -> bool {
    false
}
