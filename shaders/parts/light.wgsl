// Lights as a shading point sees them. Twin of src/kernel/light.rs.

// LightRecord.kind.
const POINT: u32 = 0u;
const DIRECTIONAL: u32 = 1u;
const SPOT: u32 = 2u;
const AREA: u32 = 3u;

// Light that arrives at a point where nothing is in the way.
struct Incident {
    // Unit vector towards the light; 0 at the light itself.
    direction: vec3<f32>,
    // Colour · intensity · falloff · the spot's share.
    radiance: vec3<f32>,
}

// From a shadow ray's origin to the light.
fn shadow_ray(light: LightRecord, origin: vec3<f32>) -> Ray {
    return Ray(origin, select(light.place - origin, light.place, light.kind == DIRECTIONAL));
}

// The distance at which a shadow ray ends, in units of its direction's length.
fn shadow_end(light: LightRecord) -> f32 {
    // no hit is farther than the largest float
    return select(1.0, FLOAT_MAX, light.kind == DIRECTIONAL);
}

// What arrives at a point from a light.
fn incident(light: LightRecord, point: vec3<f32>) -> Incident {
    if (light.kind == DIRECTIONAL) {
        return Incident(light.place, light.radiance);
    }
    let to_light = light.place - point;
    let direction = normalize_or_zero(to_light);
    var radiance = light.radiance;
    if (light.inverse_square != 0u) {
        radiance /= dot(to_light, to_light);
    }
    if (light.kind == SPOT) {
        radiance *= smooth_step(light.cos_outer, light.cos_inner, -dot(light.axis, direction));
    }
    return Incident(direction, radiance);
}

// 0 up to `low`, 1 from `high` on, 3t² − 2t³ between; a step where they are equal, of which WGSL's smoothstep knows nothing.
fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    if (x >= high) {
        return 1.0;
    }
    if (x <= low) {
        return 0.0;
    }
    let t = (x - low) / (high - low);
    return t * t * (3.0 - 2.0 * t);
}
