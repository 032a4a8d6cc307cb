"""Meshes and gprims of USD."""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="usd-core is not installed")

from usd_stages import CAMERA, expect_same, image, image_of_xml, load, write

import etendue as et

SUN = 'def DistantLight "Sun" { float inputs:intensity = 2\nbool inputs:normalize = true }'
CUBE = """def Mesh "Cube" {
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1), (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    %s }
"""


def mesh(folder: Path, text: str, path: str = "/Cube", **options: object) -> dict[str, np.ndarray]:
    return load(folder, CAMERA + SUN + text, **options)[path]["mesh"]


def area(m: dict[str, np.ndarray]) -> float:
    p = m["positions"].astype(float)[m["triangles"]]
    return float(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2)


def test_catmull_clark(tmp_path: Path) -> None:
    """The first level of a cube [Catmull & Clark 1978]: corners at 5/9, edges at 3/4, faces stay."""
    one = mesh(tmp_path, CUBE % "", subdivision=1)
    assert len(one["positions"]) == 26 and len(one["triangles"]) == 48
    rows = np.unique(np.sort(np.abs(one["positions"]).round(5), axis=1), axis=0)
    assert rows == pytest.approx(np.array([[0, 0, 1], [0, 0.75, 0.75], [0.55556, 0.55556, 0.55556]]))
    assert np.einsum("ij,ij->i", one["positions"], one["normals"]).min() > 0.5
    three = mesh(tmp_path, CUBE % "", subdivision=3)
    assert len(three["triangles"]) == 6 * 64 * 2
    # The control mesh, with flat faces.
    assert len(mesh(tmp_path, CUBE % "", subdivision=0)["positions"]) == 8
    assert len(mesh(tmp_path, CUBE % 'uniform token subdivisionScheme = "none"')["positions"]) == 8
    assert len(mesh(tmp_path, CUBE % 'uniform token subdivisionScheme = "bilinear"')["positions"]) == 8


def test_creases(tmp_path: Path) -> None:
    """Sharp edges all around keep a cube a cube, with flat normals; a finite sharpness wears off."""
    edges = "0, 1, 3, 2, 0, 6, 4, 2, 4, 5, 3, 5, 7, 1, 7, 6"
    infinite = mesh(tmp_path, CUBE % f"int[] creaseIndices = [{edges}]\nint[] creaseLengths = [16]\nfloat[] creaseSharpnesses = [10]")
    assert area(infinite) == pytest.approx(24)
    assert np.abs(infinite["normals"]).max(1) == pytest.approx(np.ones(len(infinite["normals"])))
    finite = [area(mesh(tmp_path, CUBE % f"int[] creaseIndices = [{edges}]\nint[] creaseLengths = [16]\n"
                        f"float[] creaseSharpnesses = [{s}]")) for s in (0, 0.5, 1, 2)]
    assert finite[0] == pytest.approx(area(mesh(tmp_path, CUBE % ""))) and sorted(finite) == finite and finite[-1] == pytest.approx(24)
    by_edge = "int[] creaseIndices = [0, 1, 3]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [10, 0]"
    once = "int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [10]"
    assert area(mesh(tmp_path, CUBE % by_edge)) == pytest.approx(area(mesh(tmp_path, CUBE % once)))
    corner = mesh(tmp_path, CUBE % "int[] cornerIndices = [3]\nfloat[] cornerSharpnesses = [10]")
    assert (corner["positions"] == [1, 1, 1]).all(1).any()


def test_boundaries(tmp_path: Path) -> None:
    quad = 'def Mesh "Cube" { int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]\n' \
        'point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]\n%s }'
    assert area(mesh(tmp_path, quad % "")) == pytest.approx(4)
    assert area(mesh(tmp_path, quad % 'token interpolateBoundary = "edgeOnly"')) < 3.5


def test_vertex_and_face_varying_primvars_are_refined(tmp_path: Path) -> None:
    colors = ", ".join(["(0, 0, 1)"] * 4 + ["(0, 1, 0)"] * 4)
    smooth = mesh(tmp_path, CUBE % f'color3f[] primvars:displayColor = [{colors}] ( interpolation = "vertex" )', subdivision=1)
    # The same rules as for points.
    z = smooth["positions"][:, 1]
    assert smooth["colors"].sum(1) == pytest.approx(np.ones(26)) and len(z) == 26
    assert len(np.unique(smooth["colors"].round(4), axis=0)) > 3
    corners = ", ".join(f"({i % 4 / 3}, 0, 0)" for i in range(24))
    linear = mesh(tmp_path, CUBE % f'color3f[] primvars:displayColor = [{corners}] ( interpolation = "faceVarying" )', subdivision=1)
    assert sorted(set(linear["colors"][:, 0].round(3))) == pytest.approx(sorted({0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1}), abs=1e-3)


TETRAHEDRON = """def Mesh "Cube" {
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2]
    point3f[] points = [(1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)]
    uniform token subdivisionScheme = "loop"
    %s }
"""


def test_loop(tmp_path: Path) -> None:
    """The first level of a tetrahedron [Loop 1987]: its points and the middles of its edges, at a quarter and at half of their
    distance from the centre.
    """
    one = mesh(tmp_path, TETRAHEDRON % "", subdivision=1)
    assert len(one["positions"]) == 10 and len(one["triangles"]) == 16
    rows = np.unique(np.sort(np.abs(one["positions"]).round(5), axis=1), axis=0)
    assert rows == pytest.approx(np.array([[0, 0, 0.5], [0.25, 0.25, 0.25]]))
    assert np.einsum("ij,ij->i", one["positions"], one["normals"]).min() > 0.2
    assert len(mesh(tmp_path, TETRAHEDRON % "", subdivision=3)["triangles"]) == 4 * 64
    # Sharp edges all around.
    edges = "int[] creaseIndices = [0, 1, 2, 0, 3, 1, 2, 3]\nint[] creaseLengths = [6, 2]\nfloat[] creaseSharpnesses = "
    sharp = mesh(tmp_path, TETRAHEDRON % (edges + "[10, 10]"))
    assert area(sharp) == pytest.approx(area(mesh(tmp_path, TETRAHEDRON % "", subdivision=0)))
    finite = [area(mesh(tmp_path, TETRAHEDRON % (edges + f"[{s}, {s}]"))) for s in (0, 0.5, 1)]
    assert sorted(finite) == finite and finite[0] == pytest.approx(area(mesh(tmp_path, TETRAHEDRON % "")))
    corners = ", ".join(f"({i % 3}, 0, 0)" for i in range(12))
    linear = mesh(tmp_path, TETRAHEDRON % f'color3f[] primvars:displayColor = [{corners}] ( interpolation = "faceVarying" )',
                  subdivision=1)
    assert set(linear["colors"][:, 0]) == {0, 0.5, 1, 1.5, 2}


def test_loop_keeps_flat_regular_meshes(tmp_path: Path) -> None:
    """The inner points of a regular triangulation stay, as do straight boundaries; values of points are those of positions."""
    n = 4
    points = [(x + y / 2, y * 0.75**0.5, 0) for y in range(n + 1) for x in range(n + 1)]
    at = [(y * (n + 1) + x) for y in range(n) for x in range(n)]
    faces = [c for a in at for c in (a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1)]
    text = f"""def Mesh "Cube" {{ int[] faceVertexCounts = {[3] * (2 * n * n)}
        int[] faceVertexIndices = {faces}
        point3f[] points = {points}
        texCoord2f[] primvars:st = {[p[:2] for p in points]} ( interpolation = "vertex" )
        color3f[] primvars:displayColor = {points} ( interpolation = "vertex" )
        int[] cornerIndices = [0, {n}, {n * (n + 1)}, {(n + 1) ** 2 - 1}]
        float[] cornerSharpnesses = [10, 10, 10, 10]
        uniform token subdivisionScheme = "loop" }}"""
    found = mesh(tmp_path, text, subdivision=2)
    assert area(found) == pytest.approx(n * n * 0.75**0.5)
    np.testing.assert_allclose(found["positions"], found["colors"], atol=1e-5)
    assert found["normals"] == pytest.approx(np.tile([0, 0, 1], (len(found["normals"]), 1)))


POLYGON = """def Mesh "Cube" {
    int[] faceVertexCounts = [5, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7]
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0), (3, 0, 0), (4, 0, 0), (3, 2, 0)]
    uniform token subdivisionScheme = "none"
    %s }
"""


def test_concave_polygons_holes_and_orientation(tmp_path: Path) -> None:
    whole = mesh(tmp_path, POLYGON % "")
    assert len(whole["triangles"]) == 4 and area(whole) == pytest.approx(2.5 + 1)
    assert area(mesh(tmp_path, POLYGON % "int[] holeIndices = [1]")) == pytest.approx(2.5)

    def facing(m: dict[str, np.ndarray]) -> np.ndarray:
        p = m["positions"][m["triangles"]]
        return np.sign(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2])

    assert (facing(whole) == 1).all()
    assert (facing(mesh(tmp_path, POLYGON % 'uniform token orientation = "leftHanded"')) == -1).all()


@pytest.mark.parametrize("plane", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_concave_polygons_in_every_plane(tmp_path: Path, plane: tuple[int, int, int]) -> None:
    for flip in (1, -1):
        points = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]]) * [flip, 1, 1]
        text = ", ".join(str(tuple(float(x) for x in p[list(plane)])) for p in points)
        m = mesh(tmp_path, f"""def Mesh "Cube" {{ int[] faceVertexCounts = [5]
            int[] faceVertexIndices = [0, 1, 2, 3, 4]
            point3f[] points = [{text}]
            uniform token subdivisionScheme = "none" }}""")
        assert area(m) == pytest.approx(2.5)


@pytest.mark.parametrize("interpolation, values, found", [
    ("constant", "(1, 0, 0)", None),
    ("uniform", "(1, 0, 0), (0, 1, 0)", {(1, 0, 0): 5, (0, 1, 0): 3}),
    ("vertex", ", ".join(["(1, 0, 0)"] * 8), {(1, 0, 0): 8}),
    ("varying", ", ".join(["(1, 0, 0)"] * 8), {(1, 0, 0): 8}),
    ("faceVarying", ", ".join(["(1, 0, 0)"] * 4 + ["(0, 1, 0)"] * 4), {(1, 0, 0): 4, (0, 1, 0): 4}),
])
def test_interpolation(tmp_path: Path, interpolation: str, values: str, found: dict[tuple[int, ...], int] | None) -> None:
    text = POLYGON % f'color3f[] primvars:displayColor = [{values}] ( interpolation = "{interpolation}" )'
    m = mesh(tmp_path, text)
    if found is None:
        assert "colors" not in m and load(tmp_path, CAMERA + SUN + text)["/Cube.bsdf.bsdf.reflectance"]["value"] == [1, 0, 0]
    else:
        assert {tuple(int(x) for x in row): int((m["colors"] == row).all(1).sum()) for row in m["colors"]} == found


def test_indexed_primvars_and_inherited_ones(tmp_path: Path) -> None:
    colors = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "uniform" )\n' \
        'int[] primvars:displayColor:indices = [1, 0]'
    m = mesh(tmp_path, POLYGON % colors)
    assert m["colors"][np.argmax(m["positions"][:, 0])].tolist() == [1, 0, 0]
    inherited = 'def Xform "X" { color3f[] primvars:displayColor = [(0, 0, 1)]\n' + POLYGON % "" + "}"
    assert load(tmp_path, CAMERA + SUN + inherited)["/X/Cube.bsdf.bsdf.reflectance"]["value"] == [0, 0, 1]


def test_normals(tmp_path: Path) -> None:
    assert "normals" not in mesh(tmp_path, POLYGON % "")
    up = ", ".join(["(0, 0, 1)"] * 8)
    tilted = ", ".join(["(0.6, 0, 0.8)"] * 8)
    for name in ("normals", "primvars:normals"):
        m = mesh(tmp_path, POLYGON % f'normal3f[] {name} = [{tilted}] ( interpolation = "vertex" )')
        assert m["normals"] == pytest.approx(np.tile([0.6, 0, 0.8], (8, 1)))
    both = f'normal3f[] normals = [{up}] ( interpolation = "vertex" )\n' \
        f'normal3f[] primvars:normals = [{tilted}] ( interpolation = "vertex" )'
    assert mesh(tmp_path, POLYGON % both)["normals"][0] == pytest.approx([0.6, 0, 0.8])


def test_subsets_have_their_own_materials(tmp_path: Path) -> None:
    text = CUBE % """uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(1, 1, 1)]
        uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
        def GeomSubset "Top" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0, 2]
            rel material:binding = </Red> }
        """ + """def Material "Red" { token outputs:surface.connect = </Red/S.outputs:surface>
            def Shader "S" { uniform token info:id = "UsdPreviewSurface"
                token outputs:surface } }"""
    d = load(tmp_path, CAMERA + SUN + text)
    assert len(d["/Cube/Top"]["mesh"]["triangles"]) == 4 and len(d["/Cube"]["mesh"]["triangles"]) == 8
    assert d["/Cube/Top.bsdf.bsdf"]["type"] == "openpbr" and d["/Cube.bsdf.bsdf"]["type"] == "diffuse"
    refined = load(tmp_path, CAMERA + SUN + text.replace('uniform token subdivisionScheme = "none"', ""), subdivision=1)
    assert len(refined["/Cube/Top"]["mesh"]["triangles"]) == 16


@pytest.mark.parametrize("inside, message", [
    ("int[] holeIndices = [2]", "holeIndices has the index 2 of 2 faces"),
    ('color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )',
     "primvars:displayColor has 2 values, but vertex interpolation needs 8"),
    ('color3f[] primvars:displayColor = [(1, 0, 0), (1, 0, 0)] ( interpolation = "uniform" )\n'
     "int[] primvars:displayColor:indices = [0, 2]", "primvars:displayColor has the index 2 of 2 values"),
])
def test_wrong_meshes_are_errors(tmp_path: Path, inside: str, message: str) -> None:
    with pytest.raises(et.SceneError, match=re.escape(f"scene.usda: /Cube: {message}")):
        mesh(tmp_path, POLYGON % inside)


@pytest.mark.parametrize("old, new, message", [
    ("[5, 3]", "[5, 4]", "faceVertexCounts add up to 9, but there are 8 faceVertexIndices"),
    ("5, 6, 7]", "5, 6, 8]", "faceVertexIndices has the index 8 of 8 points"),
    ("(4, 0, 0)", "(inf, 0, 0)", "points has values that are not finite"),
])
def test_wrong_topologies_are_errors(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(et.SceneError, match=re.escape(f"scene.usda: /Cube: {message}")):
        mesh(tmp_path, (POLYGON % "").replace(old, new))


TURN = {"X": '<rotate y="1" angle="90"/>', "Y": '<rotate x="1" angle="-90"/>', "Z": ""}
GREY = '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>'
SKY = 'def DomeLight "Sky" {}\n'
LIGHTS_XML = '<emitter type="directional"><rgb name="irradiance" value="2, 2, 2"/><vector name="direction" x="0" y="0" z="-1"/>' \
    '</emitter><emitter type="constant"><rgb name="radiance" value="1, 1, 1"/></emitter>'


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("text, xml", [
    ('def Cylinder "C" { double radius = 0.5\ndouble height = 2.5\n%s }',
     '<shape type="cylinder"><float name="radius" value="0.5"/><point name="p0" x="0" y="0" z="-1.25"/>'
     '<point name="p1" x="0" y="0" z="1.25"/><transform name="to_world">{0}</transform>{1}</shape>'
     '<shape type="disk"><transform name="to_world"><scale value="0.5"/><translate z="1.25"/>{0}</transform>{1}</shape>'
     '<shape type="disk"><transform name="to_world"><scale value="0.5"/><translate z="-1.25"/>{0}</transform>{1}</shape>'),
])
def test_gprims_along_axes(tmp_path: Path, axis: str, text: str, xml: str) -> None:
    grey = f'uniform token axis = "{axis}"\ncolor3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]'
    seen = image(load(tmp_path, CAMERA + SUN + SKY + text % grey), 32)
    expected = image_of_xml(xml.format(TURN[axis], GREY) + LIGHTS_XML, 32)
    assert np.abs(seen - expected).mean() < 0.02 * expected.mean()


def test_planes_are_as_wide_as_usd_says(tmp_path: Path) -> None:
    for axis, size in (("X", (0, 3, 1)), ("Y", (1, 0, 3)), ("Z", (1, 3, 0))):
        d = load(tmp_path, CAMERA + SKY + f'def Plane "P" {{ double width = 1\ndouble length = 3\nuniform token axis = "{axis}" }}')
        lo, hi = d.build().bounds
        assert np.subtract(hi, lo) == pytest.approx(size, abs=1e-3)


@pytest.mark.parametrize("text, bounds, surface", [
    ('def Cone "C" { double radius = 1\ndouble height = 2 }', (2, 2, 2), np.pi * np.sqrt(5)),
    ('def Capsule "C" { double radius = 0.5\ndouble height = 1 }', (1, 1, 2), 2 * np.pi),
    ('def Cylinder_1 "C" { double radiusBottom = 2\ndouble radiusTop = 1\ndouble height = 1 }', (4, 4, 1), np.pi * 3 * np.sqrt(2)),
])
def test_revolved_gprims(tmp_path: Path, text: str, bounds: tuple[float, ...], surface: float) -> None:
    d = load(tmp_path, CAMERA + SKY + text)
    lo, hi = d.build().bounds
    assert np.subtract(hi, lo) == pytest.approx(bounds, rel=1e-3)
    m = d["/C"]["mesh"]
    assert area(m) == pytest.approx(surface, rel=2e-3)
    p = m["positions"][m["triangles"]]
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert (np.einsum("ti,ti->t", flat, m["normals"][m["triangles"]].sum(1)) > 0).all()


def test_spheres_and_cubes(tmp_path: Path) -> None:
    text = 'def Sphere "S" { double radius = 0.75 }\ndef Cube "C" { double size = 0.5\ndouble3 xformOp:translate = (1.5, 0, 0)\n' \
        'uniform token[] xformOpOrder = ["xformOp:translate"] }'
    xml = '<shape type="sphere"><float name="radius" value="0.75"/></shape>' \
        '<shape type="cube"><transform name="to_world"><scale value="0.25"/><translate x="1.5"/></transform></shape>'
    expect_same(image(load(tmp_path, CAMERA + SUN + SKY + text)), image_of_xml(xml + LIGHTS_XML), 1e-3)


def test_schemes_that_are_not_supported_are_warnings(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="/Cube: the scheme loop is for triangles: the control mesh is rendered") as notes:
        d = et.load(write(tmp_path, CAMERA + SUN + CUBE % 'uniform token subdivisionScheme = "loop"'))
    assert len(d["/Cube"]["mesh"]["positions"]) == 8
    # The description keeps the warnings.
    assert d.warnings == [str(n.message) for n in notes] and d.file == str(tmp_path / "scene.usda")
