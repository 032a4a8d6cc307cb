"""Geometry, textures and cameras against Cycles, pixel by pixel where the shapes are the same."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector


def blocks(image):
    """Means of 8 x 8 blocks, which are smooth enough to be compared."""
    height, width = image.shape[:2]
    return image.reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3))


def assert_same(studio, tolerance=0.035):
    """The filters of the two renderers differ, and so do blocks with edges: by up to 3 %."""
    ours, reference = blocks(studio.render()), blocks(studio.render("CYCLES"))
    assert reference.std() > 0.01
    assert np.abs(ours - reference).max() < tolerance * reference.max(), np.abs(ours - reference).max() / reference.max()


def diffuse(studio, color=(0.7, 0.5, 0.3), name="Material"):
    return studio.material("ShaderNodeBsdfDiffuse", name, Color=color)[0]


def lamps(studio):
    studio.light("SUN", energy=2, angle=0, at=(1, -2, 3))
    studio.world((0.2, 0.25, 0.3))


def description(studio):
    """The description of the scene as it is evaluated in the viewport."""
    from etendue_addon.scene import SceneReader

    return SceneReader(bpy.context.evaluated_depsgraph_get(), studio.folder).read()


def test_modifiers_smooth_and_flat_faces(studio):
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(-1, 0, 0.5))
    cube = studio._finish("Cube", diffuse(studio))
    cube.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    studio.sphere(diffuse(studio), at=(1, 0, 0), radius=0.7)
    bpy.ops.object.shade_flat()
    studio.plane(material=diffuse(studio), at=(0, 0, -1))
    lamps(studio)
    assert_same(studio)


def test_custom_normals(studio):
    plane = studio.plane(3, diffuse(studio))
    plane.data.normals_split_custom_set([Vector((x, y, 6)).normalized() for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    # Not the world: in Cycles its light comes through the plane from behind.
    studio.light("SUN", energy=2, angle=0, at=(1, -2, 3))
    studio.plane(material=diffuse(studio), at=(0, 0, -0.01))
    assert_same(studio)


def test_collections_are_instances_of_a_shapegroup(studio):
    bpy.ops.mesh.primitive_cone_add(radius1=0.3, depth=0.8, location=(0.2, 0, 0.4))
    cone = studio._finish("Cone", diffuse(studio))
    parts = bpy.data.collections.new("Parts")
    studio.scene.collection.objects.unlink(cone)
    parts.objects.link(cone)
    for i in range(4):
        empty = studio._add(f"Copy {i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", parts
        empty.matrix_world = Matrix.Translation((i - 1.5, 0.2 * i, 0)) @ Matrix.Rotation(i, 4, "Z")
        empty.scale[0] = -1 if i == 2 else 1
    studio.plane(material=diffuse(studio))
    lamps(studio)
    assert_same(studio)
    kinds = [v["type"] for v in description(studio).values() if isinstance(v, dict)]
    assert kinds.count("instance") == 4 and kinds.count("shapegroup") == 1


def test_instances_of_geometry_nodes(studio):
    tree = bpy.data.node_groups.new("Rows", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    points, cube, copies = (tree.nodes.new(f"GeometryNode{n}") for n in ("MeshGrid", "MeshCube", "InstanceOnPoints"))
    points.inputs["Size X"].default_value, points.inputs["Size Y"].default_value = 3, 2
    cube.inputs["Size"].default_value = (0.4, 0.3, 0.5)
    tree.links.new(points.outputs["Mesh"], copies.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    studio.plane().modifiers.new("Rows", "NODES").node_group = tree
    studio.plane(material=diffuse(studio))
    lamps(studio)
    assert_same(studio)
    assert [v["type"] for v in description(studio).values() if isinstance(v, dict)].count("instance") == 9


def test_emitters_of_particles_may_be_hidden(studio, capfd):
    """The particles are seen, the object from which they come is not."""
    ball = studio.sphere(diffuse(studio), at=(0, 0, 9), radius=0.2, name="Ball")
    source = studio.plane(2, diffuse(studio), "Source", at=(0, 0, 1))
    source.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = source.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.physics_type = 20, 0, 1, "NO"
    settings.render_type, settings.instance_object = "OBJECT", ball
    source.show_instancer_for_render = source.show_instancer_for_viewport = False
    studio.scene.frame_set(5)
    studio.plane(material=diffuse(studio))
    studio.world()
    assert not any(name.startswith("Source") for name in description(studio))
    assert_same(studio)


def test_materials_and_worlds_of_a_view_layer(studio):
    """They replace those of the objects and of the scene."""
    studio.sphere(diffuse(studio), at=(0, 0, 0.5), radius=0.5)
    studio.plane(material=diffuse(studio))
    layer = bpy.context.view_layer
    layer.material_override, _, _ = studio.material("ShaderNodeBsdfDiffuse", "Clay", Color=(0.1, 0.6, 0.2))
    studio.world((1, 0.2, 0.1))
    if hasattr(layer, "world_override"):
        layer.world_override = studio.scene.world
        studio.world((0, 0, 1))
    assert_same(studio)


def test_emitting_instances_are_meshes(studio):
    emitter, _, _ = studio.material("ShaderNodeEmission", "Lamp", Strength=5.0)
    first = studio.sphere(emitter, at=(-1, 0, 1), radius=0.2)
    second = studio._add("Second", first.data)
    second.location = (1, 0, 0.5)
    studio.plane(material=diffuse(studio))
    assert_same(studio)


def textured(studio, settings, mapping=None, kind="ShaderNodeTexImage"):
    """A plane whose colour is an image with four colours and a gradient."""
    material, tree, node = studio.material("ShaderNodeBsdfDiffuse")
    texture = tree.nodes.new(kind)
    if kind == "ShaderNodeTexImage":
        texture.image = studio.image(lambda u, v: (u, v, 0.8 if u < 0.5 else 0.2))
    for key, value in settings.items():
        setattr(texture, key, value)
    tree.links.new(texture.outputs["Color"], node.inputs["Color"])
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    vector = coordinates.outputs["UV"]
    if mapping:
        place = tree.nodes.new("ShaderNodeMapping")
        place.vector_type = mapping[0]
        for socket, value in zip(place.inputs[1:], mapping[1:]):
            socket.default_value = value
        tree.links.new(vector, place.inputs["Vector"])
        vector = place.outputs[0]
    tree.links.new(vector, texture.inputs["Vector"])
    studio.plane(3, material)
    studio.world()
    return texture


MAPPINGS = {
    "none": None,
    "point": ("POINT", (0.1, 0.3, 0), (0, 0, 0.5), (2, 1.5, 1)),
    "texture": ("TEXTURE", (0.1, 0.3, 0), (0, 0, 0.5), (0.5, 0.7, 1)),
}


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND"])
@pytest.mark.parametrize("mapping", MAPPINGS)
def test_images_lie_where_they_do_in_cycles(studio, mapping, extension):
    textured(studio, {"extension": extension}, MAPPINGS[mapping])
    assert_same(studio)


@pytest.mark.parametrize("source", ["packed", "generated", "file", "float file"])
def test_images_are_read_wherever_they_are(studio, source):
    texture = textured(studio, {})
    if source == "generated":
        values = list(texture.image.pixels)
        texture.image = bpy.data.images.new("Other", 32, 32)
        texture.image.pixels.foreach_set(values)
    elif source != "packed":
        file = studio.folder / ("image.exr" if source == "float file" else "image.png")
        image = texture.image
        if source == "float file":
            image = studio.image(lambda u, v: (u, v, 0.2), is_float=True)
            image.file_format = "OPEN_EXR"
        image.save(filepath=str(file))
        texture.image = bpy.data.images.load(str(file))
    assert_same(studio)


def test_checkerboards(studio):
    textured(studio, {}, kind="ShaderNodeTexChecker")
    assert_same(studio)


def test_second_uv_maps(studio):
    texture = textured(studio, {})
    mesh = studio.scene.objects["Plane"].data
    other = mesh.uv_layers.new(name="Other")
    for i, (u, v) in enumerate([(1, 0), (1, 1), (0, 1), (0, 0)]):
        other.uv[i].vector = (u, v)
    tree = texture.id_data
    node = tree.nodes.new("ShaderNodeUVMap")
    node.uv_map = "Other"
    tree.links.new(node.outputs[0], texture.inputs["Vector"])
    assert mesh.uv_layers[0].active_render
    assert_same(studio)


@pytest.mark.parametrize("domain, kind", [("POINT", "FLOAT_COLOR"), ("CORNER", "BYTE_COLOR")])
def test_colour_attributes(studio, domain, kind):
    material, tree, node = studio.material("ShaderNodeBsdfDiffuse")
    attribute = tree.nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = "Paint"
    tree.links.new(attribute.outputs["Color"], node.inputs["Color"])
    mesh = studio.plane(3, material).data
    paint = mesh.color_attributes.new("Paint", kind, domain)
    for item, color in zip(paint.data, [(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (0.5, 0.5, 0.5, 1)]):
        item.color = color
    studio.world()
    assert_same(studio)


def bumpy(studio, height):
    material, tree, node = studio.material("ShaderNodeBsdfDiffuse", Color=(0.7, 0.7, 0.7))
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = height
    studio.plane(3, material)
    lamps(studio)
    return tree, node, texture


@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_normal_maps(studio, strength):
    tilted = studio.image(lambda u, v: (0.5 + 0.2 * (u > 0.5), 0.5 - 0.2 * (v > 0.5), 0.95), color=False)
    tree, node, texture = bumpy(studio, tilted)
    normal = tree.nodes.new("ShaderNodeNormalMap")
    normal.inputs["Strength"].default_value = strength
    tree.links.new(texture.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], node.inputs["Normal"])
    assert_same(studio, 0.04)


def test_bumps(studio):
    waves = studio.image(lambda u, v: (0.5 + 0.5 * math.sin(6 * math.pi * u),) * 3, 128, 8, is_float=True, color=False)
    tree, node, texture = bumpy(studio, waves)
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 1, 0.1
    tree.links.new(texture.outputs["Color"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    assert_same(studio, 0.04)


CAMERAS = {
    "lens": dict(lens=28),
    "horizontal": dict(sensor_fit="HORIZONTAL", sensor_width=24),
    "vertical": dict(sensor_fit="VERTICAL", sensor_height=20),
    "shift": dict(shift_x=0.2, shift_y=-0.1),
    "orthographic": dict(type="ORTHO", ortho_scale=5, shift_x=0.1),
}


def posts(studio):
    for i, color in enumerate([(0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)]):
        studio.sphere(diffuse(studio, color, f"Post {i}"), at=(i - 1, i, 0.4), radius=0.4)
    studio.plane(material=diffuse(studio))
    lamps(studio)


@pytest.mark.parametrize("name", CAMERAS)
def test_cameras(studio, name):
    posts(studio)
    for key, value in CAMERAS[name].items():
        setattr(studio.cam.data, key, value)
    assert_same(studio, 0.04)


@pytest.mark.parametrize("scale", [1, 3])
def test_depth_of_field(studio, scale):
    """The scale of a camera moves no focus."""
    posts(studio)
    studio.cam.scale = (scale,) * 3
    dof = studio.cam.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_object = True, 0.05, studio.scene.objects["Sphere.001"]
    assert_same(studio, 0.04)


def test_orthographic_views_of_pixels_that_are_not_square(studio):
    posts(studio)
    studio.cam.data.type, studio.cam.data.ortho_scale = "ORTHO", 5
    studio.scene.render.pixel_aspect_y = 2
    assert_same(studio, 0.06)


def test_upright_images_and_pixels_that_are_not_square(studio):
    posts(studio)
    studio.scene.render.resolution_x, studio.scene.render.resolution_y = 64, 160
    studio.scene.render.resolution_percentage, studio.scene.render.pixel_aspect_x = 50, 2
    assert studio.render().shape == (80, 32, 3)
    assert_same(studio)


def test_borders(studio):
    posts(studio)
    render = studio.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1
    assert studio.render().shape == (24, 32, 3)
    assert_same(studio)


@pytest.mark.parametrize("crops", [False, True])
@pytest.mark.parametrize("size, percentage, border", [
    ((100, 100), 29, None), ((1000, 70), 7, None), ((10, 10), 100, (0.1, 0.7, 0.3, 0.9)), ((97, 61), 57, (0.2, 0.6, 0.05, 0.8)),
])
def test_images_have_the_size_that_blender_gives_them(studio, size, percentage, border, crops):
    """Its integers are those of its own arithmetic."""
    posts(studio)
    render = studio.scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = percentage
    if border:
        render.use_border, render.use_crop_to_border = True, crops
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = border
    studio.scene.etendue.samples = studio.scene.cycles.samples = 4
    ours = studio.render()
    reference = studio.render("CYCLES")
    assert ours.shape == reference.shape and ours.mean() == pytest.approx(reference.mean(), rel=0.15)
    assert ((ours.sum(axis=2) > 0) == (reference.sum(axis=2) > 0)).mean() > 0.98


def test_texts_that_share_their_data_have_modifiers_of_their_own(studio):
    text = bpy.data.curves.new("Text", "FONT")
    text.body, text.extrude = "O", 0.1
    text.materials.append(diffuse(studio))
    for x, copies in ((-1.5, 1), (0.2, 3)):
        thing = studio._add("Letter", text)
        thing.location = (x, 0, 0.1)
        if copies > 1:
            thing.modifiers.new("Array", "ARRAY").count = copies
    studio.plane(material=diffuse(studio, (0.1, 0.1, 0.1), "Ground"))
    lamps(studio)
    assert_same(studio, 0.05)


@pytest.mark.parametrize("kind", ["text", "curve", "surface", "metaball"])
def test_what_becomes_a_mesh_is_there_once(studio, kind):
    """Blender's graph has it as what it is, and as a mesh."""
    {"text": bpy.ops.object.text_add, "curve": bpy.ops.curve.primitive_bezier_circle_add,
     "surface": bpy.ops.surface.primitive_nurbs_surface_sphere_add, "metaball": bpy.ops.object.metaball_add}[kind]()
    thing = studio._finish("Thing", diffuse(studio))
    if kind == "curve":
        thing.data.dimensions, thing.data.fill_mode = "2D", "BOTH"
    kinds = [v["type"] for v in description(studio).values() if isinstance(v, dict)]
    assert kinds.count("mesh") == 1 and "instance" not in kinds
    if kind == "metaball":  # one surface of both
        bpy.ops.object.metaball_add(radius=1.5, location=(1.5, 0, 0))
        bpy.context.active_object.name = "Thing.001"
        kinds = [v["type"] for v in description(studio).values() if isinstance(v, dict)]
        assert kinds.count("mesh") == 1
    lamps(studio)
    assert studio.ratio() == pytest.approx(1, abs=0.03)


def test_materials_of_geometry_nodes(studio):
    tree = bpy.data.node_groups.new("Red", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid, cube, paint, copies = (tree.nodes.new(f"GeometryNode{n}") for n in ("MeshGrid", "MeshCube", "SetMaterial", "InstanceOnPoints"))
    paint.inputs["Material"].default_value = diffuse(studio, (0.9, 0.02, 0.02), "Red")
    cube.inputs["Size"].default_value = (0.4, 0.3, 0.5)
    grid.inputs["Size X"].default_value = 3
    tree.links.new(grid.outputs["Mesh"], copies.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
    tree.links.new(paint.outputs[0], copies.inputs["Instance"])
    tree.links.new(copies.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    studio.plane(material=diffuse(studio, (0.1, 0.9, 0.1), "Green")).modifiers.new("Red", "NODES").node_group = tree
    studio.plane(material=diffuse(studio, name="Ground"))
    lamps(studio)
    assert_same(studio)


def test_a_scene_without_a_camera_is_refused(studio):
    studio.scene.camera = None
    with pytest.raises(RuntimeError, match="camera"):
        studio.render()
