"""References to MaterialX documents (.mtlx), which usd-core cannot open: their materials, as USD's plug-in for them makes prims."""

import os
import xml.etree.ElementTree as ElementTree
from typing import Any

from pxr import Gf, Sdf, Usd, UsdShade

from .._etendue import SceneError

ROOT = Sdf.Path("/MaterialX")
_TYPES = {
    "float": Sdf.ValueTypeNames.Float, "integer": Sdf.ValueTypeNames.Int, "boolean": Sdf.ValueTypeNames.Bool,
    "color3": Sdf.ValueTypeNames.Color3f, "color4": Sdf.ValueTypeNames.Color4f, "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3, "vector4": Sdf.ValueTypeNames.Float4, "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
}
_VECTORS = {"color3": Gf.Vec3f, "color4": Gf.Vec4f, "vector2": Gf.Vec2f, "vector3": Gf.Vec3f, "vector4": Gf.Vec4f}
Element = ElementTree.Element


def add_documents(stage: Any) -> dict[str, Any]:
    """Makes the materials of all documents that the stage refers to. Returns the stages with them, by the names of the files, as
    the stage has them; it refers to their layers weakly.
    """
    made: dict[str, Any] = {}
    names: dict[str, Any] = {}
    for prim in list(stage.TraverseAll()):
        for spec in prim.GetPrimStack():
            for reference in spec.referenceList.GetAddedOrExplicitItems():
                name = reference.assetPath
                if not name.lower().endswith(".mtlx"):
                    continue
                file = spec.layer.ComputeAbsolutePath(name)
                if not os.path.isfile(file):
                    continue
                if file not in made:
                    made[file] = _document(file)
                names[name] = made[file]
                with Usd.EditContext(stage, stage.GetSessionLayer()):
                    prim.GetReferences().AddReference(made[file].GetRootLayer().identifier, reference.primPath or ROOT)
    return names


def _document(file: str) -> Any:
    """A stage with the materials of a document, below /MaterialX/Materials."""
    try:
        root = ElementTree.parse(file).getroot()
    except (ElementTree.ParseError, OSError) as e:
        raise SceneError(f"{file}: is not a MaterialX document: {e}") from None
    if root.tag != "materialx":
        raise SceneError(f'{file}: the outermost element is "{root.tag}", but must be "materialx"')
    stage = Usd.Stage.CreateInMemory()
    stage.SetDefaultPrim(stage.DefinePrim(ROOT))
    for element in root:
        if element.get("type") == "material" or element.tag == "surfacematerial":
            _Material(file, root, stage, element)
    return stage


class _Material:
    """A material with its shader, and the nodes that this is connected to."""

    def __init__(self, file: str, root: Element, stage: Any, element: Element) -> None:
        self.file, self.root, self.stage = file, root, stage
        self.path = ROOT.AppendChild("Materials").AppendChild(element.get("name", ""))
        self.made: dict[Any, Any] = {}
        material = UsdShade.Material.Define(stage, self.path)
        shader = next((i for i in element if i.get("name") == "surfaceshader"), None)
        if shader is not None and shader.get("nodename"):
            node = self._node(root, shader.get("nodename", ""))
            material.CreateSurfaceOutput("mtlx").ConnectToSource(node.CreateOutput("out", Sdf.ValueTypeNames.Token))

    def _fail(self, text: str) -> SceneError:
        return SceneError(f"{self.file}: {self.path.name}: {text}")

    def _node(self, scope: Element, name: str) -> Any:
        """The shader of a node of the document, or of one of its graphs, with all that it is connected to."""
        if (scope, name) in self.made:
            return self.made[scope, name]
        element = next((e for e in scope if e.get("name") == name and e.tag not in ("input", "output")), None)
        if element is None:
            raise self._fail(f'there is no node "{name}"')
        prefix = "" if scope is self.root else scope.get("name", "") + "_"
        shader = UsdShade.Shader.Define(self.stage, self.path.AppendChild(prefix + name))
        self.made[scope, name] = shader
        shader.CreateIdAttr(f'ND_{element.tag}_{element.get("type", "")}' if element.tag != "normalmap" else "ND_normalmap")
        for i in element:
            if i.tag in ("input", "parameter"):
                self._input(scope, element, shader, i)
        return shader

    def _input(self, scope: Element, node: Element, shader: Any, i: Element) -> None:
        kind, name = i.get("type", ""), i.get("name", "")
        if kind not in _TYPES:
            return
        made = shader.CreateInput(name, _TYPES[kind])
        if i.get("interfacename"):  # of the graph
            outer = next((e for e in scope if e.tag == "input" and e.get("name") == i.get("interfacename")), None)
            if outer is None:
                raise self._fail(f'the graph "{scope.get("name")}" has no input "{i.get("interfacename")}"')
            scope, i = self.root, outer
        source = self._source(scope, i)
        if source is not None:
            made.ConnectToSource(source.CreateOutput("out", _TYPES[kind]))
        elif i.get("value") is not None:
            self._set(made, kind, i, node)

    def _source(self, scope: Element, i: Element) -> Any:
        if i.get("nodename"):
            return self._node(scope, i.get("nodename", ""))
        if not i.get("nodegraph"):
            return None
        graph = next((e for e in self.root if e.tag == "nodegraph" and e.get("name") == i.get("nodegraph")), None)
        outputs = [] if graph is None else [o for o in graph if o.tag == "output" and i.get("output") in (None, o.get("name"))]
        if graph is None or not outputs:
            raise self._fail(f'there is no output "{i.get("output", "")}" of a graph "{i.get("nodegraph")}"')
        return self._source(graph, outputs[0])

    def _set(self, made: Any, kind: str, i: Element, node: Element) -> None:
        text, space = i.get("value", ""), i.get("colorspace") or node.get("colorspace") or self.root.get("colorspace") or ""
        if kind == "filename":
            prefix = next((e.get("fileprefix") for e in (i, node, self.root) if e.get("fileprefix")), "") or ""
            made.Set(Sdf.AssetPath(os.path.join(os.path.dirname(os.path.abspath(self.file)), prefix + text)))
            made.GetAttr().SetColorSpace(space)
        elif kind in ("string", "boolean"):
            made.Set(text if kind == "string" else text == "true")
        else:
            try:
                numbers = [float(x) for x in text.replace(",", " ").split()]
                if kind.startswith("color") and "srgb" in space:
                    numbers[:3] = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055)**2.4 for x in numbers[:3]]
                made.Set(_VECTORS[kind](*numbers) if kind in _VECTORS else int(numbers[0]) if kind == "integer" else numbers[0])
            except (ValueError, IndexError, TypeError):
                raise self._fail(f'"{text}" is no {kind}') from None
