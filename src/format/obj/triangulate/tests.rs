use super::*;
use proptest::prelude::*;

/// The triangles of a polygon whose corners are all of the positions in turn.
fn triangles(positions: &[[f32; 3]]) -> Vec<[u32; 3]> {
    let corners: Vec<u32> = (0..positions.len() as u32).collect();
    let mut out = Vec::new();
    triangulate(positions, &corners, &mut out);
    out
}

fn flat(points: &[[f32; 2]]) -> Vec<[f32; 3]> {
    points.iter().map(|&[x, y]| [x, y, 0.0]).collect()
}

fn area(positions: &[[f32; 3]], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|i| positions[i as usize]).map(|p| DVec2::new(p[0].into(), p[1].into()));
    doubled_area([a, b, c]) / 2.0
}

/// Of a polygon in the plane z = 0: n − 2 triangles, none turned over, and together as large as the polygon.
fn check(points: &[[f32; 2]]) {
    let positions = flat(points);
    let triangles = triangles(&positions);
    assert_eq!(triangles.len(), points.len() - 2);
    let n = points.len();
    let whole: f64 = (0..n as u32).map(|i| area(&positions, [0, i, (i + 1) % n as u32])).sum();
    let sum: f64 = triangles.iter().map(|&t| area(&positions, t).abs()).sum();
    assert!((sum - whole.abs()).abs() <= 1e-9 * whole.abs(), "{sum} for {whole}: {points:?}");
}

#[test]
fn a_convex_polygon_is_a_fan() {
    let square = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3]]);
    let hexagon: Vec<[f32; 2]> =
        (0..6).map(|i| (f32::to_radians(60.0 * i as f32)).sin_cos().into()).collect();
    assert_eq!(triangles(&flat(&hexagon)), [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]);
}

#[test]
fn a_concave_quad_is_cut_at_its_reflex_corner() {
    // an arrow head with its notch at corner 1 (or 3), where the cut must begin
    let notch_at_1 = [[0.0, 0.0], [2.0, 1.0], [4.0, 0.0], [2.0, 4.0]];
    check(&notch_at_1);
    assert!(triangles(&flat(&notch_at_1)).iter().all(|t| t.contains(&1) && t.contains(&3)));
    // with the notch at corner 0 the fan serves
    let notch_at_0 = [[2.0, 1.0], [4.0, 0.0], [2.0, 4.0], [0.0, 0.0]];
    assert_eq!(triangles(&flat(&notch_at_0)), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn both_ways_round() {
    let mut star: Vec<[f32; 2]> = (0..10)
        .map(|i| {
            let (sin, cos) = f32::to_radians(36.0 * i as f32).sin_cos();
            let radius = if i % 2 == 0 { 4.0 } else { 1.0 };
            [radius * cos, radius * sin]
        })
        .collect();
    check(&star);
    star.reverse();
    check(&star);
}

#[test]
fn a_keyhole_leaves_its_hole_open() {
    // a square of side 4 with a hole of side 2, joined by a bridge that is passed twice: area 16 − 4
    let keyhole = [
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [0.0, 4.0],
        [0.0, 0.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [3.0, 3.0],
        [3.0, 1.0],
        [1.0, 1.0],
    ];
    check(&keyhole);
    for shift in 0..keyhole.len() {
        let mut turned = keyhole;
        turned.rotate_left(shift);
        check(&turned);
    }
}

#[test]
fn corners_in_line_and_repeated() {
    check(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0]]);
    check(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 1.0]]);
    for points in [[[1.0f32, 1.0]; 7], [0, 1, 2, 3, 4, 5, 6].map(|i| [i as f32, 0.0])] {
        assert_eq!(triangles(&flat(&points)).len(), 5);
    }
    // a bow tie: it crosses itself, and is two triangles all the same
    assert_eq!(triangles(&flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])).len(), 2);
}

#[test]
fn far_from_the_origin() {
    // the arrow head, a unit large, at 14,000: differences of f32 are exact in f64
    check(&[[14000.0, 14000.0], [14002.0, 14001.0], [14004.0, 14000.0], [14002.0, 14004.0]]);
}

#[test]
fn ten_thousand_corners() {
    // a comb: every other corner is a tip, all notches are reflex
    let tips = (0..5_000).flat_map(|i| [[2.0 * i as f32, 0.5], [2.0 * i as f32 + 1.0, 100.0]]);
    let comb: Vec<[f32; 2]> = [[10_001.0, -1.0], [-1.0, -1.0]].into_iter().chain(tips).collect();
    check(&comb);
    // a spiral, the slow case: two windings of a strip
    let arm = |i: i32, width: f32| {
        let angle = i as f32 * 0.01;
        [(angle + width) * angle.cos(), (angle + width) * angle.sin()]
    };
    let spiral: Vec<[f32; 2]> =
        (100..5_100).map(|i| arm(i, 1.0)).chain((100..5_100).rev().map(|i| arm(i, 0.0))).collect();
    check(&spiral);
}

proptest! {
    #[test]
    fn star_shaped_polygons(radii in prop::collection::vec(1u8..100, 3..40), turn in 0usize..40) {
        let n = radii.len();
        let mut points: Vec<[f32; 2]> = radii.iter().enumerate().map(|(i, &r)| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
            [f32::from(r) * cos, f32::from(r) * sin]
        }).collect();
        points.rotate_left(turn % n);
        check(&points);
    }

    #[test]
    fn any_corners_at_all(points in prop::collection::vec((0i8..5, 0i8..5, 0i8..5), 3..30)) {
        let positions: Vec<[f32; 3]> =
            points.iter().map(|&(x, y, z)| [f32::from(x), f32::from(y), f32::from(z)]).collect();
        let triangles = triangles(&positions);
        prop_assert_eq!(triangles.len(), points.len() - 2);
        prop_assert!(triangles.iter().flatten().all(|&i| (i as usize) < points.len()));
    }
}
