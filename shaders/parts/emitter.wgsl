// Area lights: points on the triangles that glow. Twin of src/kernel/emitter.rs.

// The point light that stands for all triangles that glow at a point, chosen by a point of the unit square; its radiance
// counts the whole, given to each of `count` points alike. There must be such triangles.
fn stand_in(point: vec3<f32>, at: vec2<f32>, count: u32) -> LightRecord {
    let chosen = min(emitters_up_to(at.x), shot.emitter_count - 1u);
    let e = emitters[chosen];
    // what is left of r within the chosen one's share is as good as new
    var low = 0.0;
    if (chosen != 0u) {
        low = emitters[chosen - 1u].share;
    }
    let r = clamp((at.x - low) / (e.share - low), 0.0, 1.0);
    let root = sqrt(r);
    let barycentric = vec2<f32>(root * (1.0 - at.y), root * at.y);
    let x = hit_point(array<vec3<f32>, 3>(e.a, e.b, e.c), barycentric);
    let to_point = point - x;
    let distance_squared = dot(to_point, to_point);
    let cosine = dot(e.normal, normalize_or_zero(to_point));
    let place = offset_origin(x, select(e.normal, -e.normal, cosine < 0.0), e.magnitude);
    var radiance = vec3<f32>(0.0);
    if (distance_squared > 0.0) {
        radiance = e.radiance * (abs(cosine) / distance_squared);
        if (HAS_TEXTURES) {
            if (material_maps[e.material * MATERIAL_MAPS + MAP_KE] != ABSENT) {
                let coordinates = coordinates_of(e.object, e.triangle);
                if (coordinates.are_there) {
                    let uv = mix_coordinates(coordinates.at_corners, barycentric);
                    radiance = textured_emission(radiance, e.material, uv);
                }
            }
        }
    }
    radiance /= f32(count);
    return LightRecord(place, POINT, radiance, 0u, vec3<f32>(0.0), 0.0, 0.0, 0u, vec2<u32>(0u));
}

// How many emitters have a share of at most r.
fn emitters_up_to(r: f32) -> u32 {
    var low = 0u;
    var high = shot.emitter_count;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (emitters[middle].share <= r) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}
