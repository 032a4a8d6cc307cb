"""Links of node trees, followed through reroutes, muted nodes and groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy


@dataclass(frozen=True)
class Input:
    """An input socket of a node, and the group nodes around it, from the outermost one."""

    socket: Any
    groups: tuple[Any, ...] = ()

    @property
    def value(self) -> Any:
        """The value that the socket has without a link: a float or a tuple of the first three components."""
        value = getattr(self.socket, "default_value", 0.0)
        return float(value) if isinstance(value, (int, float)) else tuple(float(v) for v in value)[:3]

    def source(self) -> Output | None:
        """The output that determines this input; None without a link."""
        links = [link for link in self.socket.links if not link.is_muted]
        return _resolve(links[0].from_node, links[0].from_socket, self.groups) if links else None


@dataclass(frozen=True)
class Output:
    """An output socket of a node that computes something."""

    node: Any
    socket: Any
    groups: tuple[Any, ...] = ()

    def input(self, name: str) -> Input:
        """The input of the node with this name or, if several have it, with this identifier, that is in use."""
        sockets = self.node.inputs
        named = [s for s in sockets if s.identifier == name] or [s for s in sockets if s.name == name and s.enabled]
        return Input(named[0] if named else sockets[name], self.groups)

    def inputs(self) -> list[Input]:
        """The inputs that are in use, in order."""
        return [Input(s, self.groups) for s in self.node.inputs if s.enabled]

    def has(self, name: str) -> bool:
        """Whether this version of Blender gives the node such an input."""
        return name in self.node.inputs

    @property
    def name(self) -> str:
        """The node for messages: its label in the editor, and its type."""
        return f'"{self.node.name}" ({self.node.bl_idname})'


def _resolve(node: Any, socket: Any, groups: tuple[Any, ...]) -> Output | None:
    if node.mute:
        inner = [link for link in node.internal_links if link.to_socket == socket]
        return Input(inner[0].from_socket, groups).source() if inner else None
    if node.bl_idname == "NodeReroute":
        return Input(node.inputs[0], groups).source()
    if node.bl_idname == "ShaderNodeGroup" and node.node_tree:
        end = _active(node.node_tree, "NodeGroupOutput")
        inside = [s for s in end.inputs if s.identifier == socket.identifier] if end else []
        return Input(inside[0], (*groups, node)).source() if inside else None
    if node.bl_idname == "NodeGroupInput" and groups:
        outside = [s for s in groups[-1].inputs if s.identifier == socket.identifier]
        return _of_group(Input(outside[0], groups[:-1])) if outside else None
    return Output(node, socket, groups)


def _of_group(outside: Input) -> Output | None:
    """What is linked to an input of a group; without a link, the input itself holds the value."""
    return outside.source() or Output(outside.socket.node, outside.socket, outside.groups)


def _active(tree: Any, kind: str) -> Any:
    found = [n for n in tree.nodes if n.bl_idname == kind]
    return next((n for n in found if getattr(n, "is_active_output", True)), found[0] if found else None)


def surface_output(tree: Any, kind: str) -> Output | None:
    """The active output node of a material ("ShaderNodeOutputMaterial"), world or light. One for all renderers comes
    before one that names another renderer.
    """
    nodes = [n for n in tree.nodes if n.bl_idname == kind and getattr(n, "target", "ALL") == "ALL"]
    nodes = nodes or [n for n in tree.nodes if n.bl_idname == kind]
    node = next((n for n in nodes if n.is_active_output), nodes[0] if nodes else None)
    return Output(node, None) if node else None


def nodes_of(tree: Any, seen: tuple[Any, ...] = ()) -> list[Any]:
    """All nodes of a tree, and those inside groups, also of groups within groups."""
    found = list(tree.nodes)
    groups = [n.node_tree for n in found if n.bl_idname == "ShaderNodeGroup" and n.node_tree]
    return found + [n for g in dict.fromkeys(groups) if g not in seen for n in nodes_of(g, (*seen, tree))]


def tree_of(owner: Any) -> Any:
    """The node tree of a material or a world; None if its nodes are off, which Blender 5 does not have any more."""
    return owner.node_tree if bpy.app.version >= (5, 0, 0) or owner.use_nodes else None
