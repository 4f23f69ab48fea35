//! The `epsplat` program: see `epsplat --help`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    hush_wayland();
    cli::run()
}

/// Sets `XDG_RUNTIME_DIR` if it is unset, to silence Mesa's drivers on machines without a display.
///
/// Mesa looks for a Wayland server there, and without the variable prints "error: XDG_RUNTIME_DIR
/// is invalid" at every run. In any folder without a server it finds none and prints nothing.
fn hush_wayland() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: writing the environment races only with other threads that read it. This is the
        // first statement of `main`: no other thread exists.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir());
        }
    }
}
