//! A folder in which jobs appear: what is put there is rendered, whatever it is packed in; nothing leads out of it
//! (CONTRACT 8). With `--once` each daemon here runs to its own end.

mod common;
#[path = "common/watched.rs"]
mod watched;
use common::{assert_same, run, wave};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;
use watched::{Watched, until};

fn tar_of(folder: &Path, target: &Path) {
    let mut tar = tar::Builder::new(fs::File::create(target).unwrap());
    tar.append_dir_all("inner", folder).unwrap();
    tar.finish().unwrap();
}

fn zip_of(folder: &Path, target: &Path) {
    let mut zip = zip::ZipWriter::new(fs::File::create(target).unwrap());
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&fs::read(entry.path()).unwrap()).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn a_folder_and_archives_give_what_render_gives() {
    let w = Watched::new();
    let folder = w.job("folder", 3);
    let want = w.wanted(&folder, &[]);
    tar_of(&folder, &w.path("inbox/rolled.tar"));
    zip_of(&folder, &w.path("inbox/packed.zip"));
    fs::create_dir(w.path("inbox/empty")).unwrap();
    fs::write(w.path("inbox/notes.txt"), "x").unwrap();
    let said = w.once(&[], 0).stderr;
    assert!(said.contains("notes.txt") && said.contains("folder: finished, 3 frames"), "{said}");
    for job in ["folder", "rolled", "packed"] {
        assert_same(&want, &w.done(job), job);
        let status = w.status(job);
        assert_eq!(status["state"], "finished");
        assert_eq!(status["frames"], serde_json::json!({"done": 3, "failed": 0, "all": 3}));
        assert!(status["error"].is_null() && status["times"]["ended_ms"].is_u64(), "{status}");
    }
    assert!(!w.path("done/empty").exists());
    let own = w.path("done/.rentix-watch");
    assert_eq!(fs::read_dir(own.join("unpacked")).unwrap().count(), 0, "what was unpacked is gone");
    assert_eq!(fs::read_dir(own.join("claims")).unwrap().count(), 0, "no claim is left");
    assert!(folder.join("wave_0001.obj").exists(), "inputs stay");
    // again: nothing is rendered
    let events = w.once(&["--json"], 0).stdout;
    assert!(!events.contains("\"frame\""), "{events}");
}

#[test]
fn a_picture_that_is_gone_is_rendered_again() {
    let w = Watched::new();
    let folder = w.job("walk", 3);
    w.job("other", 1);
    let want = w.wanted(&folder, &[]);
    w.once(&[], 0);
    for listing in [true, false] {
        fs::remove_file(w.path("done/walk/wave_0002.png")).unwrap();
        if !listing {
            // of an earlier version, which kept none
            fs::remove_file(w.path("done/walk/.rentix/pictures")).unwrap();
        }
        let said = w.once(&["--json"], 0).stdout;
        assert!(said.contains("it is rendered again"), "{said}");
        assert_eq!(said.matches("\"status\":\"rendered\"").count(), 1, "{said}");
        assert!(!said.contains("\"job\":\"other\""), "{said}");
        assert_same(&want, &w.done("walk"), "again");
        assert_eq!(w.status("walk")["frames"], serde_json::json!({"done": 3, "failed": 0, "all": 3}));
    }
    // what else lies there, or is not there, is no reason
    fs::write(w.path("done/walk/film.png"), "").unwrap();
    let said = w.once(&["--json"], 0).stdout;
    assert!(!said.contains("\"state\""), "{said}");
}

#[test]
fn what_changed_is_a_new_run_of_the_same_job() {
    let w = Watched::new();
    let folder = w.job("walk", 2);
    let camera = ["--eye", "0,1,5", "--look-at", "0,0,0"];
    w.once(&camera, 0);
    w.job("walk", 3);
    let events = w.once(&[&camera[..], &["--json"]].concat(), 0).stdout;
    let statuses: Vec<String> = events
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .filter(|event| event["event"] == "frame")
        .map(|event| {
            assert_eq!(event["job"], "walk");
            event["status"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(statuses, ["resumed", "resumed", "rendered"]);
    assert_same(&w.wanted(&folder, &camera), &w.done("walk"), "grown");
    assert!(!w.path("done/walk-2").exists());
}

#[test]
fn a_second_job_of_a_name_in_use_has_another_name() {
    let w = Watched::new();
    let folder = w.job("walk", 1);
    zip_of(&w.job("other", 2), &w.path("inbox/walk.zip"));
    tar_of(&folder, &w.path("inbox/walk.tar"));
    for _ in 0..2 {
        w.once(&[], 0);
        let source = |job: &str| w.status(job)["source"].as_str().unwrap().to_owned();
        assert_eq!([source("walk"), source("walk-2"), source("walk-3")], ["walk", "walk.tar", "walk.zip"]);
    }
    assert!(!w.path("done/walk-4").exists());
}

#[test]
fn a_job_file_inside_wins_and_is_not_trusted() {
    let w = Watched::new();
    let folder = w.job("ordered", 3);
    fs::write(
        folder.join("job.yaml"),
        "sequence: .\noutput: {size: [32, 18], format: ppm}\nframes: 2-3\npriority: 5\n",
    )
    .unwrap();
    let bad = [
        ("up", "sequence: ../ordered\n"),
        ("away", "sequence: .\noutput: {folder: /tmp/away}\n"),
        ("named", "sequence: .\noutput: {name: ../../x}\n"),
        ("typo", "sequense: .\n"),
    ];
    for (name, text) in bad {
        fs::write(w.job(name, 1).join("job.yaml"), text).unwrap();
    }
    w.once(&[], 1);
    assert_eq!(w.done("ordered").keys().collect::<Vec<_>>(), ["wave_0002.ppm", "wave_0003.ppm"]);
    assert!(w.done("ordered")["wave_0002.ppm"].starts_with(b"P6\n32 18\n"));
    assert_eq!(w.status("ordered")["priority"], 5);
    for (name, _) in bad {
        let status = w.status(name);
        assert_eq!(status["state"], "failed", "{name}");
        assert!(status["error"].as_str().unwrap().contains("job.yaml"), "{status}");
        assert!(w.done(name).is_empty());
    }
}

#[test]
fn what_an_mtl_names_outside_the_job_is_not_read() {
    let w = Watched::new();
    let card = w.path("inbox/card");
    fs::create_dir(&card).unwrap();
    let obj = "mtllib c.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl c\nf 1/1 2/2 3/3\n";
    fs::write(card.join("card.obj"), obj).unwrap();
    fs::write(w.path("secret.ppm"), b"P6\n1 1\n255\n\xff\x00\x00").unwrap();
    let secret = w.path("secret.ppm");
    fs::write(card.join("c.mtl"), format!("newmtl c\nKd 1 1 1\nmap_Kd {}\n", secret.display())).unwrap();
    let said = w.once(&[], 0).stderr;
    assert!(said.contains("secret.ppm"), "it is said that it is missing: {said}");
    fs::write(card.join("c.mtl"), "newmtl c\nKd 1 1 1\n").unwrap();
    assert_same(&w.wanted(&card, &[]), &w.done("card"), "the constant is used");
}

#[test]
fn cancelled_jobs_are_not_rendered_until_they_are_wanted_again() {
    let w = Watched::new();
    let one = w.job("one", 1);
    w.job("two", 1);
    fs::write(one.join(".cancel"), "").unwrap();
    fs::write(w.path("inbox/two.cancel"), "").unwrap();
    w.once(&[], 0);
    for job in ["one", "two"] {
        assert_eq!(w.status(job)["state"], "cancelled");
        assert!(w.done(job).is_empty());
    }
    fs::remove_file(one.join(".cancel")).unwrap();
    w.once(&[], 0);
    assert_eq!([&w.status("one")["state"], &w.status("two")["state"]], ["finished", "cancelled"]);
}

#[test]
fn one_bad_frame_fails_its_job_and_the_others_stay() {
    let w = Watched::new();
    let folder = w.job("walk", 3);
    fs::write(folder.join("wave_0002.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    let told = w.path("told");
    let command = format!("echo $RENTIX_JOB $RENTIX_STATE $RENTIX_FAILED >> {}", told.display());
    w.job("good", 1);
    let said = w.once(&["--on-done", &command], 1).stderr;
    let status = w.status("walk");
    assert_eq!(status["state"], "failed");
    assert_eq!(status["frames"], serde_json::json!({"done": 2, "failed": 1, "all": 3}));
    assert!(status["error"].as_str().unwrap().contains("wave_0002.obj:2"), "{status}");
    assert_eq!(w.done("walk").len(), 2);
    assert!(said.contains("walk: failed") && said.contains("good: finished"), "{said}");
    let mut lines: Vec<String> = fs::read_to_string(told).unwrap().lines().map(str::to_owned).collect();
    lines.sort();
    assert_eq!(lines, ["good finished 0", "walk failed 1"]);
}

#[test]
fn it_is_said_what_a_job_waits_for() {
    let w = Watched::new();
    let part = w.job("walk", 1).join("wave_0002.obj.part");
    fs::write(&part, "v 0").unwrap();
    let said = w.path("said");
    let mut command = common::rentix(w.t.path());
    let mut daemon = command.args(w.args(&[])).stderr(fs::File::create(&said).unwrap()).spawn().unwrap();
    let said = || fs::read_to_string(&said).unwrap();
    until("why it waits", || said().contains("waits for wave_0002.obj.part"));
    fs::remove_file(&part).unwrap();
    assert!(daemon.wait().unwrap().success() && w.status("walk")["state"] == "finished", "{}", said());
    assert_eq!(said().matches("waits for").count(), 1, "{}", said());
}

#[test]
fn errors_of_archives_name_files_as_they_were_packed() {
    let w = Watched::new();
    let folder = w.path("walk");
    wave(&folder, 2, 6, 8);
    fs::write(folder.join("wave_0001.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 3\n").unwrap();
    let good = folder.join("wave_0002.obj");
    fs::write(&good, "mtllib gone.mtl\n".to_owned() + &fs::read_to_string(&good).unwrap()).unwrap();
    zip_of(&folder, &w.path("inbox/frame.zip"));
    tar_of(&folder, &w.path("inbox/inner.tar"));
    fs::write(folder.join("job.yaml"), "sequence: gone\n").unwrap();
    zip_of(&folder, &w.path("inbox/job.zip"));
    fs::write(folder.join("job.yaml"), "sequense: .\n").unwrap();
    zip_of(&folder, &w.path("inbox/typo.zip"));
    let told = w.once(&[], 1).stderr;
    for (job, begins) in [
        ("frame", "frame.zip: wave_0001.obj:3: "),
        ("inner", "inner.tar: inner/wave_0001.obj:3: "),
        ("job", "job.zip: gone"),
        ("typo", "typo.zip: job.yaml:1:1: "),
    ] {
        let error = w.status(job)["error"].as_str().unwrap().to_owned();
        assert!(error.starts_with(begins), "{error}");
    }
    assert!(told.contains("warning: frame.zip: ") && told.contains("gone.mtl"), "{told}");
    assert!(!told.contains("unpacked"), "{told}");
}

#[test]
fn a_followed_sequence_ends_as_the_whole_one_with_its_own_camera() {
    let w = Watched::new();
    let folder = w.job("sim", 4);
    w.once(&["--follow"], 0);
    assert_eq!(w.done("sim").len(), 4);
    let first = w.done("sim");
    // where the camera stands follows from the first frame alone
    fs::remove_dir_all(w.path("done")).unwrap();
    fs::write(folder.join("wave_0004.obj"), "v 90 90 90\nv 91 90 90\nv 90 91 90\nf 1 2 3\n").unwrap();
    w.once(&["--follow"], 0);
    let second = w.done("sim");
    for name in ["wave_0001.png", "wave_0002.png", "wave_0003.png"] {
        assert_eq!(first[name], second[name], "{name}");
    }
    let given = ["--eye", "0,1,5", "--look-at", "0,0,0"];
    fs::remove_dir_all(w.path("done")).unwrap();
    w.once(&[&["--follow"], &given[..]].concat(), 0);
    assert_same(&w.wanted(&folder, &given), &w.done("sim"), "with a camera of the options");
}

#[test]
fn what_lies_too_deep_fails_and_is_not_waited_for() {
    let w = Watched::new();
    fs::create_dir_all(w.job("deep", 1).join(["d"; 40].join("/"))).unwrap();
    w.job("good", 1);
    let command = format!("echo $RENTIX_JOB >> {}", w.path("told").display());
    for _ in 0..2 {
        w.once(&["--on-done", &command], 1);
        let status = w.status("deep");
        assert_eq!([&status["state"], &w.status("good")["state"]], ["failed", "finished"]);
        let error = status["error"].as_str().unwrap();
        assert!(error.contains("inbox/deep: folders lie deeper than 32; move them up"), "{error}");
    }
    assert_eq!(fs::read_to_string(w.path("told")).unwrap().lines().count(), 2, "each once");
    fs::remove_dir_all(w.path("inbox/deep/d")).unwrap();
    w.once(&[], 0);
    assert_eq!(w.status("deep")["state"], "finished");
}

#[test]
fn wrong_use_is_named_and_nothing_is_written() {
    let w = Watched::new();
    for (more, named) in [
        (&["--job", "x.yaml"][..], "--job"),
        (&["--settle", "-1"], "--settle"),
        (&["--webhook", "ftp://x"], "ftp://x"),
        (&["--mail", "nobody"], "nobody"),
        (&["--samples", "0"], "--samples"),
        (&["--device", "gpu:99"], "gpu:99"),
    ] {
        let said = w.once(more, 2).stderr;
        assert!(said.contains(named), "{said}");
    }
    let inside = run(
        w.t.path(),
        [w.path("inbox").as_os_str(), "watch".as_ref()]
            .into_iter()
            .rev()
            .chain(["-o".as_ref(), w.path("inbox/out").as_os_str()]),
    );
    assert!(inside.status == 2 && inside.stderr.contains("two folders apart"), "{}", inside.stderr);
    let absent = run(w.t.path(), ["watch".as_ref(), w.path("absent").as_os_str(), "--once".as_ref()]);
    assert!(absent.status == 2 && absent.stderr.contains("absent"), "{}", absent.stderr);
}

#[cfg(target_os = "linux")]
#[test]
fn a_killed_daemon_loses_no_job_and_renders_no_frame_twice() {
    let w = Watched::new();
    for job in ["a", "b", "c"] {
        wave(&w.path("inbox").join(job), 6, 16, 24);
    }
    let want = w.wanted(&w.path("inbox/a"), &["--samples", "4"]);
    let ended = |w: &Watched| ["a", "b", "c"].iter().map(|job| w.done(job).len()).sum::<usize>();
    let mut finished = 0;
    for _ in 0..6 {
        let mut command = common::rentix(w.t.path());
        let mut child =
            command.args(w.args(&["--samples", "4"])).stderr(std::process::Stdio::null()).spawn().unwrap();
        until("a frame more", || ended(&w) > finished || child.try_wait().unwrap().is_some());
        child.kill().unwrap();
        child.wait().unwrap();
        finished = ended(&w);
        for job in ["a", "b", "c"] {
            assert!(
                w.done(job).iter().all(|(name, bytes)| name.starts_with('.') || *bytes == want[name]),
                "torn"
            );
        }
    }
    let events = w.once(&["--samples", "4", "--json"], 0).stdout;
    let rendered = events.lines().filter(|line| line.contains("\"status\":\"rendered\"")).count();
    assert!(rendered + finished <= 18, "{rendered} frames were rendered, {finished} were there");
    for job in ["a", "b", "c"] {
        assert_same(&want, &w.done(job), job);
        assert_eq!(w.status(job)["state"], "finished");
    }
}

#[cfg(unix)]
#[test]
fn signals_end_the_daemon_and_its_jobs_go_on_later() {
    for (signal, status) in [("-INT", 130), ("-TERM", 143)] {
        let w = Watched::new();
        wave(&w.path("inbox/walk"), 12, 16, 24);
        // all frames together take much longer than the daemon takes to hear of the signal
        let mut args = w.args(&["--samples", "512"]);
        args.retain(|a| a != "--once");
        let mut child =
            common::rentix(w.t.path()).args(args).stderr(std::process::Stdio::null()).spawn().unwrap();
        until("a frame", || !w.done("walk").is_empty() || child.try_wait().unwrap().is_some());
        let kill =
            std::process::Command::new("kill").arg(signal).arg(child.id().to_string()).status().unwrap();
        assert!(kill.success());
        assert_eq!(child.wait().unwrap().code(), Some(status));
        let there = w.done("walk").len();
        assert!((1..12).contains(&there), "{there}");
        assert_eq!(w.status("walk")["state"], "queued");
        let events = w.once(&["--samples", "512", "--json"], 0).stdout;
        assert_eq!(events.matches("\"status\":\"resumed\"").count(), there);
        assert_eq!(w.done("walk").len(), 12);
    }
}

#[cfg(unix)]
#[test]
fn a_running_daemon_sees_what_changes_and_what_is_cancelled() {
    let w = Watched::new();
    let folder = w.job("walk", 2);
    let mut args = w.args(&["--eye", "0,1,5", "--look-at", "0,0,0"]);
    args.retain(|a| a != "--once");
    let mut child =
        common::rentix(w.t.path()).args(args).stderr(std::process::Stdio::null()).spawn().unwrap();
    let mut until = |what: &str, ready: &dyn Fn() -> bool| {
        until(what, || {
            assert!(child.try_wait().unwrap().is_none(), "{what}: the daemon ended");
            ready()
        });
    };
    let is = |job: &str, state: &str, done: u64| {
        w.path("done").join(job).join("status.json").exists() && {
            let status = w.status(job);
            status["state"] == state && status["frames"]["done"] == done
        }
    };
    until("first", &|| is("walk", "finished", 2));
    w.job("walk", 3);
    until("grown", &|| is("walk", "finished", 3));
    fs::write(folder.join("wave_0002.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    until("spoilt", &|| is("walk", "failed", 2));
    w.job("walk", 3);
    until("mended", &|| is("walk", "finished", 3));
    // a long one is cancelled while it is rendered, and then taken out of the inbox; a short one goes on
    let text = "sequence: .\nsamples: 60000\noutput: {size: [640, 360]}\n";
    let long = w.path("long");
    wave(&long, 2, 6, 8);
    fs::write(long.join("job.yaml"), text).unwrap();
    fs::rename(&long, w.path("inbox/long")).unwrap();
    until("long", &|| is("long", "running", 0));
    fs::write(w.path("inbox/long.cancel"), "").unwrap();
    let since = std::time::Instant::now();
    until("cancelled", &|| is("long", "cancelled", 0));
    // it is told of, and not found by the next look at what rests, after 5 s
    assert!(since.elapsed().as_secs() < 3, "{:?}", since.elapsed());
    w.job("short", 1);
    until("short", &|| is("short", "finished", 1));
    let kill = std::process::Command::new("kill").arg("-TERM").arg(child.id().to_string()).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

#[test]
fn a_job_that_another_daemon_took_over_is_not_rendered_any_more() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;
    let w = Watched::new();
    wave(&w.path("inbox/long"), 2, 6, 8);
    // hours of work
    let mut args = w.args(&["--samples", "60000", "--size", "640x360", "--json"]);
    args.retain(|arg| arg != "--once");
    let mut daemon =
        common::rentix(w.t.path()).args(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(daemon.stdout.take().unwrap()).lines();
    let events = lines.map(|line| serde_json::from_str::<serde_json::Value>(&line.unwrap()).unwrap());
    let mut is_taken = false;
    for event in events {
        if event["event"] == "start" {
            let claims = w.path("done/.rentix-watch/claims");
            let lock = fs::read_dir(&claims).unwrap().map(|file| file.unwrap().path());
            let lock = lock.into_iter().find(|file| file.extension().is_some_and(|e| e == "lock")).unwrap();
            let next = lock.to_str().unwrap().replace(".0.lock", ".1.lock");
            fs::write(claims.join("elsewhere.7.0.alive"), "").unwrap();
            fs::write(next, "elsewhere.7.0").unwrap();
            fs::remove_file(lock).unwrap();
            is_taken = true;
        }
        if event["event"] == "end" {
            break;
        }
    }
    assert!(is_taken);
    assert_eq!(w.status("long")["state"], "running", "what the other one writes stands");
    daemon.kill().unwrap();
    daemon.wait().unwrap();
}

#[test]
#[cfg(unix)]
fn a_daemon_tells_how_far_it_is_and_ends_when_it_is_asked() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let w = Watched::new();
    let mut args = w.args(&["--device", "cpu", "--json"]);
    args.retain(|arg| arg != "--once");
    let mut daemon =
        common::rentix(w.t.path()).args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let id = daemon.id().to_string();
    let signal = |name: &str| assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    let mut ready = String::new();
    let mut told = BufReader::new(daemon.stdout.take().unwrap());
    told.read_line(&mut ready).unwrap();
    assert!(ready.contains("\"ready\""), "{ready}");
    signal("-USR1");
    let said = BufReader::new(daemon.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(said.into_iter().any(|line| line == "no jobs"));
    signal("-TERM");
    assert_eq!(daemon.wait().unwrap().code(), Some(143));
}
