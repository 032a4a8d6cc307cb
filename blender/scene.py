"""A Blender scene as a description: nested dicts as et.load_dict() takes them, with meshes as arrays.

Nothing here renders or imports etendue. engine.py renders the description, or saves it to a folder.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .camera import read_camera
from .images import ImageFiles, plain_name
from .lights import read_light
from .materials import Material, read_material
from .meshes import Arrays, read_parts
from .report import Refused, Report
from .values import Values
from .world import read_world

_RAYS = ("camera", "diffuse", "glossy", "transmission", "shadow")
_ALSO_MESHES = {"CURVE", "SURFACE", "FONT", "META"}
"""What Blender's graph has as it is, and again as a mesh."""
_IGNORED = {*_ALSO_MESHES, "EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE", "LIGHT"}


@dataclass
class _Geometry:
    """One evaluated geometry with its materials, and the transforms of all its copies."""

    name: str
    parts: list[tuple[int, Arrays]]
    materials: list[str]
    transforms: list[np.ndarray] = field(default_factory=list)


class SceneReader:
    """Reads an evaluated dependency graph; `folder` receives the files of packed and generated images."""

    def __init__(self, depsgraph: Any, folder: Path):
        self.report = Report()
        self._depsgraph = depsgraph
        self._images = ImageFiles(folder)
        self._materials: dict[str, Material] = {}
        self._material_names: dict[str | None, str] = {}
        self._geometries: dict[Any, _Geometry] = {}
        self._objects: dict[str, Any] = {}

    def read(self, sensor: dict[str, Any] | None = None) -> dict[str, Any]:
        """The description. `sensor`: instead of the scene's camera."""
        scene = self._depsgraph.scene_eval
        if sensor is None:
            if scene.camera is None:
                raise Refused("the scene has no camera")
            sensor = read_camera(scene.camera.evaluated_get(self._depsgraph), scene, self.report)
        self._warn_of_render_settings(scene.render)
        self._read_world(_override(self._depsgraph, "world") or scene.world)
        for instance in self._depsgraph.object_instances:
            self._read_instance(instance)
        shapes = [shape for geometry in self._geometries.values() for shape in self._shapes(geometry)]
        bsdfs = {name: material.bsdf for name, material in self._materials.items()}
        self._objects.update((self._new_name(name), shape) for name, shape in shapes)
        return {"type": "scene", "sensor": sensor, **bsdfs, **self._objects}

    def _read_world(self, world: Any) -> None:
        if world is not None:
            render = self._depsgraph.scene_eval.render
            threads = render.threads if render.threads_mode == "FIXED" else 0
            values = Values(f'world "{world.name}"', self._images, self.report)
            emitter = read_world(world, values, self._depsgraph.scene_eval.frame_current, threads)
            if emitter is not None:
                self._objects["world"] = emitter

    def _read_instance(self, instance: Any) -> None:
        thing = instance.object
        to_world = np.array(instance.matrix_world, dtype=float)
        if not instance.show_self:  # only its particles or copies are seen
            if thing.type == "MESH":
                self._warn_of_hair(thing)
        elif thing.type == "LIGHT":
            self._warn_of_ray_visibility(thing)
            values = Values(f'light "{thing.name}"', self._images, self.report)
            emitter = read_light(thing.data, to_world, values)
            if emitter is not None:
                self._objects[self._new_name("light-" + plain_name(thing.name))] = emitter
        elif thing.type == "MESH":
            self._warn_of_ray_visibility(thing)
            self._warn_of_hair(thing)
            # The graph makes objects anew for each step, but not their data.
            key = (thing.data.as_pointer(), tuple(s.material.name_full if s.material else "" for s in thing.material_slots))
            if key not in self._geometries:
                self._geometries[key] = self._read_geometry(thing)
            self._geometries[key].transforms.append(to_world)
        elif thing.type not in _IGNORED:
            self.report.warn(f'object "{thing.name}"', f"objects of the type {thing.type} are left out")

    def _warn_of_render_settings(self, render: Any) -> None:
        for name, what in (("use_motion_blur", "motion blur"), ("film_transparent", "a transparent film")):
            if getattr(render, name):
                self.report.warn("render settings", f"{what} has no effect")

    def _warn_of_ray_visibility(self, thing: Any) -> None:
        where = f'object "{thing.name}"'
        if not all(getattr(thing, f"visible_{kind}") for kind in _RAYS):
            self.report.warn(where, "ray visibility has no effect")
        for name, what in (("is_holdout", "a holdout"), ("is_shadow_catcher", "a shadow catcher")):
            if getattr(thing, name):
                self.report.warn(where, f"is {what}, which has no effect")
        links = thing.light_linking
        if links.receiver_collection or links.blocker_collection:
            self.report.warn(where, "light linking has no effect")

    def _warn_of_hair(self, thing: Any) -> None:
        where = f'object "{thing.name}"'
        for system in thing.particle_systems:
            if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
                self.report.warn(where, f'the hair of "{system.name}" is left out')

    def _read_geometry(self, thing: Any) -> _Geometry:
        override = _override(self._depsgraph, "material")
        materials = [override] if override else [slot.material for slot in thing.material_slots] or [None]
        names = [self._material(material) for material in materials]
        mesh = thing.to_mesh()
        try:
            parts = [] if mesh is None else read_parts(
                mesh, [self._materials[name] for name in names], f'object "{thing.name}"', self.report)
        finally:
            thing.to_mesh_clear()
        return _Geometry(plain_name(thing.name), parts, names)

    def _material(self, material: Any) -> str:
        key = material.name_full if material else None
        if key not in self._material_names:
            name = self._new_name("material-" + plain_name(key) if key else "default-material")
            self._materials[name] = read_material(material, self._images, self.report)
            self._material_names[key] = name
        return self._material_names[key]

    def _shapes(self, geometry: _Geometry) -> list[tuple[str, dict[str, Any]]]:
        """A mesh that occurs once, or emits, has its transform; others are groups with instances."""
        shapes, grouped = [], []
        for index, arrays in geometry.parts:
            material = geometry.materials[index]
            mesh = {"type": "mesh", "mesh": arrays, "bsdf": {"type": "ref", "id": material}}
            name = f"{geometry.name}-{index}"
            emission = self._materials[material].emission
            if emission is not None:
                mesh["emitter"] = {"type": "area", "radiance": emission, "two_sided": True}
            elif len(geometry.transforms) > 1:
                grouped.append((name, mesh))
                continue
            shapes += [(name, {**mesh, "to_world": to_world}) for to_world in geometry.transforms]
        if grouped:
            group = self._new_name("group-" + geometry.name)
            self._objects[group] = {"type": "shapegroup", **dict(grouped)}
            copy = {"type": "instance", "shapegroup": {"type": "ref", "id": group}}
            shapes += [("copy-" + geometry.name, {**copy, "to_world": to_world}) for to_world in geometry.transforms]
        return shapes

    def _new_name(self, name: str) -> str:
        """The name, with a number if it is taken."""
        taken, result = 1, name
        while result in self._objects or result in self._materials:
            taken += 1
            result = f"{name}-{taken}"
        return result


def _override(depsgraph: Any, kind: str) -> Any:
    """The material or the world that a view layer has instead of those of its objects; None without one."""
    override = getattr(depsgraph.view_layer_eval, kind + "_override", None)
    return override.evaluated_get(depsgraph) if override else None
