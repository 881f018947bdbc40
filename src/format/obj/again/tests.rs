use crate::format::library::Library;
use crate::format::obj::{Lines, Parsed};
use crate::format::text::Text;
use crate::format::{FormatError, ReadOptions};
use crate::scene::{Geometry, Material, Part};
use crate::warning::Warnings;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// What comes of reading a frame.
struct Outcome {
    geometry: Arc<Geometry>,
    names: Vec<Vec<u8>>,
    parsed: Option<Parsed>,
    /// Whether all was not read anew.
    again: bool,
}

fn library() -> Library {
    let material = |kd: f32| Part::new(Material { kd: [kd; 3], ..Material::default() });
    [("red", 0.1), ("rot", 0.1), ("blue", 0.2)]
        .map(|(name, kd)| (name.as_bytes().to_vec(), material(kd)))
        .into_iter()
        .collect()
}

fn read(
    bytes: &[u8],
    before: Option<&Parsed>,
    options: &ReadOptions,
    library: &Library,
) -> (Result<Outcome, FormatError>, Warnings) {
    let mut warnings = Warnings::default();
    let outcome = (|| {
        let path = Path::new("a.obj");
        let text = Text::new(bytes, path)?;
        let lines = Lines::new(&text, path, options.lenient, before, &mut warnings)?;
        let again = lines.before.is_some();
        let shape = lines.into_shape(library, options, &mut warnings);
        let (geometry, names, parsed) = shape.keep(Some(bytes.to_vec()));
        Ok(Outcome { geometry, names, parsed, again })
    })();
    (outcome, warnings)
}

/// Reads a frame with and without the one before and compares; the one that was read with it.
fn same(bytes: &[u8], before: Option<&Parsed>, options: &ReadOptions, library: &Library) -> Option<Outcome> {
    let (fast, fast_warnings) = read(bytes, before, options, library);
    let (full, full_warnings) = read(bytes, None, options, library);
    let text = || {
        let before = before.map(|b| String::from_utf8_lossy(&b.bytes).into_owned());
        format!("{options:?}\n{before:?}\n{:?}", String::from_utf8_lossy(bytes))
    };
    assert_eq!(fast_warnings.list(), full_warnings.list(), "{}", text());
    match (fast, full) {
        (Ok(fast), Ok(full)) => {
            assert_eq!(fast.geometry.hash(), full.geometry.hash(), "{}", text());
            // by content too: hashes are compared above
            assert_eq!(format!("{:?}", fast.geometry), format!("{:?}", full.geometry), "{}", text());
            assert_eq!(fast.names, full.names, "{}", text());
            let kept = |parsed: &Option<Parsed>| format!("{:?}", parsed.as_ref().map(|p| &p.known));
            assert_eq!(kept(&fast.parsed), kept(&full.parsed), "{}", text());
            Some(fast)
        }
        (Err(fast), Err(full)) => {
            assert_eq!(fast.to_string(), full.to_string(), "{}", text());
            None
        }
        (fast, full) => {
            panic!("{:?} but {:?}\n{}", fast.map(|f| f.again), full.map(|f| f.again), text())
        }
    }
}

const TEXTS: &[&str] = &[
    // triangles alone
    "v 0 0 0\nv 1.5 0 0\nv 0.25 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n",
    // of Blender
    "# Blender v2.81\n# www.blender.org\nmtllib a_0001.mtl\no Body_0001\nv -0.123456 0.000000 1.250000\nv 1.000000 0.000000 0.000000\nv 1.000000 1.000000 0.000000\nv 0.000000 1.000000 0.000000\nv 2.000000 0.500000 0.750000\nvt 0.000000 0.000000\nvt 1.000000 0.000000\nvt 0.500000 1.000000\nvn 0.0000 0.0000 1.0000\nvn 0.7071 0.0000 0.7071\nusemtl red\ns 1\nf 1/1/1 2/2/1 3/3/1 4/1/2\nf 2/2/2 5/3/2 3/1/1\nusemtl blue\nf 1/1/2 2/2/2 5/3/2\no Other\nv 3 3 3\nvt 0.25 0.25\nvn 0 1 0\nf 6/4/3 1/1/3 2/2/1\n",
    // polygons that are concave or become so, smoothing, several groups
    "g a\nv 0 0 0\nv 2 1 0\nv 4 0 0\nv 2 4 0\nv 1 2 1e-1\ns 1\nf 1 2 3 4\nf 1 2 3 4 5\ns 2\nf 1 2 5\nf 3 4 5\ns off\nf 5 4 1\n",
    // CR LF, comments behind values, blanks
    "v 0 0 0\r\nv 1 0 0 # so\r\nv  1\t1 0 \r\nvn 0 0 1\r\nvn 0 1 0\r\nf 1//1 2//1 3//2\r\nf 3//1 2//2 1//1\r\n\r\nf 1//1 3//1 2//1",
    // indices that count back, vertices between faces
    "vt 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\nv 5 5 5\nvn 1 0 0\nf -3//-1 -2//-2 -1//-1\nf 1/1 2/1 4\nf 1 2 3/1/2\n",
    // colours, w, numbers of all kinds
    "v 0 0 0 1\nv 1e0 0 -0 1.0\nv +.5 1234567.12345678 123456789012345678901234567890\nv 0.1 0.2 0.3 0.5 0.5 0.5\nf 1 2 3\nf 1 2 4\n",
    "v 0 0 0 1\nv 1e0 0 -0 1.0\nv +.5 1234567.12345678 1234567890123456789012\nf 1 2 3\nf 3 2 1\nvn 1 2 3 4\nvt 1\nvt 1 2 3\nf 1/1/1 2/2/1 3/1/1\n",
    // what is left out, what is wrong
    "ny 1 2\nnv 3\nv 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nf 1 2\nf 1 3 4\np 1\nf 4 3 1\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n3\nf 1 2 3\n",
    "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\rf 3 2 1\r",
    "vn 0 0 1\nv 0 0 0\nvn 0 1 1\nv 1 0 0\nvn 1 0 0\nv 0 1 0\nvn 0 0 0\n# C:\\out\\\nusemtl none\nf 1//1 2//2 3//3\nusemtl rot\nf 3//1 2//2 1//3\nf 1//3 3//2 2//1\n",
];

/// Long enough that lines are read many bytes at a time.
fn exported() -> String {
    let mut text = String::from("# Blender\nmtllib b_0001.mtl\no Grid\n");
    for k in 0..12 {
        let _ = writeln!(
            text,
            "v {:.6} {:.6} {:.6}",
            (k % 4) as f64 * 0.731,
            (k / 4) as f64 - 0.5,
            (k * k % 7) as f64 * -0.0123
        );
    }
    for k in 0..12 {
        let _ = writeln!(text, "vt {:.6} {:.6}", (k % 4) as f64 / 3.0, (k / 4) as f64 / 2.0);
    }
    for k in 0..5 {
        let _ = writeln!(text, "vn {:.4} {:.4} {:.4}", k as f64 * 0.2, -0.5, 0.25 * k as f64);
    }
    text += "usemtl red\ns off\n";
    for (a, n) in [(1, 1), (2, 2), (3, 2), (5, 3), (6, 5), (7, 4)] {
        let _ = writeln!(text, "f {a}/{a}/{n} {0}/{0}/{n} {1}/{1}/{n} {2}/{2}/{n}", a + 1, a + 5, a + 4);
    }
    // near the end of a text lines are read otherwise
    text + "# " + &"-".repeat(80) + "\n"
}

#[test]
fn a_zero_byte_fails_a_frame_however_it_is_read() {
    let (options, library) = (ReadOptions::default(), library());
    let before = same(TEXTS[0].as_bytes(), None, &options, &library).unwrap().parsed.unwrap();
    for behind in ["# so\0\n", "g \0\n", "\0\0\0\0", "ny\0\n"] {
        let text = format!("{}{behind}", TEXTS[0]);
        assert!(same(text.as_bytes(), Some(&before), &options, &library).is_none(), "{behind:?}");
    }
    assert!(same(b"<html>\n<p>f 1 2 3\n", Some(&before), &options, &library).is_none());
}

/// Splitmix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % count as u64) as usize
    }
}

/// Where a line that is picked begins, and its length with its end.
fn line(text: &[u8], random: &mut Random) -> (usize, usize) {
    let lines: Vec<&[u8]> = text.split_inclusive(|&b| b == b'\n').collect();
    let picked = random.below(lines.len().max(1));
    (lines[..picked.min(lines.len())].iter().map(|l| l.len()).sum(), lines.get(picked).map_or(0, |l| l.len()))
}

fn edit(text: &mut Vec<u8>, random: &mut Random) {
    const LIKELY: &[u8] = b"0123456789.-+eEfvnt /\n\r#\\sogu \t";
    if text.is_empty() {
        return;
    }
    let at = random.below(text.len());
    let byte = match random.below(8) {
        0 => random.below(256) as u8,
        _ => LIKELY[random.below(LIKELY.len())],
    };
    match random.below(16) {
        0 => text[at] = byte,
        1 => text.insert(at, byte),
        2 => drop(text.remove(at)),
        3 => {
            let (start, length) = line(text, random);
            let copy = text[start..start + length].to_vec();
            let (to, _) = line(text, random);
            text.splice(to..to, copy);
        }
        4 => {
            let (start, length) = line(text, random);
            text.drain(start..start + length);
        }
        // a value becomes another: what happens in sequences
        5 => {
            let digits: Vec<usize> = (0..text.len()).filter(|&i| text[i].is_ascii_digit()).collect();
            if let Some(&at) = digits.get(random.below(digits.len().max(1))) {
                text.splice(at..at, (0..random.below(9)).map(|_| b'0' + random.below(10) as u8));
            }
        }
        _ => {
            let of_values = |i: usize| {
                let start = text[..i].iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
                text[i].is_ascii_digit() && text[start] == b'v'
            };
            let digits: Vec<usize> = (0..text.len()).filter(|&i| of_values(i)).collect();
            for _ in 0..4 {
                if let Some(&at) = digits.get(random.below(digits.len().max(1))) {
                    text[at] = b'0' + random.below(10) as u8;
                }
            }
        }
    }
}

/// Sequences of texts, each with a few edits; how many frames were read, and how many of them again.
fn sequences(seed: u64, frames: usize) -> (usize, usize) {
    let mut random = Random(seed);
    let library = library();
    let (mut read, mut again) = (0, 0);
    while read < frames {
        let mut text = match random.below(TEXTS.len() + 4) {
            0..4 => exported().into_bytes(),
            k => TEXTS[k - 4].as_bytes().to_vec(),
        };
        let options = ReadOptions {
            lenient: random.below(4) == 0,
            smooth_angle_deg: (random.below(6) == 0).then_some(60.0),
            ..ReadOptions::default()
        };
        let mut before = same(&text, None, &options, &library).and_then(|outcome| outcome.parsed);
        for _ in 0..8 {
            let keep = text.clone();
            for _ in 0..=random.below(2) {
                edit(&mut text, &mut random);
            }
            let outcome = same(&text, before.as_ref(), &options, &library);
            read += 1;
            again += usize::from(outcome.as_ref().is_some_and(|o| o.again));
            // what fails or cannot be known is mostly undone, so that there is something to go on with
            match outcome.and_then(|outcome| outcome.parsed) {
                Some(parsed) => before = Some(parsed),
                None if random.below(4) > 0 => text = keep,
                None => {}
            }
        }
    }
    (read, again)
}

/// What is read of the second text by the first, which must be possible.
fn read_again(first: &str, second: &str) -> [Arc<Geometry>; 2] {
    let (options, library) = (ReadOptions::default(), library());
    let first = same(first.as_bytes(), None, &options, &library).unwrap();
    let second = same(second.as_bytes(), first.parsed.as_ref(), &options, &library).unwrap();
    assert!(second.again);
    [first.geometry, second.geometry]
}

#[test]
fn what_is_the_same_is_shared() {
    let text = exported();
    let moved = text.replace("0.731000", "0.741000");
    let [a, b] = read_again(&text, &moved);
    assert_ne!(a.positions, b.positions);
    let share = |x: &[[u32; 3]], y: &[[u32; 3]]| x.as_ptr() == y.as_ptr();
    assert!(share(&a.triangles.0, &b.triangles.0) && a.faces.corners.as_ptr() == b.faces.corners.as_ptr());
    let (ta, tb) = (a.texcoords.as_ref().unwrap(), b.texcoords.as_ref().unwrap());
    assert!(share(&ta.corners.0, &tb.corners.0) && ta.values.0.as_ptr() == tb.values.0.as_ptr());
    assert_eq!(a.normals, b.normals);
}

#[test]
fn other_names_and_normals_leave_faces_as_they_are() {
    let text = exported();
    let renumbered = text
        .replace("usemtl red", "usemtl red.001")
        .replace("o Grid", "o Grid.001")
        .replace("b_0001", "b_0002")
        .replace("usemtl", "vn 0.0000 1.0000 0.0000\nusemtl")
        .replace("/5 ", "/6 ")
        .replace("/5\n", "/6\n");
    let [a, b] = read_again(&text, &renumbered);
    assert_eq!(a.triangles.0.as_ptr(), b.triangles.0.as_ptr());
    assert_ne!(a.normals, b.normals);
}

#[test]
fn a_quad_that_becomes_concave_is_cut_the_other_way() {
    let convex = "v 0 0 0\nv 2 1 0\nv 4 0 0\nv 2 4 0\nf 2 3 4 1\n";
    let [a, b] = read_again(&convex.replace("2 1 0", "2 -1 0"), &convex.replace("f 2", "f  2"));
    assert_eq!((a.faces.hash(), a.triangles.0.len()), (b.faces.hash(), b.triangles.0.len()));
    let notch = &convex.replace("f 2 3 4 1", "f 1 2 3 4");
    let [a, b] = read_again(&notch.replace("2 1 0", "2 -1 0"), notch);
    assert_ne!(a.triangles, b.triangles);
}

#[test]
fn the_frame_before_changes_nothing() {
    let (read, again) = sequences(1, 4000);
    assert!(again * 5 > read, "{again} of {read}");
}

/// `cargo test --release --lib obj::again -- --ignored`
#[test]
#[ignore = "long"]
fn the_frame_before_changes_nothing_in_very_many_cases() {
    let (read, again) = sequences(2, 200_000);
    println!("{read} frames, {again} of them read again");
    assert!(again * 5 > read, "{again} of {read}");
}
