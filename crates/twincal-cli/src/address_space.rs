//! A small address space (`ulimit -v`): what the C library reserves of it, and what an end of it is called.

use crate::failure::INPUT;
use signal_hook::{consts, flag};
use std::os::unix::process::CommandExt as _;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use twincal_io::memory;

/// Asks glibc for one heap instead of one per thread.
const ONE_HEAP: &str = "MALLOC_ARENA_MAX";
/// What glibc may reserve for the heap of a thread, twice, bytes: beyond that for every thread there is room for all.
const HEAP: u64 = 256 << 20;

/// With a limit an allocation can fail, which the standard library answers with its number and SIGABRT: wrong input (2) then
/// rather than a crash. Where heaps that are only reserved would take the limit, the program starts itself again with one.
pub(crate) fn prepare() {
    let Some(limit) = memory::address_space_limit() else {
        return;
    };
    let code = i32::from(INPUT);
    // Where a handler cannot be installed the system's own reaction stays.
    let _ =
        flag::register_conditional_shutdown(consts::SIGABRT, code, Arc::new(AtomicBool::new(true)));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    if limit / HEAP > threads || std::env::var_os(ONE_HEAP).is_some() {
        return;
    }
    let mut arguments = std::env::args_os();
    if let (Some(name), Ok(program)) = (arguments.next(), std::env::current_exe()) {
        // Returns only where it cannot: then as many heaps as there are.
        let _ = Command::new(program)
            .arg0(name)
            .args(arguments)
            .env(ONE_HEAP, "1")
            .exec();
    }
}
