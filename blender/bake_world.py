"""A program for a second Blender: renders the world of a file as an equirectangular image, by Cycles.

`python bake_world.py -- JSON` with Blender as a module, `blender --background --python bake_world.py -- JSON` otherwise. The
object has `blend`, `world` (its name), `image` (the OpenEXR file, which a black world does not get), `width`, `frame` and
`threads`.
"""

import json
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix

_SAMPLES, _MANY = 4, 256
"""Samples of a pixel: everywhere, and then around the brightest things, such as the sun."""
_BRIGHT = 30
"""What is brighter than the mean by this factor is rendered again."""
_RAYS = {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Diffuse Depth": 1.0, "Ray Depth": 1.0}
"""Outputs of a Light Path node that are not 0: those of light that a surface receives."""


def bake(blend: str, world: str, image: str, width: int, frame: int, threads: int) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    with bpy.data.libraries.load(blend) as (source, target):
        target.worlds = [name for name in source.worlds if name == world]
    scene.world = target.worlds[0]
    _fix_light_paths(scene.world.node_tree, [])
    for thing in bpy.data.objects:  # whose coordinates textures use
        scene.collection.objects.link(thing)
        thing.hide_render = True
    camera = bpy.data.objects.new("Panorama", bpy.data.cameras.new("Panorama"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    # The middle of the image is at +x, up is +z, as in environment textures.
    camera.matrix_world = Matrix(((0, 0, -1, 0), (-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
    camera.data.type = "PANO"
    panorama = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles  # Blender 5, and 4.5
    panorama.panorama_type = "EQUIRECTANGULAR"
    _set_up(scene, threads)
    scene.render.resolution_x, scene.render.resolution_y = width, width // 2
    scene.frame_set(frame)
    pixels = _render(scene, image, _SAMPLES)
    box = _bright_part(pixels)
    if box is not None:
        top, bottom, left, right = box
        render = scene.render
        render.use_border = render.use_crop_to_border = True
        # In the middle of pixels, as Blender rounds downward.
        render.border_min_x, render.border_max_x = (left + 0.5) / width, (right + 0.5) / width
        render.border_min_y, render.border_max_y = (bottom + 0.5) * 2 / width, (top + 0.5) * 2 / width
        pixels[bottom:top, left:right] = _render(scene, image, _MANY)
    if pixels[..., :3].any():
        _save(scene, image, pixels)
    else:
        os.remove(image)


def _render(scene: bpy.types.Scene, file: str, samples: int) -> np.ndarray:
    """Renders to a file; returns its pixels, of which the first row is the lowest one. What is not a radiance is black."""
    scene.cycles.samples, scene.render.filepath = samples, file
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(file)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    shape = (image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    pixels = pixels.reshape(shape)
    pixels[..., :3] = np.where(np.isfinite(pixels[..., :3]), np.maximum(pixels[..., :3], 0), 0)
    return pixels


def _bright_part(pixels: np.ndarray) -> tuple[int, int, int, int] | None:
    """The end and start of the rows and the start and end of the columns with all bright things; None if they are not a
    small part of the image."""
    light = pixels[..., :3].max(axis=2)
    rows, columns = (np.flatnonzero((light > _BRIGHT * light.mean()).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    # And a pixel around them.
    bottom, left = max(rows[0] - 1, 0), max(columns[0] - 1, 0)
    top, right = min(rows[-1] + 2, light.shape[0]), min(columns[-1] + 2, light.shape[1])
    return (top, bottom, left, right) if (top - bottom) * (right - left) * 64 < light.size else None


def _save(scene: bpy.types.Scene, file: str, pixels: np.ndarray) -> None:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Panorama", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(pixels.reshape(-1))
    image.save_render(file, scene=scene)


def _set_up(scene: bpy.types.Scene, threads: int) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_percentage = 100
    render.use_file_extension = False
    if threads:
        render.threads_mode, render.threads = "FIXED", threads
    settings = render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGB", "32", "ZIP"
    cycles.pixel_filter_type = "BOX"
    cycles.use_denoising, cycles.max_bounces = False, 0
    cycles.use_adaptive_sampling = False


def _fix_light_paths(tree: bpy.types.NodeTree | None, seen: list[bpy.types.NodeTree]) -> None:
    """Replaces Light Path nodes by what light that a surface receives has there, in groups as well."""
    if tree is None or tree in seen:  # a group may have the name of the tree of the world
        return
    seen.append(tree)
    for node in list(tree.nodes):
        if node.bl_idname == "ShaderNodeGroup":
            _fix_light_paths(node.node_tree, seen)
        elif node.bl_idname == "ShaderNodeLightPath":
            for output in node.outputs:
                for link in [link for link in output.links if not link.is_muted]:
                    value = tree.nodes.new("ShaderNodeValue")
                    value.outputs[0].default_value = _RAYS.get(output.name, 0.0)
                    tree.links.new(value.outputs[0], link.to_socket)


if __name__ == "__main__":
    bake(**json.loads(sys.argv[sys.argv.index("--") + 1]))
    sys.stdout.flush()
    os._exit(0)  # without the destructors of Blender 4.5, one of which waits for ever
