//! Order, threads, chunks and what is resident never change a picture (CONTRACT 0.1).

mod common;
use common::{assert_same, pictures, render, report, wave};

#[test]
fn order_threads_chunks_and_cold_give_the_same_bytes() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 7, 24, 48);
    let base = ["--size", "160x90", "--samples", "3"];
    let with = |more: &[&'static str]| [&base[..], more].concat();
    render(t, &input, "a", &base, 0);
    let a = pictures(&t.join("a"));
    assert_eq!(a.values().collect::<std::collections::BTreeSet<_>>().len(), 7, "seven different pictures");
    let ways: [&[&str]; 5] = [
        &["--threads", "1"],
        &["--threads", "2", "--order", "shuffle"],
        &["--order", "reverse"],
        &["--no-cache"],
        &["--cold"],
    ];
    for (i, more) in ways.into_iter().enumerate() {
        render(t, &input, &format!("b{i}"), &with(more), 0);
        assert_same(&a, &pictures(&t.join(format!("b{i}"))), &more.join(" "));
    }
    for chunk in ["1/3", "2/3", "3/3"] {
        render(t, &input, "chunks", &with(&["--chunk", chunk]), 0);
    }
    assert_same(&a, &pictures(&t.join("chunks")), "three chunks");
    render(t, &input, "one", &with(&["--frames", "7"]), 0);
    assert_eq!(pictures(&t.join("one"))["wave_0007.png"], a["wave_0007.png"], "frame 7 alone");
}

#[test]
fn cold_frames_are_cold_and_still_parts_stay() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 8, 12);
    let r = t.join("r.json");
    let r = r.to_str().unwrap();
    render(t, &input, "cold", &["--size", "32x18", "--cold", "--report", r], 0);
    let cold = report(r.as_ref());
    assert!(cold["frames"].as_array().unwrap().iter().all(|f| f["warm"] == false), "{cold}");
    render(t, &input, "warm", &["--size", "32x18", "--report", r], 0);
    let warm = report(r.as_ref());
    let uploaded = |i: usize| warm["frames"][i]["bytes"]["uploaded"].as_u64().unwrap();
    assert!(uploaded(1) < uploaded(0), "faces and materials of the second frame were sent again: {warm}");
}
