//! Poses of animated glTF models agree with an evaluation of their own in numpy, `gltf_oracle.py`, whose answers are
//! in `data/gltf_poses.txt`. The models are not in this repository: without `RENTIX_SCENES` nothing is compared.

use rentix::format::{ClipChoice, Gltf, GltfOptions};
use std::collections::HashMap;
use std::path::Path;

/// The greatest distance from the oracle's place, of the diagonal of the model's box.
const TOLERANCE: f64 = 1e-4;

/// The world positions of all vertices in order.
fn vertices(gltf: &Gltf, time_s: f64) -> Vec<[f64; 3]> {
    let frame = gltf.frame(time_s, &ClipChoice::Auto).expect("a sample model can be shown");
    let mut all = Vec::new();
    for object in &frame.objects {
        for p in &object.geometry.positions.0 {
            let p = rentix::math::DVec3::from_array(p.map(f64::from));
            all.push(object.transform.map_or(p, |world| world.transform_point3(p)).to_array());
        }
    }
    all
}

#[test]
fn poses_agree_with_numpy() {
    let Some(folder) = option_env!("RENTIX_SCENES").map(|f| Path::new(f).join("gltf")).filter(|f| f.is_dir())
    else {
        eprintln!("skipped: RENTIX_SCENES names no folder with gltf/");
        return;
    };
    let mut opened: HashMap<&str, Gltf> = HashMap::new();
    let mut worst = (0.0, "");
    let mut lines = 0;
    for line in include_str!("data/gltf_poses.txt").lines() {
        let mut words = line.split(' ');
        let name = words.next().expect("a line names its model");
        let mut number = || words.next().and_then(|w| w.parse::<f64>().ok());
        let (time_s, count) = (number().expect("a time"), number().expect("a count"));
        let wanted: Vec<f64> = std::iter::from_fn(number).collect();
        let (wanted, rest) = wanted.as_chunks::<3>();
        assert!(wanted.len() == 14 && rest.is_empty(), "{name}");
        let gltf = opened.entry(name).or_insert_with(|| {
            Gltf::open(&folder.join(name), &GltfOptions::default()).expect("a sample model can be read")
        });
        let all = vertices(gltf, time_s);
        assert_eq!(all.len() as f64, count, "{name}");
        let corner = |pick: fn(f64, f64) -> f64, from: f64| {
            all.iter().fold([from; 3], |m, p| [0, 1, 2].map(|k| pick(m[k], p[k])))
        };
        let mut got = vec![corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)];
        got.extend((0..12).map(|i| all[i * (all.len() - 1) / 11]));
        let distance = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        let size = distance(&wanted[0], &wanted[1]);
        for (got, wanted) in got.iter().zip(wanted) {
            let off = distance(got, wanted) / size;
            assert!(off < TOLERANCE, "{name} at {time_s} s: {got:?}, not {wanted:?}");
            worst = if off > worst.0 { (off, name) } else { worst };
        }
        lines += 1;
    }
    eprintln!("{lines} poses, the greatest distance is {:.1e} of the box ({})", worst.0, worst.1);
}
