//! Each GPU keeps what every device promises. Without one the tests are left out and say so; with `RENTIX_REQUIRE_GPU=1`
//! they fail.

use rentix::device::conformance;
use rentix::device::gpu::{Adapter, GpuDevice, adapters};

/// The adapters that can be used.
fn usable() -> Vec<Adapter> {
    let usable: Vec<Adapter> = adapters().into_iter().filter(|a| a.lacks().is_none()).collect();
    let is_required = std::env::var_os("RENTIX_REQUIRE_GPU").is_some_and(|v| v == "1");
    assert!(!usable.is_empty() || !is_required, "RENTIX_REQUIRE_GPU=1, but no adapter can be used");
    if usable.is_empty() {
        eprintln!("left out: no adapter can be used");
    }
    usable
}

#[test]
fn every_gpu_conforms() {
    for adapter in usable() {
        conformance::check(&mut |budget| {
            Box::new(GpuDevice::new(&adapter, 2, budget).expect("the adapter lacks nothing"))
        });
    }
}
