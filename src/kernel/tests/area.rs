//! Area lights against the integral they estimate.

use super::*;

/// Points of the midpoint rule on a side.
const STEPS: u32 = 200;

/// ∫ (1/π)·|cos θ'|·max(0, N·L)/d² dA over the rectangle around (x, 0, z) that faces ±z, from the origin with N = +z.
fn integral(x: f64, half: f64, z: f64) -> f64 {
    let cell = 2.0 * half / f64::from(STEPS) * (2.2 * half / f64::from(STEPS));
    let mut sum = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS);
            let p = DVec3::new(x + half * (2.0 * at(i) - 1.0), half * (2.2 * at(j) - 1.0), z);
            let cosine = z / p.length();
            sum += cosine * cosine / p.length_squared() * cell;
        }
    }
    sum / std::f64::consts::PI
}

fn lamp(ke: f32) -> Material {
    Material { kd: [0.0; 3], ke: [ke, 0.5 * ke, 0.25 * ke], ..Material::default() }
}

/// One point is seen by all samples of the pixel.
fn from_afar(samples: u32, light_samples: u32) -> Shot {
    let mut shot =
        Shot { samples, ambient: Vec3::ZERO, ..shot(vec![Light::Area { samples: light_samples }]) };
    shot.camera.fov_deg = 0.001;
    shot
}

#[test]
fn two_lamps_light_as_their_integral_says() {
    let wall = Material { kd: [1.0; 3], ..Material::default() };
    let geometries = || {
        vec![
            rectangle(0.0, 1.0, 0.0, Some(&wall)),
            rectangle(1.0, 0.5, 2.0, Some(&lamp(8.0))),
            rectangle(-2.0, 1.0, 1.5, Some(&lamp(1.0))),
        ]
    };
    let expected = 8.0 * integral(1.0, 0.5, 2.0) + integral(-2.0, 1.0, 1.5);
    for (samples, light_samples) in [(256, 4), (4, 256)] {
        let got = middle(geometries(), &from_afar(samples, light_samples));
        for (k, share) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            let off = f64::from(got[k]) / (share * expected) - 1.0;
            assert!(off.abs() < 0.01, "{samples} × {light_samples}: {got:?} is off by {off}");
        }
    }
    let counts = render_in_tiles(&frame(geometries()), &from_afar(2, 3), 3, 5).1;
    assert_eq!(counts.shadow, 15 * 2 * 3);
}

#[test]
fn a_blocker_before_half_a_lamp_takes_that_half() {
    // the lamp in x from 0.5 to 1.5 at z = 2; seen from the origin the blocker at z = 1 covers x > 1 of it
    let wall = Material { kd: [1.0; 3], ..Material::default() };
    let geometries = vec![
        rectangle(0.0, 0.2, 0.0, Some(&wall)),
        rectangle(1.0, 0.5, 2.0, Some(&lamp(8.0))),
        rectangle(1.0, 0.5, 1.0, Some(&Material::default())),
    ];
    let got = f64::from(middle(geometries, &from_afar(256, 4))[0]);
    // the left half: x from 0.5 to 1, y as before
    let half = {
        let (mut sum, n) = (0.0, 400);
        for i in 0..n {
            for j in 0..n {
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
                let p = DVec3::new(0.5 + 0.5 * at(i), 0.5 * (2.2 * at(j) - 1.0), 2.0);
                sum += 4.0 / p.length_squared().powi(2) * (0.5 * 1.1 / f64::from(n * n));
            }
        }
        8.0 * sum / std::f64::consts::PI
    };
    assert!((got / half - 1.0).abs() < 0.02, "{got}, not {half}");
}

#[test]
fn nothing_that_glows_is_no_light() {
    let wall = rectangle(0.0, 1.0, 0.0, Some(&Material::default()));
    assert_eq!(middle(vec![wall], &from_afar(1, 1)), [0.0; 3]);
}
