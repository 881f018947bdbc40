//! FLIP is NVIDIA's FLIP: ten pairs of pictures against values of their evaluator, within 1e-4.

use rentix::film::compare::{Channel, Picture, Samples, compare};
use std::path::Path;
use std::process::Command;

/// What `flip_oracle.py` printed for [`pairs`], one a line.
const EXPECTED: &str = include_str!("data/flip.txt");

type Pixel = [u8; 3];

struct Pair {
    name: &'static str,
    size: [u32; 2],
    a: fn(u32, u32) -> Pixel,
    b: fn(u32, u32) -> Pixel,
}

/// A value that looks random and is the same everywhere.
fn noise(x: u32, y: u32, seed: u32) -> u8 {
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    (h ^ (h >> 12)) as u8
}

fn gradient(x: u32, y: u32) -> Pixel {
    [(x * 2) as u8, (y * 3) as u8, (x + y) as u8]
}

fn disk(x: u32, y: u32, cx: u32, color: Pixel) -> Pixel {
    let (dx, dy) = (x as i32 - cx as i32, y as i32 - 30);
    if dx * dx + dy * dy < 400 { color } else { [30, 40, 60] }
}

fn pairs() -> [Pair; 10] {
    const S: [u32; 2] = [96, 64];
    [
        Pair { name: "black and white", size: S, a: |_, _| [0; 3], b: |_, _| [255; 3] },
        Pair { name: "green and blue", size: S, a: |_, _| [0, 255, 0], b: |_, _| [0, 0, 255] },
        Pair {
            name: "one code",
            size: S,
            a: gradient,
            b: |x, y| gradient(x, y).map(|c| c.saturating_add(1)),
        },
        Pair {
            name: "moved disk",
            size: S,
            a: |x, y| disk(x, y, 40, [200, 90, 20]),
            b: |x, y| disk(x, y, 43, [200, 90, 20]),
        },
        Pair {
            name: "other colour",
            size: S,
            a: |x, y| disk(x, y, 40, [200, 90, 20]),
            b: |x, y| disk(x, y, 40, [200, 20, 90]),
        },
        Pair {
            name: "one pixel",
            size: S,
            a: gradient,
            b: |x, y| if (x, y) == (50, 20) { [255, 0, 255] } else { gradient(x, y) },
        },
        Pair {
            name: "noise on a gradient",
            size: S,
            a: gradient,
            b: |x, y| gradient(x, y).map(|c| c.saturating_add(noise(x, y, 1) / 8)),
        },
        Pair {
            name: "noise and noise",
            size: S,
            a: |x, y| [0, 1, 2].map(|s| noise(x, y, s)),
            b: |x, y| [3, 4, 5].map(|s| noise(x, y, s)),
        },
        Pair {
            name: "fine stripes",
            size: [130, 20],
            a: |x, _| [(x % 2 * 255) as u8; 3],
            b: |x, _| [((x + 1) % 2 * 255) as u8; 3],
        },
        Pair {
            name: "smaller than the filters",
            size: [3, 2],
            a: gradient,
            b: |x, y| [noise(x, y, 9), 100, 200],
        },
    ]
}

impl Pair {
    fn pixels(&self, of: fn(u32, u32) -> Pixel) -> Vec<Pixel> {
        let [width, height] = self.size;
        (0..height).flat_map(|y| (0..width).map(move |x| of(x, y))).collect()
    }

    fn picture(&self, of: fn(u32, u32) -> Pixel) -> Picture {
        let pixels = self.pixels(of);
        let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| Channel {
            name: name.into(),
            samples: Samples::Share(pixels.iter().map(|p| u16::from(p[c]) * 257).collect()),
        });
        Picture { size: self.size, channels: channels.collect() }
    }

    fn flip(&self) -> f64 {
        compare(&self.picture(self.a), &self.picture(self.b)).unwrap().flip
    }

    fn write_ppm(&self, of: fn(u32, u32) -> Pixel, path: &Path) {
        let mut bytes = format!("P6\n{} {}\n255\n", self.size[0], self.size[1]).into_bytes();
        bytes.extend(self.pixels(of).as_flattened());
        std::fs::write(path, bytes).unwrap();
    }
}

fn values(printed: &str) -> Vec<f64> {
    printed.split_whitespace().map(|w| w.parse().unwrap()).collect()
}

fn assert_flip(expected: &[f64]) {
    let pairs = pairs();
    assert_eq!(expected.len(), pairs.len());
    for (pair, expected) in pairs.iter().zip(expected) {
        let flip = pair.flip();
        assert!(
            (flip - expected).abs() < 1e-4,
            "{}: {flip} where NVIDIA's evaluator has {expected}",
            pair.name
        );
    }
}

#[test]
fn flip_is_that_of_the_paper() {
    assert_flip(&values(EXPECTED));
}

#[test]
#[ignore = "needs Python with flip-evaluator; cargo test --test flip -- --ignored"]
fn the_expected_values_are_those_of_the_evaluator() {
    let folder = tempfile::tempdir().unwrap();
    let mut python = Command::new("python3");
    python.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/flip_oracle.py"));
    for (i, pair) in pairs().iter().enumerate() {
        for (letter, of) in [("a", pair.a), ("b", pair.b)] {
            let path = folder.path().join(format!("{letter}{i}.ppm"));
            pair.write_ppm(of, &path);
            python.arg(path);
        }
    }
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = values(&String::from_utf8(output.stdout).unwrap());
    assert_flip(&printed);
    let kept = values(EXPECTED);
    assert!(
        kept.iter().zip(&printed).all(|(a, b)| (a - b).abs() < 1e-6),
        "tests/data/flip.txt should be {printed:?}"
    );
}
