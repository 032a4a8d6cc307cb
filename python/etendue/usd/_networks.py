"""Inputs of shaders: values, or networks of textures that set them."""

from typing import TYPE_CHECKING, Any

from ._context import Context, Object, path_of, rgb
from ._shaders import source_of, value_of
from ._textures import bitmap, is_image, normal_scale

if TYPE_CHECKING:
    from ._materials import Material

MOST_NODES = 32  # Along a path of connections.


def product(texture: Any, factor: Any) -> Any:
    """The product of two numbers, colours or textures."""
    if factor == 1:
        return texture
    if not isinstance(texture, dict):
        return product(factor, texture) if isinstance(factor, dict) else texture * factor
    if texture["type"] == "rgb" and not isinstance(factor, dict):
        return rgb([x * factor for x in texture["value"]])
    return {"type": "scale", "value": texture, "scale": factor}


def luminance(color: Any) -> Any:
    """Of a constant colour the number; a texture as it is."""
    if isinstance(color, dict) and color["type"] == "rgb":
        r, g, b = color["value"]
        return r if r == g == b else 0.212671 * r + 0.715160 * g + 0.072169 * b
    return color


def is_black(value: Any) -> bool:
    """Whether a number, colour or texture is zero everywhere."""
    if not isinstance(value, dict):
        return bool(value == 0)
    if value["type"] == "rgb":
        return not any(value["value"])
    if value["type"] == "scale":
        return is_black(value["value"]) or is_black(value["scale"])
    return value["type"] == "mix" and is_black(value["value0"]) and is_black(value["value1"])


def bounded(color: Any) -> Any:
    """A constant colour within [0, 1], as what uses it clamps textures."""
    return rgb([min(max(x, 0.0), 1.0) for x in color["value"]]) if color["type"] == "rgb" else color


def _positive(value: Any) -> Any:
    """The colour of a number or of three, without negative ones, which textures cannot have."""
    return rgb([max(float(x), 0.0) for x in (value if hasattr(value, "__len__") else [value] * 3)])


class Inputs:
    """The inputs of a surface shader. `material` collects the primvars of its textures."""

    def __init__(self, context: Context, shader: Any, defaults: dict[str, Any], material: "Material") -> None:
        self.context = context
        self.shader = shader
        self.defaults = defaults
        self.material = material

    def color(self, name: str) -> Any:
        """A colour that is not negative, or a texture."""
        found = self._evaluate(self.shader, name, self.defaults[name], "rgb", 0)
        return found if isinstance(found, dict) else _positive(found)

    def scalar(self, name: str, most: float = 1.0) -> Any:
        """A number in [0, most], or a texture."""
        found = self._evaluate(self.shader, name, self.defaults[name], "r", 0)
        if isinstance(found, dict):
            return found
        return min(max(float(luminance(rgb(found)) if hasattr(found, "__len__") else found), 0.0), most)

    def number(self, name: str) -> float:
        """A number; of textures, the default and a warning."""
        found = self._evaluate(self.shader, name, self.defaults[name], "r", 0)
        if isinstance(found, dict):
            self.context.warn(self.shader, f"inputs:{name} must be a number here: its texture has no effect")
            return float(self.defaults[name])
        return float(found)

    def token(self, name: str) -> str:
        """A text."""
        return str(self._evaluate(self.shader, name, self.defaults[name], "r", 0))

    def source(self, name: str) -> tuple[str, str] | None:
        """The path of the node to which an input is connected, and its output."""
        source = source_of(self.shader, name)
        return None if source is None else (path_of(source[0]), source[1])

    def is_changed(self, name: str) -> bool:
        """Whether an input is connected or has another value than its default."""
        shader_input = self.shader.GetInput(name)
        if not shader_input:
            return False
        if shader_input.HasConnectedSource():
            return True
        value, default = shader_input.Get(self.context.time), self.defaults.get(name)
        if value is None:
            return False
        return bool(tuple(value) != tuple(default)) if hasattr(value, "__len__") and default is not None and \
            not isinstance(value, str) else bool(value != default)

    def normal_map(self, name: str) -> Object | None:
        """The parameters of `normalmap`, None without a texture."""
        source = source_of(self.shader, name)
        scale = 1.0
        if source is not None and source[0].GetShaderId() in ("ND_normalmap", "ND_normalmap_float"):
            scale = float(self._evaluate(source[0], "scale", 1.0, "r", 0))
            source = source_of(source[0], "in")
        if source is None:
            return None
        node = source[0]
        if not is_image(node.GetShaderId()):
            self.context.warn(node, f'the node "{node.GetShaderId()}" is not supported: the normals are those of the mesh')
            return None
        if node.GetShaderId() == "UsdUVTexture":
            scale = normal_scale(self.context, node)
        texture = bitmap(self.context, node, "rgb", self.material.coordinates, is_data=True)
        return None if texture is None else {"normalmap": texture, "scale": scale}

    def _evaluate(self, node: Any, name: str, default: Any, channel: str, depth: int) -> Any:
        """A number, a sequence of them, a text, or a texture."""
        source = source_of(node, name)
        if source is None:
            return value_of(self.context, node, name, default)
        if depth > MOST_NODES:
            self.context.fail(node, "its inputs are connected in a loop")
        return self._node(source[0], source[1], default, channel, depth + 1)

    def _node(self, node: Any, output: str, default: Any, channel: str, depth: int) -> Any:
        kind = node.GetShaderId() or ""
        if is_image(kind):
            wanted = output if output in ("r", "g", "b", "a") else "rgb" if output == "rgb" or channel == "rgb" else channel
            texture = bitmap(self.context, node, wanted, self.material.coordinates, is_data=channel != "rgb")
            return default if texture is None else texture
        base = kind.rsplit("_", 1)[0]
        if kind.startswith("UsdPrimvarReader_") or base == "ND_geompropvalue":
            return self._primvar(node, default, channel)
        if kind.startswith("ND_geomcolor"):
            return self._vertex("displayColor", channel)
        if base == "ND_constant":
            return value_of(self.context, node, "value", default)
        if kind.startswith("ND_convert_"):
            return self._evaluate(node, "in", default, channel, depth)
        if kind.startswith("ND_multiply_"):
            return self._product(node, channel, depth)
        self.context.warn(node, f'the node "{kind or "without an id"}" is not supported: the default of the input is used')
        return default

    def _product(self, node: Any, channel: str, depth: int) -> Any:
        a, b = (self._evaluate(node, name, 1.0, channel, depth) for name in ("in1", "in2"))
        if isinstance(a, dict) or isinstance(b, dict):
            a, b = (x if isinstance(x, dict) else _positive(x) if hasattr(x, "__len__") else max(x, 0.0) for x in (a, b))
            return product(a, b) if isinstance(a, dict) else product(b, a)
        if hasattr(a, "__len__") or hasattr(b, "__len__"):
            a, b = (x if hasattr(x, "__len__") else [x] * 3 for x in (a, b))
            return [x * y for x, y in zip(a, b)]
        return a * b

    def _primvar(self, node: Any, default: Any, channel: str) -> Any:
        name = str(value_of(self.context, node, "varname", "") or value_of(self.context, node, "geomprop", ""))
        if not name:
            self.context.warn(node, "names no primvar")
            return value_of(self.context, node, "fallback", default)
        return self._vertex(name, channel)

    def _vertex(self, name: str, channel: str) -> Any:
        slot, attribute = ("color", "vertex_color") if channel == "rgb" else ("alpha", "vertex_alpha")
        before = getattr(self.material, slot)
        if before not in (None, name):
            self.context.warn(self.shader, f"only one primvar of this kind has an effect: {before}, not {name}")
        else:
            setattr(self.material, slot, name)
        return {"type": "mesh_attribute", "name": attribute}
