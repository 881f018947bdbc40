"""Where glTF models' vertices are over time, by numpy in f64 and by nothing else: what tests/gltf.rs compares with.

    pip install numpy
    python tests/gltf_oracle.py $RENTIX_SCENES/gltf > tests/data/gltf_poses.txt

Each line: the model's file, a time in seconds, how many vertices are in the scene at all, the least and the greatest
corner of their box, then twelve of them spread evenly, each as x y z. Clips play together where no two move the same
property of the same node, else the first plays.
"""

import base64
import json
import pathlib
import struct
import sys
import urllib.parse

import numpy as np

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Model:
    def __init__(self, path):
        raw = path.read_bytes()
        blob = b""
        if raw[:4] == b"glTF":
            length = struct.unpack_from("<I", raw, 12)[0]
            self.json = json.loads(raw[20 : 20 + length])
            blob = raw[28 + length :]
        else:
            self.json = json.loads(raw)
        self.buffers = []
        for buffer in self.json.get("buffers", []):
            uri = buffer.get("uri")
            if uri is None:
                self.buffers.append(blob)
            elif uri.startswith("data:"):
                self.buffers.append(base64.b64decode(uri.split(",", 1)[1]))
            else:
                self.buffers.append((path.parent / urllib.parse.unquote(uri)).read_bytes())

    def all(self, what):
        return self.json.get(what, [])

    def read(self, index):
        a = self.json["accessors"][index]
        assert "sparse" not in a
        kind = np.dtype(TYPES[a["componentType"]])
        width, count = WIDTHS[a["type"]], a["count"]
        view = self.json["bufferViews"][a["bufferView"]]
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        buffer = self.buffers[view["buffer"]]
        rows = [np.frombuffer(buffer, kind, width, start + i * stride) for i in range(count)]
        values = np.array(rows, dtype=np.float64)
        if a.get("normalized"):
            values /= np.iinfo(kind).max
        return values


def unit(q):
    return q / np.linalg.norm(q)


def slerp(a, b, s):
    a, b = unit(a), unit(b)
    if a @ b < 0:
        b = -b
    angle = np.arccos(min(1.0, a @ b))
    if angle < 1e-7:
        return a + (b - a) * s
    return (np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle)


def sample(times, values, mode, is_rotation, t):
    cubic = mode == "CUBICSPLINE"
    values = values.reshape(len(times), 3 if cubic else 1, -1)
    middle = 1 if cubic else 0
    if t <= times[0]:
        result = values[0, middle]
    elif t >= times[-1]:
        result = values[-1, middle]
    else:
        k = max(i for i in range(len(times)) if times[i] <= t)
        d = times[k + 1] - times[k]
        s = (t - times[k]) / d
        a, b = values[k, middle], values[k + 1, middle]
        if mode == "STEP":
            result = a
        elif cubic:
            # Hermite's basis as a matrix
            h = np.array([s**3, s**2, s, 1]) @ np.array(
                [[2, -2, 1, 1], [-3, 3, -2, -1], [0, 0, 1, 0], [1, 0, 0, 0]]
            )
            result = h[0] * a + h[1] * b + h[2] * d * values[k, 2] + h[3] * d * values[k + 1, 0]
        elif is_rotation:
            result = slerp(a, b, s)
        else:
            result = (1 - s) * a + s * b
    return unit(result) if is_rotation else result


def matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = unit(np.array(node.get("rotation", [0, 0, 0, 1]), dtype=np.float64))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    m = np.eye(4)
    m[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64)
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def playing(model):
    clips = model.all("animations")
    targets = [{(c["target"]["node"], c["target"]["path"]) for c in clip["channels"]} for clip in clips]
    apart = sum(map(len, targets)) == len(set().union(*targets))
    chosen = clips if apart else clips[:1]
    channels = []
    for clip in chosen:
        for c in clip["channels"]:
            sampler = clip["samplers"][c["sampler"]]
            times = model.read(sampler["input"])[:, 0]
            keys = (times, model.read(sampler["output"]), sampler.get("interpolation", "LINEAR"))
            channels.append((c["target"]["node"], c["target"]["path"], keys))
    return channels


def vertices(model, channels, t, meshes):
    nodes = [dict(node) for node in model.all("nodes")]
    for node, path, keys in channels:
        nodes[node][path] = sample(*keys, path == "rotation", t)
    worlds = {}

    def place(i, world):
        worlds[i] = world @ matrix(nodes[i])
        for child in nodes[i].get("children", []):
            place(child, worlds[i])

    children = {c for node in nodes for c in node.get("children", [])}
    for i in range(len(nodes)):
        if i not in children:
            place(i, np.eye(4))
    scene = model.all("scenes")[model.json.get("scene", 0)]
    order = []

    def visit(i):
        order.append(i)
        for child in nodes[i].get("children", []):
            visit(child)

    for i in scene["nodes"]:
        visit(i)
    parts = []
    for i in order:
        if "mesh" not in nodes[i]:
            continue
        mesh = model.json["meshes"][nodes[i]["mesh"]]
        weights = nodes[i].get("weights", mesh.get("weights", []))
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) < 4:
                continue
            attributes = primitive["attributes"]
            p = meshes(attributes["POSITION"]).copy()
            for weight, target in zip(weights, primitive.get("targets", [])):
                if "POSITION" in target:
                    p += weight * meshes(target["POSITION"])
            homogeneous = np.concatenate([p, np.ones((len(p), 1))], axis=1)
            if "skin" in nodes[i]:
                skin = model.json["skins"][nodes[i]["skin"]]
                binds = meshes(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
                joints = np.array([worlds[j] @ binds[k] for k, j in enumerate(skin["joints"])])
                each = joints[meshes(attributes["JOINTS_0"]).astype(int)]
                shares = meshes(attributes["WEIGHTS_0"])
                shares = shares / shares.sum(axis=1, keepdims=True)
                blended = np.einsum("vk,vkij->vij", shares, each)
                parts.append(np.einsum("vij,vj->vi", blended, homogeneous)[:, :3])
            else:
                parts.append((homogeneous @ worlds[i].T)[:, :3])
    return np.concatenate(parts)


def main(folder):
    sys.setrecursionlimit(10_000)
    for path in sorted(p for p in folder.glob("*/*") if p.suffix in (".glb", ".gltf")):
        model = Model(path)
        known = {}

        def meshes(index):
            if index not in known:
                known[index] = model.read(index)
            return known[index]

        channels = playing(model)
        last = max((keys[0][-1] for _, _, keys in channels), default=0.0)
        for k in range(10 if channels else 1):
            # times that are no keys
            t = float(f"{last * (k + 0.37) / 9:.6g}" if k < 9 else last)
            p = vertices(model, channels, t, meshes)
            shown = [p.min(axis=0), p.max(axis=0)] + [p[i * (len(p) - 1) // 11] for i in range(12)]
            numbers = " ".join(f"{x:.7g}" for x in np.concatenate(shown))
            print(f"{path.parent.name}/{path.name} {t!r} {len(p)} {numbers}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
