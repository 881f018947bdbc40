//! The kernels' texts: each is its parts joined; module scope in WGSL needs no order.

macro_rules! part {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name))
    };
}

/// What kernels that trace have in common.
const TRACING: &[&str] = &[
    part!("parts/exact.wgsl"),
    part!("parts/scene.wgsl"),
    part!("parts/slab.wgsl"),
    part!("parts/triangle.wgsl"),
    part!("parts/placement.wgsl"),
    part!("parts/traverse.wgsl"),
    part!("parts/math.wgsl"),
    part!("parts/power.wgsl"),
    part!("parts/counts.wgsl"),
    part!("parts/origin.wgsl"),
    part!("parts/camera.wgsl"),
    part!("parts/sampler.wgsl"),
    part!("parts/light.wgsl"),
    part!("parts/material.wgsl"),
    part!("parts/optics.wgsl"),
    part!("parts/shade.wgsl"),
    part!("parts/media.wgsl"),
    part!("parts/texture.wgsl"),
    part!("parts/maps.wgsl"),
    part!("parts/environment.wgsl"),
    part!("parts/world.wgsl"),
    part!("parts/emitter.wgsl"),
    part!("parts/direct.wgsl"),
    part!("parts/path.wgsl"),
    part!("parts/branch.wgsl"),
];

/// The kernel that traces a picture.
pub fn trace() -> String {
    joined(TRACING, part!("trace.wgsl"))
}

/// The kernel that makes auxiliary pictures of the rays through pixels' centres.
pub fn center() -> String {
    joined(TRACING, part!("center.wgsl"))
}

/// The kernel that fits trees.
pub fn refit() -> String {
    joined(&[part!("parts/exact.wgsl"), part!("parts/slab.wgsl")], part!("refit.wgsl"))
}

fn joined(parts: &[&str], kernel: &str) -> String {
    let mut text = parts.join("\n");
    text.push('\n');
    text.push_str(kernel);
    text
}
