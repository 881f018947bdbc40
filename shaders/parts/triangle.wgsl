// The canonical hit of one triangle. Twin of src/accel/triangle.rs.
//
// What a driver does with a + b·c is its own business, so nothing that a hit depends on leaves it a choice: a projected
// vertex is one fused operation for each coordinate, and an edge's value is the difference of two products with the error
// of one of them added (Kahan's), whose sign is right where fused operations are fused, and which is the plain difference
// of the rounded products where they are not. Either way both neighbours of an edge see opposite signs or 0, and no ray
// passes between them.

// A ray as the edge test wants it: its largest component is along the last axis, the others are sheared away.
struct ShearRay {
    // That axis: the sheared space has the other two, in cyclic order, and then it.
    last: u32,
    shear: vec3<f32>,
}

fn shear_ray(ray: Ray) -> ShearRay {
    let size = abs(ray.direction);
    var last = select(1u, 2u, size.y < size.z);
    if (size.x >= size.y && size.x >= size.z) {
        last = 0u;
    }
    let d = sheared_axes(last, ray.direction);
    return ShearRay(last, vec3<f32>(d.x / d.z, d.y / d.z, 1.0 / d.z));
}

// Coordinates in the order of the axes of the sheared space.
fn sheared_axes(last: u32, v: vec3<f32>) -> vec3<f32> {
    return select(select(v, v.zxy, last == 1u), v.yzx, last == 0u);
}

// What a ray meets in a triangle's plane inside of its edges.
struct InPlane {
    // 0 or less where it meets nothing.
    distance: f32,
    barycentric: vec2<f32>,
}

// The ray's origin, and the corners' coordinates, along each sheared axis.
fn hit_in_plane(origin: vec3<f32>, shear: vec3<f32>, along_x: vec3<f32>, along_y: vec3<f32>, along_z: vec3<f32>) -> InPlane {
    // the corners as seen along the ray
    let z = along_z - origin.z;
    let x = fma(vec3<f32>(-shear.x), z, along_x - origin.x);
    let y = fma(vec3<f32>(-shear.y), z, along_y - origin.y);
    let u = difference_of_products(x.z, y.y, y.z, x.y);
    let v = difference_of_products(x.x, y.z, y.x, x.z);
    let w = difference_of_products(x.y, y.x, y.y, x.x);
    let is_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let determinant = (u + v) + w;
    if (!is_inside || determinant == 0.0) {
        return InPlane(-1.0, vec2<f32>(0.0));
    }
    let depth = fma(u, z.x, fma(v, z.y, w * z.z));
    return InPlane(depth / determinant * shear.z, vec2<f32>(v / determinant, w / determinant));
}

// Whether a place of the order comes before another.
fn precedes(a: HitOrder, b: HitOrder) -> bool {
    return a.distance < b.distance || (a.distance == b.distance && a.primitive < b.primitive);
}
