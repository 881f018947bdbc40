//! Scenes made in code, on which the CPU and GPUs are compared.

use crate::rays::{Mesh as Shape, sphere};
use rentix::math::{DAffine3, DVec3, Vec3};
use rentix::plan::tree_name;
use rentix::scene::{
    ABSENT, Aov, AovSet, Attribute, Background, Camera, Channel, Colors, Corners, Faces, Falloff, Filter,
    Frame, Geometry, Light, Map, Material, MaterialRuns, Mesh, Normals, Object, Part, Positions, Reflection,
    Shot, Texcoords, TexelSpace, Texels, Texture, Textures, Triangles,
};
use std::sync::Arc;

/// A scene.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) frame: Frame,
    pub(crate) shot: Shot,
}

/// All of them.
pub(crate) fn all() -> Vec<Scene> {
    vec![models(), textures(), instances(), colors(), area_light()]
}

/// A picture with all auxiliary ones and a point light, from a little above.
pub(crate) fn shot(size: [u32; 2], samples: u32) -> Shot {
    let mut aovs = AovSet::default();
    for aov in Aov::ALL {
        aovs.insert(aov);
    }
    Shot {
        camera: Camera {
            eye: DVec3::new(0.3, 2.6, 7.5),
            look_at: DVec3::new(0.0, 0.7, 0.0),
            up: DVec3::Y,
            fov_deg: 40.0,
        },
        lights: vec![Light::Point {
            position: Vec3::new(-3.0, 6.0, 5.0),
            color: Vec3::new(1.0, 0.95, 0.9),
            intensity: 0.9,
            falloff: Falloff::None,
        }],
        ambient: Vec3::new(0.25, 0.2, 0.15),
        background: Background::Color(Vec3::new(0.1, 0.2, 0.4)),
        size,
        samples,
        filter: Filter::Triangle,
        depth: 4,
        seed: 3,
        prune: 1.0 / 256.0,
        alpha: false,
        aovs,
    }
}

/// An indexed mesh as a geometry of one material; None: that of faces without one.
pub(crate) fn geometry(shape: &Shape, material: Option<Material>) -> Geometry {
    let count = shape.triangles.len() as u32;
    Geometry {
        positions: Part::new(Positions(shape.positions.clone())),
        faces: Part::new(Faces {
            counts: vec![3; shape.triangles.len()],
            corners: shape.triangles.as_flattened().to_vec(),
        }),
        triangles: Part::new(Triangles(shape.triangles.clone())),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, if material.is_some() { 0 } else { ABSENT }]])),
        materials: material.map(Part::new).into_iter().collect(),
        meshes: vec![Mesh { first_face: 0, face_count: count, first_triangle: 0, triangle_count: count }],
    }
}

fn object(geometry: Geometry) -> Object {
    Object { geometry: Arc::new(geometry), transform: None }
}

/// A sphere with normals of its own.
fn ball(at: Vec3, radius: f32, cuts: usize, material: Material) -> Geometry {
    let unit = sphere(cuts);
    let shape = Shape {
        positions: unit.positions.iter().map(|&p| (Vec3::from(p) * radius + at).to_array()).collect(),
        triangles: unit.triangles.clone(),
    };
    let mut geometry = geometry(&shape, Some(material));
    geometry.normals = Some(Attribute {
        values: Part::new(Normals(unit.positions)),
        corners: Part::new(Corners(unit.triangles)),
    });
    geometry
}

/// A parallelogram from a corner along two edges, with (u, v) from 0 to 1.
fn quad(corner: Vec3, u: Vec3, v: Vec3, material: Option<Material>) -> Geometry {
    let positions = [corner, corner + u, corner + u + v, corner + v].map(|p| p.to_array()).to_vec();
    let mut geometry = geometry(&Shape { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] }, material);
    geometry.texcoords = Some(Attribute {
        values: Part::new(Texcoords(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])),
        corners: Part::new(Corners(vec![[0, 1, 2], [0, 2, 3]])),
    });
    geometry
}

fn floor(material: Material) -> Geometry {
    quad(Vec3::new(-6.0, 0.0, 5.0), Vec3::X * 12.0, Vec3::Z * -10.0, Some(material))
}

fn wall(material: Material) -> Geometry {
    quad(Vec3::new(-6.0, 0.0, -3.0), Vec3::X * 12.0, Vec3::Y * 5.0, Some(material))
}

fn matt(kd: [f32; 3]) -> Material {
    Material { ka: kd, kd, ..Material::default() }
}

/// All illumination models: balls, and panes before and beside them.
pub(crate) fn models() -> Scene {
    let mut objects = vec![
        object(floor(Material { illum: 10, ..matt([0.6, 0.55, 0.5]) })),
        object(wall(Material { textures: with_kd(map(checks(64))), ..matt([0.9; 3]) })),
    ];
    for illum in 0..=10_u8 {
        let material = Material {
            ks: [0.4, 0.45, 0.5],
            ns: 30.0,
            d: if matches!(illum, 2 | 4 | 6 | 9) { 0.5 } else { 1.0 },
            halo: illum == 2,
            tf: [0.9, 0.7, 0.8],
            tf_given: true,
            ni: 1.3,
            illum,
            ..matt([0.7, 0.5 - 0.03 * f32::from(illum), 0.2 + 0.06 * f32::from(illum)])
        };
        let (column, row) = (f32::from(illum % 6), f32::from(illum / 6));
        let at = Vec3::new(1.15 * (column - 2.5) + 0.5 * row, 0.5, 1.6 - 1.9 * row);
        objects.push(object(ball(at, 0.45, 2, material.clone())));
        if matches!(illum, 3 | 4 | 7 | 9 | 10) {
            let corner = at + Vec3::new(-0.3, 0.7 + 0.4 * row, 0.1);
            objects.push(object(quad(corner, Vec3::new(0.6, 0.0, 0.2), Vec3::Y * 0.5, Some(material))));
        }
    }
    Scene { name: "models", frame: Frame { objects }, shot: shot([128, 72], 2) }
}

/// A texture of 8 bits with all its levels, each the mean of the one below.
fn texture(side: usize, space: TexelSpace, texel: impl Fn(usize, usize) -> [u8; 4]) -> Texture {
    let mut level: Vec<[u8; 4]> = (0..side * side).map(|i| texel(i % side, i / side)).collect();
    let alpha_varies = level.iter().any(|t| t[3] != 255);
    let mut texels = level.clone();
    let mut width = side;
    while width > 1 {
        let half = width / 2;
        let mean = |i: usize| {
            let first = 2 * (i / half) * width + 2 * (i % half);
            let four = [first, first + 1, first + width, first + width + 1];
            std::array::from_fn(|k| (four.iter().map(|&j| u32::from(level[j][k])).sum::<u32>() / 4) as u8)
        };
        level = (0..half * half).map(mean).collect();
        texels.extend(&level);
        width = half;
    }
    Texture { size: [side as u32; 2], space, alpha_varies, texels: Texels::U8(texels) }
}

fn checks(side: usize) -> Texture {
    texture(side, TexelSpace::Srgb, |x, y| {
        let step = (x * 255 / side) as u8;
        if (x / 8 + y / 8) % 2 == 0 { [230, step, 60, 255] } else { [40, 90, 255 - step, 255] }
    })
}

/// Waves of heights.
fn waves(side: usize) -> Texture {
    texture(side, TexelSpace::Linear, |x, y| {
        let wave = libm::sinf(x as f32 * 0.6) * libm::cosf(y as f32 * 0.4);
        let height = (127.5 + 120.0 * wave) as u8;
        [height, height, height, 255]
    })
}

/// Holes in colour and alpha.
fn holes(side: usize) -> Texture {
    texture(side, TexelSpace::Linear, |x, y| {
        let (x, y) = (x % 16, y % 16);
        let is_hole = x.abs_diff(8).pow(2) + y.abs_diff(8).pow(2) < 25;
        [200, 200, 200, if is_hole { 20 } else { 255 }]
    })
}

/// Normals that lean.
fn leaning(side: usize) -> Texture {
    texture(side, TexelSpace::Linear, |x, y| {
        let lean = |t: usize| (127.5 + 60.0 * libm::sinf(t as f32 * 0.5)) as u8;
        [lean(x), lean(y), 230, 255]
    })
}

/// Floats without levels below 4 × 2, brighter than white.
fn glow() -> Texture {
    let level = |n: usize, value: f32| vec![[value, 0.5 * value, 0.2, 1.0]; n];
    let texels = [level(8, 1.5), level(2, 1.0), level(1, 0.7)].concat();
    Texture { size: [4, 2], space: TexelSpace::Linear, alpha_varies: false, texels: Texels::F32(texels) }
}

fn map(texture: Texture) -> Map {
    Map {
        texture: Part::new(texture),
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
        base_gain: [0.0, 1.0],
        bump_multiplier: 1.0,
        channel: None,
    }
}

fn with_kd(map: Map) -> Textures {
    Textures { map_kd: Some(map), ..Textures::default() }
}

/// Quads with maps of every kind, and a picture behind them.
fn textures() -> Scene {
    let shiny = |textures: Textures| Material {
        ks: [0.25; 3],
        ns: 40.0,
        illum: 2,
        textures,
        ..matt([0.5, 0.45, 0.4])
    };
    let of = Textures::default;
    let wide = |map: Map| Map { scale: [3.0, 2.0], offset: [0.25, 0.1], ..map };
    let kinds = [
        Textures { map_ka: Some(map(checks(64))), map_kd: Some(map(checks(64))), ..of() },
        with_kd(Map { clamp: true, ..wide(map(checks(32))) }),
        Textures { bump: Some(Map { bump_multiplier: 0.02, ..wide(map(waves(64))) }), ..of() },
        Textures { norm: Some(wide(map(leaning(64)))), ..with_kd(map(checks(32))) },
        Textures { map_d: Some(map(holes(64))), ..of() },
        Textures { map_d: Some(Map { channel: Some(Channel::Luminance), ..map(waves(32)) }), ..of() },
        Textures {
            map_ks: Some(map(checks(32))),
            map_ns: Some(Map { channel: Some(Channel::G), ..map(checks(32)) }),
            ..of()
        },
        Textures { map_ke: Some(Map { base_gain: [0.05, 0.3], ..map(glow()) }), ..of() },
        Textures { refl: Some(Reflection::Sphere(map(checks(64)))), ..of() },
        Textures {
            refl: Some(Reflection::Cube(Box::new(std::array::from_fn(|k| {
                (k != 2).then(|| map(checks(8 << (k % 3))))
            })))),
            ..of()
        },
    ];
    let mut objects = vec![object(floor(Material {
        textures: with_kd(Map { scale: [12.0; 2], ..map(checks(64)) }),
        ..matt([0.8; 3])
    }))];
    for (k, kind) in kinds.into_iter().enumerate() {
        let corner =
            Vec3::new(1.3 * ((k % 5) as f32 - 2.5), 0.1 + 1.2 * (k / 5) as f32, -0.8 * (k / 5) as f32);
        let illum = if kind.refl.is_some() { 3 } else { 2 };
        let material = Material { illum, ..shiny(kind) };
        objects.push(object(quad(
            corner,
            Vec3::new(1.1, 0.0, 0.2),
            Vec3::new(0.0, 1.0, -0.2),
            Some(material),
        )));
    }
    let background = Background::Picture { texture: Part::new(checks(64)), is_z_up: false };
    let shot = Shot { background, filter: Filter::Gaussian, ..shot([128, 72], 2) };
    Scene { name: "textures", frame: Frame { objects }, shot }
}

/// One figure in many places, some of them mirrored, sheared or flat, so that there is a level above.
pub(crate) fn instances() -> Scene {
    let figure = Arc::new(ball(Vec3::new(0.0, 0.5, 0.0), 0.5, 2, matt([0.8, 0.4, 0.3])));
    let tile = Arc::new(quad(
        Vec3::new(-0.5, 0.0, 0.5),
        Vec3::X,
        Vec3::Z * -1.0,
        Some(Material { textures: with_kd(map(checks(32))), ..matt([0.9; 3]) }),
    ));
    let mut objects = vec![object(floor(matt([0.5; 3])))];
    for k in 0..12 {
        let (column, row) = (k % 4, k / 4);
        let place = DVec3::new(1.5 * (f64::from(column) - 1.5), 0.02, 2.0 - 1.6 * f64::from(row));
        let shape = match k % 4 {
            0 => DAffine3::from_scale(DVec3::new(-1.0, 1.3, 0.8)),
            1 => DAffine3::from_rotation_z(0.4) * DAffine3::from_scale(DVec3::new(0.7, 0.9, -0.7)),
            2 => DAffine3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.1), DVec3::Z, DVec3::ZERO),
            _ => DAffine3::from_rotation_y(0.7) * DAffine3::from_scale(DVec3::new(1.0, 0.2, 1.0)),
        };
        let transform = Some(DAffine3::from_translation(place) * shape);
        objects.push(Object { geometry: Arc::clone(&figure), transform });
        let transform = Some(
            DAffine3::from_translation(place + DVec3::Y * 1.4)
                * DAffine3::from_rotation_x(1.2)
                * DAffine3::from_scale(DVec3::new(if k % 2 == 0 { 0.8 } else { -0.8 }, 1.0, 0.5)),
        );
        objects.push(Object { geometry: Arc::clone(&tile), transform });
    }
    Scene { name: "instances", frame: Frame { objects }, shot: shot([128, 72], 2) }
}

/// Faces without a material whose vertices have colours, but for some; with alpha.
pub(crate) fn colors() -> Scene {
    let shape = sphere(3);
    let mut figure = geometry(&shape, None);
    let color = |(i, p): (usize, &[f32; 3])| {
        if i % 7 == 0 { [f32::NAN; 3] } else { p.map(|x| 0.5 + 0.5 * x) }
    };
    figure.colors = Some(Part::new(Colors(shape.positions.iter().enumerate().map(color).collect())));
    let at = |x: f64| {
        Some(DAffine3::from_translation(DVec3::new(x, 1.0, 0.0)) * DAffine3::from_scale(DVec3::splat(0.9)))
    };
    let figure = Arc::new(figure);
    let objects = vec![
        Object { geometry: Arc::clone(&figure), transform: at(-1.2) },
        Object { geometry: figure, transform: at(1.2) },
        object(quad(
            Vec3::new(-1.5, 0.2, 1.5),
            Vec3::X * 3.0,
            Vec3::Y * 0.8,
            Some(Material { d: 0.4, ..matt([0.9; 3]) }),
        )),
    ];
    let shot = Shot { alpha: true, ..shot([96, 54], 3) };
    Scene { name: "colours of vertices", frame: Frame { objects }, shot }
}

/// Two glowing shapes, one of them placed, and what they light.
fn area_light() -> Scene {
    let lamp = Material { ke: [3.0, 2.6, 2.0], ..matt([0.0; 3]) };
    let objects = vec![
        object(floor(matt([0.7; 3]))),
        object(wall(matt([0.5, 0.6, 0.7]))),
        object(ball(
            Vec3::new(-1.0, 0.6, 0.3),
            0.6,
            2,
            Material { ks: [0.4; 3], ns: 20.0, illum: 2, ..matt([0.7, 0.3, 0.2]) },
        )),
        object(quad(Vec3::new(0.5, 2.2, -0.5), Vec3::X * 1.4, Vec3::Z * 1.2, Some(lamp.clone()))),
        Object {
            geometry: Arc::new(geometry(&sphere(1), Some(lamp))),
            transform: Some(
                DAffine3::from_translation(DVec3::new(1.2, 0.5, 0.8))
                    * DAffine3::from_scale(DVec3::splat(0.25)),
            ),
        },
    ];
    let mut shot = shot([96, 54], 4);
    shot.lights = vec![
        Light::Area { samples: 2 },
        Light::Spot {
            position: Vec3::new(-3.0, 4.0, 3.0),
            direction: Vec3::new(2.0, -3.0, -2.5),
            inner_deg: 8.0,
            outer_deg: 16.0,
            color: Vec3::ONE,
            intensity: 9.0,
            falloff: Falloff::InverseSquare,
        },
        Light::Directional { direction: Vec3::new(0.2, -1.0, -0.4), color: Vec3::ONE, intensity: 0.2 },
    ];
    Scene { name: "area light", frame: Frame { objects }, shot }
}

/// A wavy sheet of 2·(side − 1)² triangles over [−1, 1]², each vertex moved; quads whose diagonals may be flipped.
pub(crate) fn sheet(side: u32, flipped: impl Fn(u32) -> bool, place: impl Fn(u32, Vec3) -> Vec3) -> Geometry {
    let at = |i: u32| 2.0 * i as f32 / (side - 1) as f32 - 1.0;
    let vertex = |n: u32| {
        let (x, y) = (at(n % side), at(n / side));
        place(n, Vec3::new(x, y, 0.3 * libm::sinf(3.0 * x) * libm::cosf(4.0 * y))).to_array()
    };
    let corners = |n: u32| {
        let first = n / (side - 1) * side + n % (side - 1);
        [first, first + 1, first + side + 1, first + side]
    };
    let squares: Vec<[u32; 4]> = (0..(side - 1).pow(2)).map(corners).collect();
    let halves = (0..).zip(&squares).flat_map(|(n, &[a, b, c, d])| {
        if flipped(n) { [[b, c, d], [b, d, a]] } else { [[a, b, c], [a, c, d]] }
    });
    let triangles: Vec<[u32; 3]> = halves.collect();
    let (faces, count) = (squares.len() as u32, triangles.len() as u32);
    let shape = Shape { positions: (0..side * side).map(vertex).collect(), triangles };
    Geometry {
        faces: Part::new(Faces { counts: vec![4; squares.len()], corners: squares.concat() }),
        meshes: vec![Mesh { first_face: 0, face_count: faces, first_triangle: 0, triangle_count: count }],
        ..geometry(&shape, Some(matt([0.7, 0.5, 0.3])))
    }
}

/// More trees than a dispatch has workgroups in one direction: specks in a row, and eight tiles that are fitted after 65,535
/// others, for trees are fitted in the order of their names.
pub(crate) fn very_many_trees() -> Frame {
    let at = |middle: Vec3, size: f32| sheet(2, |_| false, move |_, p| middle + size * p);
    let specks: Vec<_> =
        (0..65_600).map(|i| at(Vec3::new(i as f32 * 1e-5 - 0.5, -1.0, -0.5), 1e-4)).collect();
    let mut names: Vec<_> = specks.iter().map(tree_name).collect();
    names.sort_unstable();
    let tile = |i: u32| {
        let put = |n: u32| {
            at(Vec3::new(0.5 * (i % 4) as f32 - 0.75, 0.5 * (i / 4) as f32 - 0.25, n as f32 * 1e-6), 0.2)
        };
        (0..100_000).map(put).find(|tile| tree_name(tile) > names[65_535]).expect("one of very many")
    };
    let objects = specks.iter().cloned().chain((0..8).map(tile));
    Frame { objects: objects.map(|g| Object { geometry: Arc::new(g), transform: None }).collect() }
}
