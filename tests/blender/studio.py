"""Builds small scenes in Blender and renders them by Cycles and etendue."""

from pathlib import Path

import bpy
import etendue as et
from mathutils import Matrix, Vector

SIZE = (64, 48)


class Studio:
    def __init__(self, folder: Path):
        self.folder = folder
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = SIZE
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.cycles.samples = 16
        scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
        # Cycles without its approximations.
        scene.cycles.sample_clamp_indirect = scene.cycles.blur_glossy = scene.cycles.light_sampling_threshold = 0
        scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 32
        scene.cycles.transmission_bounces = scene.cycles.transparent_max_bounces = 32
        scene.etendue.integrator, scene.etendue.samples = "path", 16
        self.camera((0, -4, 2), (0, 0, 0))

    def camera(self, at, target):
        self.cam = self._add("Camera", bpy.data.cameras.new("Camera"))
        self.scene.camera = self.cam
        self.cam.matrix_world = looking(at, target)
        return self.cam.data

    def light(self, kind, at=(0, 0, 2), target=(0, 0, 0), name="Light", **settings):
        data = bpy.data.lights.new(name, kind)
        for key, value in settings.items():
            setattr(data, key, value)
        self._add(name, data).matrix_world = looking(at, target)
        return data

    def world(self, color=(1, 1, 1), strength=1.0):
        """A constant world; returns its tree and the background node."""
        world = bpy.data.worlds.new("World")
        self.scene.world = world
        _use_nodes(world)
        node = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
        node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (*color, 1), strength
        return world.node_tree, node

    def plane(self, size=20, material=None, name="Plane", at=(0, 0, 0)):
        bpy.ops.mesh.primitive_plane_add(size=size, location=at)
        return self._finish(name, material)

    def sphere(self, material=None, at=(0, 0, 1), radius=1.0, name="Sphere"):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius, location=at)
        bpy.ops.object.shade_smooth()
        return self._finish(name, material)

    def material(self, node_type, name="Material", **inputs):
        """A material whose surface is a new node with these inputs; returns the tree and the node."""
        material = bpy.data.materials.new(name)
        _use_nodes(material)
        tree = material.node_tree
        tree.nodes.clear()
        output, node = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new(node_type)
        if node.outputs:  # not of a group without a tree
            tree.links.new(node.outputs[0], output.inputs["Surface"])
        for key, value in inputs.items():
            socket = node.inputs[key.replace("_", " ")]
            socket.default_value = (*value, 1) if isinstance(value, tuple) and len(socket.default_value) == 4 else value
        return material, tree, node

    def image(self, pixel, width=32, height=32, name="Image", is_float=False, color=True):
        """A packed image; pixel(u, v) is its colour, with (0, 0) at the lower left corner."""
        image = bpy.data.images.new(name, width, height, float_buffer=is_float, alpha=True)
        image.colorspace_settings.name = ("Linear Rec.709" if is_float else "sRGB") if color else "Non-Color"
        values = [(*pixel((x + 0.5) / width, (y + 0.5) / height), 1.0)[:4] for y in range(height) for x in range(width)]
        image.pixels.foreach_set([c for value in values for c in value])
        image.pack()
        return image

    def render(self, engine="ETENDUE", layer="", name=None):
        """The image of an engine: linear RGB, the first row at the top."""
        self.scene.render.engine = engine
        file = self.folder / f"{name or engine.lower()}.exr"
        self.scene.render.filepath = str(file)
        bpy.ops.render.render(write_still=True)
        return et.read_image(file, layer)[..., :3]

    def ratio(self, pixels=slice(None)):
        """The mean of etendue's image divided by that of Cycles, in all pixels or some."""
        ours, reference = self.render()[pixels], self.render("CYCLES")[pixels]
        assert reference.mean() > 1e-3
        return float(ours.mean() / reference.mean())

    def _add(self, name, data):
        thing = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(thing)
        return thing

    def _finish(self, name, material):
        thing = bpy.context.active_object
        thing.name = name
        if material is not None:
            thing.data.materials.append(material)
        return thing


def looking(at, target):
    """The matrix of a camera or light at one point that looks to another one."""
    direction = Vector(target) - Vector(at)
    up = "Y" if abs(direction.normalized().z) < 0.999 else "X"
    return Matrix.Translation(Vector(at)) @ direction.to_track_quat("-Z", up).to_matrix().to_4x4()


def _use_nodes(owner):
    if bpy.app.version < (5, 0, 0):
        owner.use_nodes = True
