//! A frame as the kernel reads it: slices into its parts, constants of materials, transforms rounded to f32; and the
//! surfaces that rays meet in it.

use super::material::MaterialRecord;
use super::power::powf;
use crate::accel::{Aabb, Hit, Placement, Ray, extent, hit_point, magnitude};
use crate::math::{DAffine3, DMat3, Mat3, Vec2, Vec3};
use crate::scene::{ABSENT, Frame, Geometry, Material, Object, Part, Reflection, Textures};

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
    /// Whether the ray meets the side that the corners go round counter-clockwise.
    pub is_front: bool,
}

/// What all surfaces of a frame are looked up in. Borrows the frame; copies none of its parts.
#[derive(Clone, Debug)]
pub struct World<'a> {
    objects: Vec<WorldObject<'a>>,
    /// The material of faces that have none stands first.
    pub materials: Vec<MaterialRecord>,
    /// The maps of each material that has some.
    textures: Vec<Option<&'a Textures>>,
    /// Whether no material lets light through.
    pub is_opaque: bool,
    /// Whether all materials are of models 0 to 2 without halo and maps.
    pub is_direct: bool,
}

#[derive(Clone, Debug)]
struct WorldObject<'a> {
    geometry: &'a Geometry,
    first_material: u32,
    first_part: u32,
    transform: Option<Transform>,
}

impl<'a> World<'a> {
    /// Takes a frame whose indices are all within what they index.
    pub fn new(frame: &'a Frame) -> Self {
        let mut objects = Vec::with_capacity(frame.objects.len());
        let mut materials = vec![MaterialRecord::new(&Material::default())];
        let mut textures = vec![None];
        let mut first_part = 0;
        for Object { geometry, transform } in &frame.objects {
            let first_material = materials.len() as u32;
            materials.extend(geometry.materials.iter().map(|m| MaterialRecord::new(m)));
            let maps = |m: &'a Part<Material>| Some(&m.textures).filter(|t| !t.is_empty());
            textures.extend(geometry.materials.iter().map(maps));
            let transform = transform.as_ref().map(Transform::new);
            objects.push(WorldObject { geometry, first_material, first_part, transform });
            first_part += geometry.meshes.len() as u32;
        }
        let has_map_d = |t: Option<&Textures>| t.is_some_and(|t| t.map_d.is_some());
        let is_opaque =
            materials.iter().all(MaterialRecord::is_opaque) && !textures.iter().copied().any(has_map_d);
        let is_direct =
            materials.iter().all(MaterialRecord::is_direct) && textures.iter().all(Option::is_none);
        Self { objects, materials, textures, is_opaque, is_direct }
    }

    /// The surface at a hit of a ray.
    #[allow(
        clippy::inline_always,
        reason = "built where it is kept, a picture takes a tenth less (benches/shade.rs)"
    )]
    #[inline(always)]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let object = &self.objects[hit.object as usize];
        let geometry = object.geometry;
        let triangle = hit.triangle as usize;
        let corners = geometry.triangles.0[triangle];
        let [u, v] = hit.barycentric;
        let weights = [1.0 - u - v, u, v];

        let vertex = |i: u32| geometry.positions.0[i as usize];
        let (p, magnitude, orientation) = match &object.transform {
            None => {
                let p = corners.map(|i| Vec3::from(vertex(i)));
                (p, magnitude(&p), 1.0)
            }
            Some(t) => {
                let [a, b, c] = corners.map(|i| t.placement.magnitude(vertex(i)));
                let p = corners.map(|i| t.placement.point(vertex(i)));
                (p, a.max(b).max(c) + extent(&p), t.orientation)
            }
        };
        let ng = orientation * triangle_normal(p, -ray.direction);
        let is_front = ng.dot(ray.direction) <= 0.0;
        let ng = if is_front { ng } else { -ng };
        let (material, kd) = self.material(object, triangle, corners, weights);
        Surface {
            position: hit_point(&p, hit.barycentric),
            ng,
            n: shading_normal(object, triangle, weights, ng),
            magnitude,
            kd,
            material,
            is_front,
        }
    }

    /// The maps of a material and where they are looked up at a hit; None where the material has none.
    pub fn maps(&self, hit: &Hit, material: u32) -> Option<(&'a Textures, Texcoord)> {
        let textures = self.textures[material as usize]?;
        let object = &self.objects[hit.object as usize];
        Some((textures, object.texcoord(hit)))
    }

    /// The material's place in [`World::materials`] at a hit.
    pub fn material_of(&self, hit: &Hit) -> u32 {
        self.objects[hit.object as usize].material(hit.triangle as usize)
    }

    /// What a material mirrors instead of the scene.
    pub fn reflection(&self, material: u32) -> Option<&'a Reflection> {
        self.textures[material as usize]?.refl.as_ref()
    }

    /// All emitting triangles in order, with their material's emission and their corners in the world.
    pub fn emitting(&self) -> Vec<(Vec3, [Vec3; 3])> {
        let mut list = Vec::new();
        for object in &self.objects {
            for (i, corners) in object.geometry.triangles.0.iter().enumerate() {
                let ke = self.materials[object.material(i) as usize].ke;
                if ke.max_element() > 0.0 {
                    list.push((ke, object.corners(*corners)));
                }
            }
        }
        list
    }

    /// The dissolve of the material at a hit.
    pub fn dissolve(&self, hit: &Hit) -> f32 {
        let object = &self.objects[hit.object as usize];
        self.materials[object.material(hit.triangle as usize) as usize].d
    }

    /// The mesh of a hit, counted over all objects, and the triangle's place in it.
    pub fn id(&self, hit: &Hit) -> [u32; 2] {
        let object = &self.objects[hit.object as usize];
        let meshes = &object.geometry.meshes;
        let after = meshes.partition_point(|m| m.first_triangle <= hit.triangle);
        let Some(mesh) = after.checked_sub(1) else { return [object.first_part, hit.triangle] };
        [object.first_part + mesh as u32, hit.triangle - meshes[mesh].first_triangle]
    }

    /// The material of a triangle and the diffuse reflectance at a point of it.
    fn material(
        &self,
        object: &WorldObject,
        triangle: usize,
        corners: [u32; 3],
        weights: [f32; 3],
    ) -> (u32, Vec3) {
        let material = object.material(triangle);
        let kd = self.materials[material as usize].kd;
        match &object.geometry.colors {
            Some(colors) if material == 0 => {
                let color = |i: u32| {
                    let srgb = colors.0[i as usize];
                    if srgb[0].is_nan() { kd } else { srgb.map(linear_from_srgb).into() }
                };
                (material, interpolate(corners.map(color), weights))
            }
            _ => (material, kd),
        }
    }
}

/// Where maps are looked up at a point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texcoord {
    /// (u, v); None where the triangle has no texture coordinates.
    pub uv: Option<Vec2>,
    /// Root of the triangle's area in (u, v) over its area in the world: units of u and v for each unit of width.
    pub uv_per_width: f32,
    /// Unit direction of growing u in the triangle's plane; 0 where it has none.
    pub tangent: Vec3,
    /// Unit direction of growing v in the triangle's plane; 0 where it has none.
    pub bitangent: Vec3,
}

impl WorldObject<'_> {
    fn corners(&self, corners: [u32; 3]) -> [Vec3; 3] {
        corners.map(|i| {
            let p = self.geometry.positions.0[i as usize];
            self.transform.as_ref().map_or_else(|| p.into(), |t| t.placement.point(p))
        })
    }

    fn texcoord(&self, hit: &Hit) -> Texcoord {
        let none = Texcoord { uv: None, uv_per_width: 0.0, tangent: Vec3::ZERO, bitangent: Vec3::ZERO };
        let Some(texcoords) = &self.geometry.texcoords else { return none };
        let corners = texcoords.corners.0[hit.triangle as usize];
        if corners.contains(&ABSENT) {
            return none;
        }
        let t = corners.map(|i| Vec2::from(texcoords.values.0[i as usize]));
        let p = self.corners(self.geometry.triangles.0[hit.triangle as usize]);
        let [u, v] = hit.barycentric;
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let (d1, d2) = (t[1] - t[0], t[2] - t[0]);
        let uv_area = d1.perp_dot(d2);
        // position as a function of (u, v): its derivatives, but for the factor 1 / uv_area
        let side = uv_area.signum();
        Texcoord {
            uv: Some(t[0] * (1.0 - u - v) + t[1] * u + t[2] * v),
            uv_per_width: (uv_area.abs() / e1.cross(e2).length().max(f32::MIN_POSITIVE)).sqrt(),
            tangent: ((e1 * d2.y - e2 * d1.y) * side).normalize_or_zero(),
            bitangent: ((e2 * d1.x - e1 * d2.x) * side).normalize_or_zero(),
        }
    }

    /// The place of a triangle's material in [`World::materials`].
    fn material(&self, triangle: usize) -> u32 {
        let runs = &self.geometry.material_runs.0;
        let after = runs.partition_point(|&[first, _]| first as usize <= triangle);
        match after.checked_sub(1).map(|run| runs[run][1]) {
            None | Some(ABSENT) => 0,
            Some(slot) => self.first_material + slot,
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
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = t.matrix3;
        let columns = [y.cross(z), z.cross(x), x.cross(y)];
        // normals have no length: scaled, so that tiny and huge transforms stay within f32
        let largest = columns.iter().map(|c| c.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
        let [cx, cy, cz] = columns.map(|c| (c / largest).as_vec3());
        Self {
            placement: Placement::new(t, &Aabb::EMPTY),
            cofactors: Mat3::from_cols(cx, cy, cz),
            orientation: if columns[2].dot(z) < 0.0 { -1.0 } else { 1.0 },
        }
    }
}

fn interpolate(at_corners: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    at_corners[0] * weights[0] + at_corners[1] * weights[1] + at_corners[2] * weights[2]
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

/// IEC 61966-2-1.
fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { powf((x + 0.055) / 1.055, 2.4) }
}
