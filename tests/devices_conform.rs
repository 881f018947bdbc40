//! All devices pass one suite.

use rentix::accel::Width;
use rentix::device::conformance;
use rentix::device::cpu::CpuDevice;
use rentix::device::fake::FakeDevice;

#[test]
fn the_cpu_with_any_number_of_threads() {
    for threads in 1..=3 {
        conformance::check(&mut |budget| Box::new(CpuDevice::new(threads, budget).unwrap()));
    }
}

#[test]
fn the_cpu_in_any_simd_width() {
    for &width in Width::available() {
        conformance::check(&mut |budget| Box::new(CpuDevice::new(1, budget).unwrap().with_width(width)));
    }
}

#[test]
fn threads_and_widths_do_not_show() {
    let cpu = |threads, width| CpuDevice::new(threads, 1 << 24).unwrap().with_width(width);
    for threads in 1..=3 {
        for &width in Width::available() {
            conformance::check_same_pictures(&mut cpu(1, Width::detect()), &mut cpu(threads, width));
        }
    }
}

#[test]
fn the_fake_device() {
    conformance::check(&mut |budget| Box::new(FakeDevice::new("fake", budget)));
}
