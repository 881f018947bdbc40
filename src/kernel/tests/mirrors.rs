//! Models 3 and 5 to 8: mirrors and glass. Behind the eye, at z = 6, hangs what a mirror in z = 0 shows.

use super::*;

const SHOWN: [f32; 3] = [0.25, 0.5, 1.0];
/// The weights of [`material`]: its Ks.
const KS: [f32; 3] = [0.5, 0.6, 0.1];

fn by(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] * b[k])
}

/// Without light of its own or from lamps.
fn bare(illum: u8, ks: [f32; 3], ni: f32) -> Material {
    Material { kd: [0.0; 3], ks, ns: 10.0, ni, illum, ..Material::default() }
}

fn black() -> Shot {
    Shot { background: Background::Color(Vec3::ZERO), ..shot(vec![]) }
}

#[test]
fn a_mirror_adds_what_it_shows() {
    let shot = shot(vec![light(Falloff::None)]);
    let with = |illum| vec![rectangle(0.0, 1.0, 0.0, Some(&material(illum))), shows(0.0, 9.0, 6.0, SHOWN)];
    assert_near(middle(with(3), &shot), sum(&[A, D, S, by(KS, SHOWN)]));
    // model 8 shows the background and traces no ray
    assert_near(middle(with(8), &shot), sum(&[A, D, S, by(KS, [0.1, 0.2, 0.4])]));
    let counts = render_in_tiles(&frame(with(8)), &shot, 3, 5).1;
    assert_eq!((counts.mirrored, counts.refracted), (0, 0));
    // d < 1: the share of the mirror, and the background straight on
    let half = Material { d: 0.5, ..material(3) };
    let got = middle(vec![rectangle(0.0, 1.0, 0.0, Some(&half)), shows(0.0, 9.0, 6.0, SHOWN)], &shot);
    let all = sum(&[A, D, S, by(KS, SHOWN), [0.1, 0.2, 0.4]]);
    assert_near(got, times(all, 0.5));
}

#[test]
fn model_5_mirrors_by_schlick() {
    // N = (sin 60°, 0, cos 60°): N·V = 1/2, F = Ks + (1 − Ks)/32; mirrored to (sin 60°, 0, −1/2), at z = −1 in x = √3
    let wall = rectangle(0.0, 1.0, 0.0, Some(&bare(5, KS, 1.0)));
    let tilted = tilted(wall, [0.866_025_4, 0.0, 0.5]);
    let got = middle(vec![tilted, shows(1.732_050_8, 0.2, -1.0, [1.0; 3])], &black());
    assert_near(got, KS.map(|ks| ks + (1.0 - ks) / 32.0));
}

#[test]
fn the_highlight_of_model_5_grows_with_the_angle_to_the_light() {
    // the light in (L·V) = −1/2: H is 60° from L, F = Ks + (1 − Ks)/32; N·H = 1/2 to the power of 1
    let m = Material { ns: 1.0, ..bare(5, KS, 1.0) };
    // Ng = +z, N = (1, 0, 1)/√2 … the light must be above the wall, so the eye looks from 60° aside
    let mut shot = black();
    shot.camera.eye = DVec3::new(-4.0 * 0.75f64.sqrt(), 0.0, 2.0);
    shot.camera.look_at = DVec3::ZERO;
    shot.depth = 0;
    let direction = Vec3::new(-0.75f32.sqrt(), 0.0, -0.5);
    shot.lights = vec![Light::Directional { direction, color: Vec3::ONE, intensity: 1.0 }];
    // V = (−√¾, 0, ½), L = (√¾, 0, ½): H = N = +z, L·H = ½, N·H = 1
    let got = middle(vec![rectangle(0.0, 1.0, 0.0, Some(&m))], &shot);
    assert_near(got, KS.map(|ks| ks + (1.0 - ks) / 32.0));
}

#[test]
fn glass_shows_what_is_before_and_behind_it() {
    let tf = [0.9, 0.5, 0.25];
    let behind = [1.0, 0.75, 0.5];
    let with = |m: Material| {
        vec![
            rectangle(0.0, 1.0, 0.0, Some(&Material { tf, ni: 1.5, ..m })),
            shows(0.0, 1.0, -1.0, behind),
            shows(0.0, 9.0, 6.0, SHOWN),
        ]
    };
    // d has no say
    let got = middle(with(Material { d: 0.3, ..material(6) }), &shot(vec![light(Falloff::None)]));
    let refracted = by(by(KS.map(|ks| 1.0 - ks), tf), behind);
    assert_near(got, sum(&[A, D, S, by(KS, SHOWN), refracted]));
    // model 7 without Ks: F0 = ((1 − 1.5)/2.5)² = 0.04
    let got = middle(with(bare(7, [0.0; 3], 1.5)), &black());
    assert_near(got, sum(&[times(SHOWN, 0.04), times(by(tf, behind), 0.96)]));
    // with Ks: F0 = Ks
    let got = middle(with(bare(7, KS, 1.5)), &black());
    assert_near(got, sum(&[by(KS, SHOWN), by(by(KS.map(|ks| 1.0 - ks), tf), behind)]));
    // its highlight has F for Ks, at L·H = √0.9 as good as F0: 0.04 · 2·(1, 0.5, 0.25) · 0.9^5
    let lit = Shot { depth: 0, ..black() };
    let lit = Shot { lights: vec![light(Falloff::None)], ..lit };
    let got = middle(with(bare(7, [0.0; 3], 1.5)), &lit);
    assert_near(got, times([2.0, 1.0, 0.5], 0.04 * 0.590_49));
}

#[test]
fn glass_bends() {
    // N is 30° off: sin 30°/1.5; T = (−0.182730, 0, −0.983163), at z = −1 in x = −0.185859
    let pane = || {
        let glass = bare(6, [0.0; 3], 1.5);
        tilted(rectangle(0.0, 1.0, 0.0, Some(&glass)), [0.5, 0.0, 0.866_025_4])
    };
    let target = |x| shows(x, 0.002, -1.0, SHOWN);
    assert_near(middle(vec![pane(), target(-0.185_859)], &black()), SHOWN);
    assert_near(middle(vec![pane(), target(-0.180)], &black()), [0.0; 3]);
    // out of it: sin = 0.75, T = −1.5·V + (1.5·0.866025 − 0.661438)·N = (0.318800, 0, −0.947822): x = 0.336350
    let from_behind = reversed(pane());
    assert_near(middle(vec![from_behind, target(0.336_350)], &black()), SHOWN);
}

#[test]
fn leaving_the_denser_side_the_cosine_outside_counts() {
    // as above: cos 0.661438 outside, (1 − c)^5 = 0.0044485, F = 0.04 + 0.96 · 0.0044485 = 0.0442706
    let glass = bare(7, [0.0; 3], 1.5);
    let pane = reversed(tilted(rectangle(0.0, 1.0, 0.0, Some(&glass)), [0.5, 0.0, 0.866_025_4]));
    let got = middle(vec![pane, shows(0.336_350, 0.002, -1.0, [1.0; 3])], &black());
    assert_near(got, [1.0 - 0.044_270_6; 3]);
}

#[test]
fn beyond_the_critical_angle_all_is_mirrored() {
    // N is 60° off, sin 60° · 1.5 > 1; mirrored to (sin 60°, 0, −1/2)
    let pane = |illum| {
        let glass = Material { tf: [0.5; 3], ..bare(illum, KS, 1.5) };
        reversed(tilted(rectangle(0.0, 1.0, 0.0, Some(&glass)), [0.866_025_4, 0.0, 0.5]))
    };
    let target = || shows(1.732_050_8, 0.2, -1.0, SHOWN);
    assert_near(middle(vec![pane(7), target()], &black()), SHOWN);
    // Ks·Ir + (1 − Ks)·Tf·Ir
    assert_near(middle(vec![pane(6), target()], &black()), by(KS.map(|ks| ks + (1.0 - ks) * 0.5), SHOWN));
}

#[test]
fn glass_in_glass_knows_what_is_around_it() {
    // Between equal densities nothing is mirrored. From 1.5 into 2 and back F = (0.5/3.5)² = 0.0204082 each, 0.04 at
    // the outer surface. Three bounces leave no room for light that goes to and fro.
    let outer = bare(7, [0.0; 3], 1.5);
    let through = |inner: Material| {
        let geometries = vec![
            rectangle(0.0, 1.0, 0.0, Some(&outer)),
            rectangle(0.0, 1.0, -1.0, Some(&inner)),
            reversed(rectangle(0.0, 1.0, -2.0, Some(&inner))),
            shows(0.0, 1.0, -3.0, [1.0; 3]),
        ];
        middle(geometries, &Shot { depth: 3, ..black() })[0]
    };
    let f = 0.020_408_16_f32;
    let dense = through(bare(7, [0.0; 3], 2.0));
    assert!((dense - 0.96 * (1.0 - f) * (1.0 - f)).abs() < 1e-6, "{dense}");
    let same = through(Material { ns: 11.0, ..bare(7, [0.0; 3], 1.5) });
    assert!((same - 0.96).abs() < 1e-6, "{same}");
}

#[test]
fn a_ninth_medium_is_ignored_and_counted() {
    let glass = |i: u16| bare(6, [0.0; 3], 1.0 + f32::from(i) / 16.0);
    let panes = |n: u16| (0..n).map(|i| rectangle(0.0, 1.0, -0.1 * f32::from(i), Some(&glass(i)))).collect();
    let one_pixel = Shot { size: [1, 1], depth: 20, ..black() };
    let counts = |n| render_in_tiles(&frame(panes(n)), &one_pixel, 1, 1).1;
    assert_eq!((counts(8).refracted, counts(8).media_ignored), (8, 0));
    assert_eq!((counts(9).refracted, counts(9).media_ignored), (9, 1));
}

#[test]
fn rays_bounce_as_deep_and_as_long_as_they_count() {
    // mirrors that glow, face to face: 1 + 1/2 + 1/4 + …
    let mirror = Material { ke: [1.0; 3], ..bare(3, [0.5; 3], 1.0) };
    let pair = || vec![rectangle(0.0, 1.0, 0.0, Some(&mirror)), rectangle(0.0, 9.0, 6.0, Some(&mirror))];
    let with = |depth, prune| middle(pair(), &Shot { depth, prune, ..black() })[0];
    assert_eq!((with(0, 0.0), with(1, 0.0), with(3, 0.0)), (1.0, 1.5, 1.875));
    // the weight of the second bounce is 1/4
    assert_eq!((with(10, 0.3), with(10, 0.25)), (1.5, 1.75));
    // a wholly transparent surface on the way is a crossing
    let pane = rectangle(0.0, 9.0, 5.0, Some(&Material { d: 0.0, ..Material::default() }));
    let got = middle([pair(), vec![pane]].concat(), &Shot { depth: 2, prune: 0.0, ..black() })[0];
    assert_eq!(got, 1.5);
}

#[test]
fn a_thousand_bounces_need_no_stack() {
    let mirror = Material { ke: [1.0; 3], ..bare(3, [1.0; 3], 1.0) };
    let pair = vec![rectangle(0.0, 1.0, 0.0, Some(&mirror)), rectangle(0.0, 9.0, 6.0, Some(&mirror))];
    let deep = Shot { depth: 1000, prune: 0.0, ..black() };
    assert_eq!(middle(pair, &deep), [1001.0; 3]);
    let glass = bare(7, [0.0; 3], 1.5);
    let pair = vec![rectangle(0.0, 1.0, 0.0, Some(&glass)), reversed(rectangle(0.0, 9.0, 6.0, Some(&glass)))];
    let (film, counts) = render_in_tiles(&frame(pair), &Shot { prune: 1e-6, ..deep }, 3, 5);
    assert!(film.rgb[MIDDLE][0].is_finite() && counts.mirrored < 1000);
}
