use super::*;
use crate::math::DVec3;
use std::fs;
use std::path::Path;

struct Folder(tempfile::TempDir);

impl Folder {
    /// A folder with OBJ files of these names, folders in between made.
    fn with(files: &[&str]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for file in files {
            folder.write(file, "");
        }
        folder
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.0.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn request(&self, inputs: &[&str]) -> Request {
        Request { inputs: inputs.iter().map(|i| self.0.path().join(i)).collect(), ..Request::default() }
    }
}

fn named(name: &str) -> Options {
    Options { name: Some(name.to_string()), ..Options::default() }
}

fn pictures(job: &Job) -> Vec<&str> {
    job.pictures.iter().map(|p| p.picture.to_str().unwrap()).collect()
}

fn error(request: &Request) -> String {
    resolve(request).unwrap_err().to_string()
}

#[test]
fn sequences_that_would_write_one_name_get_folders() {
    let t = Folder::with(&["a/f_1.obj", "a/f_2.obj", "b/f_1.obj", "c/g_1.obj", "d/a/f_9.obj"]);
    assert_eq!(pictures(&resolve(&t.request(&["a", "c"])).unwrap()), ["f_1.png", "f_2.png", "g_1.png"]);
    let both = resolve(&t.request(&["a", "b"])).unwrap();
    assert_eq!(pictures(&both), ["a/f_1.png", "a/f_2.png", "b/f_1.png"]);
    assert_eq!((both.name.as_str(), both.folder.as_path()), ("a", Path::new("out/a")));
    let mut same = t.request(&["a", "d/a"]);
    same.options = named("{name}_{frame:02}");
    assert_eq!(pictures(&resolve(&same).unwrap()), ["a_01.png", "a_02.png", "a_09.png"]);
    same.options = named("{frame}");
    same.inputs.push(t.0.path().join("a"));
    let folders = ["a/1.png", "a/2.png", "a-2/9.png", "a-3/1.png", "a-3/2.png"];
    assert_eq!(pictures(&resolve(&same).unwrap()), folders);
    // each sequence of a folder has a name of its own
    let t = Folder::with(&["d/a_1.obj", "d/a_2.obj", "d/b_1.obj"]);
    let request = Request { options: named("{name}.{frame}"), ..t.request(&["d"]) };
    assert_eq!(pictures(&resolve(&request).unwrap()), ["a.1.png", "a.2.png", "b_1.1.png"]);
    let request = Request { options: named("one"), ..t.request(&["d"]) };
    for word in ["one.png", "a_1.obj", "a_2.obj", "put {stem} or {frame}"] {
        assert!(error(&request).contains(word), "{word}: {}", error(&request));
    }
    // the same stem, so that only the number parts them, or nothing does
    let t = Folder::with(&["d/w_1.obj", "d/w_1.OBJ", "e/a.obj", "e/a.OBJ"]);
    let request = Request { one_sequence: true, ..t.request(&["d"]) };
    let told = error(&request);
    assert!(["w_1.obj", "w_1.OBJ", "put {frame} into"].iter().all(|w| told.contains(w)), "{told}");
    assert_eq!(resolve(&Request { options: named("{stem}.{frame}"), ..request }).unwrap().pictures.len(), 2);
    let told = error(&t.request(&["e"]));
    assert!(["a.obj", "a.OBJ", "rename one"].iter().all(|w| told.contains(w)), "{told}");
}

#[test]
fn what_is_for_nothing_is_warned_of() {
    let t = Folder::with(&["w/a_1.obj", "w/a_2.obj"]);
    t.write(
        "j.yaml",
        "sequence: w
clip: Walk
overrides:
  - {frames: 2, samples: 2}
  - {frames: 99, samples: 4}
  - {files: 'zz*', samples: 4}
",
    );
    let told = |request: &Request| -> Vec<String> {
        let warnings = resolve(request).unwrap().warnings.list();
        let folder = format!("{}/", t.0.path().display());
        warnings.iter().map(|w| w.to_string().replace(&folder, "")).collect()
    };
    let clip = "j.yaml: `clip` is for glTF files and there is none; it changes nothing";
    let idle = "j.yaml:5: an override is for none of the frames; check its `frames` and `files` (2 times)";
    assert_eq!(told(&t.request(&["j.yaml"])), [clip, idle]);
    // frames that are not chosen are there all the same
    let first = Request { frames: Some("1".parse().unwrap()), ..t.request(&["j.yaml"]) };
    assert_eq!(told(&first), [clip, idle]);
    assert_eq!(told(&Request { grows: true, ..first }), [clip]);
    let typed = Request { clip: Some(ClipChoice::from_word("Walk")), ..t.request(&["w"]) };
    assert_eq!(told(&typed), ["--clip is for glTF files and there is none; it changes nothing"]);
    assert_eq!(told(&t.request(&["w"])), [""; 0]);
}

#[test]
fn frames_then_chunks_then_order() {
    let t = Folder::with(&["w/a_1.obj", "w/a_2.obj", "w/a_3.obj", "w/b_2.obj", "w/b_3.obj", "w/b_4.obj"]);
    let mut request = t.request(&["w"]);
    request.frames = Some("2-4x2".parse().unwrap());
    assert_eq!(pictures(&resolve(&request).unwrap()), ["a_2.png", "b_2.png", "b_4.png"]);
    request.chunk = Some("2/2".parse().unwrap());
    request.order = Order::Reverse;
    assert_eq!(pictures(&resolve(&request).unwrap()), ["b_4.png", "b_2.png"]);
    request.chunk = Some("1/9".parse().unwrap());
    assert!(pictures(&resolve(&request).unwrap()).is_empty());
    request.frames = Some("1-9".parse().unwrap());
    assert!(error(&request).contains("frame 5 "), "{}", error(&request));
    // chosen or not, the first frame on disk is the sequence's first
    request = Request { frames: Some("3".parse().unwrap()), ..t.request(&["w"]) };
    assert_eq!(resolve(&request).unwrap().sequences[1].first.frame, Some(2));
}

#[test]
fn the_command_line_wins_over_the_job() {
    let t = Folder::with(&["w/a_1.obj", "w/a_2.obj", "w/a_3.obj"]);
    t.write(
        "job.yaml",
        "sequence: w\nframes: 1-2\nup: z\ncamera: {eye: [0, 0, 5], look_at: [0, 0, 0], fov: 30}\nsamples: 3\n",
    );
    let mut request = t.request(&["job.yaml"]);
    let camera = |job: &Job| job.pictures[0].settings.camera_at(Some(1)).unwrap();
    let job = resolve(&request).unwrap();
    assert_eq!((pictures(&job), job.name.as_str()), (vec!["a_1.png", "a_2.png"], "job"));
    assert_eq!((camera(&job).fov_deg, camera(&job).up), (30.0, DVec3::Z));
    assert!(job.inputs.iter().any(|i| i.ends_with("job.yaml")) && job.inputs.len() == 4);
    request.frames = Some("3".parse().unwrap());
    request.options = Options { fov: Some(20.0), up: Some(DVec3::Y), ..Options::default() };
    let job = resolve(&request).unwrap();
    assert_eq!(pictures(&job), ["a_3.png"]);
    assert_eq!(
        (camera(&job).fov_deg, camera(&job).up, job.pictures[0].settings.samples),
        (20.0, DVec3::Y, 3)
    );
    // the job's settings for another INPUT; the file after --job may be called anything
    t.write("x/b.obj", "");
    fs::rename(t.0.path().join("job.yaml"), t.0.path().join("settings")).unwrap();
    let request = Request { job_file: Some(t.0.path().join("settings")), ..t.request(&["x/b.obj"]) };
    assert!(error(&request).contains("frame 1 "), "{}", error(&request));
}

#[test]
fn later_overrides_win() {
    let t = Folder::with(&["w/a_1.obj", "w/a_2.obj", "w/b_2.obj"]);
    t.write(
        "job.yaml",
        "sequence: w
samples: 2
overrides:
  - {frames: 2, samples: 4, format: exr}
  - {files: 'a*', name: '{stem}-hd', size: [64, 32], samples: 8}
",
    );
    let job = resolve(&t.request(&["job.yaml"])).unwrap();
    assert_eq!(pictures(&job), ["a_1-hd.png", "a_2-hd.exr", "b_2.exr"]);
    let settings: Vec<_> = job.pictures.iter().map(|p| (p.settings.samples, p.settings.size)).collect();
    assert_eq!(settings, [(8, [64, 32]), (8, [64, 32]), (4, [1280, 720])]);
}

#[test]
fn layers_are_one_sequence() {
    let t = Folder::with(&["room.obj", "w/a_3.obj", "w/a_4.obj", "w/a_6.obj", "two/a_1.obj", "two/b.obj"]);
    t.write(
        "j.yaml",
        "name: play
layers:
  - sequence: room.obj
  - {sequence: w, name: figure, transform: {keys: [{frame: 3}, {frame: 5, translate: [2, 0, 0]}]}}
overrides:
  - {files: 'a_4', samples: 9}
",
    );
    let request = t.request(&["j.yaml"]);
    let job = resolve(&request).unwrap();
    assert_eq!(pictures(&job), ["play_0003.png", "play_0004.png", "play_0006.png"]);
    assert_eq!(job.pictures.iter().map(|p| p.settings.samples).collect::<Vec<_>>(), [1, 9, 1]);
    let sources = &job.pictures[1].sources;
    assert_eq!((sources[0].file, sources[0].transform), (Some(0), None));
    assert_eq!(sources[1].file, Some(1));
    assert_eq!(sources[1].transform.unwrap().translation, DVec3::X);
    assert_eq!(job.sequences[0].layers[1].name, "figure");
    let request = Request { options: named("{stem}"), ..request };
    assert_eq!(pictures(&resolve(&request).unwrap()), ["a_3.png", "a_4.png", "a_6.png"]);
    let refused = [
        ("layers: [{sequence: two}]", "2 sequences"),
        ("layers: [{sequence: w, materials: no.mtl}]", "no.mtl"),
        ("layers: [{sequence: w}]\nframes: 1-9999999", "1000000"),
    ];
    for (yaml, words) in refused {
        t.write("j.yaml", yaml);
        assert!(error(&t.request(&["j.yaml"])).contains(words), "{yaml}");
    }
    // numbers far apart are no reason to count from one to the other
    let t = Folder::with(&["w/a_-999999999999999.obj", "w/a_1.obj", "w/a_999999999999999.obj"]);
    t.write(
        "j.yaml",
        "layers: [{sequence: w, frames: {start: -9000000000000000, step: 9, outside: loop}}]\n",
    );
    assert_eq!(resolve(&t.request(&["j.yaml"])).unwrap().pictures.len(), 3);
}

#[test]
fn files_named_by_their_time_are_frames() {
    let t = Folder::with(&["w/s_20240101123045122.obj", "w/s_20240101123045123.obj"]);
    t.write(
        "j.yaml",
        "layers: [{sequence: w, frames: {start: 20240101123045123}}]\nframes: 20240101123045121\n",
    );
    let job = resolve(&t.request(&["j.yaml"])).unwrap();
    assert_eq!(pictures(&job), ["j_20240101123045121.png"]);
    assert_eq!(job.pictures[0].sources[0].file, Some(1));
    let typed = |frames: &str| Request { frames: Some(frames.parse().unwrap()), ..t.request(&["w"]) };
    assert_eq!(pictures(&resolve(&typed("20240101123045123")).unwrap()), ["s_20240101123045123.png"]);
    assert!(error(&typed("20240101123045124")).contains("frame 20240101123045124 "));
    // the ends of 64 bits
    let t = Folder::with(&["w/a_-9223372036854775808.obj", "w/a_9223372036854775807.obj"]);
    t.write("j.yaml", "layers: [{sequence: w, frames: {step: -9223372036854775808, outside: loop}}]\n");
    assert_eq!(resolve(&t.request(&["j.yaml"])).unwrap().pictures.len(), 2);
}

#[cfg(target_os = "linux")]
#[test]
fn names_may_be_any_bytes() {
    use std::os::unix::ffi::OsStrExt;
    let t = Folder::with(&[]);
    for name in [b"\xff_1.obj".as_slice(), b"\xff_2.obj", b"\xfe\xff.obj"] {
        fs::write(t.0.path().join(std::ffi::OsStr::from_bytes(name)), "").unwrap();
    }
    assert_eq!(resolve(&t.request(&[""])).unwrap().pictures.len(), 3);
}

#[test]
fn wrong_use_is_refused() {
    let t = Folder::with(&["w/a_1.obj"]);
    t.write("a.yaml", "sequence: w\n");
    t.write("b.yaml", "sequence: w\nsise: 1\n");
    t.write("c.yaml", "layers: [{sequence: w}]\n");
    assert!(error(&Request::default()).contains("INPUT"));
    assert!(error(&t.request(&["a.yaml", "c.yaml"])).contains("more than one job file"));
    assert!(error(&t.request(&["b.yaml"])).contains("b.yaml:2:1: unknown key `sise`"));
    assert!(error(&t.request(&["c.yaml", "w"])).contains("layers"));
    for (yaml, told) in [
        ("frames: 9", "f.yaml:2:9: frames: frame 9 "),
        ("output: {bits: 16, format: jpg}", "f.yaml:2:16: bits: jpg has 8 bits"),
        ("output: {format: jpg}\noverrides: [{frames: 1, bits: 16}]", "f.yaml:3:31: bits: jpg has 8 bits"),
    ] {
        t.write("f.yaml", &format!("sequence: w\n{yaml}\n"));
        assert!(error(&t.request(&["f.yaml"])).contains(told), "{}", error(&t.request(&["f.yaml"])));
    }
    // what is typed is not the job's
    let typed = Options { bits: Some(16), ..Options::default() };
    let request = Request { options: typed, ..t.request(&["f.yaml"]) };
    assert!(error(&request).starts_with("jpg has 8 bits"), "{}", error(&request));
    t.write("e.yaml", "sequence: w\nfilter: \"\\e[31m\"\n");
    assert!(!error(&t.request(&["e.yaml"])).contains('\u{1b}'));
    let told = error(&t.request(&["d.yaml"]));
    assert!(told.contains("d.yaml") && told.matches("o such file").count() == 1, "{told}");
    t.write("g.yaml", "sequence: c.yaml\n");
    assert!(error(&t.request(&["g.yaml"])).contains("c.yaml: is a job file; a job's sequence is"));
}
