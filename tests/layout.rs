//! Records have the same layout on both sides: each structure of a kernel that has a twin in Rust has its fields, in its
//! order, at its places.

use bytemuck::Zeroable;
use naga::{Expression, Literal, Module, TypeInner};
use rentix::accel::PackedNode;
use rentix::device::gpu::shaders::FARS;
use rentix::device::gpu::{records, shaders};
use rentix::kernel::{self, camera, light, material, media};
use rentix::scene::Filter;
use std::mem::offset_of;

/// A structure: its name, its bytes, and its fields with where each begins and its bytes.
#[derive(Clone, Debug, PartialEq)]
struct Layout {
    name: String,
    span: usize,
    fields: Vec<(String, usize, usize)>,
}

/// The layout of a structure in Rust. All fields must be named: the pattern holds for no other list.
macro_rules! layout {
    ($room:ident :: $name:ident { $($field:ident),+ $(,)? }) => {{
        let $room::$name { $($field),+ } = $room::$name::zeroed();
        Layout {
            name: stringify!($name).to_string(),
            span: size_of::<$room::$name>(),
            fields: vec![$((
                stringify!($field).to_string(),
                offset_of!($room::$name, $field),
                size_of_val(&$field),
            )),+],
        }
    }};
}

/// The records that kernels which trace read.
fn records_of_trace() -> Vec<Layout> {
    vec![
        layout!(camera::CameraConstants {
            eye,
            center_x,
            forward,
            center_y,
            right,
            pad_right,
            down,
            pad_down,
        }),
        layout!(records::ShotConstants {
            camera,
            ambient,
            samples,
            background,
            background_map,
            size,
            seed,
            depth,
            prune,
            spread,
            alpha,
            is_z_up,
            pixel_filter,
            light_count,
            emitter_count,
            object_count,
            top_node,
            top_reach,
            top_objects,
            material_slots,
            gain,
            code_steps,
            pad,
        }),
        layout!(records::Slice { first_row, end_row, first_tile, lanes, waiting_each }),
        layout!(light::LightRecord {
            place,
            kind,
            radiance,
            inverse_square,
            axis,
            cos_inner,
            cos_outer,
            samples,
            pad,
        }),
        layout!(material::MaterialRecord { ka, illum, kd, ns, ks, d, ke, flags, tf, ni }),
        layout!(records::MapRecord {
            scale,
            offset,
            base_gain,
            bump_multiplier,
            channel,
            size,
            first_texel,
            flags,
        }),
        layout!(records::EmitterRecord {
            a,
            material,
            b,
            share,
            c,
            object,
            magnitude,
            triangle,
            normal,
            pad_normal,
            radiance,
            pad_radiance,
        }),
        layout!(records::ObjectRecord {
            world_from_object,
            object_from_world,
            margin_of_origin,
            cofactors,
            box_min,
            flags,
            box_max,
            first_primitive,
            root,
            first_triangle,
            first_part,
            meshes,
            mesh_count,
            triangle_slots,
            slots,
            corners,
            colors,
            normals,
            normal_corners,
            texcoords,
            texcoord_corners,
            pad_a,
            pad_b,
            pad_c,
        }),
    ]
}

/// The records that kernels which fit trees read.
fn records_of_refit() -> Vec<Layout> {
    vec![
        layout!(records::RefitTree {
            positions,
            vertices,
            by_height,
            heights,
            height_count,
            top_height,
            first_node,
            first_triangle,
            first_box,
            pad_a,
            pad_b,
            pad_c,
        }),
        layout!(records::RefitLevel { tree, first, count, trees }),
    ]
}

fn parsed(text: &str) -> Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)))
}

/// The layout of a structure of a kernel.
fn layout_in(module: &Module, name: &str) -> Option<Layout> {
    let (_, found) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name))?;
    let TypeInner::Struct { members, span } = &found.inner else { return None };
    let fields = members.iter().map(|m| {
        let bytes = module.types[m.ty].inner.size(module.to_ctx());
        (m.name.clone().unwrap_or_default(), m.offset as usize, bytes as usize)
    });
    Some(Layout { name: name.to_string(), span: *span as usize, fields: fields.collect() })
}

/// How a kernel's records differ from those here.
fn differences(text: &str, records: &[Layout]) -> Vec<String> {
    let module = parsed(text);
    let difference = |here: &Layout| {
        let there = layout_in(&module, &here.name);
        (there.as_ref() != Some(here)).then(|| format!("{}: here {here:?}, there {there:?}", here.name))
    };
    records.iter().filter_map(difference).collect()
}

#[test]
fn records_are_laid_out_alike() {
    for (text, records) in [
        (shaders::trace(FARS[FARS.len() - 1]), records_of_trace()),
        (shaders::center(FARS[FARS.len() - 1]), records_of_trace()),
        (shaders::refit(), records_of_refit()),
    ] {
        let differences = differences(&text, &records);
        assert!(differences.is_empty(), "{}", differences.join("\n"));
        // no holes either: what is sent is whole
        for record in records {
            let bytes: usize = record.fields.iter().map(|(_, _, bytes)| bytes).sum();
            assert_eq!(bytes, record.span, "{}", record.name);
        }
    }
}

/// Every structure that a binding holds has its twin here.
#[test]
fn no_record_is_without_its_twin() {
    for (text, records) in
        [(shaders::trace(FARS[FARS.len() - 1]), records_of_trace()), (shaders::refit(), records_of_refit())]
    {
        let module = parsed(&text);
        for (_, variable) in module.global_variables.iter().filter(|(_, v)| v.binding.is_some()) {
            let mut held = &module.types[variable.ty];
            if let TypeInner::Array { base, .. } = held.inner {
                held = &module.types[base];
            }
            if matches!(held.inner, TypeInner::Struct { .. }) {
                let name = held.name.as_deref().unwrap_or_default();
                assert!(records.iter().any(|r| r.name == name), "{name} is compared with nothing");
            }
        }
    }
}

/// Fields that change places, kinds or numbers are found, also where the text stays valid.
#[test]
fn what_differs_is_found() {
    let text = shaders::trace(FARS[FARS.len() - 1]);
    let bites = |changes: &[(&str, &str)], name: &str| {
        let mut changed = text.clone();
        for (from, to) in changes {
            assert_eq!(changed.matches(from).count(), 1, "{from}");
            changed = changed.replace(from, to);
        }
        let found = differences(&changed, &records_of_trace());
        assert!(found.iter().any(|f| f.starts_with(&format!("{name}: "))), "{changes:?}: {found:?}");
    };
    assert_eq!(differences(&text, &records_of_trace()), [""; 0]);
    // two of one type change names
    let swapped = [("    prune: f32,", "    other: f32,"), ("    spread: f32,", "    prune: f32,")];
    bites(&[&swapped[..], &[("    other: f32,", "    spread: f32,")]].concat(), "ShotConstants");
    // one is added where there was room
    bites(
        &[("    scale: vec2<f32>,\n    offset", "    scale: vec2<f32>,\n    more: u32,\n    offset")],
        "MapRecord",
    );
    // one is left out at the end
    bites(
        &[("    material_slots: u32,\n", "    material_slots: u32,\n    extra: vec4<u32>,\n")],
        "ShotConstants",
    );
    // the structure is gone
    bites(&[("struct EmitterRecord {", "alias EmitterRecord = Emitted;\nstruct Emitted {")], "EmitterRecord");
}

/// Kernels read nodes as five rows of four words.
#[test]
fn nodes_are_five_rows() {
    assert_eq!(size_of::<PackedNode>(), 5 * 16);
    // row 0: origin, exponents; row 1: links; rows 2 to 4: planes
    assert_eq!([offset_of!(PackedNode, origin), offset_of!(PackedNode, exponents)], [0, 12]);
    assert_eq!([offset_of!(PackedNode, child_base), offset_of!(PackedNode, triangle_base)], [16, 20]);
    assert_eq!([offset_of!(PackedNode, meta), offset_of!(PackedNode, planes)], [24, 32]);
}

/// A constant of a kernel.
fn constant(module: &Module, name: &str) -> Option<u64> {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => Some(value.into()),
        _ => None,
    }
}

#[test]
fn constants_are_the_same_on_both_sides() {
    let trace = [
        ("ABSENT", u64::from(records::ABSENT)),
        ("PLACED", records::PLACED.into()),
        ("MIRRORED", records::MIRRORED.into()),
        ("MAP_CLAMP", records::MAP_CLAMP.into()),
        ("MAP_SRGB", records::MAP_SRGB.into()),
        ("MAP_FLOAT", records::MAP_FLOAT.into()),
        ("MAP_ALPHA_VARIES", records::MAP_ALPHA_VARIES.into()),
        ("MATERIAL_MAPS", records::MATERIAL_MAPS as u64),
        ("REFLECTION", records::MATERIAL_MAPS as u64 - 1),
        ("COUNTER_ROWS", records::COUNTER_ROWS),
        ("WAITING_ROWS", records::WAITING_ROWS),
        ("HALO", material::HALO.into()),
        ("TF_GIVEN", material::TF_GIVEN.into()),
        ("TEXTURED", material::TEXTURED.into()),
        ("TEXTURED_SHADOW", material::TEXTURED_SHADOW.into()),
        ("POINT", light::POINT.into()),
        ("DIRECTIONAL", light::DIRECTIONAL.into()),
        ("SPOT", light::SPOT.into()),
        ("AREA", light::AREA.into()),
        ("FILTER_BOX", Filter::Box as u64),
        ("FILTER_TRIANGLE", Filter::Triangle as u64),
        ("FILTER_GAUSSIAN", Filter::Gaussian as u64),
        ("SURFACES_MAX", kernel::SURFACES_MAX.into()),
        ("MEDIA_MAX", media::MEDIA_MAX as u64),
    ];
    let center = [("CENTER_WORDS", records::CENTER_WORDS), ("SURFACES_MAX", kernel::SURFACES_MAX.into())];
    for (text, constants) in [
        (shaders::trace(FARS[FARS.len() - 1]), &trace[..]),
        (shaders::center(FARS[FARS.len() - 1]), &center[..]),
    ] {
        let module = parsed(&text);
        for (name, here) in constants {
            assert_eq!(constant(&module, name), Some(*here), "{name}");
        }
    }
}

/// The places of maps in a material's words are those of `Textures::slots`.
#[test]
fn maps_stand_in_the_order_of_slots() {
    let module = parsed(&shaders::trace(FARS[FARS.len() - 1]));
    let names = ["MAP_KA", "MAP_KD", "MAP_KS", "MAP_KE", "MAP_NS", "MAP_D", "MAP_BUMP", "MAP_NORM"];
    let map = |value: u8| {
        let texture = rentix::scene::Texture {
            size: [1, 1],
            space: rentix::scene::TexelSpace::Linear,
            alpha_varies: false,
            texels: rentix::scene::Texels::U8(vec![[value; 4]]),
        };
        rentix::scene::Map {
            texture: rentix::scene::Part::new(texture),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            base_gain: [0.0, 1.0],
            bump_multiplier: 1.0,
            channel: None,
        }
    };
    let textures = rentix::scene::Textures {
        map_ka: Some(map(0)),
        map_kd: Some(map(1)),
        map_ks: Some(map(2)),
        map_ke: Some(map(3)),
        map_ns: Some(map(4)),
        map_d: Some(map(5)),
        bump: Some(map(6)),
        norm: Some(map(7)),
        refl: Some(rentix::scene::Reflection::Sphere(map(8))),
    };
    for (value, name) in (0_u8..).zip(names.into_iter().chain(["MAP_SPHERE"])) {
        let place = constant(&module, name).unwrap_or_else(|| panic!("{name} is not there")) as usize;
        assert_eq!(textures.slots()[place], Some(&map(value)), "{name}");
    }
    let faces = std::array::from_fn(|k| Some(map(9 + k as u8)));
    let cube =
        rentix::scene::Textures { refl: Some(rentix::scene::Reflection::Cube(Box::new(faces))), ..textures };
    let first = constant(&module, "MAP_CUBE").unwrap() as usize;
    for k in 0..6 {
        assert_eq!(cube.slots()[first + k], Some(&map(9 + k as u8)), "face {k}");
    }
    assert_eq!(cube.slots().len() + 1, records::MATERIAL_MAPS);
}
