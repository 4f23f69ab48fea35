//! The command line; see `epsplat --help`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    hush_wayland();
    cli::run()
}

/// Without a display there often is no `XDG_RUNTIME_DIR`, and then Mesa's drivers, which look for a Wayland server, print
/// "error: XDG_RUNTIME_DIR is invalid" over every run. In any folder without a server they find none and say nothing.
fn hush_wayland() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: writing the environment races only with other threads that read it. This is the first statement of
        // `main`: no other thread exists.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir());
        }
    }
}
