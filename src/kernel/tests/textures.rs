//! Maps as pixels show them.

use super::*;
use crate::kernel::texture::tests::map;
use crate::scene::{Map, Texcoords, TexelSpace, Texels, Texture, Textures};

/// A texture of 64 × 64 texels whose levels are each of one value: 0, 1, 2 …
fn levels() -> Texture {
    let texels = (0..7_u16).flat_map(|level| {
        let side = 64_usize >> level;
        vec![[f32::from(level), 0.0, 0.0, 1.0]; side * side]
    });
    Texture {
        size: [64, 64],
        space: TexelSpace::Linear,
        alpha_varies: false,
        texels: Texels::F32(texels.collect()),
    }
}

/// The rectangle with (u, v) from 0 to 1 over the whole of it.
fn mapped(x: f32, half: f32, z: f32, material: &Material) -> Geometry {
    let mut g = rectangle(x, half, z, Some(material));
    g.texcoords = Some(Attribute {
        values: Part::new(Texcoords(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])),
        corners: Part::new(Corners(vec![[0, 1, 2], [0, 2, 3]])),
    });
    g
}

fn shows_levels() -> Material {
    let textures = Textures { map_kd: Some(map(levels())), ..Textures::default() };
    Material { kd: [1.0; 3], illum: 0, textures, ..Material::default() }
}

#[test]
fn the_level_grows_with_the_way_mirrors_included() {
    // 64 texels over √(16 · 17.6) = 16.78092: 3.813857 a unit. The cone is 2·tan 45°/3 = 2/3 of the way wide: after 4
    // 2.666667 · 3.813857 = 10.170285 texels, log2 3.346288; after 4 + 6 by way of a mirror 25.425714: 4.668215.
    let mut shot = shot(vec![]);
    shot.camera.fov_deg = 90.0;
    let seen = middle(vec![mapped(0.0, 8.0, 0.0, &shows_levels())], &shot)[0];
    assert!((seen - 3.346_288).abs() < 1e-4, "{seen}");
    let mirror = Material { kd: [0.0; 3], ks: [1.0; 3], illum: 3, ..Material::default() };
    let wall = vec![rectangle(0.0, 1.0, 0.0, Some(&mirror)), mapped(0.0, 8.0, 6.0, &shows_levels())];
    let seen = middle(wall, &shot)[0];
    assert!((seen - 4.668_215).abs() < 1e-4, "{seen}");
}

#[test]
fn a_map_of_the_dissolve_cuts_holes_for_light_too() {
    // the left half is there, the right is not; the edge lies in the middle
    let texels = vec![[1.0; 4], [1.0; 4], [0.0; 4], [0.0; 4], [1.0; 4], [0.0; 4], [0.5; 4]];
    let texture =
        Texture { size: [4, 1], space: TexelSpace::Linear, alpha_varies: false, texels: Texels::F32(texels) };
    let textures = Textures { map_d: Some(Map { clamp: true, ..map(texture) }), ..Textures::default() };
    let holes = Material { textures, ..material(1) };
    let shot = Shot { background: Background::Color(Vec3::ONE), ..shot(vec![light(Falloff::None)]) };
    // level 0 at u = 1/8 and 7/8: a tiny picture angle, so that the cone is narrow
    let narrow = |shot: &Shot| {
        let mut shot = shot.clone();
        shot.camera.fov_deg = 0.01;
        shot
    };
    assert_near(middle(vec![mapped(0.75, 1.0, 0.0, &holes)], &narrow(&shot)), sum(&[A, D]));
    assert_near(middle(vec![mapped(-0.75, 1.0, 0.0, &holes)], &narrow(&shot)), [1.0; 3]);
    // the shadow ray passes (1.5, 0, 2)
    let wall = || rectangle(0.0, 1.0, 0.0, Some(&material(1)));
    let behind = |x| vec![wall(), mapped(x, 0.2, 2.0, &holes)];
    assert_near(middle(behind(1.65), &shot), A);
    assert_near(middle(behind(1.35), &shot), sum(&[A, D]));
}

#[test]
fn a_face_without_texture_coordinates_has_the_constant() {
    let wall = rectangle(0.0, 1.0, 0.0, Some(&Material { kd: [0.5; 3], ..shows_levels() }));
    assert_near(middle(vec![wall], &shot(vec![])), [0.5; 3]);
}

#[test]
fn auxiliary_pictures_of_material_and_coordinates() {
    // the same material in two files is one; it is used second
    let [first, second] = [0.5, 0.6].map(|kd| Material { kd: [kd; 3], ..Material::default() });
    let film = render(
        vec![
            rectangle(9.0, 0.1, 0.0, Some(&first)),
            mapped(0.0, 1.0, 0.0, &second),
            rectangle(0.0, 9.0, -1.0, Some(&first)),
            mapped(8.0, 0.1, 0.0, &second),
        ],
        &shot(vec![]),
    );
    let material = film.aovs.material.unwrap();
    assert_eq!((material[MIDDLE], material[0]), (1, 0));
    // the weights of the corners are 1/2, 1/22, 10/22: u = 1/22 + 10/22, v = 10/22
    let [u, v] = film.aovs.uv.as_ref().unwrap()[MIDDLE];
    assert!((u - 0.5).abs() < 1e-6 && (v - 10.0 / 22.0).abs() < 1e-6, "{u}, {v}");
    assert_eq!(film.aovs.uv.unwrap()[0], [0.0; 2]);
    let nothing = render(vec![], &shot(vec![])).aovs;
    assert_eq!((nothing.material.unwrap()[0], nothing.coverage.unwrap()[0]), (u32::MAX, 0.0));
}
