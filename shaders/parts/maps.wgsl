// What the maps of a material make of its constants and of the normal at a point. Twin of src/kernel/maps.rs.

// A point of a textured triangle.
struct MapPoint {
    // Texture coordinates.
    uv: vec2<f32>,
    // Square root of the area of texture coordinates that a unit of the triangle's area has.
    scale: f32,
    // Width of the ray's cone on the surface; 0 asks for level 0.
    width: f32,
    // How the point moves with u and with v.
    tangent_u: vec3<f32>,
    tangent_v: vec3<f32>,
}

// Corners and their texture coordinates in the same order.
fn map_point(corners: array<vec3<f32>, 3>, coordinates: array<vec2<f32>, 3>, uv: vec2<f32>, width: f32) -> MapPoint {
    let e1 = corners[1] - corners[0];
    let e2 = corners[2] - corners[0];
    let t1 = coordinates[1] - coordinates[0];
    let t2 = coordinates[2] - coordinates[0];
    let area_uv = t1.x * t2.y - t1.y * t2.x;
    let across = cross(e1, e2);
    let scale = sqrt(abs(area_uv) / sqrt(dot(across, across)));
    // e1 = t1.x·∂p/∂u + t1.y·∂p/∂v, e2 alike, solved but for a positive factor
    let sign = signum(area_uv);
    return MapPoint(uv, scale, width, (e1 * t2.y - e2 * t1.y) * sign, (e2 * t1.x - e1 * t2.x) * sign);
}

// log2 of the footprint in texels of level 0, at least 0.
fn map_level(point: MapPoint, map: MapRecord) -> f32 {
    let size = vec2<f32>(map.size);
    let texels_wide = point.width * point.scale * sqrt(size.x * size.y * abs(map.scale.x * map.scale.y));
    // also where it is not a number
    if (texels_wide > 1.0) {
        return log2_of(texels_wide);
    }
    return 0.0;
}

// What maps make of a material.
struct Textured {
    constants: MaterialRecord,
    // The texel of the normal map.
    norm: vec3<f32>,
}

// The constants times the maps. One loop over all maps that are read alike, so that a kernel has that code once.
fn textured(m: MaterialRecord, material: u32, point: MapPoint) -> Textured {
    var result = Textured(m, vec3<f32>(0.0));
    var last = ABSENT;
    var at = vec4<f32>(1.0);
    for (var slot = MAP_KA; slot <= MAP_NORM; slot += 1u) {
        let place = material_maps[material * MATERIAL_MAPS + slot];
        if (place == ABSENT || slot == MAP_BUMP) {
            continue;
        }
        let map = maps[place];
        // Ka and Kd usually have the same map
        if (place != last) {
            at = map_at(map, point.uv, map_level(point, map));
            last = place;
        }
        switch (slot) {
            case MAP_KA: {
                result.constants.ka *= at.xyz;
            }
            case MAP_KD: {
                result.constants.kd *= at.xyz;
            }
            case MAP_KS: {
                result.constants.ks *= at.xyz;
            }
            case MAP_KE: {
                result.constants.ke *= at.xyz;
            }
            case MAP_NS: {
                result.constants.ns = clamp(m.ns * map_channel(at, map.channel, CHANNEL_LUMINANCE), 0.0, FLOAT_MAX);
            }
            case MAP_D: {
                let otherwise = select(CHANNEL_LUMINANCE, CHANNEL_ALPHA, (map.flags & MAP_ALPHA_VARIES) != 0u);
                result.constants.d = clamp(m.d * map_channel(at, map.channel, otherwise), 0.0, 1.0);
            }
            default: {
                result.norm = at.xyz;
            }
        }
    }
    return result;
}

// Emission times its map at level 0.
fn textured_emission(ke: vec3<f32>, material: u32, uv: vec2<f32>) -> vec3<f32> {
    return ke * map_at(maps[material_maps[material * MATERIAL_MAPS + MAP_KE]], uv, 0.0).xyz;
}

// The normal as `bump` and `norm` tilt it; of `norm` the texel.
fn tilted(n: vec3<f32>, material: u32, point: MapPoint, norm: vec3<f32>) -> vec3<f32> {
    var tilted = n;
    let bump_place = material_maps[material * MATERIAL_MAPS + MAP_BUMP];
    if (bump_place != ABSENT) {
        let map = maps[bump_place];
        let t = map_axis(n, point.tangent_u, map.scale.x);
        let b = map_axis(n, point.tangent_v, map.scale.y);
        let by = slopes(map, point);
        tilted = normalize_or(n - (t * by.x + b * by.y) * map.bump_multiplier, n);
    }
    let norm_place = material_maps[material * MATERIAL_MAPS + MAP_NORM];
    if (norm_place != ABSENT) {
        let scale = maps[norm_place].scale;
        let t = map_axis(tilted, point.tangent_u, scale.x);
        let b = map_axis(tilted, point.tangent_v, scale.y);
        let along = norm * 2.0 - 1.0;
        tilted = normalize_or(t * along.x + b * along.y + tilted * along.z, tilted);
    }
    return tilted;
}

// The unit direction of growing u or v of a map, perpendicular to the normal; 0 where there is none.
fn map_axis(n: vec3<f32>, tangent: vec3<f32>, scale: f32) -> vec3<f32> {
    let t = normalize_or_zero(tangent) * signum(scale);
    return normalize_or_zero(t - n * dot(n, t));
}

// Half the differences of the heights a texel to both sides, along u and v, of the level that is next.
fn slopes(map: MapRecord, point: MapPoint) -> vec2<f32> {
    let nearest = min(u32(map_level(point, map) + 0.5), levels(map.size) - 1u);
    let level = level_of(map, nearest);
    let clamps = map_clamps(map);
    let uv = map_coordinates(map, point.uv);
    let column = axis(uv.x, level.size.x, clamps);
    let row = axis(1.0 - uv.y, level.size.y, clamps);
    var differences = vec2<f32>(0.0);
    // right, left, above, below; rows run down
    for (var side = 0; side < 4; side += 1) {
        let by = 1 - 2 * (side & 1);
        let is_along_u = side < 2;
        let beside = Axis(column.low + select(0, by, is_along_u), column.share);
        let over = Axis(row.low - select(by, 0, is_along_u), row.share);
        let texel = level_mix(level, beside, over, clamps) * map.base_gain.y + map.base_gain.x;
        let height = f32(by) * map_channel(texel, map.channel, CHANNEL_LUMINANCE);
        differences += select(vec2<f32>(0.0, height), vec2<f32>(height, 0.0), is_along_u);
    }
    return differences / 2.0;
}

fn map_channel(texel: vec4<f32>, given: u32, otherwise: u32) -> f32 {
    switch (select(given, otherwise, given == 0u)) {
        case CHANNEL_R: {
            return texel.x;
        }
        case CHANNEL_G: {
            return texel.y;
        }
        case CHANNEL_B: {
            return texel.z;
        }
        case CHANNEL_ALPHA: {
            return texel.w;
        }
        default: {
            // Rec. 709
            return 0.2126 * texel.x + 0.7152 * texel.y + 0.0722 * texel.z;
        }
    }
}
