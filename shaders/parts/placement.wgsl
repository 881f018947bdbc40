// Where an object stands in the world. Twin of src/accel/placement.rs.

fn row_times(row: vec4<f32>, v: vec3<f32>) -> f32 {
    return fma(row.x, v.x, fma(row.y, v.y, row.z * v.z));
}

// The ray in an object's space; its direction is not normalised, so that distances are the world's.
fn object_ray(object: u32, ray: Ray) -> Ray {
    let to = objects[object].world_from_object;
    let back = objects[object].object_from_world;
    let o = ray.origin - vec3<f32>(to[0].w, to[1].w, to[2].w);
    let d = ray.direction;
    return Ray(
        vec3<f32>(row_times(back[0], o), row_times(back[1], o), row_times(back[2], o)),
        vec3<f32>(row_times(back[0], d), row_times(back[1], d), row_times(back[2], d)),
    );
}

// A box in the world that a ray enters not after any of the object's triangles.
fn object_box(object: u32, origin: vec3<f32>) -> Aabb {
    let back = objects[object].object_from_world;
    let more = objects[object].margin_of_origin;
    let o = abs(origin);
    let margin = vec3<f32>(back[0].w, back[1].w, back[2].w)
        + vec3<f32>(row_times(more[0], o), row_times(more[1], o), row_times(more[2], o));
    return Aabb(objects[object].box_min - margin, objects[object].box_max + margin);
}

// A vertex in the world.
fn placed_point(object: u32, p: vec3<f32>) -> vec3<f32> {
    let to = objects[object].world_from_object;
    return vec3<f32>(row_times(to[0], p), row_times(to[1], p), row_times(to[2], p)) + vec3<f32>(to[0].w, to[1].w, to[2].w);
}

// |M|·|p| + |T|.
fn placed_magnitude(object: u32, p: vec3<f32>) -> vec3<f32> {
    let to = objects[object].world_from_object;
    let a = abs(p);
    return vec3<f32>(row_times(abs(to[0]), a), row_times(abs(to[1]), a), row_times(abs(to[2]), a))
        + abs(vec3<f32>(to[0].w, to[1].w, to[2].w));
}
