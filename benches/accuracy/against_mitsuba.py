#!/usr/bin/env python3
"""Direct light against Mitsuba 3: the bunny and CornellBox-Original under one point light with inverse-square falloff,
and CornellBox-Original under its own lamp as an area light, radiance = Ke; every material diffuse (illum 1), ambient 0, box
filter. Wants a mean FLIP below 0.01 on each, by NVIDIA's evaluator and by `rentix compare`.

  pip install mitsuba flip-evaluator pillow numpy
  cargo build --release
  RENTIX_SCENES=... python benches/accuracy/against_mitsuba.py [--samples 256] [--keep FOLDER]

RENTIX_BIN names another binary than target/release/rentix. Mitsuba's point light has pi times rentix's intensity, since
its diffuse surfaces reflect albedo / pi. Mitsuba's OBJ reader knows no MTL, so each material's faces go to it as a mesh
of their own with that material's Kd."""
import argparse, json, math, os, pathlib, subprocess, sys, tempfile
import numpy as np
from PIL import Image
import flip_evaluator
import mitsuba as mi

SCENES = pathlib.Path(os.environ.get("RENTIX_SCENES", "absent"))
BIN = pathlib.Path(os.environ.get("RENTIX_BIN", "target/release/rentix"))
CASES = {
    "bunny": dict(obj="bunny/stanford-bunny.obj", eye=[-0.02, 0.12, 0.35], look_at=[-0.02, 0.11, 0.0], light=[0.15, 0.3, 0.3], intensity=0.12),
    "cornell": dict(obj="cornell-box/CornellBox-Original.obj", eye=[0.0, 1.0, 3.5], look_at=[0.0, 1.0, 0.0], light=[0.2, 1.5, 0.6], intensity=0.9),
    # no light of its own: what glows lights it
    "cornell by its lamp": dict(obj="cornell-box/CornellBox-Original.obj", eye=[0.0, 1.0, 3.5], look_at=[0.0, 1.0, 0.0]),
}


def materials(obj):
    """Kd and Ke by material name, of the MTL that lies beside the OBJ under its name."""
    found, name = {}, None
    mtl = obj.with_suffix(".mtl")
    for line in mtl.read_text().splitlines() if mtl.exists() else []:
        words = line.split("#")[0].split()
        if words[:1] == ["newmtl"]:
            name = words[1]
            found[name] = {"Kd": [0.8, 0.8, 0.8], "Ke": [0.0, 0.0, 0.0]}
        elif words[:1] in (["Kd"], ["Ke"]):
            found[name][words[0]] = [float(x) for x in words[1:4]]
    return found


def split(obj, folder):
    """Writes an OBJ for each material; returns (file, Kd, Ke)."""
    known, name = materials(obj), None
    vertices, faces = [], {}
    for line in obj.read_text().splitlines():
        words = line.split("#")[0].split()
        if words[:1] == ["v"]:
            vertices.append(" ".join(words[1:4]))
        elif words[:1] == ["usemtl"]:
            name = words[1]
        elif words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) for w in words[1:]]
            faces.setdefault(name, []).append([c if c > 0 else len(vertices) + 1 + c for c in corners])
    meshes = []
    for i, (name, list_) in enumerate(faces.items()):
        path = folder / f"mesh{i}.obj"
        lines = [f"v {v}" for v in vertices]
        for f in list_:
            lines += [f"f {f[0]} {f[k]} {f[k + 1]}" for k in range(1, len(f) - 1)]
        path.write_text("\n".join(lines) + "\n")
        material = known.get(name, {"Kd": [0.8, 0.8, 0.8], "Ke": [0.0, 0.0, 0.0]})
        meshes.append((path, material["Kd"], material["Ke"]))
    return meshes


def by_mitsuba(case, samples, folder):
    # the reference: a lamp is looked at often enough that its noise is not what is measured
    emitter_samples = 1 if "light" in case else 16
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": emitter_samples, "bsdf_samples": 0},
        "sensor": {"type": "perspective", "fov": 40, "fov_axis": "y", "near_clip": 1e-4, "far_clip": 1e6,
                   "to_world": mi.ScalarTransform4f().look_at(origin=case["eye"], target=case["look_at"], up=[0, 1, 0]),
                   "sampler": {"type": "independent", "sample_count": samples},
                   "film": {"type": "hdrfilm", "width": 1280, "height": 720, "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32"}},
    }
    if "light" in case:
        scene["light"] = {"type": "point", "position": case["light"], "intensity": {"type": "rgb", "value": math.pi * case["intensity"]}}
    for i, (path, kd, ke) in enumerate(split(SCENES / case["obj"], folder)):
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": kd}}}
        scene[f"mesh{i}"] = {"type": "obj", "filename": str(path), "face_normals": True, "bsdf": bsdf}
        if "light" not in case and max(ke) > 0:
            emitter = {"type": "area", "radiance": {"type": "rgb", "value": ke}}
            scene[f"mesh{i}"]["emitter"] = emitter
            # rentix's lamps shine on both sides, Mitsuba's on one: another, a little above, shines up
            above = mi.ScalarTransform4f().translate([0, 1e-4, 0])
            scene[f"back{i}"] = scene[f"mesh{i}"] | {"to_world": above, "flip_normals": True, "emitter": emitter}
    linear = np.clip(np.array(mi.render(mi.load_dict(scene), spp=samples)), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return Image.fromarray((255 * encoded + 0.5).astype(np.uint8))


def by_rentix(case, samples, folder):
    obj = SCENES / case["obj"]
    light = {"area": {"material": "all"}}
    diffuse = {"illum": 1, "Ka": [0, 0, 0]}
    if "light" in case:
        light = {"point": {"position": case["light"], "intensity": case["intensity"], "falloff": "inverse-square"}}
        diffuse["Ke"] = [0, 0, 0]
    job = {
        "sequence": str(obj), "samples": samples, "ambient": [0, 0, 0], "output": {"size": [1280, 720]},
        "camera": {"eye": case["eye"], "look_at": case["look_at"], "fov": 40},
        "lights": [light],
        "materials": {name: diffuse for name in materials(obj)},
    }
    (folder / "job.yaml").write_text(json.dumps(job))
    subprocess.run([str(BIN), "render", str(folder / "job.yaml"), "-o", str(folder / "out"), "-q"], check=True)
    return Image.open(next((folder / "out").glob("*.png"))).convert("RGB")


def flip_by_nvidia(ours, theirs):
    reference, test = (np.asarray(picture, dtype=np.float32) / 255 for picture in (theirs, ours))
    return float(flip_evaluator.evaluate(reference, test, "LDR")[1])


def flip_by_rentix(ours, theirs):
    told = subprocess.run([str(BIN), "compare", str(ours), str(theirs), "--json"], stdout=subprocess.PIPE, check=False)
    return json.loads(told.stdout)["flip"]  # the status only tells that the pictures differ


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--samples", type=int, default=256)
    p.add_argument("--keep", help="put both pictures of each scene here")
    a = p.parse_args()
    mi.set_variant("scalar_rgb")
    worst = 0.0
    for name, case in CASES.items():
        with tempfile.TemporaryDirectory() as t:
            folder = pathlib.Path(t)
            ours, theirs = by_rentix(case, a.samples, folder), by_mitsuba(case, a.samples, folder)
            kept = pathlib.Path(a.keep) if a.keep else folder
            kept.mkdir(parents=True, exist_ok=True)
            files = [kept / f"{name}-rentix.png", kept / f"{name}-mitsuba.png"]
            for file, picture in zip(files, (ours, theirs)):
                picture.save(file)
            flip, compared = flip_by_nvidia(ours, theirs), flip_by_rentix(*files)
        worst = max(worst, flip, compared)
        print(f"{name}: mean FLIP {flip:.5f}, by rentix compare {compared:.5f}, {a.samples} samples, Mitsuba {mi.__version__}")
    return 0 if worst < 0.01 else 1


if __name__ == "__main__":
    sys.exit(main())
