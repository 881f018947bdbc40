//! Pictures that are infinitely far away: the background and `refl` maps.

use super::texture::{map_at, map_clamped_at, trilinear};
use crate::math::Vec3;
use crate::scene::{Background, Reflection, Texture};
use std::f32::consts::{FRAC_1_PI, PI};

/// What is seen of the background in a direction.
#[inline]
pub fn background(background: &Background, direction: Vec3) -> Vec3 {
    match background {
        Background::Color(color) => *color,
        Background::Picture { texture, is_z_up: false } => picture(texture, direction),
        Background::Picture { texture, is_z_up: true } => {
            picture(texture, Vec3::new(direction.x, direction.z, -direction.y))
        }
    }
}

/// A latitude-longitude picture. Around, it goes on at its other edge; beyond its upper and lower edge it must not.
fn picture(texture: &Texture, direction: Vec3) -> Vec3 {
    let [u, v] = latitude_longitude(direction);
    let half_texel = 0.5 / texture.size[1] as f32;
    trilinear(texture, [u, v.clamp(half_texel, 1.0 - half_texel)], 0.0, false).truncate()
}

/// What is seen of a `refl` map in a direction.
pub fn reflection(map: &Reflection, direction: Vec3) -> Vec3 {
    match map {
        Reflection::Sphere(map) => map_at(map, latitude_longitude(direction), 0.0).truncate(),
        Reflection::Cube(faces) => {
            let (face, uv) = cube_face(direction);
            faces[face].as_ref().map_or(Vec3::ZERO, |map| map_clamped_at(map, uv).truncate())
        }
    }
}

/// Where a latitude-longitude picture shows a direction: −z in its middle, +x to the right of it, +y at the top.
fn latitude_longitude(direction: Vec3) -> [f32; 2] {
    let d = direction.normalize_or(Vec3::NEG_Z);
    [0.5 + 0.5 * FRAC_1_PI * libm::atan2f(d.x, -d.z), 1.0 - libm::acosf(d.y.clamp(-1.0, 1.0)) / PI]
}

/// The face of a cube in a direction (−x, +x, −y, +y, −z, +z) and where it shows it. Seen from inside, the four sides
/// stand upright; the upper one joins them as if one looked along −z and then up, the lower one as if down.
fn cube_face(d: Vec3) -> (usize, [f32; 2]) {
    let a = d.abs();
    let (face, right, up, ahead) = if a.x >= a.y && a.x >= a.z {
        if d.x < 0.0 { (0, -d.z, d.y, a.x) } else { (1, d.z, d.y, a.x) }
    } else if a.y >= a.z {
        if d.y < 0.0 { (2, d.x, -d.z, a.y) } else { (3, d.x, d.z, a.y) }
    } else if d.z < 0.0 {
        (4, d.x, d.y, a.z)
    } else {
        (5, -d.x, d.y, a.z)
    };
    (face, [0.5 + 0.5 * right / ahead, 0.5 + 0.5 * up / ahead])
}

#[cfg(test)]
mod tests {
    use super::super::texture::tests::{grey, map};
    use super::*;
    use crate::scene::Part;

    #[test]
    fn directions_lie_on_a_latitude_longitude_picture() {
        for (direction, [u, v]) in [
            (Vec3::NEG_Z, [0.5, 0.5]),
            (Vec3::X, [0.75, 0.5]),
            (Vec3::NEG_X, [0.25, 0.5]),
            // 45° up and down
            (Vec3::new(0.0, 2.0, -2.0), [0.5, 0.75]),
            (Vec3::new(2.0, -2.0, 0.0), [0.75, 0.25]),
        ] {
            let got = latitude_longitude(direction);
            assert!((got[0] - u).abs() < 1e-6 && (got[1] - v).abs() < 1e-6, "{direction}: {got:?}");
        }
    }

    #[test]
    fn a_background_picture_does_not_go_on_above_its_top() {
        let texture = Part::new(grey([1, 2], &[8.0, 2.0, 5.0]));
        let picture = Background::Picture { texture: texture.clone(), is_z_up: false };
        assert_eq!(background(&picture, Vec3::Y).x, 8.0);
        assert_eq!(background(&picture, Vec3::NEG_Y).x, 2.0);
        assert!((background(&picture, Vec3::Z).x - 5.0).abs() < 1e-5);
        let picture = Background::Picture { texture, is_z_up: true };
        assert_eq!((background(&picture, Vec3::Z).x, background(&picture, Vec3::NEG_Z).x), (8.0, 2.0));
    }

    #[test]
    fn a_cube_has_six_faces_and_missing_ones_are_black() {
        // left to right 0 1
        let face = |x| Some(map(grey([2, 1], &[x, x + 1.0, x + 0.5])));
        let faces = [face(0.0), face(10.0), face(20.0), face(30.0), face(40.0), None];
        let cube = Reflection::Cube(Box::new(faces));
        let at = |x, y, z| reflection(&cube, Vec3::new(x, y, z)).x;
        assert_eq!((at(0.2, 0.1, -0.3), at(0.2, 0.1, 0.3)), (41.0, 0.0));
        // looking along −x, −z is to the right; along +x, +z
        assert_eq!((at(-1.0, 0.0, -0.9), at(-1.0, 0.0, 0.9)), (1.0, 0.0));
        assert_eq!((at(1.0, 0.0, 0.9), at(1.0, 0.0, -0.9)), (11.0, 10.0));
        assert_eq!((at(0.9, -1.0, 0.0), at(-0.9, 1.0, 0.0)), (21.0, 30.0));
    }
}
