"""A room in Blender, with a window, glass, metal and plants of instances, rendered by Cycles and by methods of etendue.

    build/venv-blender-5.0.1/bin/python tests/blender/room.py FOLDER [SECONDS]

bpy (Blender as a Python module) and the package etendue must be importable, and the add-on in blender/ is used as it is. Writes
room.blend, and for each engine and method the image after SECONDS (60), such as bdpt.exr and bdpt.denoised.exr; room.png has
all of them, the noisy ones above.
"""

import importlib.util
import math
import os
import sys
from pathlib import Path

import bpy
import etendue as et
import numpy as np
from mathutils import Vector

METHODS = ("bdpt", "upg+bdpt", "mlt")


def material(name, **inputs):
    """A material with inputs of its Principled BSDF."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    node = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = (*value, 1) if isinstance(value, tuple) else value
    return made


def planks():
    """Wood: an image of planks, which is part of the file."""
    made, size = material("Planks", Roughness=0.35), 128
    image = bpy.data.images.new("Planks", size, size)
    pixels = []
    for y in range(size):
        for x in range(size):
            plank, gap = y // 16, y % 16 == 0 or (x + 40 * (y // 16 % 2)) % 96 == 0
            grain = 0.06 * math.sin(0.9 * y + 2 * math.sin(0.06 * x + plank)) + 0.05 * math.sin(plank * 7)
            pixels += [0.05] * 3 + [1] if gap else [0.55 + grain, 0.36 + grain, 0.2 + grain, 1]
    image.pixels.foreach_set(pixels)
    image.pack()
    texture = made.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    made.node_tree.links.new(texture.outputs["Color"], made.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    return made


def pane():
    """A window pane as in most scenes of Blender: it lets light pass straight, and reflects a little."""
    made = material("Pane")
    tree = made.node_tree
    tree.nodes.clear()
    output, mix = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeMixShader")
    clear, glossy = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.inputs["Roughness"].default_value = 0.0
    mix.inputs[0].default_value = 0.08
    for one, other in ((clear.outputs[0], mix.inputs[1]), (glossy.outputs[0], mix.inputs[2]), (mix.outputs[0], output.inputs[0])):
        tree.links.new(one, other)
    return made


def box(name, low, high, of):
    """A box between two corners."""
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    bpy.ops.mesh.primitive_cube_add(size=1, location=middle)
    thing = bpy.context.active_object
    thing.name, thing.scale = name, [b - a for a, b in zip(low, high)]
    thing.data.materials.append(of)
    return thing


def ball(name, at, radius, of):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=at)
    bpy.ops.object.shade_smooth()
    thing = bpy.context.active_object
    thing.name = name
    thing.data.materials.append(of)
    return thing


def walls():
    plaster, wood, frame = material("Plaster", Base_Color=(0.75, 0.72, 0.66), Roughness=0.8), planks(), material(
        "Frame", Base_Color=(0.85, 0.85, 0.85), Roughness=0.3)
    box("Floor", (-2, -3, -0.1), (2, 3, 0), wood)
    for name, low, high in (
        ("Ceiling", (-2, -3, 2.6), (2, 3, 2.7)), ("Right", (2, -3, 0), (2.1, 3, 2.6)), ("Back", (-2, 3, 0), (2, 3.1, 2.6)),
        ("Front", (-2, -3.1, 0), (2, -3, 2.6)),
        # Around the window.
        ("Left below", (-2.1, -3, 0), (-2, 3, 0.9)), ("Left above", (-2.1, -3, 2.2), (-2, 3, 2.6)),
        ("Left before", (-2.1, -3, 0.9), (-2, 0, 2.2)), ("Left behind", (-2.1, 1.8, 0.9), (-2, 3, 2.2)),
    ):
        box(name, low, high, plaster)
    bpy.ops.mesh.primitive_plane_add(size=1, location=(-2.05, 0.9, 1.55), rotation=(0, math.pi / 2, 0))
    bpy.context.active_object.scale = (1.3, 1.8, 1)
    bpy.context.active_object.data.materials.append(pane())
    for name, low, high in (
        ("Bar", (-2.08, 0.88, 0.93), (-2.02, 0.92, 2.17)), ("Sill", (-2.12, -0.1, 0.86), (-1.85, 1.9, 0.92)),
    ):
        box(name, low, high, frame)


def furniture():
    wood = material("Oak", Base_Color=(0.35, 0.18, 0.08), Roughness=0.4, Coat_Weight=0.5)
    box("Table", (-0.9, 0.4, 0.7), (0.7, 1.5, 0.76), wood)
    for x in (-0.85, 0.6):
        for y in (0.45, 1.4):
            box("Leg", (x, y, 0), (x + 0.06, y + 0.06, 0.7), wood)
    ball("Glass ball", (-0.55, 0.75, 0.94), 0.18, material("Glass", Roughness=0.0, Transmission_Weight=1.0, IOR=1.5))
    ball("Copper", (-0.05, 1.2, 0.94), 0.18, material("Copper", Base_Color=(0.95, 0.64, 0.54), Metallic=1.0, Roughness=0.2))
    ball("Frosted", (0.4, 0.75, 0.9), 0.14, material("Frosted", Roughness=0.3, Transmission_Weight=1.0, IOR=1.4))
    box("Mirror", (1.96, 0.2, 0.9), (1.99, 1.8, 2.1), material("Silver", Base_Color=(0.97, 0.96, 0.95), Metallic=1.0, Roughness=0.02))


def plants():
    """Pots of leaves, which are instances of one leaf by way of collections."""
    green = material("Leaf", Base_Color=(0.08, 0.3, 0.05), Roughness=0.45)
    mesh = bpy.data.meshes.new("Leaf")
    rows = [(0.0, 0.0, 0.0), (0.05, 0.12, 0.04), (0.06, 0.26, 0.06), (0.0, 0.42, 0.02)]
    mesh.from_pydata([(s * x, y, z + 0.01 * abs(s)) for x, y, z in rows for s in (-1, 0, 1)], [],
                     [(3 * i + j, 3 * i + j + 1, 3 * i + j + 4, 3 * i + j + 3) for i in range(3) for j in range(2)])
    mesh.materials.append(green)
    plant = bpy.data.collections.new("Plant")
    for i in range(28):
        leaf = bpy.data.objects.new("Leaf", mesh)
        leaf.rotation_euler = (0.3 + 0.9 * (i % 7) / 7, 0.2 * math.sin(i), 2.4 * i)
        leaf.location, leaf.scale = (0, 0, 0.3 + 0.012 * i), [0.8 + 0.4 * math.sin(3 * i) ** 2] * 3
        plant.objects.link(leaf)
    clay = material("Clay", Base_Color=(0.6, 0.25, 0.12), Roughness=0.9)
    for at, size in (((1.5, 2.4, 0), 1.5), ((-1.6, 2.4, 0), 1.1), ((1.5, -0.6, 0), 1.2)):
        bpy.ops.mesh.primitive_cone_add(radius1=0.12 * size, radius2=0.18 * size, depth=0.3 * size,
                                        location=(*at[:2], 0.15 * size))
        bpy.context.active_object.data.materials.append(clay)
        copy = bpy.data.objects.new("Plant", None)
        copy.instance_type, copy.instance_collection = "COLLECTION", plant
        copy.location, copy.scale, copy.rotation_euler = at, [size] * 3, (0, 0, size)
        bpy.context.scene.collection.objects.link(copy)


def lights(scene):
    world = bpy.data.worlds.new("World")
    scene.world = world
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.45, 0.65, 1, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1.5
    sun = bpy.data.objects.new("Evening", bpy.data.lights.new("Evening", "AREA"))
    sun.data.shape, sun.data.size, sun.data.energy, sun.data.color = "DISK", 0.8, 5000, (1, 0.75, 0.45)
    sun.location = (-6, -0.6, 4.2)
    sun.rotation_euler = (Vector((-0.4, 1, 0.4)) - sun.location).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(sun)
    ball("Lamp", (0.9, 2.2, 2.1), 0.14, material("Lamp", Emission_Color=(1, 0.7, 0.4), Emission_Strength=12.0))


def build(scene):
    walls()
    furniture()
    plants()
    lights(scene)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location = (0.75, -1.9, 1.55)
    camera.rotation_euler = (Vector((-0.3, 1.2, 0.98)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = 24


def main(folder, seconds):
    addon = Path(__file__).resolve().parents[2] / "blender"
    spec = importlib.util.spec_from_file_location("etendue_addon", addon / "__init__.py", submodule_search_locations=[str(addon)])
    module = sys.modules["etendue_addon"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    build(scene)
    scene.render.resolution_x, scene.render.resolution_y = 400, 300
    scene.render.image_settings.file_format = "OPEN_EXR"
    cycles = scene.cycles
    cycles.samples, cycles.time_limit, cycles.use_adaptive_sampling = 1000000, seconds, False
    cycles.sample_clamp_indirect = cycles.blur_glossy = cycles.light_sampling_threshold = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 64
    scene.etendue.samples, scene.etendue.time, scene.etendue.denoise = 1000000, seconds, True
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"))

    def render(name):
        scene.render.filepath = str(folder / f"{name}.exr")
        bpy.ops.render.render(write_still=True)

    scene.render.engine = "CYCLES"
    for cycles.use_denoising in (False, True):
        render("cycles.denoised" if cycles.use_denoising else "cycles")
    scene.render.engine = "ETENDUE"
    engine = sys.modules["etendue_addon.engine"]
    fill = engine._fill
    for scene.etendue.integrator in METHODS:
        method = scene.etendue.integrator

        def keep(result, name, image):
            fill(result, name, image)
            if name == engine.DENOISED:
                et.write_image(folder / f"{method}.denoised.exr", np.ascontiguousarray(image[..., :3]))

        engine._fill = keep
        render(method)
    names = ("cycles", *METHODS)
    rows = [np.concatenate([et.read_image(folder / f"{name}{suffix}.exr") for name in names], axis=1) for suffix in ("", ".denoised")]
    et.write_image(folder / "room.png", et.tonemap(np.concatenate(rows), "aces", exposure=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), float(sys.argv[2]) if len(sys.argv) > 2 else 60)
    sys.stdout.flush()
    os._exit(0)  # a destructor of Blender 4.5 would wait for ever
