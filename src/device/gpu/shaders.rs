//! The kernels' texts: each is its parts joined; module scope in WGSL needs no order.

macro_rules! part {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name))
    };
}

/// How a kernel has a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It only reads it.
    Read,
    /// It writes to it.
    Write,
}

use Access::{Read, Write};

/// The bindings of kernels that trace, from 0 on: all of group 0.
pub const TRACE_BINDINGS: [Access; 16] =
    [Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Read, Write, Write, Write];
/// The bindings of kernels that fit trees, from 0 on: all of group 0.
pub const REFIT_BINDINGS: [Access; 8] = [Read, Read, Read, Write, Write, Write, Write, Read];

/// The constants of kernels that trace which say whether a frame has something.
pub const FLAGS: [&str; 9] = [
    "SINGLE_TREE",
    "HAS_BRANCHES",
    "HAS_TEXTURES",
    "HAS_AREA_LIGHT",
    "HAS_TRANSPARENCY",
    "GOES_ON",
    "HAS_ALBEDO",
    "HAS_ONE_LIGHT",
    "HAS_ONE_RAY",
];
/// The constant of kernels that trace which says how many words a pixel has: 1, 3 or 4.
pub const FILM_WORDS: &str = "FILM_WORDS";
/// The constant of kernels that fit trees which says how many threads a workgroup has: eight for each node.
pub const GROUP: &str = "GROUP";

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

/// Entries of a thread's stack that are in the workgroup's memory: `NEAR` in shaders/parts/traverse.wgsl.
const NEAR: usize = 2;
/// Numbers of further entries for which there are kernels: of their own memory threads clear all before they begin, which for
/// the largest takes as long as a tenth of tracing. The last is enough for all trees.
pub const FARS: [u32; 4] = [6, 12, 24, 48];

/// The least of [`FARS`] for rays through trees of so many levels, below a top level of so many (0: there is none). A ray leaves
/// one group of children for each level that it goes down; where an object is entered, its siblings and what stands in the
/// same leaves wait, too.
pub fn far(levels: usize, top_levels: usize) -> u32 {
    let entries = levels.saturating_sub(1) + if top_levels > 0 { top_levels + 1 } else { 0 };
    let far = entries.saturating_sub(NEAR) as u32;
    FARS.into_iter().find(|f| *f >= far).unwrap_or(FARS[FARS.len() - 1])
}

/// The kernel that traces a picture, with so many further entries of stacks.
pub fn trace(far: u32) -> String {
    with_far(&joined(TRACING, part!("trace.wgsl")), far)
}

fn with_far(text: &str, far: u32) -> String {
    text.replace("const FAR: u32 = 48u;", &format!("const FAR: u32 = {far}u;"))
}

/// The kernel that makes auxiliary pictures of the rays through pixels' centres.
pub fn center(far: u32) -> String {
    with_far(&joined(TRACING, part!("center.wgsl")), far)
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
