// Paths of light, from the eye on: where one is, what it counts for, and how it goes straight on. Twin of
// src/kernel/path.rs and of the steps of src/kernel/tile.rs.

// A ray on its way to a surface, and after it.
struct Path {
    ray: Ray,
    // The candidates before this one, itself included, lie behind; at a surface that surface's place.
    after: HitOrder,
    // What is seen there counts for this in the sum that is being added up.
    weight: vec3<f32>,
    // Surfaces that this ray has crossed.
    crossed: u32,
    // Bounces and crossings since the eye.
    used: u32,
    // Length of the way from the eye to where this ray starts.
    travelled: f32,
    // Whether it is the camera's, straight on.
    is_camera: bool,
    // Whether no surface before it had d > 0.
    sees_first: bool,
}

// Sums over samples.
struct PixelSum {
    // Colour.
    rgb: vec3<f32>,
    // What the background counts for.
    through: f32,
    // Diffuse reflectance.
    albedo: vec3<f32>,
}

// Those of this thread. They stand here, not in one record, so that drivers keep them in registers.
var<private> path: Path;
var<private> sum: PixelSum;
// What the sum that is being added up counts for in the picture.
var<private> base: vec3<f32>;
// What the path is inside of.
var<private> media: Media;

// A camera ray starts.
fn start_path(ray: Ray) {
    path = Path(ray, order_start(), vec3<f32>(1.0), 0u, 0u, 0.0, true, true);
    base = vec3<f32>(1.0);
    media.depth = 0u;
    traced.camera += 1u;
}

// A sample starts at the eye.
fn start_sample(at: Sample) {
    let place = vec2<f32>(at.pixel) + place_in_pixel(at.index, shot.samples, at.pixel, shot.seed);
    start_path(camera_ray(place.x, place.y));
}

// Adds a pixel's samples `lane`, `lane + lanes` and so on. All rays but those to lights are traced at one place, one of the
// two below: a driver puts a whole traversal wherever there is a call.
fn add_samples(pixel: vec2<u32>, lane: u32, lanes: u32) {
    var at = Sample(pixel, lane, 0u);
    if (HAS_ONE_RAY) {
        // without a loop a driver keeps nothing for rays that never come
        if (lane < shot.samples) {
            start_sample(at);
            let hit = closest(path.ray, path.after);
            if (hit.object == ABSENT) {
                escape();
            } else {
                _ = meet(hit, at);
            }
        }
        return;
    }
    var next = lane;
    var is_under_way = false;
    loop {
        if (!is_under_way) {
            if (next >= shot.samples) {
                break;
            }
            at = Sample(pixel, next, 0u);
            next += lanes;
            start_sample(at);
        }
        let hit = closest(path.ray, path.after);
        is_under_way = false;
        if (hit.object == ABSENT) {
            escape();
        } else if (path.crossed < SURFACES_MAX) {
            is_under_way = meet(hit, at);
            at.step += 1u;
        }
        if (HAS_BRANCHES) {
            if (!is_under_way) {
                is_under_way = take_waiting();
            }
        }
    }
}

// Adds what a surface shows; true where the path is on its way to a next one.
fn meet(hit: Hit, at: Sample) -> bool {
    path.after = order_of(hit);
    let material = material_of(hit);
    var m = materials[material];
    if (cover(m) != 0.0 || (m.flags & TEXTURED) != 0u) {
        let triangle = placed_triangle(hit);
        var surface = surface_at(path.ray, hit, triangle, material);
        if ((m.flags & (TEXTURED | HALO)) != 0u) {
            let width = shot.spread * (path.travelled + hit.distance);
            let here = changed(path.ray, hit, triangle, surface, width);
            m = here.constants;
            surface.n = here.n;
            surface.kd = here.kd;
        }
        if (HAS_BRANCHES) {
            if (m.illum == 7u && is_zero(m.ks)) {
                let border = border_of(surface);
                m.ks = vec3<f32>(reflectance_upright(border.n1, border.n2));
            }
        }
        if (HAS_ALBEDO) {
            if (path.sees_first && m.d > 0.0) {
                sum.albedo += surface.kd;
                path.sees_first = false;
            }
        }
        // of other frames all is opaque
        var covered = 1.0;
        if (HAS_BRANCHES || GOES_ON) {
            covered = cover(m);
        }
        let weight = path.weight * covered;
        path.weight *= 1.0 - covered;
        let view = -path.ray.direction;
        // before the lights' rays, so that the surface is not needed after them
        let own = own_color(surface, m);
        let shading = Shading(weight, surface, m, view, own, add_lights(surface, m, view, at));
        if (HAS_BRANCHES) {
            if (m.illum > 2u) {
                if (settle(shading)) {
                    return true;
                }
            } else {
                sum.rgb += plain_color(shading) * weight;
            }
        } else {
            sum.rgb += plain_color(shading) * weight;
        }
    }
    if (HAS_BRANCHES || GOES_ON) {
        return go_straight_on();
    }
    return false;
}

// Sends the path on behind its surface; false where what it counts for is not worth it.
fn go_straight_on() -> bool {
    if (!counts(path.weight * base)) {
        return false;
    }
    path.crossed += 1u;
    path.used += 1u;
    return true;
}

// Whether what counts for so little is traced.
fn counts(weight: vec3<f32>) -> bool {
    let most = max_element(weight);
    return !(most == 0.0 || most < shot.prune);
}

// The path leaves the scene. With alpha the background adds no colour to camera rays.
fn escape() {
    if (path.is_camera) {
        sum.through += element_sum(path.weight) / 3.0;
    }
    if (shot.alpha == 0u || !path.is_camera) {
        sum.rgb += background(path.ray.direction) * path.weight;
    }
}
