//! Many jobs, several daemons, hostile archives, and who is told of ends (CONTRACT 8).

mod common;
#[path = "common/watched.rs"]
mod watched;
use common::assert_same;
use serde_json::Value;
use std::fs;
use watched::{Watched, until};

#[test]
fn each_of_many_jobs_comes_through_every_state() {
    let w = Watched::new();
    for n in 0..100 {
        let folder = w.path(&format!("inbox/job{n}"));
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("a.obj"), "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    }
    let events = w.once(&["--json", "--device", "cpu"], 0).stdout;
    let mut states = std::collections::BTreeMap::<String, Vec<String>>::new();
    for event in events.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()) {
        if event["event"] == "state" {
            let word = |key: &str| event[key].as_str().unwrap().to_owned();
            states.entry(word("job")).or_default().push(word("state"));
        }
    }
    assert_eq!(states.len(), 100);
    for (job, states) in states {
        assert_eq!(states, ["received", "accepted", "queued", "running", "finished"], "{job}");
        assert_eq!(w.done(&job).len(), 1);
    }
    let journal = w.path("done/.rentix-watch/journal");
    let lines: String =
        fs::read_dir(journal).unwrap().map(|e| fs::read_to_string(e.unwrap().path()).unwrap()).collect();
    assert_eq!(lines.lines().count(), 500);
}

#[cfg(unix)]
#[test]
fn what_a_killed_daemon_told_nobody_of_the_next_one_tells() {
    let w = Watched::new();
    for job in ["a", "b", "c"] {
        w.job(job, 1);
    }
    let (told, killed) = (w.path("told"), w.path("killed"));
    // the first time it ends its daemon
    let command = format!(
        "echo $RENTIX_JOB >> {}; [ -e {killed} ] || {{ touch {killed}; kill -KILL $PPID; }}",
        told.display(),
        killed = killed.display()
    );
    w.once(&["--on-done", &command], -1);
    w.once(&["--on-done", &command], 0);
    let lines = || fs::read_to_string(&told).unwrap().lines().map(str::to_owned).collect::<Vec<_>>();
    let times = |job: &str| lines().iter().filter(|line| *line == job).count();
    let first = lines()[0].clone();
    assert_eq!(times(&first), 2, "the one that was being told of");
    assert!(["a", "b", "c"].iter().all(|job| times(job) > 0), "{:?}", lines());
    let all = lines();
    w.once(&["--on-done", &command], 0);
    assert_eq!(lines(), all, "once is enough");
}

#[cfg(unix)]
#[test]
fn a_command_that_does_not_end_holds_nobody_up() {
    let w = Watched::new();
    w.job("walk", 1);
    let said = w.once(&["--on-done", "sleep 1000", "--on-done-within", "0.1"], 0).stderr;
    assert!(said.contains("walk: --on-done: `sleep 1000` took more than 0.1 s and was killed"), "{said}");
    assert!(w.once(&["--on-done-within", "-1"], 2).stderr.contains("--on-done-within"));
}

#[cfg(target_os = "linux")]
#[test]
fn an_archive_of_a_million_files_is_refused_in_little_memory() {
    use std::io::{BufRead, BufReader};
    let w = Watched::new();
    let path = w.path("million.zip");
    let mut zip = zip::ZipWriter::new(std::io::BufWriter::new(fs::File::create(&path).unwrap()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for n in 0..1_000_000 {
        zip.start_file(format!("{n}.obj"), options).unwrap();
    }
    zip.finish().unwrap();
    let mut args = w.args(&["--json", "--device", "cpu"]);
    args.retain(|arg| arg != "--once");
    let mut daemon =
        common::rentix(w.t.path()).args(args).stdout(std::process::Stdio::piped()).spawn().unwrap();
    let status = format!("/proc/{}/status", daemon.id());
    let peak_mb = || {
        let status = fs::read_to_string(&status).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() / 1024
    };
    let mut lines = BufReader::new(daemon.stdout.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.next().unwrap().contains("ready"));
    let before_mb = peak_mb();
    fs::rename(path, w.path("inbox/million.zip")).unwrap();
    assert!(lines.any(|line| line.contains("\"state\":\"failed\"")));
    let took_mb = peak_mb() - before_mb;
    daemon.kill().unwrap();
    daemon.wait().unwrap();
    let error = w.status("million")["error"].as_str().unwrap().to_owned();
    assert!(error.contains("million.zip") && error.contains("more than 100000 entries"), "{error}");
    assert!(took_mb < 32, "{took_mb} MB");
    let all =
        |name: &str| fs::read_dir(w.path(name)).unwrap().map(|e| e.unwrap().file_name()).collect::<Vec<_>>();
    assert_eq!(all("done/million"), ["status.json"]);
    assert!(!w.path("done/.rentix-watch/unpacked/million").exists());
    assert_eq!(all("inbox"), ["million.zip"]);
}

#[cfg(unix)]
#[test]
fn two_daemons_share_an_inbox_and_one_goes_on_when_the_other_is_killed() {
    let w = Watched::new();
    let jobs: Vec<String> = (0..12).map(|n| format!("job{n}")).collect();
    for job in &jobs {
        w.job(job, 2);
    }
    let all_there = |more: &[&str]| {
        let want = w.wanted(&w.path("inbox/job0"), more);
        for job in &jobs {
            assert_same(&want, &w.done(job), job);
            assert_eq!(w.status(job)["state"], "finished");
            assert!(!w.path(&format!("done/{job}-2")).exists());
        }
    };
    let daemon = |more: &[&str]| {
        let mut command = common::rentix(w.t.path());
        command.args(w.args(more)).stdout(std::process::Stdio::piped()).spawn().unwrap()
    };
    let told =
        [daemon(&["--json"]), daemon(&["--json"])].map(|daemon| daemon.wait_with_output().unwrap().stdout);
    let rendered = |told: &[u8]| String::from_utf8_lossy(told).matches("\"status\":\"rendered\"").count();
    assert_eq!(told.iter().map(|told| rendered(told)).sum::<usize>(), 24, "each frame once");
    all_there(&[]);
    fs::remove_dir_all(w.path("done")).unwrap();
    let more = ["--samples", "9"];
    let (mut killed, other) = (daemon(&more), daemon(&more));
    let is_begun = || jobs.iter().any(|job| !w.done(job).is_empty());
    until("a frame", || is_begun() || killed.try_wait().unwrap().is_some());
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(other.wait_with_output().unwrap().status.success());
    all_there(&more);
}

#[test]
fn jobs_of_higher_priority_come_first_and_then_the_oldest() {
    let w = Watched::new();
    let ordered = |name: &str, text: &str| {
        fs::write(w.job(name, 1).join("job.yaml"), format!("sequence: .\n{text}\n")).unwrap();
    };
    // as many as are rendered at a time keep the others waiting, and end when they are told to
    let long: Vec<String> = (0..16).map(|n| format!("a{n:02}")).collect();
    for name in &long {
        ordered(name, "samples: 65536");
    }
    let mut command = common::rentix(w.t.path());
    command.args(w.args(&["--quiet", "--priority", "3", "--device", "cpu"]));
    let mut daemon = command.spawn().unwrap();
    let is = |job: &str, state: &str| {
        let status = fs::read_to_string(w.path("done").join(job).join("status.json")).unwrap_or_default();
        serde_json::from_str::<Value>(&status).is_ok_and(|status| status["state"] == state)
    };
    until("long jobs run", || long.iter().all(|job| is(job, "running")));
    ordered("b", "priority: -1");
    ordered("c", "priority: 0");
    w.job("d", 1);
    ordered("e", "priority: 7");
    until("others wait", || ["b", "c", "d", "e"].iter().all(|job| is(job, "queued")));
    for name in &long {
        fs::write(w.path("inbox").join(name).join(".cancel"), "").unwrap();
    }
    daemon.wait().unwrap();
    let begun = ["e", "d", "c", "b"].map(|job| w.status(job)["times"]["started_ms"].as_u64());
    assert!(begun.is_sorted() && begun[0].is_some(), "{begun:?}");
}
