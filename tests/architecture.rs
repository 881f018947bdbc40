//! The house stands as its plan says: rooms use only rooms below them, and what has one place has no other.

#[path = "architecture/bites.rs"]
mod bites;
#[path = "architecture/rules.rs"]
mod rules;
#[path = "architecture/source.rs"]
mod source;

use std::fs;
use std::path::Path;

use rules::{File, House, OnePlace, Places, check};

const HOUSE: House = House {
    rooms: &[
        "cli", "watch", "bench", "run", "schedule", "device", "kernel", "plan", "accel", "diff", "output",
        "film", "job", "format", "store", "scene",
    ],
    ground: &["math", "clock", "warning"],
    one_place: ONE_PLACE,
    unsafe_files: &[
        "src/accel/lanes.rs",
        "src/accel/traced.rs",
        "src/accel/stack.rs",
        "src/cli/driver.rs",
        "src/device/gpu/adapter.rs",
        "src/device/gpu/cache.rs",
        "src/device/gpu/pipelines.rs",
        "src/format/decimals.rs",
        "src/format/obj/lines.rs",
        "src/format/triple.rs",
        "src/format/wide.rs",
        "src/output/jp2.rs",
    ],
    suites: &["src/device/conformance.rs"],
    longest_file: 500,
};

/// Pure: the same answer for the same arguments, whenever and wherever.
const PURE: &[&str] = &["plan", "diff", "schedule", "kernel", "scene"];

const ONE_PLACE: &[OnePlace] = &[
    OnePlace {
        rule: "only output, store, run and watch write files; bench makes scenes",
        names: &[
            "std::fs::write",
            "std::fs::rename",
            "std::fs::copy",
            "std::fs::hard_link",
            "std::fs::remove_*",
            "std::fs::create_dir*",
            "std::fs::set_permissions",
            "std::fs::DirBuilder",
            "std::fs::OpenOptions",
            "std::fs::File::create*",
            "std::fs::File::options",
            "std::os::unix::fs::symlink",
            "tempfile",
        ],
        places: Places::Only(&["output", "store", "run", "watch", "bench"]),
    },
    OnePlace {
        // The machine tells about itself in files; a frame is known by its files before it is read.
        rule: "only format, job, output and store read files (run/machine and run/source: facts, no scenes; bench: texts to move; watch: what is put into the inbox and its own)",
        names: &[
            "std::fs::read*",
            "std::fs::File::open",
            "std::fs::metadata",
            "std::fs::symlink_metadata",
            "std::fs::canonicalize",
            "memmap2",
        ],
        places: Places::Only(&[
            "format",
            "job",
            "output",
            "store",
            "run/machine",
            "run/source",
            "bench",
            "watch",
        ]),
    },
    OnePlace {
        rule: "only device/gpu names wgpu",
        names: &["wgpu", "pollster"],
        places: Places::Only(&["device/gpu"]),
    },
    OnePlace {
        rule: "only watch serves, mails, unpacks and hears of files",
        names: &["axum", "tokio", "lettre", "ureq", "notify", "zip", "tar", "flate2", "ruzstd"],
        places: Places::Only(&["watch"]),
    },
    OnePlace { rule: "only accel names obvhs", names: &["obvhs"], places: Places::Only(&["accel"]) },
    OnePlace { rule: "only job reads YAML", names: &["serde_yaml"], places: Places::Only(&["job"]) },
    OnePlace {
        rule: "only bench reads OBJ by another crate, for comparison",
        names: &["tobj"],
        places: Places::Only(&["bench"]),
    },
    OnePlace { rule: "only bench draws charts", names: &["plotters"], places: Places::Only(&["bench"]) },
    OnePlace { rule: "only format reads glTF", names: &["gltf"], places: Places::Only(&["format"]) },
    OnePlace {
        rule: "only output knows picture formats; format decodes textures",
        names: &["png", "exr", "image", "openjp2", "tiff"],
        places: Places::Only(&["output", "format"]),
    },
    OnePlace {
        rule: "only output encodes pictures",
        names: &[
            "png::Encoder",
            "png::Writer",
            "image::codecs::*::*Encoder",
            "image::ImageEncoder",
            "image::save_*",
            "image::write_*",
            "exr::prelude::Writ*",
            "exr::image::write",
            "exr::block::writ*",
            "openjp2",
            "tiff",
        ],
        places: Places::Only(&["output"]),
    },
    OnePlace {
        rule: "only cli prints",
        names: &["std::io::stderr", "std::io::Stdout", "std::io::Stderr", "anstream", "indicatif"],
        places: Places::Only(&["cli"]),
    },
    OnePlace {
        rule: "only cli/say prints lines: those that cannot be said end nothing",
        names: &["print!", "println!", "eprint!", "eprintln!", "std::io::stdout"],
        places: Places::Only(&["cli/say"]),
    },
    OnePlace {
        rule: "only clock reads clocks",
        names: &["std::time::Instant", "std::time::SystemTime"],
        places: Places::Only(&["clock"]),
    },
    OnePlace {
        rule: "only cli reads arguments and environment",
        names: &[
            "std::env::arg*",
            "std::env::var*",
            "std::env::current_*",
            "std::env::set_*",
            "std::env::home_dir",
            "std::env::temp_dir",
        ],
        places: Places::Only(&["cli"]),
    },
    OnePlace {
        rule: "no clock in plan, diff, schedule, kernel and scene",
        names: &["std::time", "crate::clock"],
        places: Places::AllBut(PURE),
    },
    OnePlace {
        rule: "no thread in plan, diff, schedule, kernel and scene",
        names: &["std::thread", "std::sync::mpsc", "rayon", "tokio"],
        places: Places::AllBut(PURE),
    },
    OnePlace {
        rule: "no file in plan, diff, schedule, kernel and scene",
        names: &["std::fs", ".exists", ".try_exists", ".is_file", ".is_dir", ".read_dir", ".canonicalize"],
        places: Places::AllBut(PURE),
    },
];

#[test]
fn the_house_stands_as_planned() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for folder in ["src", "tests", "benches", "examples", "shaders"] {
        gather(&root.join(folder), folder, &mut found);
    }
    assert!(
        found.iter().any(|(path, _)| path == "src/lib.rs"),
        "the sources are not where they were looked for"
    );
    let files: Vec<File<'_>> = found.iter().map(|(path, text)| File { path, text }).collect();
    let breaches: Vec<String> = check(&HOUSE, &files).iter().map(ToString::to_string).collect();
    assert!(breaches.is_empty(), "\n{}", breaches.join("\n"));
}

/// Code files below a folder with their texts; a folder that is not there has none.
fn gather(folder: &Path, name: &str, found: &mut Vec<(String, String)>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.expect("a folder of the package can be listed").path();
        let name = format!("{name}/{}", path.file_name().expect("an entry has a name").to_string_lossy());
        if path.is_dir() {
            gather(&path, &name, found);
        } else if path.extension().is_some_and(|e| e == "rs" || e == "wgsl" || e == "py") {
            found.push((name, fs::read_to_string(&path).expect("code is UTF-8")));
        }
    }
}
