// Auxiliary pictures of the ray through the pixel's centre, at the first surface with d > 0. Twin of src/kernel/center.rs.

// Words of a pixel: depth, normal, position, id (part, triangle), material, texture coordinates.
const CENTER_WORDS: u32 = 12u;

// Every other bit of a number of up to six, from the lowest on.
fn even_bits(number: u32) -> u32 {
    return (number & 1u) | ((number >> 1u) & 2u) | ((number >> 2u) & 4u);
}

@compute @workgroup_size(64)
fn center(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    thread_in_group = local;
    let pixel = vec2<u32>(
        8u * (slice.first_tile + group.x) + even_bits(local),
        slice.first_row + 8u * group.y + even_bits(local >> 1u),
    );
    if (pixel.x < shot.size.x && pixel.y < min(shot.size.y, slice.end_row)) {
        fill_center(pixel);
    }
    clear_group_counts(local);
    workgroupBarrier();
    add_to_group_counts();
    workgroupBarrier();
    add_group_counts(local, group.y * groups.x + group.x);
}

fn fill_center(pixel: vec2<u32>) {
    // a single sample's ray is the same one and counted there
    if (shot.samples > 1u) {
        traced.camera += 1u;
    }
    let ray = camera_ray(f32(pixel.x) + 0.5, f32(pixel.y) + 0.5);
    var depth = INFINITY_BITS;
    var n = vec3<f32>(0.0);
    var position = vec3<f32>(0.0);
    var id = vec2<u32>(ABSENT);
    var slot = ABSENT;
    var uv = vec2<f32>(0.0);
    var after = order_start();
    for (var crossed = 0u; crossed < SURFACES_MAX; crossed += 1u) {
        let hit = closest(ray, after);
        if (hit.object == ABSENT) {
            break;
        }
        after = order_of(hit);
        let material = material_of(hit);
        if ((materials[material].flags & (TEXTURED | HALO)) == 0u && !(materials[material].d > 0.0)) {
            continue;
        }
        let triangle = placed_triangle(hit);
        let surface = surface_at(ray, hit, triangle, material);
        // maps change the normal and the dissolve
        let here = changed(ray, hit, triangle, surface, shot.spread * hit.distance);
        if (here.constants.d > 0.0) {
            depth = bitcast<u32>(hit.distance);
            n = here.n;
            position = surface.position;
            id = id_of(hit);
            slot = material_slot(material);
            uv = uv_of(hit);
            break;
        }
    }
    let first = CENTER_WORDS * (pixel.y * shot.size.x + pixel.x);
    film[first] = depth;
    film[first + 1u] = bitcast<u32>(n.x);
    film[first + 2u] = bitcast<u32>(n.y);
    film[first + 3u] = bitcast<u32>(n.z);
    film[first + 4u] = bitcast<u32>(position.x);
    film[first + 5u] = bitcast<u32>(position.y);
    film[first + 6u] = bitcast<u32>(position.z);
    film[first + 7u] = id.x;
    film[first + 8u] = id.y;
    film[first + 9u] = slot;
    film[first + 10u] = bitcast<u32>(uv.x);
    film[first + 11u] = bitcast<u32>(uv.y);
}
