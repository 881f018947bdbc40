// Light on a surface at one point (A + D + S; no π). Twin of src/kernel/shade.rs.

// What leaves a surface towards the viewer, by kind; linear RGB.
struct Reflected {
    // D: Σ Kd·Ij·Sj·(N·Lj). In model 10 Σ Ij·Sj·(N·Lj).
    diffuse: vec3<f32>,
    // S: Σ Ks·Ij·Sj·max(0, N·Hj)^Ns. In model 10 Σ Ij·(N·Lj).
    specular: vec3<f32>,
}

// Whether a light in that direction reaches the viewer's side.
fn faces(surface: Surface, direction: vec3<f32>) -> bool {
    return dot(surface.n, direction) > 0.0 && dot(surface.ng, direction) > 0.0;
}

// What one light, which faces the surface, adds where nothing is in its way.
fn reflected(surface: Surface, m: MaterialRecord, view: vec3<f32>, light: Incident) -> Reflected {
    if (m.illum == 10u) {
        return Reflected(unshadowed(surface, light), vec3<f32>(0.0));
    }
    let diffuse = surface.kd * light.radiance * dot(surface.n, light.direction);
    let is_fresnel = m.illum == 5u || m.illum == 7u;
    if (m.illum < 2u || (is_zero(m.ks) && !is_fresnel)) {
        return Reflected(diffuse, vec3<f32>(0.0));
    }
    // S is 0 where the light and the viewer are opposite
    let halfway = normalize_or_zero(light.direction + view);
    if (is_zero(halfway)) {
        return Reflected(diffuse, vec3<f32>(0.0));
    }
    var ks = m.ks;
    if (is_fresnel) {
        ks = schlick(ks, dot(light.direction, halfway));
    }
    return Reflected(diffuse, ks * light.radiance * powf(max(dot(surface.n, halfway), 0.0), m.ns));
}

// What a light that faces the surface brings to it where nothing is in its way.
fn unshadowed(surface: Surface, light: Incident) -> vec3<f32> {
    return light.radiance * dot(surface.n, light.direction);
}

// The colour without light from lights and without mirrored and refracted light.
fn own_color(surface: Surface, m: MaterialRecord) -> vec3<f32> {
    if (m.illum == 0u) {
        return surface.kd;
    }
    return m.ka * shot.ambient + m.ke;
}
