//! A job that someone else put into a watched folder: nothing of it leads out of its folder (CONTRACT 8).

use super::JobError;
use super::file::{self, JobFile};
use super::options::{Background, Options};
use crate::format::{self, ReadOptions};
use std::path::{Component, Path, PathBuf};

/// The priority that a job file asks for, where it can be read and asks for one.
pub fn priority(job_file: &Path) -> Option<i64> {
    file::read(job_file).ok()?.priority
}

/// Refuses what a dropped job file must not say. `folder` is the job's, as the system names it, without links.
pub(super) fn check_file(job: &JobFile, path: &Path, folder: &Path) -> Result<(), JobError> {
    let refused = |text: String| Err(JobError::Dropped { path: path.to_path_buf(), text });
    if job.folder.is_some() {
        return refused("output.folder is not for a dropped job to say; leave it out".to_owned());
    }
    let options = || std::iter::once(&job.options).chain(job.overrides.iter().map(|o| &o.options));
    if let Some(name) = options().filter_map(|o| o.name.as_deref()).find(|name| leads_away(name)) {
        return refused(format!("the name `{name}` leads to another folder"));
    }
    if let Some(map) = options().find_map(map_elsewhere) {
        return refused(format!("the map `{map}` lies outside the job's folder"));
    }
    let backgrounds = options().filter_map(|o| match &o.background {
        Some(Background::File(file)) => Some(file),
        _ => None,
    });
    let layers = job.layers.iter().flat_map(|l| [Some(&l.sequence), l.materials.as_ref()]).flatten();
    let own = path.parent().unwrap_or(Path::new(""));
    for named in job.sequence.iter().chain(layers).chain(backgrounds) {
        if is_odd(named) {
            return refused(format!("{} is no plain file", named.display()));
        }
        // what is relative was joined to the job file's folder
        let stays =
            named.strip_prefix(own).is_ok_and(stays) && real(named).is_none_or(|r| r.starts_with(folder));
        if !stays {
            return refused(format!("{} lies outside the job's folder", named.display()));
        }
    }
    Ok(())
}

/// Refuses files that lie elsewhere, as links make them, and what is no plain file: a pipe is never read to its end. What a
/// glTF names counts, too; what an OBJ names is looked at when it is read.
pub(super) fn check_inputs(inputs: &[PathBuf], folder: &Path) -> Result<(), JobError> {
    for input in inputs {
        check_input(input, folder)?;
        if format::is_gltf(input) {
            for named in format::named_files(input, &ReadOptions::default()) {
                check_input(&named, folder)?;
            }
        }
    }
    Ok(())
}

fn check_input(input: &Path, folder: &Path) -> Result<(), JobError> {
    let refused = |text: &str| Err(JobError::Dropped { path: input.to_path_buf(), text: text.to_owned() });
    if real(input).is_some_and(|real| !real.starts_with(folder)) {
        return refused(
            "lies outside the job's folder, or is a link that leads there; put the file itself into it",
        );
    }
    if is_odd(input) { refused("is no plain file") } else { Ok(()) }
}

/// Whether something is there that is neither a file nor a folder.
fn is_odd(path: &Path) -> bool {
    path.exists() && !path.is_file() && !path.is_dir()
}

fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Whether a relative path never climbs.
fn stays(path: &Path) -> bool {
    path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
}

/// Whether a name is a path, or may become one.
fn leads_away(name: &str) -> bool {
    name.contains(['/', '\\']) || name.contains("..")
}

/// A word behind a map of the job's own materials that is a path out of the folder.
fn map_elsewhere(options: &Options) -> Option<&str> {
    let words = options.materials.iter().flat_map(|m| &m.words);
    let maps = words.filter(|(word, _)| {
        let word = word.to_ascii_lowercase();
        word.starts_with("map") || ["bump", "norm", "refl", "disp", "decal"].contains(&word.as_str())
    });
    let parts = maps.flat_map(|(_, behind)| behind.split_whitespace());
    parts.filter(|part| part.contains('/') || part.contains('\\') || *part == "..").find(|part| {
        let plain = part.replace('\\', "/");
        !stays(Path::new(&plain)) || plain.split('/').next().is_some_and(|drive| drive.ends_with(':'))
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Request, resolve};

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn dropped(job: &str) -> Result<super::super::Job, String> {
        let t = tempfile::tempdir().unwrap();
        let root = t.path().canonicalize().unwrap();
        let folder = root.join("job");
        std::fs::create_dir(&folder).unwrap();
        for file in ["job/a_1.obj", "job/a_2.obj", "outside.obj", "outside.hdr", "outside.mtl"] {
            std::fs::write(root.join(file), TRIANGLE).unwrap();
        }
        std::fs::write(folder.join("job.yaml"), job).unwrap();
        let mut request = Request {
            inputs: vec![folder.join("job.yaml")],
            dropped: Some(folder),
            folder: Some(root.join("out")),
            ..Request::default()
        };
        request.options.size = Some([32, 18]);
        request.options.samples = Some(3);
        request.options.eye = Some(crate::math::DVec3::X);
        request.options.look_at = Some(crate::math::DVec3::ZERO);
        request.frames = Some("1".parse().unwrap());
        resolve(&request).map_err(|e| e.to_string())
    }

    #[test]
    fn a_dropped_job_wins_over_options() {
        let job = dropped("sequence: .\nframes: 2\noutput: {size: [64, 36]}\npriority: 7\ncamera: {eye: [0, 0, 5], look_at: [0, 0, 0]}\n")
            .unwrap();
        assert_eq!((job.pictures.len(), job.pictures[0].frame, job.priority), (1, Some(2), Some(7)));
        let settings = &job.pictures[0].settings;
        assert_eq!((settings.size, settings.samples), ([64, 36], 3));
        assert_eq!(settings.camera_at(None).unwrap().eye.z, 5.0);
        assert!(job.folder.ends_with("out"));
    }

    #[test]
    fn nothing_of_a_dropped_job_leads_out_of_its_folder() {
        for (job, named) in [
            ("sequence: ..\n", ".."),
            ("sequence: ../outside.obj\n", "outside.obj"),
            ("sequence: '../*.obj'\n", "*.obj"),
            ("sequence: sub/../../outside.obj\n", "outside.obj"),
            ("sequence: /etc\n", "/etc"),
            ("layers: [{sequence: a_1.obj}, {sequence: ../outside.obj}]\n", "outside.obj"),
            ("layers: [{sequence: a_1.obj, materials: ../outside.mtl}]\n", "outside.mtl"),
            ("sequence: .\nbackground: ../outside.hdr\n", "outside.hdr"),
            ("sequence: .\noverrides: [{frames: 1, background: ../outside.hdr}]\n", "outside.hdr"),
            ("sequence: .\noutput: {folder: out}\n", "output.folder"),
            ("sequence: .\noutput: {folder: /tmp/x}\n", "output.folder"),
            ("sequence: .\noutput: {name: ../x}\n", "../x"),
            ("sequence: .\noutput: {name: 'a/{stem}'}\n", "a/{stem}"),
            ("sequence: .\noverrides: [{frames: 1, name: 'a/b'}]\n", "a/b"),
            ("sequence: .\nname: ../x\n", "../x"),
            ("sequence: .\nmaterials: {m: {map_Kd: ../outside.png}}\n", "outside.png"),
            ("sequence: .\nmaterials: {m: {map_Kd: /etc/outside.png}}\n", "outside.png"),
        ] {
            let error = dropped(job).unwrap_err();
            assert!(error.contains("job.yaml") && error.contains(named), "{job}: {error}");
        }
        dropped("sequence: ./\nbackground: [0, 0, 0]\nmaterials: {m: {map_Kd: tex/a.png}}\n").unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_do_not_lead_out_either() {
        let t = tempfile::tempdir().unwrap();
        let root = t.path().canonicalize().unwrap();
        let folder = root.join("job");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(root.join("a_1.obj"), TRIANGLE).unwrap();
        std::os::unix::fs::symlink(root.join("a_1.obj"), folder.join("a_1.obj")).unwrap();
        let request =
            Request { inputs: vec![folder.clone()], dropped: Some(folder.clone()), ..Request::default() };
        let error = resolve(&request).unwrap_err().to_string();
        assert!(error.contains("a_1.obj") && error.contains("link"), "{error}");
        std::fs::remove_file(folder.join("a_1.obj")).unwrap();
        let made = std::process::Command::new("mkfifo").arg(folder.join("a_1.obj")).status().unwrap();
        assert!(made.success());
        let error = resolve(&request).unwrap_err().to_string();
        assert!(error.contains("a_1.obj") && error.contains("no plain file"), "{error}");
        std::fs::remove_file(folder.join("a_1.obj")).unwrap();
        let gltf = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "../a_1.obj", "byteLength": 1}]}"#;
        std::fs::write(folder.join("a.gltf"), gltf).unwrap();
        let error = resolve(&request).unwrap_err().to_string();
        assert!(error.contains("a_1.obj"), "{error}");
    }
}
