//! Where a mirrored, refracted or shadow ray starts.

use crate::math::Vec3;

/// 32 ULP (2⁻²³): what rounding can displace a hit by is below it.
const LEAVE: f32 = 32.0 * f32::EPSILON;

/// The point of a hit: the combination of the triangle's corners by the hit's weights, never origin + distance ·
/// direction, whose error grows with the distance.
pub fn hit_point(corners: &[Vec3; 3], barycentric: [f32; 2]) -> Vec3 {
    let [u, v] = barycentric;
    corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v
}

/// The largest |x|, |y|, |z| of a triangle's corners, each with the triangle's [`extent`]: the magnitude that
/// [`offset_origin`] wants for an object without a transform. For a placed one it is the largest of
/// [`super::Placement::magnitude`], with the extent likewise.
pub fn magnitude(corners: &[Vec3; 3]) -> Vec3 {
    corners[0].abs().max(corners[1].abs()).max(corners[2].abs()) + extent(corners)
}

/// A triangle's largest extent along an axis. The edge test works with corners relative to the ray's origin and mixes
/// the axes, so a ray that starts on the triangle may meet it again at some ULP of this, whatever the normal: a floor
/// at y = 1e-8 needs it, whose corners and points say that y is known to 1e-15.
pub fn extent(corners: &[Vec3; 3]) -> f32 {
    let [a, b, c] = *corners;
    (a.max(b).max(c) - a.min(b).min(c)).max_element()
}

/// Moves the point p of a hit off its triangle to the side that the unit normal n points to, by
/// 32 ULP · Σ|nₖ|·(|pₖ| + magnitudeₖ): farther than the point and the corners can be off through rounding, in units of
/// the numbers that were rounded, so at any scale and anywhere.
pub fn offset_origin(p: Vec3, n: Vec3, magnitude: Vec3) -> Vec3 {
    p + n * (LEAVE * n.abs().dot(p.abs() + magnitude))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_is_that_worked_out_on_paper() {
        // along z: 32 · 2⁻²³ · (|3| + 5) = 2⁻¹⁸ · 8 = 2⁻¹⁵
        let p = offset_origin(Vec3::new(1.0, 2.0, 3.0), Vec3::NEG_Z, Vec3::new(1.0, 2.0, 5.0));
        assert_eq!(p, Vec3::new(1.0, 2.0, 3.0 - 1.0 / 32768.0));
    }

    #[test]
    fn a_hit_point_is_the_combination_of_the_corners() {
        let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 8.0), Vec3::new(0.0, 2.0, -8.0)];
        assert_eq!(hit_point(&corners, [0.25, 0.5]), Vec3::new(1.0, 1.0, -2.0));
        assert_eq!(extent(&corners), 16.0);
        assert_eq!(magnitude(&corners), Vec3::new(20.0, 18.0, 24.0));
    }
}
