#!/usr/bin/env python3
"""A folder of OBJ frames to PNG by Blender's Cycles on the CPU: direct light, diffuse of albedo 0.8, box filter, no denoising.

  pip install "bpy<5"                    (for Python 3.11)
  apt-get install libxi6 libxkbcommon0 libsm6 libxxf86vm1 libxfixes3 libxrender1 libgl1 libegl1
  python job_blender.py FOLDER OUT --eye 0.05,0.16,0.35 --look-at=-0.017,0.11,0 --light 0.3,0.6,0.5

Every frame is imported and replaces the one before, as stop motion does it. --persistent keeps Cycles' data from frame to
frame; --keep keeps one object as well, which takes the vertices of each frame."""
import math
import job

p = job.options(__doc__)
p.add_argument("--persistent", action="store_true", help="Cycles' persistent data")
p.add_argument("--keep", action="store_true", help="one object whose vertices move")
a = p.parse_args()

import bpy
import numpy as np
from mathutils import Matrix, Vector

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
render, cycles = scene.render, scene.cycles
render.engine = "CYCLES"
render.resolution_x, render.resolution_y = map(int, a.size.split("x"))
render.image_settings.file_format = "PNG"
render.image_settings.color_mode = "RGBA" if a.alpha else "RGB"
render.film_transparent = a.alpha
render.dither_intensity = 0
render.use_persistent_data = a.persistent
scene.view_settings.view_transform = "Standard"
cycles.device = "CPU"
cycles.samples = a.samples
cycles.use_denoising = False
cycles.use_adaptive_sampling = False
cycles.max_bounces = 0
cycles.pixel_filter_type = "BOX"


def add(name, data):
    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    return thing


eye = Vector(a.eye)
back = (eye - Vector(a.look_at)).normalized()
right = Vector((0, 1, 0)).cross(back).normalized()
camera = scene.camera = add("camera", bpy.data.cameras.new("camera"))
camera.data.sensor_fit = "VERTICAL"
camera.data.angle = math.radians(a.fov)
camera.data.clip_start, camera.data.clip_end = 1e-3, 1e4
camera.matrix_world = Matrix((right, back.cross(right), back)).transposed().to_4x4()
camera.matrix_world.translation = eye

light = add("light", bpy.data.lights.new("light", "POINT"))
light.location = a.light
light.data.shadow_soft_size = 0
light.data.energy = 4 * math.pi**2 * a.intensity  # watts over the whole sphere, and surfaces reflect albedo / pi

diffuse = bpy.data.materials.new("diffuse")
diffuse.use_nodes = True
nodes = diffuse.node_tree.nodes
nodes.clear()
surface = nodes.new("ShaderNodeBsdfDiffuse")
surface.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1)
diffuse.node_tree.links.new(surface.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])


def imported(file):
    bpy.ops.wm.obj_import(filepath=file, forward_axis="NEGATIVE_Z", up_axis="Y")
    (thing,) = bpy.context.selected_objects
    thing.rotation_euler = (0, 0, 0)  # y stays up
    return thing


def remove(thing):
    mesh = thing.data
    bpy.data.objects.remove(thing)
    bpy.data.meshes.remove(mesh)


shown = None


def show(file):
    global shown
    thing = imported(file)
    if a.keep and shown:
        places = np.empty(3 * len(thing.data.vertices), np.float32)
        thing.data.vertices.foreach_get("co", places)
        shown.data.vertices.foreach_set("co", places)
        shown.data.update()
        remove(thing)
        return
    if shown:
        remove(shown)
    thing.data.materials.clear()
    thing.data.materials.append(diffuse)
    shown = thing


def frame(file, picture):
    with job.stage("read"):
        show(file)
    with job.stage("update, trace and write"):
        render.filepath = picture
        bpy.ops.render.render(write_still=True)


job.run(a, "blender", bpy.app.version_string, frame)
