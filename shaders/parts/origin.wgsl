// Where a mirrored, refracted or shadow ray starts. Twin of src/accel/origin.rs.

// 32 ULP (2⁻²³).
const LEAVE: f32 = 0x1p-18;

// The point of a hit: the combination of the triangle's corners by the hit's weights.
fn hit_point(corners: array<vec3<f32>, 3>, barycentric: vec2<f32>) -> vec3<f32> {
    let u = barycentric.x;
    let v = barycentric.y;
    return corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
}

// The largest |x|, |y|, |z| of a triangle's corners, each with the triangle's extent.
fn magnitude(corners: array<vec3<f32>, 3>) -> vec3<f32> {
    return max(max(abs(corners[0]), abs(corners[1])), abs(corners[2])) + extent(corners);
}

// A triangle's largest extent along an axis.
fn extent(corners: array<vec3<f32>, 3>) -> f32 {
    let sides = max(max(corners[0], corners[1]), corners[2]) - min(min(corners[0], corners[1]), corners[2]);
    return max(max(sides.x, sides.y), sides.z);
}

// Moves the point p of a hit off its triangle to the side that the unit normal n points to, by 32 ULP · Σ|nₖ|·(|pₖ| +
// magnitudeₖ).
fn offset_origin(p: vec3<f32>, n: vec3<f32>, magnitude: vec3<f32>) -> vec3<f32> {
    return p + n * (LEAVE * dot(abs(n), abs(p) + magnitude));
}
