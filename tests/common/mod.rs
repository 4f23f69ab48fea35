//! What the kernels' tests share: the adapter, all needs, seeded numbers, scenes, and the derived error bounds.

#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use epsplat::gpu::Gpu;

/// The adapter, or `None` with a line on stderr where there is none and none is required.
pub fn gpu() -> Option<Gpu> {
    match Gpu::open(std::env::var("EPSPLAT_TEST_ADAPTER").ok().as_deref()) {
        Ok(gpu) => Some(gpu),
        Err(error) if std::env::var("EPSPLAT_REQUIRE_ADAPTER").is_ok_and(|v| v == "1") => {
            panic!("EPSPLAT_REQUIRE_ADAPTER=1, but {error}")
        }
        Err(_) => {
            eprintln!("skipped: no adapter");
            None
        }
    }
}
