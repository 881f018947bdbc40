//! A frame as the kernel reads it: slices into its parts, constants of materials, transforms rounded to f32; and the
//! surfaces that rays meet in it.

use super::maps::{MapPoint, textured, tilted};
use super::material::{HALO, MaterialRecord, TEXTURED, TEXTURED_SHADOW};
use super::texture::linear_from_srgb;
use crate::accel::{Aabb, Hit, Placement, Ray, extent, hit_point, magnitude};
use crate::math::{DAffine3, DMat3, Mat3, Vec3};
use crate::scene::{ABSENT, Frame, Geometry, Material, Object, PartHash, Textures};
use std::collections::HashMap;

/// What a ray meets at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The barycentric combination of the triangle's corners in the world.
    pub position: Vec3,
    /// The triangle's normal, turned to the viewer; unit.
    pub ng: Vec3,
    /// The shading normal, turned to the side of `ng`; unit.
    pub n: Vec3,
    /// How large the numbers are that the position comes from, by axis, for [`crate::accel::offset_origin`].
    pub magnitude: Vec3,
    /// Diffuse reflectance.
    pub kd: Vec3,
    /// The material's place in [`World::materials`].
    pub material: u32,
    /// Whether the viewer is on the side that the triangle's normal points to.
    pub is_front: bool,
}

/// What all surfaces of a frame are looked up in. Borrows the frame; copies none of its parts.
#[derive(Clone, Debug)]
pub struct World<'a> {
    objects: Vec<WorldObject<'a>>,
    /// The distinct materials; that of faces that have none stands first.
    pub materials: Vec<MaterialRecord>,
    /// The maps of each material.
    textures: Vec<Option<&'a Textures>>,
    /// The place of each material in the order of first use.
    slots: Vec<u32>,
    /// Whether no material lets light through.
    pub is_opaque: bool,
    /// Whether a material is of a model beyond 2.
    pub has_models_beyond_2: bool,
}

#[derive(Clone, Debug)]
struct WorldObject<'a> {
    geometry: &'a Geometry,
    /// For each slot of the geometry the place in [`World::materials`].
    materials: Vec<u32>,
    first_part: u32,
    transform: Option<Transform>,
}

impl<'a> World<'a> {
    /// Takes a frame whose indices are all within what they index.
    pub fn new(frame: &'a Frame) -> Self {
        let mut world = Self {
            objects: Vec::with_capacity(frame.objects.len()),
            materials: vec![MaterialRecord::new(&Material::default())],
            textures: vec![None],
            slots: Vec::new(),
            is_opaque: true,
            has_models_beyond_2: false,
        };
        let mut places = HashMap::new();
        let mut first_part = 0;
        for Object { geometry, transform } in &frame.objects {
            let materials =
                geometry.materials.iter().map(|m| world.place(m.hash(), m, &mut places)).collect();
            let transform = transform.as_ref().map(Transform::new);
            world.objects.push(WorldObject { geometry, materials, first_part, transform });
            first_part += geometry.meshes.len() as u32;
        }
        world.slots = world.order_of_use();
        world.is_opaque = world.materials.iter().all(MaterialRecord::is_opaque);
        world.has_models_beyond_2 = world.materials.iter().any(|m| m.illum > 2);
        world
    }

    /// The place of a material, which is added where it is new.
    fn place(&mut self, name: PartHash, material: &'a Material, places: &mut HashMap<PartHash, u32>) -> u32 {
        *places.entry(name).or_insert_with(|| {
            self.materials.push(MaterialRecord::new(material));
            self.textures.push(Some(&material.textures));
            self.materials.len() as u32 - 1
        })
    }

    /// For each material its place in the order in which triangles use them first.
    fn order_of_use(&self) -> Vec<u32> {
        let mut slots = vec![ABSENT; self.materials.len()];
        let mut used = 0;
        for object in &self.objects {
            for &[_, slot] in &object.geometry.material_runs.0 {
                let place = &mut slots[object.material_in(slot) as usize];
                if *place == ABSENT {
                    *place = used;
                    used += 1;
                }
            }
        }
        slots
    }

    /// The place of the material at a hit in [`Self::materials`].
    pub fn material(&self, hit: &Hit) -> u32 {
        self.objects[hit.object as usize].material(hit.triangle as usize)
    }

    /// The place of a hit's material among those that the frame uses, in the order of their first use.
    pub fn material_slot(&self, hit: &Hit) -> u32 {
        self.slots[self.material(hit) as usize]
    }

    /// For each material its place among those that the frame uses, in the order of their first use.
    pub fn material_slots(&self) -> &[u32] {
        &self.slots
    }

    /// For each slot of an object's geometry the place of its material in [`Self::materials`].
    pub fn materials_of(&self, object: usize) -> &[u32] {
        &self.objects[object].materials
    }

    /// The number of an object's first mesh, counted over all objects.
    pub fn first_part(&self, object: usize) -> u32 {
        self.objects[object].first_part
    }

    /// The maps of a material.
    pub fn textures(&self, material: u32) -> Option<&'a Textures> {
        self.textures[material as usize]
    }

    /// The surface at a hit of a ray; its material is the one given, as the constants have it.
    #[allow(
        clippy::inline_always,
        reason = "built where it is kept, a picture takes a tenth less (benches/shade.rs)"
    )]
    #[inline(always)]
    pub fn surface(&self, ray: &Ray, hit: &Hit, material: u32) -> Surface {
        let object = &self.objects[hit.object as usize];
        let triangle = hit.triangle as usize;
        let corners = object.geometry.triangles.0[triangle];
        let weights = weights(hit);
        let (p, magnitude, orientation) = object.placed(corners);
        let ng = orientation * triangle_normal(p, -ray.direction);
        let is_front = ng.dot(ray.direction) <= 0.0;
        let ng = if is_front { ng } else { -ng };
        Surface {
            position: hit_point(&p, hit.barycentric),
            ng,
            n: shading_normal(object, triangle, weights, ng),
            magnitude,
            kd: self.diffuse(object, corners, weights, material),
            material,
            is_front,
        }
    }

    /// The material's constants at a hit where they depend on the place or the direction, by maps or a halo; maps
    /// change the surface's normal and colour, too. `width` is that of the ray's cone there; 0 asks for level 0.
    pub fn changed(&self, ray: &Ray, hit: &Hit, surface: &mut Surface, width: f32) -> Option<MaterialRecord> {
        let mut m = self.materials[surface.material as usize];
        if !m.is(TEXTURED | HALO) {
            return None;
        }
        let footprint = width / surface.ng.dot(ray.direction).abs().max(0.1);
        if let (true, Some(textures)) = (m.is(TEXTURED), self.textures(surface.material))
            && let Some(point) = self.map_point(hit, footprint)
        {
            m = textured(&m, textures, &point);
            surface.n = tilted(surface.n, textures, &point);
            surface.kd = m.kd;
        }
        if m.is(HALO) {
            m = m.with_halo(-surface.n.dot(ray.direction));
        }
        Some(m)
    }

    /// The dissolve at a hit.
    pub fn dissolve(&self, ray: &Ray, hit: &Hit, width: f32) -> f32 {
        let material = self.material(hit);
        let m = &self.materials[material as usize];
        if !m.is(TEXTURED | HALO) {
            return m.d;
        }
        let mut surface = self.surface(ray, hit, material);
        self.changed(ray, hit, &mut surface, width).map_or(m.d, |m| m.d)
    }

    /// What a shadow ray is let through at a hit.
    pub fn shadow_factor(&self, ray: &Ray, hit: &Hit) -> Vec3 {
        let material = self.material(hit);
        let m = &self.materials[material as usize];
        if !m.is(TEXTURED_SHADOW | HALO) {
            return m.shadow_factor();
        }
        let unit = Ray { direction: ray.direction.normalize_or_zero(), ..*ray };
        let mut surface = self.surface(&unit, hit, material);
        self.changed(&unit, hit, &mut surface, 0.0).as_ref().unwrap_or(m).shadow_factor()
    }

    /// Texture coordinates at a hit, where the triangle has them.
    pub fn uv(&self, hit: &Hit) -> Option<[f32; 2]> {
        self.coordinates(hit).map(|c| mix(c, weights(hit)))
    }

    fn map_point(&self, hit: &Hit, footprint: f32) -> Option<MapPoint> {
        let object = &self.objects[hit.object as usize];
        let coordinates = self.coordinates(hit)?;
        let (p, ..) = object.placed(object.geometry.triangles.0[hit.triangle as usize]);
        Some(MapPoint::new(p, coordinates, mix(coordinates, weights(hit)), footprint))
    }

    /// The texture coordinates of a triangle's corners.
    fn coordinates(&self, hit: &Hit) -> Option<[[f32; 2]; 3]> {
        let texcoords = self.objects[hit.object as usize].geometry.texcoords.as_ref()?;
        let corners = texcoords.corners.0[hit.triangle as usize];
        (!corners.contains(&ABSENT)).then(|| corners.map(|i| texcoords.values.0[i as usize]))
    }

    /// The mesh of a hit, counted over all objects, and the triangle's place in it.
    pub fn id(&self, hit: &Hit) -> [u32; 2] {
        let object = &self.objects[hit.object as usize];
        let meshes = &object.geometry.meshes;
        let after = meshes.partition_point(|m| m.first_triangle <= hit.triangle);
        let Some(mesh) = after.checked_sub(1) else { return [object.first_part, hit.triangle] };
        [object.first_part + mesh as u32, hit.triangle - meshes[mesh].first_triangle]
    }

    /// The triangles of the world that have one of the given materials, in order: a place on them, the material,
    /// the corners, and their [`Surface::magnitude`].
    pub fn triangles_of(
        &self,
        wanted: impl Fn(u32) -> bool,
        mut take: impl FnMut(Hit, u32, [Vec3; 3], Vec3),
    ) {
        for (place, object) in (0..).zip(&self.objects) {
            let runs = &object.geometry.material_runs.0;
            for (i, &[first, slot]) in runs.iter().enumerate() {
                let material = object.material_in(slot);
                if !wanted(material) {
                    continue;
                }
                let end = runs.get(i + 1).map_or(object.geometry.triangles.0.len() as u32, |next| next[0]);
                for triangle in first..end {
                    let (p, magnitude, _) = object.placed(object.geometry.triangles.0[triangle as usize]);
                    let at = Hit { distance: 0.0, object: place, triangle, barycentric: [0.0; 2] };
                    take(at, material, p, magnitude);
                }
            }
        }
    }

    /// The diffuse reflectance at a point of a triangle: of faces without a material their vertices' colours.
    fn diffuse(&self, object: &WorldObject, corners: [u32; 3], weights: [f32; 3], material: u32) -> Vec3 {
        let kd = self.materials[material as usize].kd;
        match &object.geometry.colors {
            Some(colors) if material == 0 => {
                let color = |i: u32| {
                    let srgb = colors.0[i as usize];
                    if srgb[0].is_nan() { kd } else { srgb.map(linear_from_srgb).into() }
                };
                interpolate(corners.map(color), weights)
            }
            _ => kd,
        }
    }
}

impl WorldObject<'_> {
    /// The place of a triangle's material in [`World::materials`].
    fn material(&self, triangle: usize) -> u32 {
        let runs = &self.geometry.material_runs.0;
        let after = runs.partition_point(|&[first, _]| first as usize <= triangle);
        after.checked_sub(1).map_or(0, |run| self.material_in(runs[run][1]))
    }

    fn material_in(&self, slot: u32) -> u32 {
        if slot == ABSENT { 0 } else { self.materials[slot as usize] }
    }

    /// Corners in the world, how large the numbers are that they come from, and −1 where the object is mirrored.
    #[allow(clippy::inline_always, reason = "as `World::surface`, which is most of what needs it")]
    #[inline(always)]
    fn placed(&self, corners: [u32; 3]) -> ([Vec3; 3], Vec3, f32) {
        let vertex = |i: u32| self.geometry.positions.0[i as usize];
        match &self.transform {
            None => {
                let p = corners.map(|i| Vec3::from(vertex(i)));
                (p, magnitude(&p), 1.0)
            }
            Some(t) => {
                let [a, b, c] = corners.map(|i| t.placement.magnitude(vertex(i)));
                let p = corners.map(|i| t.placement.point(vertex(i)));
                (p, a.max(b).max(c) + extent(&p), t.orientation)
            }
        }
    }
}

/// Where an object stands, and what takes its normals there.
#[derive(Clone, Debug)]
struct Transform {
    placement: Placement,
    /// The cofactors of the linear part, scaled: the inverse transpose but for a factor, finite where that is not.
    cofactors: Mat3,
    /// −1 where it mirrors, else 1.
    orientation: f32,
}

impl Transform {
    fn new(t: &DAffine3) -> Self {
        let (cofactors, orientation) = cofactors(t);
        Self { placement: Placement::new(t, &Aabb::EMPTY), cofactors, orientation }
    }
}

/// What takes normals to the world (the cofactors of the linear part, scaled: the inverse transpose but for a factor,
/// finite where that is not), and -1 where the transform mirrors, else 1.
pub fn cofactors(t: &DAffine3) -> (Mat3, f32) {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = t.matrix3;
    let columns = [y.cross(z), z.cross(x), x.cross(y)];
    // normals have no length: scaled, so that tiny and huge transforms stay within f32
    let largest = columns.iter().map(|c| c.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
    let [cx, cy, cz] = columns.map(|c| (c / largest).as_vec3());
    (Mat3::from_cols(cx, cy, cz), if columns[2].dot(z) < 0.0 { -1.0 } else { 1.0 })
}

/// The weights of a triangle's corners at a hit.
fn weights(hit: &Hit) -> [f32; 3] {
    let [u, v] = hit.barycentric;
    [1.0 - u - v, u, v]
}

fn interpolate(at_corners: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    at_corners[0] * weights[0] + at_corners[1] * weights[1] + at_corners[2] * weights[2]
}

fn mix(at_corners: [[f32; 2]; 3], weights: [f32; 3]) -> [f32; 2] {
    [0, 1].map(|k| {
        at_corners[0][k] * weights[0] + at_corners[1][k] * weights[1] + at_corners[2][k] * weights[2]
    })
}

/// The unit normal of a triangle, counter-clockwise; `otherwise` where f32 knows none.
fn triangle_normal(p: [Vec3; 3], otherwise: Vec3) -> Vec3 {
    // edges are scaled to about 1 each, so that neither tiny nor huge triangles leave the range of f32
    let edge = |q: Vec3| q / q.abs().max_element();
    edge(p[1] - p[0]).cross(edge(p[2] - p[0])).normalize_or(otherwise)
}

/// The normal of the corners, interpolated; the triangle's where one is absent or their sum has no length.
fn shading_normal(object: &WorldObject, triangle: usize, weights: [f32; 3], ng: Vec3) -> Vec3 {
    let Some(normals) = &object.geometry.normals else { return ng };
    let corners = normals.corners.0[triangle];
    if corners.contains(&ABSENT) {
        return ng;
    }
    let n = interpolate(corners.map(|i| normals.values.0[i as usize].into()), weights);
    let n = object.transform.as_ref().map_or(n, |t| t.cofactors * n).normalize_or(ng);
    if n.dot(ng) < 0.0 { -n } else { n }
}
