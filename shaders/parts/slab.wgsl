// Boxes and the slab test. Twin of src/accel/slab.rs.

// 1 + 2^-20: see slab.rs.
const EXIT_FACTOR: f32 = 1.00000095367431640625;
const LEAST_DIRECTION: f32 = 1e-20;

struct Aabb {
    low: vec3<f32>,
    high: vec3<f32>,
}

fn next_up_of_each(x: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(next_up(x.x), next_up(x.y), next_up(x.z));
}

// A triangle's own box: that of its corners, each side moved out by 8 ULP (2^-23) of the largest extent and then to the
// next float.
fn own_box(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Aabb {
    let low = min(a, min(b, c));
    let high = max(a, max(b, c));
    let size = high - low;
    // 2^-20; a product with a power of two is exact, fused or not
    let margin = vec3<f32>(max(size.x, max(size.y, size.z)) * 0.00000095367431640625);
    return Aabb(-next_up_of_each(margin - low), next_up_of_each(high + margin));
}

fn inverse_of(d: f32) -> f32 {
    if (abs(d) < LEAST_DIRECTION) {
        return 1.0 / select(LEAST_DIRECTION, -LEAST_DIRECTION, (bitcast<u32>(d) >> 31u) != 0u);
    }
    return 1.0 / d;
}

fn inverse_of_each(d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(inverse_of(d.x), inverse_of(d.y), inverse_of(d.z));
}

// Where a ray enters a box, or -1 where it misses it.
fn box_entry(box: Aabb, origin: vec3<f32>, inverse: vec3<f32>) -> f32 {
    let is_back = inverse < vec3<f32>(0.0);
    let near = (select(box.low, box.high, is_back) - origin) * inverse;
    let far = (select(box.high, box.low, is_back) - origin) * inverse;
    let entry = max(max(near.x, near.y), max(near.z, 0.0));
    let exit = min(min(far.x, far.y), far.z) * EXIT_FACTOR;
    return select(-1.0, entry, entry <= exit);
}
