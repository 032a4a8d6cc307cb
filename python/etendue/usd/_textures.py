"""Image textures: UsdUVTexture and the image nodes of MaterialX, as `bitmap`."""

import os
import struct
from typing import Any

import numpy as np
from pxr import Ar

from ._context import Context, Matrix, Object, rgb
from ._shaders import source_of, value_of

IMAGES = ("UsdUVTexture", "ND_UsdUVTexture", "ND_image", "ND_tiledimage")
WRAPS = {"black": "zero", "useMetadata": "zero", "constant": "zero", "clamp": "clamp", "repeat": "repeat", "periodic": "repeat",
         "mirror": "mirror"}


def is_image(kind: str | None) -> bool:
    """Whether a node of this id is an image."""
    return bool(kind) and (str(kind) in IMAGES or str(kind).startswith(("ND_image_", "ND_tiledimage_", "ND_UsdUVTexture_")))


def bitmap(context: Context, node: Any, channel: str, coordinates: list[str], is_data: bool) -> Object | None:
    """The texture of a node. `coordinates` are the primvars that the material uses already. None where the file is missing,
    with a warning."""
    asset = value_of(context, node, "file")
    image = None if asset is None else image_source(context, node, asset)
    if image is None:
        return None
    uv_set, to_uv = _coordinates(context, node, coordinates)
    made: Object = {"type": "bitmap", **image}
    if _is_raw(context, node, image, is_data):
        made["raw"] = True
    if channel != "rgb":
        made["channel"] = "opacity" if channel == "a" else channel
    is_preview = "UsdUVTexture" in node.GetShaderId()
    names = ("wrapS", "wrapT") if is_preview else ("uaddressmode", "vaddressmode")
    default = "useMetadata" if is_preview else "periodic"
    u, v = (WRAPS.get(str(value_of(context, node, name, default)), "repeat") for name in names)
    if u != "repeat":
        made["wrap_mode"] = u
    if v != u:
        made["wrap_mode_v"] = v
    if uv_set:
        made["uv_set"] = uv_set
    if not np.array_equal(to_uv, np.eye(3)):
        made["to_uv"] = _upside_down(to_uv)
    return _scaled(context, node, made, channel) if is_preview and not (is_data and channel == "rgb") else made


def image_source(context: Context, prim: Any, asset: Any) -> Object | None:
    """The file of an image, or its bytes if it is part of a .usdz file."""
    path = asset.resolvedPath or asset.path
    if "<UDIM>" in asset.path:
        context.refuse(prim, f"tiles of images ({asset.path}) are not supported")
        return None
    if not path:
        return None
    if Ar.IsPackageRelativePath(path):
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
        if opened:
            return {"image": {"name": path, "bytes": bytes(opened.GetBuffer())}}
    elif os.path.isfile(path):
        return {"filename": os.path.abspath(path)}
    context.warn(prim, f"there is no image {asset.path}")
    return None


def normal_scale(context: Context, node: Any) -> float:
    """The scale of a normal map, from its scale and bias."""
    scale, bias = _scale_and_bias(context, node)
    factor = scale[0] / 2
    if not np.allclose(scale[:3], [2 * factor, 2 * factor, 2]) or not np.allclose(bias[:3], [-factor, -factor, -1]):
        context.warn(node, f"normals with the scale {tuple(scale)} and the bias {tuple(bias)} are read as with (2, 2, 2, 1) "
                           "and (-1, -1, -1, 0)")
        return 1.0
    return float(factor)


def _scale_and_bias(context: Context, node: Any) -> tuple[list[float], list[float]]:
    """value * scale + bias, by channel."""
    return list(value_of(context, node, "scale", (1.0,) * 4)), list(value_of(context, node, "bias", (0.0,) * 4))


def _scaled(context: Context, node: Any, texture: Object, channel: str) -> Object:
    """value * scale + bias, clamped by what uses it."""
    scale, bias = _scale_and_bias(context, node)
    if channel != "rgb":
        i = "rgba".index(channel)
        s, b = float(scale[i]), float(bias[i])
        if b == 0 and s >= 0:
            return texture if s == 1 else {"type": "scale", "value": texture, "scale": s}
        black, white = max(b, 0.0), max(s + b, 0.0)
        if (black, white) != (b, s + b):
            context.warn(node, f"values below 0 are not clamped: they go from {black:g} for black to {white:g} for white")
        return {"type": "mix", "value0": black, "value1": white, "weight": texture}
    if any(bias[:3]):
        context.warn(node, "inputs:bias of a colour has no effect")
    if scale[:3] == [1, 1, 1]:
        return texture
    return {"type": "scale", "value": texture, "scale": rgb([max(s, 0.0) for s in scale[:3]])}


def _coordinates(context: Context, node: Any, known: list[str]) -> tuple[int, Matrix]:
    """The number of the texture coordinates among those of the material, and the map before the look-up, whose v points up."""
    is_preview = "UsdUVTexture" in node.GetShaderId()
    matrix = np.eye(3)
    if "tiledimage" in node.GetShaderId():
        tiles, offset = (list(value_of(context, node, name, d)) for name, d in (("uvtiling", (1, 1)), ("uvoffset", (0, 0))))
        matrix = np.array([[tiles[0], 0, -offset[0]], [0, tiles[1], -offset[1]], [0, 0, 1]])
    at, name = node, "st" if is_preview else "texcoord"
    for _ in range(8):
        connected = source_of(at, name)
        if connected is None:
            return _number(context, node, known, "st"), matrix
        source, _ = connected
        kind = source.GetShaderId() or ""
        if kind in ("UsdTransform2d", "ND_UsdTransform2d"):
            matrix = matrix @ _transform_2d(context, source)
            at, name = source, "in"
        elif kind.startswith(("UsdPrimvarReader_float2", "ND_geompropvalue_vector2", "ND_UsdPrimvarReader_vector2")):
            named = value_of(context, source, "varname") or value_of(context, source, "geomprop")
            return _number(context, node, known, str(named or "st")), matrix
        elif kind == "ND_texcoord_vector2":
            index = int(value_of(context, source, "index", 0))
            return _number(context, node, known, "st" if index == 0 else f"st{index}"), matrix
        else:
            context.warn(source, f'the node "{kind}" is not supported: the texture coordinates are st')
            return _number(context, node, known, "st"), matrix
    context.fail(node, "its texture coordinates are connected in a loop")


def _number(context: Context, node: Any, known: list[str], name: str) -> int:
    if name in known:
        return known.index(name)
    if len(known) == 2:
        context.refuse(node, "a material whose textures use more than two sets of texture coordinates "
                             f"({known[0]}, {known[1]} and {name}) is not supported")
        return 0
    known.append(name)
    return len(known) - 1


def _transform_2d(context: Context, node: Any) -> Matrix:
    """in * scale, rotated counter-clockwise, + translation."""
    angle = np.radians(float(value_of(context, node, "rotation", 0)))
    scale, move = (list(value_of(context, node, name, d)) for name, d in (("scale", (1, 1)), ("translation", (0, 0))))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * scale[0], -s * scale[1], move[0]], [s * scale[0], c * scale[1], move[1]], [0, 0, 1]])


def _upside_down(m: Matrix) -> Matrix:
    """The same map for coordinates whose v points down, as a 4x4 matrix."""
    flip = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
    m = flip @ m @ flip
    made = np.eye(4)
    made[:2, :2], made[:2, 3] = m[:2, :2], m[:2, 2]
    return made


def _is_raw(context: Context, node: Any, image: Object, is_data: bool) -> bool:
    if "UsdUVTexture" not in node.GetShaderId():
        file = node.GetInput("file")
        space = file.GetAttr().GetColorSpace() if file else ""
        return is_data or "srgb" not in str(space).lower()
    space = str(value_of(context, node, "sourceColorSpace", "auto"))
    return space == "raw" or (space != "sRGB" and not _is_srgb(image))


def _is_srgb(image: Object) -> bool:
    """The rule of `auto`: images with 8 bits and three or four channels are sRGB."""
    if "image" in image:
        head = image["image"]["bytes"][:1 << 16]
    else:
        with open(image["filename"], "rb") as f:
            head = f.read(1 << 16)
    if head.startswith(b"\x89PNG"):
        bits, kind = head[24], head[25]
        return bits <= 8 and kind in (2, 3, 6)
    if head.startswith(b"\xff\xd8"):
        return _jpeg_components(head) != 1
    return True


def _jpeg_components(head: bytes) -> int:
    """The number of channels, from the frame header; 3 where it is not in `head`."""
    at = 2
    while at + 10 <= len(head) and head[at] == 0xFF:
        if 0xC0 <= head[at + 1] <= 0xCF and head[at + 1] not in (0xC4, 0xC8, 0xCC):
            return head[at + 9]
        at += 2 + int(struct.unpack(">H", head[at + 2:at + 4])[0])
    return 3
