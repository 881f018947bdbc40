// Steps of arithmetic that WGSL lacks or leaves to the driver. Twin of what src/kernel takes from glam and libm.

const PI: f32 = 3.14159265;
const FRAC_1_PI: f32 = 0.318309886;
const FLOAT_MAX: f32 = 0x1.fffffep+127;
const INFINITY_BITS: u32 = 0x7f800000u;

// A test of bits: drivers may take x != x for false.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > INFINITY_BITS;
}

// Also of zeros, which WGSL's sign makes 0.
fn signum(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) & 0x80000000u) != 0u);
}

// By comparisons, so that what is not a number counts as in the CPU's.
fn max_element(v: vec3<f32>) -> f32 {
    let most = select(v.y, v.x, v.x > v.y);
    return select(v.z, most, most > v.z);
}

fn element_sum(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

fn is_zero(v: vec3<f32>) -> bool {
    return v.x == 0.0 && v.y == 0.0 && v.z == 0.0;
}

// The unit vector; `otherwise` where the squared length is 0, infinite or not a number.
fn normalize_or(v: vec3<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    let squared = dot(v, v);
    if (squared > 0.0 && squared <= FLOAT_MAX) {
        return v * (1.0 / sqrt(squared));
    }
    return otherwise;
}

fn normalize_or_zero(v: vec3<f32>) -> vec3<f32> {
    return normalize_or(v, vec3<f32>(0.0));
}

// Drivers need not give atan2 to more than 12 bits. The arc tangent is that of Cephes (atanf): below tan 22.5° a polynomial,
// above it turned by 45°.
fn atan2_of(y: f32, x: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let most = max(a, b);
    let least = min(a, b);
    let is_turned = least > 0.41421356 * most;
    let above = select(least, least - most, is_turned);
    let below = select(most, least + most, is_turned);
    let t = above / select(below, 1.0, below == 0.0);
    let z = t * t;
    let series = ((0.0805374449538 * z - 0.138776856032) * z + 0.199777106478) * z - 0.333329491539;
    var angle = t + t * z * series + select(0.0, 0.25 * PI, is_turned);
    angle = select(angle, 0.5 * PI - angle, b > a);
    angle = select(angle, PI - angle, signum(x) < 0.0);
    return angle * signum(y);
}

fn acos_of(x: f32) -> f32 {
    return atan2_of(sqrt((1.0 - x) * (1.0 + x)), x);
}
