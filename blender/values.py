"""Values of node inputs: numbers, colours (tuples of 3), or textures (dicts of etendue's texture plug-ins)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .images import ImageFiles
from .mapping import mapping_matrix
from .nodes import Input, Output
from .report import Report

Color = tuple[float, float, float]
Value = float | Color | dict[str, Any]

_WRAPS = {"REPEAT": "repeat", "EXTEND": "clamp", "CLIP": "zero", "MIRROR": "mirror"}


def power(a: float, b: float) -> float:
    """As the shaders of Blender: 0 where there is no real power. It is also 0 where theirs is infinite."""
    try:
        result = a**b
    except (ZeroDivisionError, OverflowError):
        return 0.0
    return 0.0 if isinstance(result, complex) or abs(result) > np.finfo(np.float32).max else result


_OPERATIONS = {
    "ADD": lambda a, b: a + b, "SUBTRACT": lambda a, b: a - b, "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: a / b if b else 0.0, "POWER": power, "MINIMUM": min, "MAXIMUM": max,
}
# Blender's (u, v) = (0, 0) is the lower left corner of an image, etendue's the upper left one.
_FLIP_V = np.array([[1.0, 0, 0, 0], [0, -1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])


def is_texture(value: Value) -> bool:
    return isinstance(value, dict)


def as_color(value: float | Color) -> Color:
    return (value, value, value) if isinstance(value, float) else value


def luminance(value: float | Color) -> float:
    r, g, b = as_color(value)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def _single(values: tuple[float, ...]) -> float | Color:
    """A tuple of one number as this number."""
    return values[0] if len(values) == 1 else values


def is_black(value: Value) -> bool:
    return not is_texture(value) and not any(as_color(value))


def bounded(value: Value) -> Value:
    """A constant within [0, 1], as etendue clamps textures of parameters with these bounds: it refuses other constants."""
    if is_texture(value):
        return value
    return tuple(min(max(c, 0.0), 1.0) for c in value) if isinstance(value, tuple) else min(max(value, 0.0), 1.0)


def parameter(value: Value) -> Any:
    """The value as a parameter of a plug-in."""
    return {"type": "rgb", "value": list(value)} if isinstance(value, tuple) else value


def product(a: Value, b: Value) -> Value:
    if not is_texture(a) and not is_texture(b):
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        return tuple(x * y for x, y in zip(as_color(a), as_color(b)))
    if not is_texture(a):
        a, b = b, a
    return a if b in (1.0, (1.0, 1.0, 1.0)) else {"type": "scale", "value": a, "scale": parameter(b)}


def mixture(weight: Value, a: Value, b: Value) -> Value:
    """(1 - weight) a + weight b."""
    if not is_texture(a) and not is_texture(b) and as_color(a) == as_color(b):
        return a
    if not is_texture(weight):
        weight = min(max(luminance(weight), 0.0), 1.0)
        if weight == 0.0:
            return a
        if weight == 1.0:
            return b
        if not is_texture(a) and not is_texture(b):
            both = tuple(x + weight * (y - x) for x, y in zip(as_color(a), as_color(b)))
            return both[0] if isinstance(a, float) and isinstance(b, float) else both
    return {"type": "mix", "weight": weight, "value0": parameter(a), "value1": parameter(b)}


def grey(value: Value) -> Value:
    """A texture of colours as one of their luminances."""
    if not is_texture(value) or "channel" in value or value.get("name") == "vertex_alpha":
        return value
    return {"type": "mix", "weight": value, "value0": 0.0, "value1": 1.0}


@dataclass
class Values:
    """Evaluates inputs of the nodes of one material (or world, or light)."""

    where: str
    """For messages, such as 'material "Glass"'."""
    images: ImageFiles
    report: Report
    uv_maps: list[str] = field(default_factory=list)
    """UV maps other than the active one that textures use; a mesh can have one of them."""
    color_attribute: str | None = None
    """The colour attribute that textures use; "" for the active one."""

    def warn(self, node: Output, what: str) -> None:
        self.report.warn(self.where, f"node {node.name}: {what}")

    def color(self, i: Input) -> Value:
        """The value of an input as a colour."""
        value, source = self._value(i), i.source()
        if is_texture(value):
            return grey(value) if source and source.socket.type == "VALUE" else value
        return as_color(value)

    def number(self, i: Input) -> float | dict[str, Any]:
        """The value of an input as a number; of colours the luminance, in textures too."""
        value = self._value(i)
        return value if is_texture(value) else luminance(value) if isinstance(value, tuple) else value

    def constant(self, i: Input, node: Output) -> float:
        """The value of an input that cannot be a texture in etendue."""
        value = self.number(i)
        if is_texture(value):
            self.warn(node, f"{i.socket.name} cannot be a texture and is {i.value:.4g}")
            return i.value
        return value

    def mapping(self, node: Output) -> np.ndarray:
        """The matrix of a Mapping node, whose settings must be constant."""
        kind, vectors = node.node.vector_type, []
        for name in ("Location", "Rotation", "Scale"):
            socket = node.node.inputs[name]
            value = self.color(Input(socket, node.groups)) if socket.enabled else (0.0, 0.0, 0.0)
            if is_texture(value):
                self.warn(node, f"{name} cannot be a texture")
                value = Input(socket).value
            vectors.append(value)
        return mapping_matrix(kind, *vectors)

    def _value(self, i: Input) -> Value:
        source = i.source()
        if source is None:
            return i.value
        if not source.socket.is_output:  # the input of a group, without a link
            return Input(source.socket).value
        read = getattr(self, "_" + source.node.bl_idname, None)
        value = read(source) if read else None
        if value is None:
            self.warn(source, f"not supported; {i.socket.name} is {i.value} instead")
            return i.value
        return value

    # One method for each type of node. None: not supported with these settings.

    def _ShaderNodeRGB(self, node: Output) -> Value:
        return Input(node.node.outputs[0]).value

    def _ShaderNodeValue(self, node: Output) -> Value:
        return Input(node.node.outputs[0]).value

    def _ShaderNodeTexImage(self, node: Output) -> Value | None:
        image = node.node.image
        if image is None or node.node.projection != "FLAT":
            return None
        placed = self._placement(node.input("Vector"))
        if placed is None:
            return None
        to_uv, uv_set = placed
        texture = {
            "type": "bitmap",
            "filename": self.images.file_of(image, f"{self.where}: node {node.name}"),
            "filter_type": "nearest" if node.node.interpolation == "Closest" else "bilinear",
            "wrap_mode": _WRAPS[node.node.extension],
            "raw": image.colorspace_settings.name != "sRGB",
            "to_uv": _FLIP_V @ to_uv,
        }
        if uv_set:
            texture["uv_set"] = uv_set
        if node.socket.name == "Alpha":
            texture["channel"] = "opacity"
        if image.colorspace_settings.name not in ("sRGB", "Non-Color", "Linear Rec.709"):
            self.warn(node, f'colour space "{image.colorspace_settings.name}" is read as linear Rec.709')
        return texture

    def _ShaderNodeTexChecker(self, node: Output) -> Value | None:
        scale, source = self.number(node.input("Scale")), node.input("Vector").source()
        placed = self._placement(node.input("Vector")) if source else None
        if placed is None or placed[1] or is_texture(scale):
            return None
        half = np.diag([scale / 2, scale / 2, 1.0, 1.0])  # etendue's unit square has two by two squares
        if node.socket.name == "Color":
            colors = parameter(self.color(node.input("Color2"))), parameter(self.color(node.input("Color1")))
        else:
            colors = (0.0, 1.0)
        return {"type": "checkerboard", "color0": colors[0], "color1": colors[1], "to_uv": half @ placed[0]}

    def _ShaderNodeVertexColor(self, node: Output) -> Value | None:
        return self._attribute(node, node.node.layer_name)

    def _ShaderNodeAttribute(self, node: Output) -> Value | None:
        is_geometry = node.node.attribute_type == "GEOMETRY" and node.socket.name in ("Color", "Alpha")
        return self._attribute(node, node.node.attribute_name) if is_geometry else None

    def _attribute(self, node: Output, name: str) -> Value | None:
        if self.color_attribute not in (None, name):
            return None
        self.color_attribute = name
        return {"type": "mesh_attribute", "name": "vertex_alpha" if node.socket.name == "Alpha" else "vertex_color"}

    def _ShaderNodeMix(self, node: Output) -> Value | None:
        kind = {"FLOAT": "Float", "RGBA": "Color", "VECTOR": "Vector"}.get(node.node.data_type)
        if kind is None or kind == "Vector" and node.node.factor_mode != "UNIFORM":
            return None
        read = self.number if kind == "Float" else self.color
        a, b, weight = read(node.input(f"A_{kind}")), read(node.input(f"B_{kind}")), self.number(node.input("Factor_Float"))
        if not is_texture(weight) and not node.node.clamp_factor and not 0 <= weight <= 1:
            return None
        is_color = kind == "Color"
        return self._blend(node.node.blend_type if is_color else "MIX", weight, a, b, is_color and node.node.clamp_result)

    def _ShaderNodeMixRGB(self, node: Output) -> Value | None:
        a, b = self.color(node.input("Color1")), self.color(node.input("Color2"))
        return self._blend(node.node.blend_type, self.number(node.input("Fac")), a, b, node.node.use_clamp)

    def _blend(self, blend: str, weight: Value, a: Value, b: Value, clamps: bool) -> Value | None:
        if blend not in ("MIX", "MULTIPLY"):
            return None
        result = mixture(weight, a, product(a, b) if blend == "MULTIPLY" else b)
        if clamps and is_texture(result) and any(v != bounded(v) for v in (a, b)):
            return None
        return bounded(result) if clamps else result

    def _ShaderNodeInvert(self, node: Output) -> Value | None:
        value, weight = self._value(node.input("Color")), self.number(node.input("Fac"))
        if is_texture(value) or is_texture(weight):
            return None
        return tuple(c + weight * (1 - 2 * c) for c in as_color(value))

    def _ShaderNodeGamma(self, node: Output) -> Value | None:
        value, gamma = self.color(node.input("Color")), self.number(node.input("Gamma"))
        if is_texture(value) or is_texture(gamma):
            return None
        return tuple(power(c, gamma) if c > 0 or gamma == 0 else c for c in value)

    def _ShaderNodeMath(self, node: Output) -> Value | None:
        operation = node.node.operation
        if operation not in _OPERATIONS:
            return None
        a, b = (self.number(i) for i in node.inputs()[:2])
        if not is_texture(a) and not is_texture(b):
            result = _OPERATIONS[operation](a, b)
            return bounded(result) if node.node.use_clamp else result
        if node.node.use_clamp:
            return None
        if operation == "MULTIPLY":
            return product(grey(a), grey(b)) if is_texture(a) and is_texture(b) else product(a, b)
        if operation == "SUBTRACT" and a == 1.0:
            return mixture(b, 1.0, 0.0)
        return None

    def _ShaderNodeRGBToBW(self, node: Output) -> Value:
        return self.number(node.input("Color"))

    def _ShaderNodeSeparateColor(self, node: Output) -> Value | None:
        if node.node.mode != "RGB":
            return None
        value, index = self.color(node.input("Color")), list(node.node.outputs).index(node.socket)
        if not is_texture(value):
            return value[index]
        if "channel" in value:  # grey
            return value
        return {**value, "channel": "rgb"[index]} if value["type"] == "bitmap" else None

    def _ShaderNodeCombineColor(self, node: Output) -> Value | None:
        parts = [self.number(i) for i in node.inputs()]
        return tuple(parts) if node.node.mode == "RGB" and not any(map(is_texture, parts)) else None

    def _ShaderNodeValToRGB(self, node: Output) -> Value | None:
        weight, ramp = self.number(node.input("Fac")), node.node.color_ramp
        part = slice(3, 4) if node.socket.name == "Alpha" else slice(3)
        if not is_texture(weight):
            return _single(tuple(ramp.evaluate(weight))[part])
        ends = ramp.elements
        if len(ends) != 2 or (ends[0].position, ends[1].position) != (0.0, 1.0) \
                or (ramp.interpolation, ramp.color_mode) != ("LINEAR", "RGB"):
            return None
        return mixture(weight, *(_single(tuple(end.color)[part]) for end in ends))

    def _placement(self, vector: Input) -> tuple[np.ndarray, int] | None:
        """The map from the UV coordinates to those of a texture, and the number of the UV map."""
        source = vector.source()
        if source is None:
            return np.eye(4), 0
        if source.node.bl_idname == "ShaderNodeTexCoord" and source.socket.name == "UV":
            return np.eye(4), 0
        if source.node.bl_idname == "ShaderNodeUVMap":
            return np.eye(4), self._uv_set(source.node.uv_map)
        if source.node.bl_idname == "ShaderNodeMapping":
            inner = self._placement(source.input("Vector"))
            return (self.mapping(source) @ inner[0], inner[1]) if inner else None
        self.warn(source, "only UV coordinates are supported")
        return None

    def _uv_set(self, name: str) -> int:
        if not name:
            return 0
        if name not in self.uv_maps:
            self.uv_maps.append(name)
        return 1
