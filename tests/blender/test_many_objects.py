"""A scene of four hundred objects of all kinds: its export, and the image against Cycles."""

import math
import sys
import time

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

_SECONDS = 30
"""A generous limit of the export, which takes about one: it must not grow with the square of the number of objects."""


def materials(studio):
    made = []
    for i in range(12):
        color = tuple(0.2 + 0.6 * ((i * k) % 7) / 6 for k in (1, 2, 3))
        kind = ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfAnisotropic")[i % 3]
        settings = {"Base_Color" if i % 3 == 1 else "Color": color, "Roughness": 0.0 if i % 3 == 0 else 0.5}
        made.append(studio.material(kind, f"Paint {i}", **settings)[0])
    return made


def place(i, count):
    """Points of a spiral on the ground."""
    r, angle = 3.2 * math.sqrt((i + 0.5) / count), 2.399963 * i
    return Vector((r * math.cos(angle), r * math.sin(angle), 0.12))


def meshes(studio, paints):
    """Boxes, balls, cones and rings of which each has a mesh of its own, and some have modifiers."""
    makers = [lambda: bpy.ops.mesh.primitive_cube_add(size=0.2), lambda: bpy.ops.mesh.primitive_ico_sphere_add(radius=0.12),
              lambda: bpy.ops.mesh.primitive_cone_add(radius1=0.12, depth=0.24),
              lambda: bpy.ops.mesh.primitive_torus_add(major_radius=0.1, minor_radius=0.03, major_segments=12, minor_segments=6)]
    parts = []
    for maker in makers:
        maker()
        parts.append(bpy.context.active_object.data)
        bpy.data.objects.remove(bpy.context.active_object)
    for i in range(200):
        thing = studio._add(f"Thing {i}", parts[i % 4].copy())
        thing.matrix_world = Matrix.Translation(place(i, 200)) @ Matrix.Rotation(i, 4, "Z")
        thing.data.materials.append(paints[i % len(paints)])
        if i % 10 == 0:
            thing.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
        elif i % 10 == 5:
            array = thing.modifiers.new("Array", "ARRAY")
            array.count, array.relative_offset_displace = 2, (0, 0, 1.1)


def shared(studio, paints):
    """Objects with one mesh, with one text, and with curves."""
    bpy.ops.mesh.primitive_monkey_add(size=0.2)
    head = bpy.context.active_object
    head.data.materials.append(paints[1])
    head.location = (0, 0, 0.8)
    for i in range(120):
        copy = studio._add(f"Head {i}", head.data)
        copy.matrix_world = Matrix.Translation(place(i, 120) + Vector((0, 0, 0.45))) @ Matrix.Rotation(2 * i, 4, "Z")
    text = bpy.data.curves.new("Text", "FONT")
    text.body, text.size, text.extrude = "et", 0.25, 0.02
    text.materials.append(paints[2])
    for i in range(20):
        studio._add(f"Text {i}", text).location = place(i, 20) + Vector((0, 0, 0.7))


def collections(studio, paints):
    """Forty copies of a collection of two objects, of which one is hidden; hidden objects; a hidden collection."""
    pair = bpy.data.collections.new("Pair")
    for i, name in enumerate(("Seen", "Hidden within")):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.07 + 0.3 * i, segments=12, ring_count=8)
        ball = bpy.context.active_object
        ball.name = name
        ball.data.materials.append(paints[4])
        studio.scene.collection.objects.unlink(ball)
        pair.objects.link(ball)
        ball.hide_render = i == 1
    for i in range(40):
        empty = studio._add(f"Pair {i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", pair
        empty.location = place(i, 40) + Vector((0, 0, 0.25))
    cube = bpy.data.meshes["Cube"] if "Cube" in bpy.data.meshes else bpy.data.meshes[0]
    out = bpy.data.collections.new("Out")
    studio.scene.collection.children.link(out)
    out.hide_render = True
    for i in range(20):
        thing = bpy.data.objects.new(f"Not seen {i}", cube)
        (out if i % 2 else studio.scene.collection).objects.link(thing)
        thing.location, thing.scale, thing.hide_render = (0, 0, 1), (9, 9, 9), i % 2 == 0


@pytest.fixture
def crowd(studio):
    paints = materials(studio)
    meshes(studio, paints)
    shared(studio, paints)
    collections(studio, paints)
    studio.plane(material=studio.material("ShaderNodeBsdfDiffuse", "Ground", Color=(0.4, 0.4, 0.4))[0])
    studio.light("SUN", energy=1, angle=0, at=(1, -2, 3), name="Sun")
    studio.light("AREA", energy=60, size=1, at=(-2, -1, 3), name="Area")
    studio.light("POINT", energy=40, shadow_soft_size=0, at=(1.5, 1, 2), name="Point")
    studio.light("SPOT", energy=100, shadow_soft_size=0, at=(0, -3, 3), name="Spot")
    studio.world((0.1, 0.15, 0.2))
    studio.camera((0, -5, 3.5), (0, 0, 0))
    return studio


def test_the_export_of_many_objects(crowd, monkeypatch):
    """A group for each mesh that occurs several times; what is hidden in renderings is left out."""
    assert len(crowd.scene.objects) >= 400
    seen = []
    monkeypatch.setattr(sys.modules["etendue_addon"].EtendueEngine, "_trace", lambda self, found, _: seen.append(found))
    start = time.perf_counter()
    crowd.scene.render.engine = "ETENDUE"
    bpy.ops.render.render()
    assert time.perf_counter() - start < _SECONDS
    kinds = [v["type"] for v in seen[0].values() if isinstance(v, dict)]
    assert kinds.count("instance") == 121 + 40 and kinds.count("shapegroup") == 2
    assert kinds.count("mesh") == 200 + 20 + 1  # Blender makes a mesh of each text
    assert not [name for name in seen[0] if "Hidden" in name or "Not_seen" in name]


def test_many_objects_look_as_in_cycles(crowd):
    crowd.scene.cycles.samples = crowd.scene.etendue.samples = 64
    ours, reference = crowd.render(), crowd.render("CYCLES")
    assert ours.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=0.02)
    ours, reference = (image.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3)) for image in (ours, reference))
    assert np.abs(ours - reference).max() < 0.05 * reference.max()
