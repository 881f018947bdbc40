// The surfaces that rays meet. Twin of src/kernel/world.rs.

// What a ray meets at a hit.
struct Surface {
    // The barycentric combination of the triangle's corners in the world.
    position: vec3<f32>,
    // The triangle's normal, turned to the viewer; unit.
    ng: vec3<f32>,
    // The shading normal, turned to the side of `ng`; unit.
    n: vec3<f32>,
    // How large the numbers are that the position comes from, by axis, for offset_origin.
    magnitude: vec3<f32>,
    // Diffuse reflectance.
    kd: vec3<f32>,
    // The material's place in `materials`.
    material: u32,
    // Whether the viewer is on the side that the triangle's normal points to.
    is_front: bool,
}

// A triangle in the world.
struct PlacedTriangle {
    corners: array<vec3<f32>, 3>,
    // How large the numbers are that the corners come from.
    magnitude: vec3<f32>,
}

// Texture coordinates of a triangle's corners.
struct Coordinates {
    at_corners: array<vec2<f32>, 3>,
    are_there: bool,
}

// The place of the material at a hit in `materials`.
fn material_of(hit: Hit) -> u32 {
    return material_at(hit.object, hit.triangle);
}

// The place of a triangle's material in `materials`.
fn material_at(object: u32, triangle: u32) -> u32 {
    let slots = objects[object].triangle_slots;
    if (slots == ABSENT) {
        return 0u;
    }
    var slot = words[slots + 1u];
    if (triangle < words[slots]) {
        slot = words[slots + 2u + triangle];
    }
    if (slot == ABSENT) {
        return 0u;
    }
    return tables[objects[object].slots + slot];
}

// The place of a material among those that the frame uses, in the order of their first use.
fn material_slot(material: u32) -> u32 {
    return tables[shot.material_slots + material];
}

// The hit's triangle in the world.
fn placed_triangle(hit: Hit) -> PlacedTriangle {
    let c = corners_of(hit);
    if ((objects[hit.object].flags & PLACED) == 0u) {
        return PlacedTriangle(c, magnitude(c));
    }
    let p = array<vec3<f32>, 3>(
        placed_point(hit.object, c[0]),
        placed_point(hit.object, c[1]),
        placed_point(hit.object, c[2]),
    );
    let most = max(
        max(placed_magnitude(hit.object, c[0]), placed_magnitude(hit.object, c[1])),
        placed_magnitude(hit.object, c[2]),
    );
    return PlacedTriangle(p, most + extent(p));
}

// The surface at a hit of a ray; its material is the one given, as the constants have it.
fn surface_at(ray: Ray, hit: Hit, triangle: PlacedTriangle, material: u32) -> Surface {
    let is_mirrored = (objects[hit.object].flags & MIRRORED) != 0u;
    let normal = triangle_normal(triangle.corners, -ray.direction);
    let oriented = select(normal, -normal, is_mirrored);
    let is_front = dot(oriented, ray.direction) <= 0.0;
    let ng = select(-oriented, oriented, is_front);
    return Surface(
        hit_point(triangle.corners, hit.barycentric),
        ng,
        shading_normal(hit, ng),
        triangle.magnitude,
        diffuse(hit, material),
        material,
        is_front,
    );
}

// What maps or a halo make of a surface.
struct Changed {
    constants: MaterialRecord,
    n: vec3<f32>,
    kd: vec3<f32>,
}

// The material's constants at a hit where they depend on the place or the direction, by maps or a halo; maps change the
// surface's normal and colour, too. `width` is that of the ray's cone there; 0 asks for level 0.
fn changed(ray: Ray, hit: Hit, triangle: PlacedTriangle, surface: Surface, width: f32) -> Changed {
    var result = Changed(materials[surface.material], surface.n, surface.kd);
    if (HAS_TEXTURES) {
        if ((result.constants.flags & TEXTURED) != 0u) {
            let coordinates = coordinates_of(hit.object, hit.triangle);
            if (coordinates.are_there) {
                let uv = mix_coordinates(coordinates.at_corners, hit.barycentric);
                let footprint = width / max(abs(dot(surface.ng, ray.direction)), 0.1);
                let point = map_point(triangle.corners, coordinates.at_corners, uv, footprint);
                let maps_make = textured(result.constants, surface.material, point);
                result.constants = maps_make.constants;
                result.n = tilted(surface.n, surface.material, point, maps_make.norm);
                result.kd = result.constants.kd;
            }
        }
    }
    if ((result.constants.flags & HALO) != 0u) {
        result.constants.d = with_halo(result.constants.d, -dot(result.n, ray.direction));
    }
    return result;
}

// Whether a triangle's material may let shadow rays through.
fn is_clear(object: u32, triangle: u32) -> bool {
    let m = materials[material_at(object, triangle)];
    return (m.flags & (TEXTURED_SHADOW | HALO)) != 0u || !is_zero(material_shadow_factor(m));
}

// What a shadow ray is let through at a hit.
fn shadow_factor(ray: Ray, hit: Hit) -> vec3<f32> {
    let material = material_of(hit);
    var m = materials[material];
    if ((m.flags & (TEXTURED_SHADOW | HALO)) != 0u) {
        let along = Ray(ray.origin, normalize_or_zero(ray.direction));
        let triangle = placed_triangle(hit);
        m = changed(along, hit, triangle, surface_at(along, hit, triangle, material), 0.0).constants;
    }
    return material_shadow_factor(m);
}

// Texture coordinates at a hit; 0 where the triangle has none.
fn uv_of(hit: Hit) -> vec2<f32> {
    let coordinates = coordinates_of(hit.object, hit.triangle);
    if (coordinates.are_there) {
        return mix_coordinates(coordinates.at_corners, hit.barycentric);
    }
    return vec2<f32>(0.0);
}

// The texture coordinates of a triangle's corners.
fn coordinates_of(object: u32, triangle: u32) -> Coordinates {
    var result = Coordinates(array<vec2<f32>, 3>(vec2<f32>(0.0), vec2<f32>(0.0), vec2<f32>(0.0)), false);
    let texcoords = objects[object].texcoords;
    if (texcoords == ABSENT) {
        return result;
    }
    let corners = three_words(objects[object].texcoord_corners + 3u * triangle);
    if (any(corners == vec3<u32>(ABSENT))) {
        return result;
    }
    result.at_corners[0] = texcoord(texcoords + 2u * corners.x);
    result.at_corners[1] = texcoord(texcoords + 2u * corners.y);
    result.at_corners[2] = texcoord(texcoords + 2u * corners.z);
    result.are_there = true;
    return result;
}

fn texcoord(at: u32) -> vec2<f32> {
    return bitcast<vec2<f32>>(vec2<u32>(words[at], words[at + 1u]));
}

fn three_words(at: u32) -> vec3<u32> {
    return vec3<u32>(words[at], words[at + 1u], words[at + 2u]);
}

fn three_floats(at: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(three_words(at));
}

// The mesh of a hit, counted over all objects, and the triangle's place in it.
fn id_of(hit: Hit) -> vec2<u32> {
    let meshes = objects[hit.object].meshes;
    let first_part = objects[hit.object].first_part;
    var low = 0u;
    var high = objects[hit.object].mesh_count;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (tables[meshes + middle] <= hit.triangle) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low == 0u) {
        return vec2<u32>(first_part, hit.triangle);
    }
    return vec2<u32>(first_part + low - 1u, hit.triangle - tables[meshes + low - 1u]);
}

// The diffuse reflectance at a point of a triangle: of faces without a material their vertices' colours.
fn diffuse(hit: Hit, material: u32) -> vec3<f32> {
    let kd = materials[material].kd;
    if (material != 0u) {
        return kd;
    }
    let colors = objects[hit.object].colors;
    if (colors == ABSENT) {
        return kd;
    }
    let corners = three_words(objects[hit.object].corners + 3u * hit.triangle);
    let w = weights(hit.barycentric);
    return vertex_color(colors + 3u * corners.x, kd) * w.x
        + vertex_color(colors + 3u * corners.y, kd) * w.y
        + vertex_color(colors + 3u * corners.z, kd) * w.z;
}

fn vertex_color(at: u32, kd: vec3<f32>) -> vec3<f32> {
    let srgb = three_floats(at);
    if (is_nan(srgb.x)) {
        return kd;
    }
    return vec3<f32>(linear_from_srgb(srgb.x), linear_from_srgb(srgb.y), linear_from_srgb(srgb.z));
}

// The weights of a triangle's corners at a hit.
fn weights(barycentric: vec2<f32>) -> vec3<f32> {
    return vec3<f32>(1.0 - barycentric.x - barycentric.y, barycentric.x, barycentric.y);
}

fn mix_coordinates(at_corners: array<vec2<f32>, 3>, barycentric: vec2<f32>) -> vec2<f32> {
    let w = weights(barycentric);
    return at_corners[0] * w.x + at_corners[1] * w.y + at_corners[2] * w.z;
}

// The unit normal of a triangle, counter-clockwise; `otherwise` where f32 knows none.
fn triangle_normal(p: array<vec3<f32>, 3>, otherwise: vec3<f32>) -> vec3<f32> {
    return normalize_or(cross(scaled_edge(p[1] - p[0]), scaled_edge(p[2] - p[0])), otherwise);
}

// Edges are scaled to about 1 each, so that neither tiny nor huge triangles leave the range of f32.
fn scaled_edge(q: vec3<f32>) -> vec3<f32> {
    let a = abs(q);
    let most = max(max(a.x, a.y), a.z);
    return q / select(most, 1.0, most == 0.0);
}

// The normal of the corners, interpolated; the triangle's where one is absent or their sum has no length.
fn shading_normal(hit: Hit, ng: vec3<f32>) -> vec3<f32> {
    let normals = objects[hit.object].normals;
    if (normals == ABSENT) {
        return ng;
    }
    let corners = three_words(objects[hit.object].normal_corners + 3u * hit.triangle);
    if (any(corners == vec3<u32>(ABSENT))) {
        return ng;
    }
    let w = weights(hit.barycentric);
    var n = three_floats(normals + 3u * corners.x) * w.x
        + three_floats(normals + 3u * corners.y) * w.y
        + three_floats(normals + 3u * corners.z) * w.z;
    if ((objects[hit.object].flags & PLACED) != 0u) {
        n = objects[hit.object].cofactors[0].xyz * n.x
            + objects[hit.object].cofactors[1].xyz * n.y
            + objects[hit.object].cofactors[2].xyz * n.z;
    }
    n = normalize_or(n, ng);
    return select(n, -n, dot(n, ng) < 0.0);
}
