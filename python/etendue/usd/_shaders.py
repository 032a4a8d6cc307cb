"""Inputs of shader nodes: their values, or the nodes that they are connected to, through any interfaces of graphs."""

from typing import Any

from pxr import UsdShade

from ._context import Context


def value_of(context: Context, node: Any, name: str, default: Any = None) -> Any:
    """The value of an input, or `default`."""
    shader_input = node.GetInput(name)
    for attribute in shader_input.GetValueProducingAttributes() if shader_input else []:
        value = attribute.Get(context.time)
        if value is not None:
            return value
    return default


def source_of(node: Any, name: str) -> tuple[Any, str] | None:
    """The shader and the name of its output that an input is connected to."""
    shader_input = node.GetInput(name)
    for attribute in shader_input.GetValueProducingAttributes() if shader_input else []:
        shader = UsdShade.Shader(attribute.GetPrim())
        if shader and UsdShade.Output.IsOutput(attribute):
            return shader, UsdShade.Output(attribute).GetBaseName()
    return None
