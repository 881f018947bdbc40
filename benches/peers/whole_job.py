#!/usr/bin/env python3
"""The whole job beside other programs: a folder of OBJ frames to PNG, by rentix and by every peer that is installed.

  cargo build --release
  pip install mitsuba "bpy<5" vtk f3d numpy pillow        (whichever; bpy wants Python 3.11; each job_*.py says what else)
  python benches/peers/whole_job.py bunny.obj -o whole.json

FOLDER holds OBJ frames without normals and materials, of which each program thinks otherwise; an OBJ file in its place is
made a sequence of --frames in which every vertex moves (as `--example wave` does). One camera, one point light that falls
off by 1/d^2, diffuse of albedo 0.8, no ambient light, the same for all; without --eye and --light they follow from the first
frame's box. In each round every program runs once, as a process of its own, and rentix right before each of them: a ratio is
that of two neighbours, so that a busy machine is busy for both.

Before speeds are compared pictures are, of the middle frame. All: coverage, as alpha; at most 1 % of the pixels that rentix
covers may differ. Those that trace rays: mean FLIP of --reference samples (256) against rentix's as many, at most 0.01. One
that differs gets no ratio. The error is that of the timed picture against the reference: Mitsuba's, else rentix's own.

`start to end`: frames over the time from the process's start to its end. `afterwards`: the pictures after the first over
the time from the first picture's to the last one's, without what a program takes to start. `CPU`: milliseconds of all cores
for each frame, start included, which a busy machine changes least. --json prints one object for each
program on stdout; tables are for people, on stderr. A program that is not installed is absent, and nothing stands for it."""
import argparse, importlib.util, json, math, os, pathlib, platform, resource, shutil, statistics, subprocess, sys, tempfile, time

HERE = pathlib.Path(__file__).resolve().parent
COVERAGE_LIMIT, FLIP_LIMIT = 0.01, 0.01

# name: module, script, options, whether it traces rays
PEERS = {
    "Mitsuba, llvm": ("mitsuba", "job_mitsuba.py", ["--variant", "llvm_ad_rgb"], True),
    "Mitsuba, llvm, one scene kept": ("mitsuba", "job_mitsuba.py", ["--variant", "llvm_ad_rgb", "--keep"], True),
    "Mitsuba, scalar": ("mitsuba", "job_mitsuba.py", ["--variant", "scalar_rgb"], True),
    "Blender, frames imported": ("bpy", "job_blender.py", [], True),
    "Blender, frames imported, persistent data": ("bpy", "job_blender.py", ["--persistent"], True),
    "Blender, one object kept, persistent data": ("bpy", "job_blender.py", ["--persistent", "--keep"], True),
    "VTK (raster)": ("vtk", "job_vtk.py", [], False),
    "F3D (raster)": ("f3d", "job_f3d.py", [], False),
}


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folder", type=pathlib.Path, metavar="FOLDER|FILE.obj")
    p.add_argument("-o", dest="out", type=pathlib.Path, help="write all of it as JSON")
    p.add_argument("--json", action="store_true", help="one JSON object a program on stdout")
    p.add_argument("--rentix", default="target/release/rentix", help="the program (%(default)s)")
    p.add_argument("--device", default="cpu", help="rentix's device (%(default)s)")
    p.add_argument("--embree", help="the program made of embree_bench.cpp; it has stages, no whole job")
    p.add_argument("--only", action="append", help="peers whose name holds this word; may be repeated")
    p.add_argument("--rounds", type=int, default=5)
    p.add_argument("--frames", type=int, default=24, help="of the wave made of an OBJ file")
    p.add_argument("--size", default="1280x720")
    p.add_argument("--samples", type=int, default=1)
    p.add_argument("--reference", type=int, default=256, help="samples of the reference")
    for name in ("--eye", "--look-at", "--light"):
        p.add_argument(name, type=lambda text: [float(x) for x in text.split(",")], metavar="X,Y,Z")
    p.add_argument("--fov", type=float, default=40)
    p.add_argument("--intensity", type=float, help="of the light (0.9 times the square of its distance)")
    p.add_argument("--keep", type=pathlib.Path, help="leave the pictures here")
    return p.parse_args()


def say(text=""):
    print(text, file=sys.stderr, flush=True)


# ---- the scene


def wave(obj, frames, folder):
    """`--example wave` in Python: a wave through the vertices along x."""
    lines = obj.read_text().splitlines()
    places = {i: [float(x) for x in line.split()[1:4]] for i, line in enumerate(lines) if line.startswith("v ")}
    low, high = ([f(p[k] for p in places.values()) for k in range(3)] for f in (min, max))
    extent = max(h - l for l, h in zip(low, high))
    for frame in range(frames):
        for i, (x, y, z) in places.items():
            phase = 3 * (x - low[0]) / extent + frame / frames
            lines[i] = f"v {x} {y + 0.02 * extent * math.sin(math.tau * phase):.6f} {z}"
        (folder / f"wave_{frame + 1:04}.obj").write_text("\n".join(lines) + "\n")


def view(a, obj):
    """Camera and light: as given, else from the frame's box."""
    corners, words = [], set()
    for line in obj.read_text().splitlines():
        words.add(line.split(" ")[0])
        if line.startswith("v "):
            corners.append([float(x) for x in line.split()[1:4]])
    if words & {"vn", "mtllib"}:
        sys.exit(f"{obj} has normals or materials, of which each program thinks otherwise: leave out its vn and mtllib lines")
    low, high = ([f(p[k] for p in corners) for k in range(3)] for f in (min, max))
    middle = [(l + h) / 2 for l, h in zip(low, high)]
    diagonal = math.dist(low, high)
    at = lambda *steps: [m + s * diagonal for m, s in zip(middle, steps)]
    a.eye, a.look_at, a.light = a.eye or at(0.25, 0.2, 1.0), a.look_at or middle, a.light or at(0.6, 1.2, 1.0)
    a.intensity = a.intensity or 0.9 * math.dist(a.light, middle) ** 2


# ---- one run of a program


def by_rentix(a, folder, out, samples, alpha=False):
    job = {
        "sequence": str(folder.absolute()), "samples": samples, "ambient": [0, 0, 0],
        "output": {"size": [int(x) for x in a.size.split("x")], "alpha": alpha},
        "camera": {"eye": a.eye, "look_at": a.look_at, "fov": a.fov},
        "lights": [{"point": {"position": a.light, "intensity": a.intensity, "falloff": "inverse-square"}}],
    }
    out.mkdir(parents=True)
    (out / "job.yaml").write_text(json.dumps(job))
    # the store is an empty one: nothing is known from the round before
    words = ["render", out / "job.yaml", "-o", out, "--device", a.device, "--cache", out / "store", "--report", out / "report.json", "-q"]
    return [a.rentix, *words]


def by_peer(a, name, folder, out, samples, alpha=False):
    _, script, words, _ = PEERS[name]
    vectors = [f"--{key}={','.join(map(str, value))}" for key, value in (("eye", a.eye), ("look-at", a.look_at), ("light", a.light))]
    rest = ["--size", a.size, "--samples", samples, "--fov", a.fov, "--intensity", a.intensity] + ["--alpha"] * alpha
    return [sys.executable, HERE / script, folder, out, *words, *vectors, *rest]


def command(a, name, *rest):
    return by_rentix(a, *rest) if name == "rentix" else by_peer(a, name, *rest)


def run(command):
    """When it began, seconds, seconds of all cores, the JSON object that it printed, and why it failed where it did."""
    cores_s = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    begin, before = time.time(), cores_s()
    done = subprocess.run([str(x) for x in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    seconds, work_s = time.time() - begin, cores_s() - before
    told = [line for line in done.stdout.splitlines() if line.startswith('{"peer"')]
    why = None if done.returncode == 0 else f"status {done.returncode}: {(done.stderr.strip().splitlines() or ['it said nothing'])[-1]}"
    return begin, seconds, work_s, json.loads(told[-1]) if told else {}, why


def timed(a, name, folder, out):
    begin, seconds, work_s, told, why = run(command(a, name, folder, out, a.samples))
    times = sorted(picture.stat().st_mtime for picture in out.glob("*.png"))
    frames = len(list(folder.glob("*.obj")))
    if why or len(times) != frames:
        return {"failed": why or f"{len(times)} pictures of {frames}"}
    if name == "rentix":
        told = told_by_rentix(json.loads((out / "report.json").read_text()))
    return {
        "version": told["version"], "stages_ms": told["stages_ms"], "first_s": times[0] - begin, "cpu_ms": 1e3 * work_s / frames,
        "whole": frames / seconds, "afterwards": (frames - 1) / (times[-1] - times[0]) if frames > 1 else None,
    }


def told_by_rentix(report):
    stages = {"read": ("read", "parse", "diff"), "update": ("upload", "update"), "trace": ("trace", "readback"), "write": ("encode", "write")}
    frames = [frame["ms"] for frame in report["frames"]]
    median = lambda terms: round(statistics.median(sum(ms[t] or 0 for t in terms) for ms in frames[1:] or frames), 2)
    return {"version": report["rentix"], "stages_ms": {stage: median(terms) for stage, terms in stages.items()}}


# ---- what pictures are compared by


def compared(a, picture, reference):
    done = subprocess.run([a.rentix, "compare", picture, reference, "--json"], capture_output=True, text=True)
    told = json.loads(done.stdout.splitlines()[0])  # the status only tells that they differ
    return {"rmse": told["rmse"], "flip": told["flip"]}


def covered(picture):
    import numpy as np
    from PIL import Image
    return np.asarray(Image.open(picture).convert("RGBA"))[..., 3] >= 128


def still(name):
    """What makes one frame alone: whatever is kept from frame to frame has no part in it."""
    return None if name == "rentix" else (PEERS[name][1], [w for w in PEERS[name][2] if w not in ("--keep", "--persistent")])


def look(a, names, middle, shelf):
    """For each program: the share of covered pixels that differ, the FLIP of its reference; or why there is none."""
    found = {}
    for name in names:
        rays = name == "rentix" or PEERS[name][3]
        shape, fine = shelf / name / "shape", shelf / name / "reference"
        *_, why = run(command(a, name, middle, shape, 16, True))
        if rays and not why:
            same = next((n for n in found if "reference" in found[n] and still(n) == still(name)), None)
            fine = pathlib.Path(found[same]["reference"]).parent if same else fine
            *_, why = (None,) if same else run(command(a, name, middle, fine, a.reference))
        if why and name == "rentix":
            sys.exit(f"rentix: {why}")
        if why:
            found[name] = {"failed": why}
            continue
        (picture,) = shape.glob("*.png")
        mask = covered(picture)
        ours = mask if name == "rentix" else ours
        found[name] = {"coverage_differs": float((mask != ours).sum() / ours.sum())}
        if rays:
            found[name]["reference"] = str(next(fine.glob("*.png")))
            found[name]["reference_flip"] = compared(a, found[name]["reference"], found["rentix"]["reference"])["flip"]
        found[name]["agrees"] = found[name]["coverage_differs"] <= COVERAGE_LIMIT and found[name].get("reference_flip", 0) <= FLIP_LIMIT
    return found


# ---- the tables


def spread(figures):
    return {"median": statistics.median(figures), "least": min(figures), "greatest": max(figures)}


def row(name, rounds, seen):
    good = [r for r in rounds if "failed" not in r]
    if not good:
        return {"peer": name, "failed": rounds[0]["failed"] if rounds else seen["failed"]}
    found = {"peer": name, "version": good[0]["version"], "unit": "frames/s", **spread([r["whole"] for r in good])}
    found["cpu_ms_a_frame"] = spread([r["cpu_ms"] for r in good])
    found["first_picture_s"] = statistics.median(r["first_s"] for r in good)
    if good[0]["afterwards"]:
        found["afterwards"] = spread([r["afterwards"] for r in good])
    found["stages_ms"] = {s: statistics.median(r["stages_ms"][s] for r in good) for s in good[0]["stages_ms"]}
    found |= {key: value for key, value in seen.items() if key != "reference"}
    pairs = [(r["beside"], r) for r in good if "failed" not in r.get("beside", {"failed": "it stands beside none"})]
    if pairs and seen["agrees"]:
        found["ratio_cpu"] = spread([theirs["cpu_ms"] / ours["cpu_ms"] for ours, theirs in pairs])
        found["ratio"] = spread([ours["whole"] / theirs["whole"] for ours, theirs in pairs])
        if good[0]["afterwards"]:
            found["ratio_afterwards"] = spread([ours["afterwards"] / theirs["afterwards"] for ours, theirs in pairs])
    found["rounds"] = rounds
    return found


def embree(a, files):
    """What of a frame Embree does: the tree, camera and shadow rays."""
    words = [a.embree, files[0], "--moved", files[1 % len(files)], "--brief", "--fov", a.fov, "--size", a.size]
    words += [x for key, value in (("--eye", a.eye), ("--look-at", a.look_at), ("--light", a.light)) for x in (key, ",".join(map(str, value)))]
    done = subprocess.run([str(x) for x in words], capture_output=True, text=True)
    if done.returncode:
        return {"peer": "Embree", "failed": done.stderr.strip().splitlines()[-1]}
    told = [json.loads(line) for line in done.stdout.splitlines()]
    stages = {f"{t['what']}{', rays ' + t['packet'] if 'packet' in t else ''}": t["value"] for t in told if t["threads"] == max(t["threads"] for t in told) and t["unit"] == "ms"}
    return {"peer": "Embree", "version": told[0]["version"], "stages_ms": stages}


def number(x, digits=3):
    return "" if x is None else f"{x:.{digits}g}" if x < 1000 else f"{x:,.0f}"


def table(rows):
    say("\n| program | version | start to end, frames/s: median (least to greatest) | rentix is x times as fast | CPU, ms a frame | x times | first picture, s | afterwards, frames/s | x times | FLIP, RMSE of the error | pixels covered otherwise, FLIP of the reference |")
    say("|" + " --- |" * 11)
    three = lambda s: f"{number(s['median'])} ({number(s['least'])} to {number(s['greatest'])})" if s else ""
    for r in rows:
        if "median" not in r:
            if r["peer"] != "Embree" or "failed" in r:
                say(f"| {r['peer']} | {'absent' if 'absent' in r else 'failed: ' + r['failed']} " + " |" * 10)
            continue
        ratio = three(r.get("ratio")) if r["agrees"] else "pictures differ"
        error = f"{r['error']['flip']:.4f}, {r['error']['rmse']:.4f}" if "error" in r else ""
        seen = f"{100 * r['coverage_differs']:.2f} %" + (f", {r['reference_flip']:.4f}" if "reference_flip" in r else "")
        say(f"| {r['peer']} | {r['version']} | {three(r)} | {ratio} | {three(r['cpu_ms_a_frame'])} | {three(r.get('ratio_cpu'))} | {number(r['first_picture_s'])} | {three(r.get('afterwards'))} | {three(r.get('ratio_afterwards'))} | {error} | {seen} |")
    say("\n| program | stages of a frame, ms (medians; stages of one program may run side by side) |")
    say("| --- | --- |")
    for r in rows:
        if "stages_ms" in r:
            say(f"| {r['peer']} | {', '.join(f'{stage} {number(ms)}' for stage, ms in r['stages_ms'].items())} |")


def machine():
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "") if pathlib.Path("/proc/cpuinfo").exists() else ""
    return {"cpu": cpu or platform.processor(), "cores": len(os.sched_getaffinity(0)), "system": platform.platform()}


def write(a, files, loads, rows):
    scene = {"frames": len(files), "size": a.size, "samples": a.samples, "eye": a.eye, "look_at": a.look_at, "fov": a.fov, "light": a.light, "intensity": a.intensity}
    a.out.write_text(json.dumps({"what": "whole job", "machine": machine(), "load": loads, "scene": scene, "rows": rows}, indent=1) + "\n")


def pair_of(a, name, folder, files, shelf, seen, best, keep):
    """rentix, and right after it another program."""
    pair = {}
    for program in dict.fromkeys(("rentix", name)):
        out = shelf / "timed" / program
        pair[program] = timed(a, program, folder, out)
        picture = out / (files[len(files) // 2].stem + ".png")
        if "error" not in seen[program] and "reference" in seen[program] and picture.exists():
            seen[program]["error"] = compared(a, picture, best)
        if keep:
            shutil.copytree(out, keep / program, dirs_exist_ok=True, ignore=shutil.ignore_patterns("store", ".rentix"))
        shutil.rmtree(out, ignore_errors=True)
    return pair


def measured(a, shelf, names, absent):
    """The rows, and the load at the beginning of each round; what is known is written after each."""
    folder = a.folder
    if folder.is_file():
        folder = shelf / "frames"
        folder.mkdir()
        wave(a.folder, a.frames, folder)
    files = sorted(folder.glob("*.obj")) or sys.exit(f"{folder} holds no OBJ frames")
    view(a, files[0])
    middle = shelf / "middle"
    middle.mkdir()
    shutil.copy(files[len(files) // 2], middle)
    say(f"{len(files)} frames, {a.size}, samples {a.samples}, rounds {a.rounds}, {machine()}")
    say("pictures are compared")
    seen = look(a, names, middle, shelf / "looked")
    best_by = next(n for n in names[1:] + ["rentix"] if n.startswith(("Mitsuba", "rentix")) and "reference" in seen[n])
    rows_absent = [{"peer": name, "absent": f"the Python module {PEERS[name][0]} is not installed"} for name in absent]
    rows_embree = [embree(a, files)] if a.embree else []
    rounds, loads = {name: [] for name in seen}, []
    able = [n for n in names[1:] if "failed" not in seen[n]] or ["rentix"]
    for round_ in range(a.rounds):
        loads.append(os.getloadavg()[0])
        for name in able:
            pair = pair_of(a, name, folder, files, shelf, seen, seen[best_by]["reference"], a.keep if round_ == 0 else None)
            rounds["rentix"].append(pair["rentix"])
            if name != "rentix":
                rounds[name].append(pair[name] | {"beside": pair["rentix"]})
            say(f"round {round_ + 1}, {name}: " + ", ".join(number(r["whole"]) if "whole" in r else r["failed"] for r in pair.values()) + " frames/s")
        rows = [row(name, rounds[name], seen[name]) for name in seen] + rows_absent + rows_embree
        if a.out:
            write(a, files, loads, rows)
    return rows, loads, best_by


def main():
    a = arguments()
    a.rentix = shutil.which(a.rentix) or sys.exit(f"{a.rentix} is no program: cargo build --release, or name it with --rentix")
    chosen = [name for name in PEERS if not a.only or any(word.lower() in name.lower() for word in a.only)]
    absent = [name for name in chosen if not importlib.util.find_spec(PEERS[name][0])]
    with tempfile.TemporaryDirectory() as shelf:
        rows, loads, best_by = measured(a, pathlib.Path(shelf), ["rentix"] + [n for n in chosen if n not in absent], absent)
    table(rows)
    say(f"\nload (1 minute) at each round: {', '.join(f'{x:.1f}' for x in loads)}; reference of the error: {best_by}, {a.reference} samples")
    if a.json:
        for r in rows:
            print(json.dumps(r))


if __name__ == "__main__":
    main()
