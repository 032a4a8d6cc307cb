"""The prims of a stage in order: what each adds to the scene, and instances."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

from ._context import Context, Matrix, Object, column_matrix, inverse, is_singular, path_of
from ._gprims import shapes_of_gprim
from ._lights import emitted, is_normalized, light
from ._materials import Material, bound_material
from ._meshes import parts_of_mesh
from ._networks import product

PREDICATE = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimIsDefined & ~Usd.PrimIsAbstract)


@dataclass
class Target:
    """Where shapes go: into the scene, or into a group. `from_stage` maps the space of the stage to that of the target."""

    from_stage: Matrix
    shapes: dict[str, Object] = field(default_factory=dict)
    suffix: str = ""  # Of keys, where prims are copied.

    def has_light(self) -> bool:
        """Groups cannot have emitters."""
        return any("emitter" in o or o["type"] in _EMITTERS for o in self.shapes.values())


_EMITTERS = ("point", "spot", "directional", "constant", "envmap")


def add_prims(context: Context) -> None:
    """Adds all prims of the stage to the objects of the scene."""
    reader = _Reader(context)
    target = Target(context.root)
    for prim in context.stage.GetPseudoRoot().GetFilteredChildren(PREDICATE):
        reader.visit(prim, target)
    if not target.has_light():
        context.notes.append(f"{context.file}: there is no light: a white environment is added")
        target.shapes["emitter"] = {"type": "constant"}
    context.objects.update(reader.groups)
    context.objects.update(target.shapes)


class _Reader:

    def __init__(self, context: Context) -> None:
        self.context = context
        self.groups: dict[str, Object] = {}
        self.made: dict[Any, str | None] = {}  # Keys of groups; None: of what cannot be one.

    def visit(self, prim: Any, target: Target) -> None:
        context = self.context
        if not self._is_seen(prim) or prim.IsA(UsdShade.Material) or prim.IsA(UsdShade.NodeGraph):
            return
        if prim.IsA(UsdGeom.PointInstancer):
            return self._point_instancer(prim, target)
        if prim.IsInstance() and not prim.IsA(UsdGeom.Gprim):
            return self._instance(prim, target)
        if is_singular(context.stage_matrix(prim)):
            context.warn(prim, "its transform has no inverse: it is left out with what is below it")
            return
        if self._has_purpose(prim):
            self._add(prim, target)
        for child in prim.GetFilteredChildren(PREDICATE):
            self.visit(child, target)

    def _is_seen(self, prim: Any) -> bool:
        return str(self.context.get(prim, "visibility")) != "invisible"

    def _has_purpose(self, prim: Any) -> bool:
        imageable = UsdGeom.Imageable(prim)
        return not imageable or str(imageable.ComputePurpose()) in self.context.options.purposes

    def _add(self, prim: Any, target: Target) -> None:
        context = self.context
        to_target = target.from_stage @ context.stage_matrix(prim)
        if prim.IsA(UsdGeom.Mesh):
            if prim.HasAPI(UsdSkel.BindingAPI) and prim.GetRelationship("skel:skeleton").HasAuthoredTargets():
                context.warn(prim, "skinning has no effect: the mesh is at rest")
            for part, arrays in parts_of_mesh(context, prim):
                if not len(arrays["triangles"]):
                    continue
                shape: Object = {"type": "mesh", "mesh": arrays, "compute_normals": False}
                self._place(prim, part.key, shape, part.material, to_target, target)
            return
        shapes = shapes_of_gprim(context, prim)
        if shapes is not None:
            material = bound_material(context, prim)
            for suffix, shape in shapes:
                self._place(prim, path_of(prim) + suffix, shape, material, to_target @ shape.pop("to_world"), target)
        elif prim.HasAPI(UsdLux.LightAPI):
            made = light(context, prim, to_target)
            if made is not None:
                target.shapes[path_of(prim) + target.suffix] = made
        elif prim.IsA(UsdGeom.Gprim):
            context.warn(prim, f"a {prim.GetTypeName()} is not supported, and is left out")
        elif prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaType():
            context.warn(prim, f"the type {prim.GetTypeName()} is unknown")

    def _place(self, prim: Any, key: str, shape: Object, material: Material, to_target: Matrix, target: Target) -> None:
        """Adds a shape with its material and emitter."""
        if not np.array_equal(to_target, np.eye(4)):
            shape["to_world"] = to_target
        if material.bsdf is not None:
            shape["bsdf"] = material.bsdf
        emitter = material.emitter
        if prim.HasAPI(UsdLux.LightAPI):
            emitter = self._mesh_light(prim, shape, material)
        if emitter is not None:
            two_sided = {"two_sided": True} if self.context.get(prim, "doubleSided") else {}
            shape["emitter"] = {**emitter, **two_sided}
        target.shapes[key + target.suffix] = shape

    def _mesh_light(self, prim: Any, shape: Object, material: Material) -> Object:
        """The light of a mesh, tinted by what its material emits."""
        radiance: Any = emitted(self.context, prim)
        if is_normalized(self.context, prim) and "mesh" in shape:
            p = (shape["mesh"]["positions"] @ self.context.stage_matrix(prim)[:3, :3].T)[shape["mesh"]["triangles"]]
            radiance = radiance / (np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2)
        color: Object = {"type": "rgb", "value": [float(x) for x in radiance]}
        if material.emitter is not None and _tints(self.context, prim):
            color = {"type": "scale", "value": product(material.emitter["radiance"], 1 / self.context.exposure), "scale": color}
        return {"type": "area", "radiance": color}

    def _instance(self, prim: Any, target: Target) -> None:
        """An instance of a prototype: of a group, or copies of its prims if they emit light."""
        bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        inherited = [(p.GetName(), str(p.Get(self.context.time))) for p in UsdGeom.PrimvarsAPI(prim).FindInheritablePrimvars()]
        key = (prim.GetPrototype().GetPath(), path_of(bound) if bound else "", tuple(inherited),
               str(UsdGeom.Imageable(prim).ComputePurpose()) if UsdGeom.Imageable(prim) else "")
        children = prim.GetFilteredChildren(PREDICATE)
        to_stage = self.context.stage_matrix(prim)
        if is_singular(to_stage):
            self.context.warn(prim, "its transform has no inverse: it is left out")
            return
        if not self._place_group(prim, key, children, inverse(to_stage), target, path_of(prim), target.from_stage @ to_stage):
            for child in children:
                self.visit(child, target)

    def _place_group(
        self, prim: Any, key: Any, children: list[Any], to_group: Matrix, target: Target, name: str, to_target: Matrix
    ) -> bool:
        """Adds an instance of the group `key` of some prims, which is made when it is first used. False where they emit."""
        if key not in self.made:
            group = Target(to_group)
            for child in children:
                self.visit(child, group)
            if group.has_light():
                self.made[key] = None
            else:
                self.made[key] = f"{name}:group"
                self.groups[f"{name}:group"] = _group(group.shapes)
        group_name = self.made[key]
        if group_name is None:
            return False
        if len(self.groups[group_name]) > 1:
            target.shapes[name + target.suffix] = {"type": "instance", "to_world": to_target,
                                                   "shapegroup": {"type": "ref", "id": group_name}}
        return True

    def _point_instancer(self, prim: Any, target: Target) -> None:
        context = self.context
        if not self._has_purpose(prim):
            return
        instancer = UsdGeom.PointInstancer(prim)
        paths = instancer.GetPrototypesRel().GetForwardedTargets()
        numbers = context.get(prim, "protoIndices")
        if not paths or numbers is None:
            context.warn(prim, "a point instancer without prototypes is left out")
            return
        transforms = instancer.ComputeInstanceTransformsAtTime(
            context.time, context.time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask)
        if len(transforms) != len(numbers):
            context.fail(prim, f"has {len(numbers)} protoIndices, but its positions give {len(transforms)} transforms")
        mask = instancer.ComputeMaskAtTime(context.time)
        to_stage = context.stage_matrix(prim)
        prototypes = [context.stage.GetPrimAtPath(path) for path in paths]
        for i, number in enumerate(numbers):
            if mask and not mask[i]:
                continue
            if not 0 <= number < len(prototypes) or not prototypes[number]:
                context.fail(prim, f"protoIndices has the index {number} of {len(prototypes)} prototypes")
            prototype = prototypes[number]
            placed = to_stage @ column_matrix(transforms[i])
            if is_singular(placed) or is_singular(context.stage_matrix(prototype)):
                context.warn(prim, "instances whose transforms have no inverse are left out")
                continue
            to_group = inverse(context.stage_matrix(prototype))
            if not self._place_group(prim, (paths[number], "point"), [prototype], to_group, target, f"{path_of(prim)}[{i}]",
                                     target.from_stage @ placed):
                copy = Target(target.from_stage @ placed @ to_group, suffix=f"{target.suffix}[{i}]")
                self.visit(prototype, copy)
                target.shapes.update(copy.shapes)


def _tints(context: Context, prim: Any) -> bool:
    """Whether the emission of a material tints the light of a mesh."""
    return str(context.get(prim, "light:materialSyncMode")) == "materialGlowTintsLight"


def _group(shapes: dict[str, Object]) -> Object:
    made: Object = {"type": "shapegroup"}
    for i, (key, shape) in enumerate(shapes.items()):
        made["shape" if i == 0 else f"shape_{i + 1}"] = {**shape, "id": key}
    return made

