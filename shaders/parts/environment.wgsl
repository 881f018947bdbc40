// Pictures that are infinitely far away: the background and `refl` maps. Twin of src/kernel/environment.rs.

// What is seen of the background in a direction.
fn background(direction: vec3<f32>) -> vec3<f32> {
    if (HAS_TEXTURES) {
        if (shot.background_map != ABSENT) {
            let turned = vec3<f32>(direction.x, direction.z, -direction.y);
            return picture(maps[shot.background_map], select(direction, turned, shot.is_z_up != 0u));
        }
    }
    return shot.background;
}

// A latitude-longitude picture. Around, it goes on at its other edge; beyond its upper and lower edge it must not.
fn picture(map: MapRecord, direction: vec3<f32>) -> vec3<f32> {
    let uv = latitude_longitude(direction);
    let half_texel = 0.5 / f32(map.size.y);
    return trilinear(map, vec2<f32>(uv.x, clamp(uv.y, half_texel, 1.0 - half_texel)), 0.0, false).xyz;
}

// What is seen of a material's `refl` map in a direction.
fn reflection(material: u32, direction: vec3<f32>) -> vec3<f32> {
    let first = material * MATERIAL_MAPS;
    if (material_maps[first + REFLECTION] == REFLECTION_SPHERE) {
        return map_at(maps[material_maps[first + MAP_SPHERE]], latitude_longitude(direction), 0.0).xyz;
    }
    let at = cube_face(direction);
    let place = material_maps[first + MAP_CUBE + at.face];
    if (place == ABSENT) {
        return vec3<f32>(0.0);
    }
    return map_clamped_at(maps[place], at.uv).xyz;
}

// Where a latitude-longitude picture shows a direction: −z in its middle, +x to the right of it, +y at the top.
fn latitude_longitude(direction: vec3<f32>) -> vec2<f32> {
    let d = normalize_or(direction, vec3<f32>(0.0, 0.0, -1.0));
    return vec2<f32>(0.5 + 0.5 * FRAC_1_PI * atan2_of(d.x, -d.z), 1.0 - acos_of(clamp(d.y, -1.0, 1.0)) / PI);
}

// A place on a cube: −x, +x, −y, +y, −z, +z.
struct CubePlace {
    face: u32,
    uv: vec2<f32>,
}

// The face of a cube in a direction and where it shows it.
fn cube_face(d: vec3<f32>) -> CubePlace {
    let a = abs(d);
    if (a.x >= a.y && a.x >= a.z) {
        return cube_place(select(1u, 0u, d.x < 0.0), select(d.z, -d.z, d.x < 0.0), d.y, a.x);
    }
    if (a.y >= a.z) {
        return cube_place(select(3u, 2u, d.y < 0.0), d.x, select(d.z, -d.z, d.y < 0.0), a.y);
    }
    return cube_place(select(5u, 4u, d.z < 0.0), select(-d.x, d.x, d.z < 0.0), d.y, a.z);
}

fn cube_place(face: u32, right: f32, up: f32, ahead: f32) -> CubePlace {
    return CubePlace(face, vec2<f32>(0.5 + 0.5 * right / ahead, 0.5 + 0.5 * up / ahead));
}
