//! Where rays that leave a surface start.

use super::world::Surface;
use crate::math::Vec3;

/// 32 ULP of 2⁻²³: what the roundings of a hit's position, and of the next ray's tests against it, stay below.
const MARGIN: f32 = 32.0 / 8_388_608.0;

/// The start of a ray that leaves the surface on the viewer's side: moved along Ng by
/// 32 ULP × Σ |n_k|·(|p_k| + |v_k|max).
pub fn leaving(surface: &Surface) -> Vec3 {
    let scale = surface.ng.abs().dot(surface.position.abs() + surface.reach);
    surface.position + surface.ng * (MARGIN * scale)
}
