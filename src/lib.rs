//! rentix: a headless ray tracer for animation sequences.
//!
//! A frame flows downwards through these rooms; a room uses rooms below it in this list, never above
//! (`tests/architecture.rs` holds the table):
//!
//! | room | what it is for |
//! | --- | --- |
//! | [`cli`] | what was typed, what it means, a call below; the only room that prints |
//! | [`watch`] | the daemon: inbox, settling, archives, jobs' states, journal, status page, notification |
//! | [`mod@bench`] | workloads, timing, peers, charts |
//! | [`run`] | a run: reader, device and writer stages, resume, events, report; warm against cold |
//! | [`schedule`] | frames to devices: estimates, policies, a simulation of them (pure) |
//! | [`device`] | the device trait, the CPU, GPUs (wgpu), the fake device, the conformance suite, the registry |
//! | [`kernel`] | camera rays, materials, lights, sampling: what one ray does |
//! | [`plan`] | what a device must do before it can trace a frame, as a value (pure) |
//! | [`accel`] | bounding volume hierarchies and the canonical hit |
//! | [`diff`] | what changed between two frames (pure) |
//! | [`output`] | encoders, atomic files, the records of finished frames |
//! | [`film`] | film, AOVs, colour, comparison |
//! | [`job`] | what is to be rendered: job file, discovery, cameras and transforms over time |
//! | [`mod@format`] | bytes to values with diagnostics: OBJ, MTL, glTF, textures |
//! | [`store`] | the cache on disk; knows bytes, not scenes |
//! | [`scene`] | frames, parts, meshes, materials, lights, cameras: plain data |
//! | [`math`], [`clock`], [`warning`] | the ground floor |
//!
//! Everything is addressed by its content: a frame is a list of part names (hashes), and a part that a device
//! holds is neither parsed, sent nor built again. A ray's hit is a function of the ray and the triangles alone,
//! never of the tree, so that a warm picture is the cold one, byte for byte.

pub mod accel;
pub mod bench;
pub mod cli;
pub mod clock;
pub mod device;
pub mod diff;
pub mod film;
pub mod format;
pub mod job;
pub mod kernel;
pub mod math;
pub mod output;
pub mod plan;
pub mod run;
pub mod scene;
pub mod schedule;
pub mod store;
pub mod warning;
pub mod watch;
