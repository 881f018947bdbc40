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

/// The largest |x|, |y|, |z| of a triangle's corners: the magnitude that [`offset_origin`] wants for an object without
/// a transform. For a placed one it is the largest of [`super::Placement::magnitude`].
pub fn magnitude(corners: &[Vec3; 3]) -> Vec3 {
    corners[0].abs().max(corners[1].abs()).max(corners[2].abs())
}

/// Moves the point p of a hit off its triangle to the side that the unit normal n points to, by
/// 32 ULP · Σ|nₖ|·(|pₖ| + magnitudeₖ): farther than the point and the corners can be off through rounding, in units of
/// the numbers that were rounded, so at any scale and anywhere.
pub fn offset_origin(p: Vec3, n: Vec3, magnitude: Vec3) -> Vec3 {
    p + n * (LEAVE * n.abs().dot(p.abs() + magnitude))
}
