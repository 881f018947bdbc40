#!/usr/bin/env python3
"""A folder of OBJ frames to PNG by F3D: rasterised, its own lights, no shadows. Less work than tracing rays; it stands here
because many would take it.

  pip install f3d
  apt-get install libegl1 libosmesa6 libgl1
  python job_f3d.py FOLDER OUT --eye 0.05,0.16,0.35 --look-at=-0.017,0.11,0 --light 0,0,0      (the light is not used)"""
from importlib.metadata import version
import job

a = job.options(__doc__).parse_args()

import f3d

f3d.Log.set_verbose_level(f3d.Log.QUIET)
f3d.Engine.autoload_plugins()
try:
    engine = f3d.Engine.create_egl()
except Exception:
    engine = f3d.Engine.create_osmesa()
engine.window.size = tuple(map(int, a.size.split("x")))


def frame(file, picture):
    with job.stage("read"):
        engine.scene.clear()
        engine.scene.add(file)
    with job.stage("update and draw"):
        camera = engine.window.camera
        camera.position, camera.focal_point, camera.view_up, camera.view_angle = a.eye, a.look_at, [0, 1, 0], a.fov
        image = engine.window.render_to_image(a.alpha)
    with job.stage("write"):
        image.save(picture)


job.run(a, "f3d", version("f3d"), frame)
