// Mirrors and glass: directions, and how much is mirrored. Twin of src/kernel/optics.rs.

// The mirrored direction of the unit vector towards the viewer; unit.
fn mirrored(view: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    return normalize_or(n * (2.0 * dot(n, view)) - view, n);
}

// A ray behind the surface that bends it.
struct Refracted {
    // Where it goes; unit.
    direction: vec3<f32>,
    // Cosine of its angle to the normal.
    cosine: f32,
    // Whether there is none, for the reflection is total.
    is_total: bool,
}

// Snell's law from a medium of density n1 into one of n2.
fn refracted(view: vec3<f32>, n: vec3<f32>, n1: f32, n2: f32) -> Refracted {
    let eta = n1 / n2;
    let c = dot(n, view);
    let cosine_squared = 1.0 - eta * eta * (1.0 - c * c);
    if (cosine_squared < 0.0) {
        return Refracted(-view, 0.0, true);
    }
    let cosine = sqrt(cosine_squared);
    return Refracted(normalize_or(n * (eta * c - cosine) - view * eta, -view), cosine, false);
}

// Schlick's approximation of the Fresnel equations: F0 + (1 − F0)(1 − c)^5, c clamped to [0, 1].
fn schlick(f0: vec3<f32>, c: f32) -> vec3<f32> {
    let x = 1.0 - clamp(c, 0.0, 1.0);
    let x2 = x * x;
    return f0 + (1.0 - f0) * (x2 * x2 * x);
}

// What a border between two densities mirrors of light that meets it upright.
fn reflectance_upright(n1: f32, n2: f32) -> f32 {
    let r = (n1 - n2) / (n1 + n2);
    return r * r;
}
