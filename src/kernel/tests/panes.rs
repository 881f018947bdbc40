//! Models 4, 9 and 10, halos and coloured shadows: what is seen straight through.

use super::*;

const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.4];

/// A pane without light of its own, with Ks 0.5 0.6 0.1.
fn pane(illum: u8, d: f32) -> Material {
    Material { ka: [0.0; 3], kd: [0.0; 3], ke: [0.0; 3], d, ..material(illum) }
}

fn over(c: [f32; 3], opacity: [f32; 3], behind: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| opacity[k] * c[k] + (1.0 - opacity[k]) * behind[k])
}

#[test]
fn glass_is_as_opaque_as_it_shines() {
    // it mirrors what hangs behind the eye: Ks·Ir, their mean 0.4 · Ir
    let with = |m: &Material, shown: f32| {
        middle(vec![rectangle(0.0, 1.0, 0.0, Some(m)), shows(0.0, 9.0, 6.0, [shown; 3])], &shot(vec![]))
    };
    let ks = [0.5, 0.6, 0.1];
    // 1 − t = 0.6 is more than 0.4; 0.8 more than that; at most 1
    assert_near(with(&pane(4, 0.6), 1.0), over(ks, [0.6; 3], BACKGROUND));
    assert_near(with(&pane(4, 0.6), 2.0), over(times(ks, 2.0), [0.8; 3], BACKGROUND));
    assert_near(with(&pane(4, 0.6), 10.0), times(ks, 10.0));
    // Tf where it is given, d where it is below 1, else nothing is seen through it
    let tinted = Material { tf: [1.0, 0.5, 0.0], tf_given: true, ..pane(4, 1.0) };
    assert_near(with(&tinted, 0.5), over(times(ks, 0.5), [0.2, 0.5, 1.0], BACKGROUND));
    assert_near(with(&Material { d: 0.6, ..tinted.clone() }, 1.0), over(ks, [0.6; 3], BACKGROUND));
    assert_near(with(&Material { tf_given: false, ..tinted }, 1.0), ks);
    // model 9 mirrors the background: mean of Ks·(0.1, 0.2, 0.4) = 0.07
    let around = [0.05, 0.12, 0.04];
    assert_near(with(&pane(9, 0.01), 1.0), over(around, [0.07; 3], BACKGROUND));
}

#[test]
fn the_highlight_of_glass_hides_what_is_behind() {
    // S = (0.348678, 0.209207, 0.017434), its mean 0.191773
    let got = middle(
        vec![rectangle(0.0, 1.0, 0.0, Some(&pane(4, 0.0)))],
        &Shot { depth: 0, ..shot(vec![light(Falloff::None)]) },
    );
    assert_near(got, over(S, [0.191_773_1; 3], BACKGROUND));
}

#[test]
fn glass_before_glass_adds_up_within_the_mirror() {
    // the pane mirrors a second one behind the eye, which mirrors the first: depth 2 gives Ks·(Ke + Ks·Ke), and what is
    // added before and after it is not lost
    let glowing = Material { ke: [0.25; 3], ks: [0.5; 3], ..pane(4, 0.5) };
    let panes = || {
        vec![
            rectangle(0.0, 0.1, 1.0, Some(&Material { ke: [1.0; 3], d: 0.5, illum: 1, ..pane(1, 0.5) })),
            rectangle(0.0, 1.0, 0.0, Some(&glowing)),
            rectangle(0.0, 9.0, 6.0, Some(&glowing)),
        ]
    };
    let shot = Shot { depth: 3, ambient: Vec3::ZERO, prune: 0.0, ..shot(vec![]) };
    let b = 0.1;
    // Crossings and bounces on the way: the first glow at z = 1 (0 so far), the pane (1). What it mirrors goes on at 2:
    // the glow from behind at z = 1, then the pane at z = 6 with 3, which mirrors nothing any more:
    // C = 1/4, o = 1/2. Mirrored: 1/2 · 1 + 1/2 · (1/8 + 1/2 · b).
    let mirrored = 0.5 + 0.5 * (0.125 + 0.5 * b);
    let c = 0.25 + 0.5 * mirrored;
    let opacity = (0.5f32 * mirrored).max(0.5);
    let expected = 0.5 + 0.5 * (opacity * c + (1.0 - opacity) * b);
    let got = middle(panes(), &shot)[0];
    assert!((got - expected).abs() < 1e-6, "{got}, not {expected}");
}

#[test]
fn twenty_panes_end() {
    let glass = Material { ks: [0.1; 3], ..pane(4, 0.05) };
    let panes = |ks: f32| {
        let glass = Material { ks: [ks; 3], ..glass.clone() };
        let at = |i: u16| rectangle(0.0, 1.0, -0.05 * f32::from(i), Some(&glass));
        frame((0..20).map(at).collect())
    };
    let one_pixel = Shot { size: [1, 1], ..shot(vec![]) };
    let counts = render_in_tiles(&panes(0.1), &one_pixel, 1, 1).1;
    // Within depth 10 there are 10 mirrored rays of weight 0.1, at most 45 of 0.01 and 120 of 0.001; those of 0.0001 are
    // pruned.
    assert!((10..=175).contains(&counts.mirrored), "{counts:?}");
    // without Ks nothing is mirrored, and they are straight crossings alone
    let (film, counts) = render_in_tiles(&panes(0.0), &one_pixel, 1, 1);
    assert_eq!(counts.mirrored, 0);
    assert_near(film.rgb[0], times(BACKGROUND, 0.95f32.powi(20)));
}

#[test]
fn a_halo_is_opaque_at_its_rim() {
    let glow = |d| Material { ke: [1.0; 3], halo: true, ..pane(1, d) };
    let flat = rectangle(0.0, 1.0, 0.0, Some(&glow(0.25)));
    let seen = |g: Geometry| middle(vec![g], &Shot { ambient: Vec3::ZERO, ..shot(vec![]) });
    // N·V = 1: d = f; N·V = 0.6: d = 1 − 0.75 · 0.6 = 0.55
    assert_near(seen(flat.clone()), over([1.0; 3], [0.25; 3], BACKGROUND));
    assert_near(seen(tilted(flat, [0.8, 0.0, 0.6])), over([1.0; 3], [0.55; 3], BACKGROUND));
}

#[test]
fn shadows_of_glass_are_coloured() {
    // the shadow ray passes (1.5, 0, 2) and (0.75, 0, 1); see what blocks it in `shadows_take_what_the_blockers_hold_back`
    let tf = [0.9, 0.5, 0.25];
    let wall = || rectangle(0.0, 1.0, 0.0, Some(&material(1)));
    let blocker = |x, z, m: Material| rectangle(x, 0.2, z, Some(&Material { tf, tf_given: true, ..m }));
    let lit = |blockers: Vec<Geometry>| {
        let got = middle([vec![wall()], blockers].concat(), &shot(vec![light(Falloff::None)]));
        std::array::from_fn::<f32, 3, _>(|k| (got[k] - A[k]) / D[k])
    };
    let near = |got: [f32; 3], expected: [f32; 3]| {
        assert!((0..3).all(|k| (got[k] - expected[k]).abs() < 1e-5), "{got:?}, not {expected:?}");
    };
    near(lit(vec![blocker(1.5, 2.0, pane(4, 1.0))]), tf);
    near(lit(vec![blocker(1.5, 2.0, pane(9, 0.75))]), [0.25; 3]);
    // Tf·(1 − Ks) = (0.9 · 0.5, 0.5 · 0.4, 0.25 · 0.9)
    let refracting = [0.45, 0.2, 0.225];
    near(lit(vec![blocker(1.5, 2.0, pane(6, 1.0))]), refracting);
    near(lit(vec![blocker(1.5, 2.0, pane(7, 0.1))]), refracting);
    near(lit(vec![blocker(1.5, 2.0, pane(10, 1.0))]), [1.0; 3]);
    let both = vec![blocker(1.5, 2.0, pane(4, 1.0)), blocker(0.75, 1.0, pane(6, 1.0))];
    near(lit(both), [0.9 * 0.45, 0.5 * 0.2, 0.25 * 0.225]);
    // a halo by its angle to the shadow ray: N·L = 0.8, d = 1 − 0.75 · 0.8 = 0.4
    near(lit(vec![blocker(1.5, 2.0, Material { halo: true, ..pane(1, 0.25) })]), [0.6; 3]);
}

#[test]
fn a_catcher_shows_only_its_shadow() {
    let catcher = || rectangle(0.0, 1.0, 0.0, Some(&material(10)));
    let blocker = || rectangle(1.5, 0.2, 2.0, Some(&pane(2, 0.6)));
    let mut shot = shot(vec![light(Falloff::None)]);
    assert_near(middle(vec![catcher()], &shot), BACKGROUND);
    // 0.6 of the light is held back
    assert_near(middle(vec![catcher(), blocker()], &shot), times(BACKGROUND, 0.4));
    // the catcher's own d weakens its shadow: 1 − 0.5 · 0.6
    let faint = rectangle(0.0, 1.0, 0.0, Some(&Material { d: 0.5, ..material(10) }));
    assert_near(middle(vec![faint, blocker()], &shot), times(BACKGROUND, 0.7));
    // without light there is no shadow
    assert_near(middle(vec![catcher(), blocker()], &Shot { lights: vec![], ..shot.clone() }), BACKGROUND);
    shot.alpha = true;
    let film = render(vec![catcher(), blocker()], &shot);
    assert_near(film.rgb[MIDDLE], [0.0; 3]);
    assert!((film.alpha.unwrap()[MIDDLE] - 0.6).abs() < 1e-6);
    assert!((film.aovs.coverage.unwrap()[MIDDLE] - 0.6).abs() < 1e-6);
}

#[test]
fn alpha_is_the_mean_of_what_is_let_through() {
    let tinted = Material { tf: [0.5, 0.25, 0.0], tf_given: true, ..pane(4, 1.0) };
    let shot = Shot { alpha: true, depth: 0, ..shot(vec![]) };
    let film = render(vec![rectangle(0.0, 1.0, 0.0, Some(&tinted))], &shot);
    assert!((film.alpha.unwrap()[MIDDLE] - 0.75).abs() < 1e-6);
    // the background behind glass adds no colour, what a mirror shows of it does
    assert_near(film.rgb[MIDDLE], [0.0; 3]);
    let mirror = render(vec![rectangle(0.0, 1.0, 0.0, Some(&pane(3, 1.0)))], &Shot { depth: 1, ..shot });
    assert_near(mirror.rgb[MIDDLE], [0.05, 0.12, 0.04]);
    assert_eq!(mirror.alpha.unwrap()[MIDDLE], 1.0);
}
