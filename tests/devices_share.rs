//! Pictures do not depend on how many devices there are, or on who takes which frame (CONTRACT 0.1, 9).

mod common;
use common::{assert_same, pictures, render, report, wave};

#[test]
fn halves_and_thirds_of_a_cpu_give_the_same_bytes() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 12, 24, 48);
    let size = ["--size", "160x90", "--threads", "3"];
    render(t, &input, "one", &[&size[..], &["--device", "cpu"]].concat(), 0);
    let one = pictures(&t.join("one"));
    for (i, device) in ["cpu/2", "cpu/3"].into_iter().enumerate() {
        for schedule in ["affinity", "fifo"] {
            let (folder, r) = (format!("{schedule}{i}"), t.join("r.json"));
            let more = ["--device", device, "--schedule", schedule, "--report", r.to_str().unwrap()];
            render(t, &input, &folder, &[&size[..], &more].concat(), 0);
            assert_same(&one, &pictures(&t.join(&folder)), &folder);
            let report = report(&r);
            let devices = report["devices"].as_array().unwrap();
            assert_eq!(devices.len(), i + 2);
            let traced: u64 = devices.iter().map(|d| d["frames"].as_u64().unwrap()).sum();
            assert_eq!(traced, 12);
        }
    }
}

#[test]
fn devices_that_cannot_be_are_named() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 1, 4, 7);
    let twice = render(t, &input, "a", &["--device", "cpu,cpu"], 2).stderr;
    assert!(twice.contains("cpu is named twice"), "{twice}");
    for parts in ["cpu/0", "cpu/x", "cpu/3"] {
        let split = render(t, &input, "a", &["--threads", "2", "--device", parts], 2).stderr;
        assert!(split.contains(parts) && split.contains("its 2 threads"), "{split}");
    }
}
