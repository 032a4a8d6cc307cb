"""A room in Blender, with a window, glass, metal and plants of instances, rendered by Cycles and by methods of etendue.

    build/venv-blender-5.0.1/bin/python tests/blender/room.py FOLDER [SECONDS]

bpy (Blender as a Python module) and the package etendue must be importable, and the add-on in blender/ is used as it is. Writes
room.blend and one image for each engine and method, which render for SECONDS (60) each, Cycles with a fixed number of samples.
"""

import importlib.util
import math
import sys
from pathlib import Path

import bpy
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
    box("Pane", (-2.06, 0.03, 0.93), (-2.04, 1.77, 2.17), material("Pane", Roughness=0.0, Transmission_Weight=1.0, IOR=1.5))
    for name, low, high in (
        ("Bar", (-2.08, 0.88, 0.93), (-2.02, 0.92, 2.17)), ("Sill", (-2.1, -0.1, 0.86), (-1.85, 1.9, 0.9)),
    ):
        box(name, low, high, frame)


def furniture():
    wood = material("Oak", Base_Color=(0.35, 0.18, 0.08), Roughness=0.4, Coat_Weight=0.5)
    box("Table", (-0.9, 0.4, 0.7), (0.7, 1.5, 0.76), wood)
    for x in (-0.85, 0.6):
        for y in (0.45, 1.4):
            box("Leg", (x, y, 0), (x + 0.06, y + 0.06, 0.7), wood)
    ball("Glass ball", (-0.5, 0.8, 0.92), 0.16, material("Glass", Roughness=0.0, Transmission_Weight=1.0, IOR=1.5))
    ball("Copper", (0.0, 1.15, 0.9), 0.14, material("Copper", Base_Color=(0.95, 0.64, 0.54), Metallic=1.0, Roughness=0.2))
    ball("Frosted", (0.4, 0.75, 0.87), 0.11, material("Frosted", Roughness=0.3, Transmission_Weight=1.0, IOR=1.4))
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
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.5, 0.7, 1, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 2
    box("Sunlit wall", (-5, -1.5, 2), (-4.9, 1.5, 4), material("Sunlit", Emission_Color=(1, 0.85, 0.6), Emission_Strength=40.0))
    ball("Lamp", (0.9, 2.2, 2.1), 0.1, material("Lamp", Emission_Color=(1, 0.7, 0.4), Emission_Strength=20.0))


def build(scene):
    walls()
    furniture()
    plants()
    lights(scene)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location = (0.9, -2.7, 1.5)
    camera.rotation_euler = (Vector((-0.35, 1.2, 1.05)) - camera.location).to_track_quat("-Z", "Y").to_euler()
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
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 4 * int(seconds), False, False
    scene.cycles.sample_clamp_indirect = scene.cycles.blur_glossy = scene.cycles.light_sampling_threshold = 0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 64
    scene.etendue.samples, scene.etendue.time = 1000000, seconds
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"))
    for method in ("cycles", *METHODS):
        if method != "cycles":
            scene.etendue.integrator = method
        scene.render.engine = "CYCLES" if method == "cycles" else "ETENDUE"
        scene.render.filepath = str(folder / f"{method}.exr")
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), float(sys.argv[2]) if len(sys.argv) > 2 else 60)
