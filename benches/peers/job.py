"""What the peers' jobs share: the options, the folder of frames, and what each stage took.

A job turns a folder of OBJ frames into a folder of PNG, in one process, as a user of that program would write it. It prints
one JSON object."""
import argparse, collections, contextlib, json, pathlib, statistics, time

STAGES = collections.defaultdict(list)


def triple(text):
    return [float(x) for x in text.split(",")]


def options(doc):
    p = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folder", type=pathlib.Path)
    p.add_argument("out", type=pathlib.Path)
    p.add_argument("--size", default="1280x720")
    p.add_argument("--samples", type=int, default=1)
    p.add_argument("--eye", type=triple, required=True, metavar="X,Y,Z", help="write --eye=-1,2,3 where it begins with a minus")
    p.add_argument("--look-at", type=triple, required=True, metavar="X,Y,Z")
    p.add_argument("--fov", type=float, default=40, help="vertical, degrees")
    p.add_argument("--light", type=triple, required=True, metavar="X,Y,Z", help="a point light that falls off by 1/d^2")
    p.add_argument("--intensity", type=float, default=1, help="a surface of albedo a that faces the light at distance d shows a * intensity / d^2")
    p.add_argument("--alpha", action="store_true", help="write coverage as alpha")
    return p


@contextlib.contextmanager
def stage(name):
    begin = time.perf_counter()
    yield
    STAGES[name].append((time.perf_counter() - begin) * 1e3)


def run(a, peer, version, frame):
    """Calls frame(file, picture) for every OBJ of the folder, in order; the first is left out of the stages' medians."""
    a.out.mkdir(parents=True, exist_ok=True)
    files = sorted(a.folder.glob("*.obj"))
    for file in files:
        frame(str(file), str((a.out / file.stem).with_suffix(".png").absolute()))
    medians = {name: round(statistics.median(ms[1:] or ms), 2) for name, ms in STAGES.items()}
    print(json.dumps({"peer": peer, "version": version, "frames": len(files), "stages_ms": medians}), flush=True)
