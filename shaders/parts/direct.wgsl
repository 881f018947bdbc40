// Direct light: shadow rays from a surface to one light after the other. Twin of src/kernel/direct.rs.

// A surface on its way to a colour.
struct Shading {
    // What its colour counts for.
    weight: vec3<f32>,
    surface: Surface,
    // The material's constants at this point.
    constants: MaterialRecord,
    // Unit vector towards the viewer.
    view: vec3<f32>,
    // Its colour without light from lights.
    own: vec3<f32>,
    // What its lights add up to; nothing in model 0.
    sum: Reflected,
}

// The colour without mirrored and refracted light.
fn plain_color(s: Shading) -> vec3<f32> {
    return s.own + s.sum.diffuse + s.sum.specular;
}

// Which of a pixel's samples is being taken, and how many surfaces its paths have met before in it.
struct Sample {
    pixel: vec2<u32>,
    index: u32,
    step: u32,
}

// A point of the unit square for point `k` of `count` of a light at a shading point.
fn light_point(at: Sample, light: u32, k: u32, count: u32) -> vec2<f32> {
    return unit_square_for(hash(at.step) ^ light, at.index * count + k, at.pixel, shot.seed);
}

// What all lights, in the order given, add up to at a surface.
fn add_lights(surface: Surface, m: MaterialRecord, view: vec3<f32>, at: Sample) -> Reflected {
    var sum = Reflected(vec3<f32>(0.0), vec3<f32>(0.0));
    if (m.illum == 0u) {
        return sum;
    }
    // of one light a driver then knows that nothing of the surface is needed once its ray is traced
    let count = select(shot.light_count, 1u, HAS_ONE_LIGHT);
    for (var number = 0u; number < count; number += 1u) {
        var points = 1u;
        if (HAS_AREA_LIGHT) {
            if (lights[number].kind == AREA) {
                points = select(lights[number].samples, 0u, shot.emitter_count == 0u);
            }
        }
        for (var k = 0u; k < points; k += 1u) {
            var light = lights[number];
            if (HAS_AREA_LIGHT) {
                if (light.kind == AREA) {
                    light = stand_in(surface.position, light_point(at, number, k, points), points);
                }
            }
            let arriving = incident(light, surface.position);
            if (!faces(surface, arriving.direction) || is_zero(arriving.radiance)) {
                continue;
            }
            let ray = shadow_ray(light, offset_origin(surface.position, surface.ng, surface.magnitude));
            let end = shadow_end(light);
            traced.shadow += 1u;
            if (m.illum == 10u) {
                sum.specular += unshadowed(surface, arriving);
            }
            let light_here = reflected(surface, m, view, arriving);
            let met = meets(ray, end);
            if (met == MEETS_NOTHING) {
                sum.diffuse += light_here.diffuse;
                sum.specular += light_here.specular;
            } else if (HAS_TRANSPARENCY) {
                if (met == MEETS_CLEAR) {
                    let visibility = transmittance(ray, end);
                    if (!is_zero(visibility)) {
                        sum.diffuse += light_here.diffuse * visibility;
                        sum.specular += light_here.specular * visibility;
                    }
                }
            }
        }
    }
    return sum;
}

// The share of light that comes along a shadow ray through surfaces that are not opaque: the product of what they let
// through, in order; 0 after SURFACES_MAX.
fn transmittance(ray: Ray, end: f32) -> vec3<f32> {
    var share = vec3<f32>(1.0);
    var after = order_start();
    for (var crossed = 0u; crossed < SURFACES_MAX; crossed += 1u) {
        let hit = closest(ray, after);
        if (hit.object == ABSENT || !(hit.distance < end)) {
            return share;
        }
        share *= shadow_factor(ray, hit);
        if (is_zero(share)) {
            return share;
        }
        after = order_of(hit);
    }
    return vec3<f32>(0.0);
}
