// A frame as kernels read it: constants, records and heaps. Twin of the records in src/device/gpu/records.rs.

// An index that is not there.
const ABSENT: u32 = 0xffffffffu;

struct CameraConstants {
    eye: vec3<f32>,
    center_x: f32,
    forward: vec3<f32>,
    center_y: f32,
    right: vec3<f32>,
    pad_right: f32,
    down: vec3<f32>,
    pad_down: f32,
}

// Everything but the geometry that bears on a frame's film.
struct ShotConstants {
    camera: CameraConstants,
    ambient: vec3<f32>,
    samples: u32,
    // The background's colour; of a picture its place in `maps`, else ABSENT.
    background: vec3<f32>,
    background_map: u32,
    size: vec2<u32>,
    seed: u32,
    depth: u32,
    prune: f32,
    // How much wider a ray's cone becomes with each unit of its path.
    spread: f32,
    // 1 where the background adds no colour to camera rays.
    alpha: u32,
    // 1 where a background picture has +z at its top.
    is_z_up: u32,
    // BOX, TRIANGLE or GAUSSIAN.
    pixel_filter: u32,
    light_count: u32,
    emitter_count: u32,
    object_count: u32,
    // The root of the level above the objects in `nodes`; ABSENT where rays ask one object after the other.
    top_node: u32,
    // Rays whose origin is as far away, on each axis, as the float at this place in `tables` says may use it. It is not here, so
    // that no kernel branches on a constant that changes from frame to frame.
    top_reach: u32,
    // For each of its leaves the object: from here on in `tables`.
    top_objects: u32,
    // For each material its place in the order of first use: from here on in `tables`.
    material_slots: u32,
    // The factor of the exposure, and where in `tables` the least floats of codes 1 to 255 stand, for kernels that make codes.
    gain: f32,
    code_steps: u32,
    pad: vec2<u32>,
}

// Which part of the picture one dispatch traces.
struct Slice {
    // The first row of pixels, and the first one that is not traced any more.
    first_row: u32,
    end_row: u32,
    // The first tile of each row of tiles.
    first_tile: u32,
    // The lanes that take a pixel's samples side by side: a power of two, 16 at most.
    lanes: u32,
    // Rays that may wait for each thread.
    waiting_each: u32,
}

struct LightRecord {
    place: vec3<f32>,
    kind: u32,
    radiance: vec3<f32>,
    inverse_square: u32,
    axis: vec3<f32>,
    cos_inner: f32,
    cos_outer: f32,
    samples: u32,
    pad: vec2<u32>,
}

struct MaterialRecord {
    ka: vec3<f32>,
    illum: u32,
    kd: vec3<f32>,
    ns: f32,
    ks: vec3<f32>,
    d: f32,
    ke: vec3<f32>,
    flags: u32,
    tf: vec3<f32>,
    ni: f32,
}

// A texture as a material uses it.
struct MapRecord {
    scale: vec2<f32>,
    offset: vec2<f32>,
    base_gain: vec2<f32>,
    bump_multiplier: f32,
    // 0 where none was given, else one of CHANNEL_*.
    channel: u32,
    // Width and height of level 0.
    size: vec2<u32>,
    // The place of its first texel in `texels`: one word a texel, four where they are floats.
    first_texel: u32,
    // MAP_*.
    flags: u32,
}

// A triangle that glows.
struct EmitterRecord {
    a: vec3<f32>,
    material: u32,
    b: vec3<f32>,
    // The shares of all emitters up to this one, itself included.
    share: f32,
    c: vec3<f32>,
    object: u32,
    magnitude: vec3<f32>,
    triangle: u32,
    normal: vec3<f32>,
    pad_normal: u32,
    radiance: vec3<f32>,
    pad_radiance: u32,
}

// An object: where it stands, and where its parts are. Places are those of words in `words`, ABSENT where there is no such
// part, unless something else is said.
struct ObjectRecord {
    // By rows; the fourth is the translation.
    world_from_object: array<vec4<f32>, 3>,
    // By rows; the fourth is what the box in the world is widened by, see Placement.
    object_from_world: array<vec4<f32>, 3>,
    // By rows; the fourth is unused.
    margin_of_origin: array<vec4<f32>, 3>,
    // By columns: takes normals to the world; the fourth is unused.
    cofactors: array<vec4<f32>, 3>,
    box_min: vec3<f32>,
    // PLACED, MIRRORED.
    flags: u32,
    box_max: vec3<f32>,
    // The primitive number of its triangle 0.
    first_primitive: u32,
    // Its tree: the root in `nodes`, its first triangle in `triangles`; ABSENT without triangles.
    root: u32,
    first_triangle: u32,
    // The number of its first mesh, counted over all objects.
    first_part: u32,
    // For each of its meshes the first triangle: from here on in `tables`; and how many there are.
    meshes: u32,
    mesh_count: u32,
    // Whose materials its triangles have: the first triangle of the last slot, that slot, then the slots of the triangles before
    // it. ABSENT without materials.
    triangle_slots: u32,
    // For each slot the material: from here on in `tables`.
    slots: u32,
    // Three position indices for each triangle.
    corners: u32,
    colors: u32,
    normals: u32,
    normal_corners: u32,
    texcoords: u32,
    texcoord_corners: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

const PLACED: u32 = 1u;
const MIRRORED: u32 = 2u;

const MAP_CLAMP: u32 = 1u;
const MAP_SRGB: u32 = 2u;
const MAP_FLOAT: u32 = 4u;
const MAP_ALPHA_VARIES: u32 = 8u;

const CHANNEL_R: u32 = 1u;
const CHANNEL_G: u32 = 2u;
const CHANNEL_B: u32 = 3u;
const CHANNEL_ALPHA: u32 = 4u;
const CHANNEL_LUMINANCE: u32 = 5u;

// The words of a material in `material_maps`: the places of its maps in `maps` in the order of Textures::slots (Ka, Kd, Ks,
// Ke, Ns, d, bump, norm, the sphere of refl, the six faces of its cube), ABSENT where there is none, then what refl is.
const MATERIAL_MAPS: u32 = 16u;
const MAP_KA: u32 = 0u;
const MAP_KD: u32 = 1u;
const MAP_KS: u32 = 2u;
const MAP_KE: u32 = 3u;
const MAP_NS: u32 = 4u;
const MAP_D: u32 = 5u;
const MAP_BUMP: u32 = 6u;
const MAP_NORM: u32 = 7u;
const MAP_SPHERE: u32 = 8u;
const MAP_CUBE: u32 = 9u;
const REFLECTION: u32 = 15u;
const REFLECTION_NONE: u32 = 0u;
const REFLECTION_SPHERE: u32 = 1u;
const REFLECTION_CUBE: u32 = 2u;

// Also single records are in storage: of uniforms llvmpipe makes constants, and a kernel anew for each frame.
@group(0) @binding(0) var<storage, read> shot: ShotConstants;
@group(0) @binding(1) var<storage, read> slice: Slice;
@group(0) @binding(2) var<storage, read> lights: array<LightRecord>;
@group(0) @binding(3) var<storage, read> emitters: array<EmitterRecord>;
@group(0) @binding(4) var<storage, read> materials: array<MaterialRecord>;
@group(0) @binding(5) var<storage, read> material_maps: array<u32>;
@group(0) @binding(6) var<storage, read> maps: array<MapRecord>;
@group(0) @binding(7) var<storage, read> objects: array<ObjectRecord>;
// Small lists of this frame.
@group(0) @binding(8) var<storage, read> tables: array<u32>;
// Trees: five rows a node; three rows a triangle, one for each axis: the three corners, and the triangle's number.
@group(0) @binding(9) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(10) var<storage, read> triangles: array<vec4<u32>>;
// Indices and attributes.
@group(0) @binding(11) var<storage, read> words: array<u32>;
// The linear values of the 256 codes of sRGB as floats, then texels.
@group(0) @binding(12) var<storage, read> texels: array<u32>;
// What kernels write: the film's words, pixel by pixel, then, where it is asked for, the albedo, three words a pixel; or the
// auxiliary pictures of the centre.
@group(0) @binding(13) var<storage, read_write> film: array<u32>;
// Rays that wait, for kernels with models beyond 2.
@group(0) @binding(14) var<storage, read_write> waiting: array<vec4<u32>>;
// Rays traced, rows of camera, shadow, mirrored, refracted, media ignored.
@group(0) @binding(15) var<storage, read_write> counters: array<atomic<u32>>;

// What a frame needs; a kernel is made for what its frame has.
override HAS_BRANCHES: bool = true;
override HAS_TEXTURES: bool = true;
override HAS_AREA_LIGHT: bool = true;
// Whether some material lets shadow rays through.
override HAS_TRANSPARENCY: bool = true;
// Whether rays go straight on through some surface.
override GOES_ON: bool = true;
// Whether there is one light, and it is no area light.
override HAS_ONE_LIGHT: bool = false;
override HAS_ALBEDO: bool = true;
// Whether a thread takes one sample at most, of a path that ends at its first surface.
override HAS_ONE_RAY: bool = false;
// Words of the film for each pixel: 3 for linear RGB, 4 with what the background counts for; 1 for codes of 8 bits on the sRGB
// curve, which are packed.
override FILM_WORDS: u32 = 4u;

// Threads of a workgroup that traces.
const GROUP: u32 = 64u;

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

// Where a ray meets a triangle; the object is ABSENT where it meets none.
struct Hit {
    distance: f32,
    object: u32,
    // The triangle's number in its object.
    triangle: u32,
    // Its place in `triangles`, three rows each.
    place: u32,
    // Weights of the second and third corner.
    barycentric: vec2<f32>,
}

// A hit's place in the order of candidates along a ray.
struct HitOrder {
    distance: f32,
    primitive: u32,
}

// The start of the order: distances are above 0.
fn order_start() -> HitOrder {
    return HitOrder(0.0, 0u);
}

fn order_of(hit: Hit) -> HitOrder {
    return HitOrder(hit.distance, objects[hit.object].first_primitive + hit.triangle);
}
