// What follows from a material's constants. Twin of src/kernel/material.rs.

// MaterialRecord.flags: the dissolve is that of `d -halo`;
const HALO: u32 = 1u;
// Tf counts as a transparency of models 4 and 9;
const TF_GIVEN: u32 = 2u;
// maps change what stands there;
const TEXTURED: u32 = 4u;
// a map changes what shadow rays are let through.
const TEXTURED_SHADOW: u32 = 8u;

// Whether its dissolve is not that of all models: models 4 and 9 have a transparency of their own, 6 and 7 refract.
fn is_glass(illum: u32) -> bool {
    return illum == 4u || illum == 6u || illum == 7u || illum == 9u;
}

// What of a ray's weight the surface takes; the rest goes straight on.
fn cover(m: MaterialRecord) -> f32 {
    return select(m.d, 1.0, is_glass(m.illum));
}

// Specular reflectance as a weight of rays.
fn mirror_of(m: MaterialRecord) -> vec3<f32> {
    return clamp(m.ks, vec3<f32>(0.0), vec3<f32>(1.0));
}

// The transparency of models 4 and 9.
fn transparency(m: MaterialRecord) -> vec3<f32> {
    if (m.d < 1.0) {
        return vec3<f32>(1.0 - m.d);
    }
    return select(vec3<f32>(0.0), m.tf, (m.flags & TF_GIVEN) != 0u);
}

// What shadow rays are let through.
fn material_shadow_factor(m: MaterialRecord) -> vec3<f32> {
    switch (m.illum) {
        case 4u, 9u: {
            return transparency(m);
        }
        case 6u, 7u: {
            return m.tf * (1.0 - mirror_of(m));
        }
        case 10u: {
            return vec3<f32>(1.0);
        }
        default: {
            return vec3<f32>(1.0 - m.d);
        }
    }
}

// `d -halo f` seen under an angle of that cosine: 1 − (1 − f)·(N·V).
fn with_halo(d: f32, cosine: f32) -> f32 {
    return 1.0 - (1.0 - d) * clamp(cosine, 0.0, 1.0);
}
