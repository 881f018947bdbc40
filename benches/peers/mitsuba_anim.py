#!/usr/bin/env python3
"""Mitsuba 3 with a scene that stays: the vertices of one mesh move every frame, it is rendered with direct light, and the float
picture is read back. One JSON object a line; `rentix bench updates --mitsuba` runs it.

  pip install mitsuba numpy
  python mitsuba_anim.py cuda_ad_rgb          (NVIDIA's driver with OptiX)
  python mitsuba_anim.py llvm_ad_rgb          (LLVM: Debian's libllvm19; DRJIT_LIBLLVM_PATH where it is not found)

--mesh takes the place of a sphere of 384 x 192 quads. The first frame, which compiles, is told apart. Of the others, medians:
update: positions from the host and the acceleration structure, which a single ray then asks for; render; readback."""
import argparse, json, statistics, time

p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
p.add_argument("variant")
p.add_argument("--mesh")
p.add_argument("--frames", type=int, default=24)
p.add_argument("--sizes", default="1280x720,1920x1080")
p.add_argument("--spps", default="1,16")
p.add_argument("--from", dest="source", default="host", choices=["host"], help="where positions come from")
a = p.parse_args()

import drjit as dr
import mitsuba as mi
import numpy as np
mi.set_variant(a.variant)

DIFFUSE = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.8}}}
POSES = 24


def sphere(around=384, down=192):
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, around, endpoint=False), np.linspace(0, np.pi, down + 1))
    places = np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], -1).reshape(-1, 3).astype(np.float32)
    i, j = np.meshgrid(np.arange(down), np.arange(around), indexing="ij")
    at = lambda i, j: i * around + j % around
    halves = [(at(i, j), at(i + 1, j + 1), at(i + 1, j)), (at(i, j), at(i, j + 1), at(i + 1, j + 1))]
    faces = np.stack([np.stack(half, -1) for half in halves], 2).reshape(-1, 3).astype(np.uint32)
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(DIFFUSE)
    props["face_normals"] = True
    mesh = mi.Mesh("sphere", vertex_count=len(places), face_count=len(faces), props=props)
    there = mi.traverse(mesh)
    there["vertex_positions"], there["faces"] = places.ravel(), faces.ravel()
    there.update()
    return mesh


mesh = mi.load_dict({"type": "obj", "filename": a.mesh, "face_normals": True, "bsdf": DIFFUSE}) if a.mesh else sphere()
places = np.array(mi.traverse(mesh)["vertex_positions"]).reshape(-1, 3)
low, high = places.min(0), places.max(0)
middle, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
eye = middle + np.array([0.25, 0.2, 1.0]) * diagonal
light = middle + np.array([0.6, 1.2, 1.0]) * diagonal


def pose(k):
    bend, reach = 12 / diagonal, 0.02 * diagonal * np.sin(2 * np.pi * k / POSES)
    x, y, z = places.T
    return (places + reach * np.stack([np.sin(bend * y), np.sin(bend * z + 1), np.sin(bend * x + 2)], 1)).astype(np.float32).ravel()


def scene_of(width, height):
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {"type": "perspective", "fov": 40, "fov_axis": "y", "near_clip": 1e-3 * diagonal, "far_clip": 100 * diagonal,
                   "to_world": mi.ScalarTransform4f().look_at(origin=eye.tolist(), target=middle.tolist(), up=[0, 1, 0]),
                   "sampler": {"type": "independent"},
                   "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32"}},
        "light": {"type": "point", "position": light.tolist(), "intensity": {"type": "rgb", "value": 4 * diagonal**2}},
        "mesh": mesh})


def finish(*results):
    if "scalar" not in a.variant:
        dr.eval(*results)
        dr.sync_thread()


def measure(scene, samples, poses):
    there = mi.traverse(scene)
    key = next(k for k in there.keys() if k.endswith("vertex_positions"))
    for k in range(a.frames + 1):
        begin = time.perf_counter()
        there[key] = poses[k % POSES]
        there.update()
        finish(scene.ray_test(mi.Ray3f(mi.Point3f(*eye.tolist()), mi.Vector3f(*(middle - eye).tolist()))))
        updated = time.perf_counter()
        image = mi.render(scene, spp=samples, seed=k)
        finish(image)
        rendered = time.perf_counter()
        np.array(image)
        end = time.perf_counter()
        yield [1e3 * x for x in (updated - begin, rendered - updated, end - rendered, end - begin)]


poses = [pose(k) for k in range(POSES)]
for size in a.sizes.split(","):
    scene = scene_of(*map(int, size.split("x")))
    for samples in map(int, a.spps.split(",")):
        first, *others = measure(scene, samples, poses)
        update, render, readback, _ = (round(statistics.median(ms), 3) for ms in zip(*others))
        fps = round(len(others) * 1e3 / sum(ms[3] for ms in others), 3)
        print(json.dumps({"peer": "mitsuba", "version": mi.__version__, "variant": a.variant, "what": "anim", "positions": a.source,
                          "triangles": int(mesh.face_count()), "size": size, "spp": samples, "frames": a.frames, "first_frame_ms": round(first[3], 2),
                          "update_ms": update, "render_ms": render, "readback_ms": readback, "fps": fps}), flush=True)
