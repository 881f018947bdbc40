"""Compares poses of animated glTF models with those of Blender's importer, every vertex; tests/gltf.rs runs it.

    pip install bpy
    python tests/gltf_blender.py cases FOLDER            # a line for each case: model, times of its first clip
    python tests/gltf_blender.py compare FOLDER POSES    # a line for each case: model, worst distance, how compared

FOLDER has the models, POSES has a file for each case by its number, with what Rentix makes of it: numbers of times, of
objects and of each object's vertices (u64), then the places (f64), by time, object and vertex.

Blender turns curves that it has no kind for into others: between two keys it takes rotations apart into four numbers that
go straight (glTF wants the arc between them at an even pace), and CUBICSPLINE loses its tangents. A clip with such curves
is compared where all of them have a key; and at ten times in between after keys for those times, by gltf_oracle.py, took
the place of the curves' own: all else is Blender's.
"""

import base64
import json
import pathlib
import struct
import sys
import tempfile

import numpy as np

from gltf_oracle import WIDTHS, Model, sample

TIMES = 10
# Frames a second: a key's frame is a float of 32 bits, which is exact to 1e-7 s then.
FPS = 1000
# A picture of one texel.
PIXEL = (
    "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def models(folder):
    for path in sorted(p for p in folder.glob("*/*") if p.suffix in (".glb", ".gltf")):
        model = Model(path)
        if model.all("animations"):
            yield f"{path.parent.name}/{path.name}", path, model


def is_turned(model, channel):
    """Whether Blender makes another curve of a channel."""
    sampler = model.json["animations"][0]["samplers"][channel["sampler"]]
    mode = sampler.get("interpolation", "LINEAR")
    values = model.read(sampler["output"])
    turns = channel["target"]["path"] == "rotation" and mode == "LINEAR"
    return (turns or mode == "CUBICSPLINE") and not (values == values[0]).all()


def cases(folder):
    """Of each animated model: name, file, times, what is done."""
    for name, path, model in models(folder):
        clip = model.all("animations")[0]
        keys = [model.read(clip["samplers"][c["sampler"]]["input"])[:, 0] for c in clip["channels"]]
        last = max(of_channel[-1] for of_channel in keys)
        between = [float(last * (k + 0.37) / 9 if k < 9 else last) for k in range(TIMES)]
        turned = [set(k) for c, k in zip(clip["channels"], keys) if is_turned(model, c)]
        if turned:
            shared = sorted(set.intersection(*turned))
            picked = sorted({i * (len(shared) - 1) // (TIMES - 1) for i in range(TIMES)})
            yield name, path, [float(shared[i]) for i in picked], "at keys"
            yield name, path, between, "resampled"
        else:
            yield name, path, between, "anywhere"


def resampled(path, at, folder):
    """The model with keys at those times for curves that Blender would turn into others."""
    model = Model(path)
    clip = model.json["animations"][0]
    for buffer, content in zip(model.all("buffers"), model.buffers):
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(content).decode()

    def accessor(values, kind):
        content = np.asarray(values, dtype="<f4").tobytes()
        uri = "data:application/octet-stream;base64," + base64.b64encode(content).decode()
        model.json["buffers"].append({"byteLength": len(content), "uri": uri})
        buffer = len(model.json["buffers"]) - 1
        model.json["bufferViews"].append({"buffer": buffer, "byteLength": len(content)})
        view = len(model.json["bufferViews"]) - 1
        bounds = {"min": [float(np.min(values))], "max": [float(np.max(values))]} if kind == "SCALAR" else {}
        described = {"bufferView": view, "componentType": 5126, "count": len(content) // 4 // WIDTHS[kind]}
        model.json["accessors"].append({**described, "type": kind, **bounds})
        return len(model.json["accessors"]) - 1

    for channel in [c for c in clip["channels"] if is_turned(model, c)]:
        old = clip["samplers"][channel["sampler"]]
        keys, values = model.read(old["input"])[:, 0], model.read(old["output"])
        path_word = channel["target"]["path"]
        mode = old.get("interpolation", "LINEAR")
        new = np.array([sample(keys, values, mode, path_word == "rotation", t).ravel() for t in at])
        kind = {"rotation": "VEC4", "weights": "SCALAR"}.get(path_word, "VEC3")
        clip["samplers"].append({"input": accessor(at, "SCALAR"), "output": accessor(new, kind)})
        channel["sampler"] = len(clip["samplers"]) - 1
    for image in model.all("images"):
        # not looked at, and relative to another folder
        image.update({"uri": PIXEL})
        image.pop("bufferView", None)
    changed = folder / "resampled.gltf"
    changed.write_text(json.dumps(model.json))
    return changed


def poses_of_blender(path, at):
    """For each time the world vertices of each mesh, in glTF's axes."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = FPS
    # plays the first clip
    bpy.ops.import_scene.gltf(filepath=str(path))
    hidden = bpy.data.collections.get("glTF_not_exported")
    meshes = [o for o in scene.objects if o.type == "MESH" and not (hidden and o.name in hidden.objects)]
    poses = []
    for time in at:
        frame = time * FPS
        scene.frame_set(int(frame), subframe=frame - int(frame))
        graph = bpy.context.evaluated_depsgraph_get()
        pose = []
        for o in meshes:
            shown = o.evaluated_get(graph)
            mesh = shown.to_mesh()
            places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
            mesh.vertices.foreach_get("co", places)
            shown_places = places.reshape(-1, 3).astype(np.float64)
            world = np.array(shown.matrix_world, dtype=np.float64)
            shown.to_mesh_clear()
            x, y, z = (shown_places @ world[:3, :3].T + world[:3, 3]).T
            pose.append(np.stack([x, z, -y], axis=1))
        poses.append(pose)
    return poses


def read_poses(file):
    raw = file.read_bytes()
    time_count, object_count = struct.unpack_from("<QQ", raw)
    counts = struct.unpack_from(f"<{object_count}Q", raw, 16)
    places = np.frombuffer(raw, "<f8", offset=16 + 8 * object_count).reshape(time_count, sum(counts), 3)
    ends = np.cumsum(counts)[:-1]
    return [np.split(pose, ends) for pose in places]


def partners(ours, theirs):
    """For each of our meshes that of Blender with as many vertices that lies nearest; None where there is none."""
    left, found = list(range(len(theirs))), []
    for mesh in ours:
        fitting = [i for i in left if len(theirs[i]) == len(mesh)]
        if not fitting:
            return None
        found.append(min(fitting, key=lambda i: np.abs(theirs[i] - mesh).max(initial=0.0)))
        left.remove(found[-1])
    return None if left else found


def farthest_nearest(a, b):
    """The greatest distance of a vertex from the other's nearest, both ways."""
    from mathutils import kdtree

    worst = 0.0
    for these, those in ((a, b), (b, a)):
        tree = kdtree.KDTree(len(those))
        for i, place in enumerate(those):
            tree.insert(place, i)
        tree.balance()
        worst = max(worst, max(tree.find(place)[2] for place in these))
    return worst


def compare(path, at, ours):
    theirs = poses_of_blender(path, at)
    everything = np.concatenate([np.concatenate(pose) for pose in ours])
    size = np.linalg.norm(everything.max(axis=0) - everything.min(axis=0))
    pairs = partners(ours[0], theirs[0])
    worst = 0.0
    for our, their in zip(ours, theirs):
        if pairs:
            off = max(np.linalg.norm(a - their[i], axis=1).max(initial=0.0) for a, i in zip(our, pairs))
        else:
            off = farthest_nearest(np.concatenate(our), np.concatenate(their))
        worst = max(worst, off / size)
    moved = max(np.abs(a - b).max() for pose in ours for a, b in zip(pose, ours[0])) / size
    matched = "by index" if pairs else "by nearest"
    return worst, f"{len(everything) // len(at)} vertices {matched}, they move by {moved:.2g}"


def main(what, folder, poses=None):
    with tempfile.TemporaryDirectory() as room:
        for i, (name, path, at, how) in enumerate(cases(folder)):
            if what == "cases":
                print(name, *map(repr, at))
                continue
            shown = resampled(path, at, pathlib.Path(room)) if how == "resampled" else path
            worst, matched = compare(shown, at, read_poses(poses / str(i)))
            print(f"pose {name} {worst:.3e} {len(at)} times {how}, {matched}", flush=True)


main(sys.argv[1], *map(pathlib.Path, sys.argv[2:]))
