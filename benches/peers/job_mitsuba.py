#!/usr/bin/env python3
"""A folder of OBJ frames to PNG by Mitsuba 3: direct light, two-sided diffuse of albedo 0.8, face normals, box filter.

  pip install mitsuba
  python job_mitsuba.py FOLDER OUT --variant llvm_ad_rgb --eye 0.05,0.16,0.35 --look-at=-0.017,0.11,0 --light 0.3,0.6,0.5

llvm_ad_rgb wants LLVM (Debian: libllvm19; DRJIT_LIBLLVM_PATH names its library where it is not found). With --keep one scene
stays and takes the vertices of each frame; otherwise each frame's scene is loaded."""
import math
import job

p = job.options(__doc__)
p.add_argument("--variant", default="llvm_ad_rgb")
p.add_argument("--keep", action="store_true", help="one scene whose vertices move")
a = p.parse_args()

import drjit
import mitsuba as mi
mi.set_variant(a.variant)

WIDTH, HEIGHT = map(int, a.size.split("x"))
FIXED = {
    "type": "scene",
    "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
    "sensor": {"type": "perspective", "fov": a.fov, "fov_axis": "y", "near_clip": 1e-4, "far_clip": 1e6,
               "to_world": mi.ScalarTransform4f().look_at(origin=a.eye, target=a.look_at, up=[0, 1, 0]),
               "sampler": {"type": "independent"},
               "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}, "pixel_format": "rgba" if a.alpha else "rgb"}},
    # its diffuse surfaces reflect albedo / pi
    "light": {"type": "point", "position": a.light, "intensity": {"type": "rgb", "value": math.pi * a.intensity}},
}
DIFFUSE = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.8}}}
kept = None


def mesh(file):
    return {"type": "obj", "filename": file, "face_normals": True, "bsdf": DIFFUSE}


def scene_of(file):
    global kept
    if not a.keep:
        return mi.load_dict(FIXED | {"mesh": mesh(file)})
    if kept is None:
        kept = mi.load_dict(FIXED | {"mesh": mesh(file)})
    else:
        there = mi.traverse(kept)
        there["mesh.vertex_positions"] = mi.traverse(mi.load_dict(mesh(file)))["vertex_positions"]
        there.update()
    return kept


def frame(file, picture):
    with job.stage("read and update"):
        scene = scene_of(file)
    with job.stage("trace"):
        image = mi.render(scene, spp=a.samples)
        drjit.eval(image)
        drjit.sync_thread()
    with job.stage("write"):
        if a.alpha:
            mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.UInt8, True).write(picture)
        else:
            mi.util.write_bitmap(picture, image)  # goes on beside the next frame


job.run(a, "mitsuba", mi.__version__, frame)
