"""Each light, and the world, against Cycles: means of a diffuse plane within 2 %."""

import math
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from studio import looking

LIGHTS = {
    "point": dict(kind="POINT", energy=100, shadow_soft_size=0),
    "sphere": dict(kind="POINT", energy=100, shadow_soft_size=0.3, use_soft_falloff=False),
    "sun": dict(kind="SUN", energy=3, angle=0, at=(1, 1, 3)),
    "spot": dict(kind="SPOT", energy=100, shadow_soft_size=0, spot_size=0.8, spot_blend=0),
    "soft spot": dict(kind="SPOT", energy=100, shadow_soft_size=0, spot_size=0.8, spot_blend=0.8),
    "square": dict(kind="AREA", energy=100, shape="SQUARE", size=1),
    "rectangle": dict(kind="AREA", energy=100, shape="RECTANGLE", size=1, size_y=0.3),
    "disk": dict(kind="AREA", energy=100, shape="DISK", size=1, at=(1, 0, 2)),
    "ellipse": dict(kind="AREA", energy=100, shape="ELLIPSE", size=1, size_y=0.3),
    "exposure": dict(kind="POINT", energy=10, shadow_soft_size=0, exposure=2.5),
    "temperature": dict(kind="POINT", energy=100, shadow_soft_size=0, use_temperature=True, temperature=3000),
    "not normalized": dict(kind="AREA", energy=10, shape="SQUARE", size=0.5, normalize=False),
    "colour": dict(kind="POINT", energy=100, shadow_soft_size=0, color=(1, 0.5, 0.1)),
}


def gray(studio):
    return studio.material("ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5))[0]


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_have_the_power_that_cycles_gives_them(studio, name):
    studio.plane(material=gray(studio))
    studio.light(**LIGHTS[name])
    ours, reference = studio.render(), studio.render("CYCLES")
    assert ours.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=0.02)


def test_strengths_of_a_lights_nodes_are_factors(studio):
    studio.plane(material=gray(studio))
    light = studio.light("POINT", energy=100, shadow_soft_size=0)
    light.use_nodes = True
    node = next(n for n in light.node_tree.nodes if n.bl_idname == "ShaderNodeEmission")
    node.inputs["Strength"].default_value, node.inputs["Color"].default_value = 2, (1, 0.5, 0.2, 1)
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_scaled_area_lights_keep_their_power(studio):
    studio.plane(material=gray(studio))
    studio.light("AREA", energy=100, size=0.5)
    light = studio.scene.objects["Light"]
    light.matrix_world = light.matrix_world @ Matrix.Diagonal((2, 1, 1, 1))
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_emitting_meshes(studio):
    emitter, _, _ = studio.material("ShaderNodeEmission", "Lamp", Color=(1, 0.8, 0.5), Strength=20.0)
    studio.plane(material=gray(studio))
    studio.sphere(emitter, at=(0, 0, 1.5), radius=0.2)
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_portals_emit_nothing(studio):
    studio.plane(material=gray(studio))
    studio.world((0.2, 0.5, 1), 1.5)
    studio.light("AREA", energy=1000, size=1).cycles.is_portal = True
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_constant_worlds(studio):
    studio.plane(material=gray(studio))
    studio.world((0.2, 0.5, 1), 1.5)
    assert studio.ratio() == pytest.approx(1, abs=0.02)


SKIES = [kind for kind in ("PREETHAM", "HOSEK_WILKIE", "NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING")
         if kind in bpy.types.ShaderNodeTexSky.bl_rna.properties["sky_type"].enum_items]


@pytest.fixture
def coarse(monkeypatch):
    """Images of worlds with fewer pixels, for shorter tests."""
    module = sys.modules["etendue_addon.panorama"]
    monkeypatch.setattr(module, "_WIDTH", 512)
    monkeypatch.setattr(module, "_WIDEST_SKY", 2048)


def sky(studio, kind, **settings):
    """A world that is a sky; returns its tree, background and node."""
    tree, background = studio.world(strength=1.0 if kind in ("PREETHAM", "HOSEK_WILKIE") else 0.05)
    node = tree.nodes.new("ShaderNodeTexSky")
    node.sky_type = kind
    for key, value in settings.items():
        setattr(node, key, value)
    tree.links.new(node.outputs[0], background.inputs["Color"])
    return tree, background, node


def assert_blocks(studio, tolerance):
    """Means of all the image, and of 8 x 8 blocks, which are not exact at edges."""
    ours, reference = studio.render(), studio.render("CYCLES")
    assert ours.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=0.02)
    ours, reference = (image.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3)) for image in (ours, reference))
    assert np.abs(ours - reference).max() < tolerance * reference.max()


@pytest.mark.parametrize("kind", SKIES)
def test_skies(studio, kind):
    """A ball on a plane, with its shadow where there is a sun; and the sky itself."""
    sky(studio, kind, sun_elevation=0.7, sun_rotation=0.5, **(
        dict(turbidity=3, sun_direction=(0.5, 0.3, 0.8)) if kind in ("PREETHAM", "HOSEK_WILKIE") else {}))
    studio.plane(material=gray(studio))
    studio.sphere(gray(studio), at=(0, 0, 0.5), radius=0.5)
    studio.scene.cycles.samples = studio.scene.etendue.samples = 64
    assert_blocks(studio, 0.05)
    studio.cam.matrix_world = looking((0, 0, 2), (-1, 1, 2.5))
    studio.scene.cycles.samples = studio.scene.etendue.samples = 16
    assert_blocks(studio, 0.02)


@pytest.mark.parametrize("degrees", [0.3, 10])
def test_the_sun_of_a_sky_has_its_size_and_intensity(studio, coarse, degrees):
    """The shadow of a wall has no edge in the image, but a penumbra of 10 degrees if the sun is as large as that."""
    sky(studio, SKIES[-1], sun_elevation=0.6, sun_size=math.radians(degrees), sun_intensity=0.5)
    studio.plane(material=gray(studio))
    studio.sphere(gray(studio), at=(0.5, 0, 0.8), radius=0.5)
    studio.scene.cycles.samples = studio.scene.etendue.samples = 64
    assert_blocks(studio, 0.05)


def mixed(tree, background):
    """A mix of a gradient and a colour, turned and scaled."""
    shader, second = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBackground")
    gradient, coordinates, mapping = (tree.nodes.new(f"ShaderNode{n}") for n in ("TexGradient", "TexCoord", "Mapping"))
    mapping.inputs["Rotation"].default_value = (0.3, 0.4, 0.5)
    mapping.inputs["Scale"].default_value = (1, 0.5, 2)
    second.inputs["Color"].default_value, second.inputs["Strength"].default_value = (0.1, 0.3, 1, 1), 2
    shader.inputs[0].default_value = 0.3
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs[0], shader.inputs[1])
    tree.links.new(second.outputs[0], shader.inputs[2])
    tree.links.new(shader.outputs[0], tree.nodes["World Output"].inputs["Surface"])


def noisy(tree, background):
    """A texture in the strength, through a curve and a group."""
    group = bpy.data.node_groups.new("Clouds", "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    texture, ramp, end = (group.nodes.new(n) for n in ("ShaderNodeTexNoise", "ShaderNodeValToRGB", "NodeGroupOutput"))
    texture.inputs["Scale"].default_value = 2
    ramp.color_ramp.elements[0].position = 0.4
    group.links.new(texture.outputs[0], ramp.inputs[0])
    group.links.new(ramp.outputs[0], end.inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], background.inputs["Strength"])


@pytest.mark.parametrize("build", [mixed, noisy])
def test_worlds_of_any_nodes(studio, coarse, build):
    build(*studio.world((1, 0.7, 0.4)))
    studio.plane(3, material=gray(studio))
    studio.sphere(gray(studio), at=(0, 0, 0.5), radius=0.5)
    studio.scene.cycles.samples = studio.scene.etendue.samples = 64
    assert_blocks(studio, 0.03)


def test_images_of_worlds_are_made_once_for_the_same_nodes(studio, monkeypatch):
    """Until a number in a node, a ramp, or a group changes; the place of a node in the editor is none."""
    module, made = sys.modules["etendue_addon.panorama"], []
    monkeypatch.setattr(module, "_render", lambda *_: made.append(None))
    monkeypatch.setattr(module, "_images", {})
    monkeypatch.setattr(module, "_KEPT", 2)
    tree, background = studio.world()
    noisy(tree, background)
    studio.plane(material=gray(studio))
    studio.light(**LIGHTS["sun"])
    group = bpy.data.node_groups["Clouds"]
    texture, ramp = (next(n for n in group.nodes if n.bl_idname == f"ShaderNode{k}") for k in ("TexNoise", "ValToRGB"))

    def change(thing, name, value):
        setattr(thing, name, value)
        studio.render()
        return len(made)

    studio.render()
    assert len(made) == 1
    assert change(background, "location", (7, 7)) == 1
    assert change(background.inputs["Color"], "default_value", (1, 0, 0, 1)) == 2
    assert change(ramp.color_ramp.elements[0], "position", 0.3) == 3
    assert change(ramp.color_ramp.elements[0], "color", (0.1, 0.2, 0.3, 1)) == 4
    assert change(texture, "noise_dimensions", "4D") == 5
    assert change(texture.inputs["Scale"], "default_value", 3) == 6
    group.links.new(texture.outputs[1], ramp.inputs[0])
    studio.render()
    assert len(made) == 7 and len(module._images) == 2
    assert change(texture.inputs["Scale"], "default_value", 2) == 8
    assert change(texture.inputs["Scale"], "default_value", 3) == 8


def test_images_of_worlds_are_made_again_for_changed_pixels(studio, monkeypatch):
    """Of generated images, and of packed ones."""
    module, made = sys.modules["etendue_addon.panorama"], []
    monkeypatch.setattr(module, "_render", lambda *_: made.append(None))
    monkeypatch.setattr(module, "_images", {})
    tree, background = studio.world()
    environment = tree.nodes.new("ShaderNodeTexEnvironment")
    environment.projection = "MIRROR_BALL"
    environment.image = image = bpy.data.images.new("Grid", 8, 8)
    tree.links.new(environment.outputs[0], background.inputs["Color"])
    studio.plane(material=gray(studio))
    studio.light(**LIGHTS["sun"])
    studio.render()
    assert len(made) == 1
    image.generated_color = (0.5, 0.2, 0.1, 1)
    studio.render()
    assert len(made) == 2
    for value, count in ((0.25, 3), (0.25, 3), (0.75, 4)):
        image.pixels.foreach_set(np.full(4 * 8 * 8, value, np.float32))
        image.pack()
        studio.render()
        assert len(made) == count


def test_images_of_worlds_are_deleted_with_the_add_on(studio, coarse):
    module = sys.modules["etendue_addon.panorama"]
    noisy(*studio.world())
    studio.plane(material=gray(studio))
    first = studio.render()
    folder = Path(module._folder.name)
    assert list(folder.glob("*.exr"))
    module.forget()
    assert not folder.exists() and not module._images
    assert studio.render().mean() == pytest.approx(first.mean(), rel=0.05)


def test_light_paths_of_a_world_are_those_of_diffuse_light(studio, coarse, capfd):
    """The backdrop that the camera alone sees is left out, with a message."""
    tree, background = studio.world((1, 0.5, 0.2))
    shader, backdrop, path = (tree.nodes.new(f"ShaderNode{n}") for n in ("MixShader", "Background", "LightPath"))
    backdrop.inputs["Color"].default_value = (0, 0, 5, 1)
    tree.links.new(path.outputs["Is Camera Ray"], shader.inputs[0])
    tree.links.new(background.outputs[0], shader.inputs[1])
    tree.links.new(backdrop.outputs[0], shader.inputs[2])
    tree.links.new(shader.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    studio.plane(material=gray(studio))
    studio.cam.matrix_world = looking((0, 0, 4), (0, 0, 0))
    assert studio.ratio() == pytest.approx(1, abs=0.02)
    assert 'world "World": all rays see what Light Path gives for diffuse ones' in "".join(capfd.readouterr())


def test_animated_worlds_are_those_of_their_frame(studio, coarse):
    tree, background = studio.world()
    mixed(tree, background)
    studio.plane(material=gray(studio))
    strength = background.inputs["Strength"]
    images = []
    for frame, value in ((1, 0.5), (10, 4)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    for frame in (1, 10):
        studio.scene.frame_set(frame)
        images.append(studio.ratio())
    assert images == pytest.approx([1, 1], abs=0.02)


def test_black_worlds_of_nodes(studio, coarse):
    tree, background = studio.world()
    mixed(tree, background)
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeBackground":
            node.inputs["Strength"].default_value = 0
    studio.plane(material=gray(studio))
    studio.light(**LIGHTS["sun"])
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_what_cycles_cannot_render_is_an_error_of_the_world(studio, monkeypatch):
    tree, background = studio.world()
    mixed(tree, background)
    monkeypatch.setattr(sys.modules["etendue_addon.panorama"], "_PROGRAM", Path("missing.py"))
    with pytest.raises(RuntimeError, match='world "World": Cycles does not render it as an image: .*missing.py'):
        studio.render()


def test_environments_that_are_not_read_as_files_are_rendered(studio, coarse):
    """A mirror ball, through a mapping that scales."""
    tree, background = studio.world()
    environment, mapping, coordinates = (tree.nodes.new(f"ShaderNode{n}") for n in ("TexEnvironment", "Mapping", "TexCoord"))
    environment.image = studio.image(lambda u, v: (9 * u, 5 * v, 1 - u), 64, 32, is_float=True)
    environment.projection = "MIRROR_BALL"
    mapping.inputs["Scale"].default_value = (1, 0.3, 1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], environment.inputs["Vector"])
    tree.links.new(environment.outputs["Color"], background.inputs["Color"])
    studio.sphere(gray(studio), at=(0, 0, 0))
    assert_blocks(studio, 0.05)


def lit_by_an_image(studio, angles):
    """A white plane under an image whose quarter around u = 3/8, in its upper half, is bright."""
    tree, background = studio.world()
    image = studio.image(lambda u, v: (9, 5, 1) if 0.25 < u < 0.5 and v > 0.6 else (0.1, 0.1, 0.1), 64, 32, is_float=True)
    environment, mapping = (tree.nodes.new(f"ShaderNode{n}") for n in ("TexEnvironment", "Mapping"))
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    environment.image = image
    mapping.inputs["Rotation"].default_value = [math.radians(a) for a in angles]
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], environment.inputs["Vector"])
    tree.links.new(environment.outputs["Color"], background.inputs["Color"])
    studio.sphere(gray(studio), at=(0, 0, 0))


@pytest.mark.parametrize("angles", [(0, 0, 0), (0, 0, 70), (20, 50, 70)])
def test_environment_images_are_turned_as_in_cycles(studio, angles):
    lit_by_an_image(studio, angles)
    ours, reference = studio.render(), studio.render("CYCLES")
    for half in (slice(None, 32), slice(32, None)):
        assert ours[:, half].mean() == pytest.approx(reference[:, half].mean(), rel=0.02)
    assert ours[:24].mean() == pytest.approx(reference[:24].mean(), rel=0.02)


def test_what_lights_ignore_is_a_warning(studio, capfd):
    studio.plane(material=gray(studio))
    studio.light("AREA", energy=100, size=1, spread=1.0)
    studio.light("SPOT", energy=100, shadow_soft_size=0.5, name="Torch").use_shadow = False
    studio.scene.objects["Plane"].visible_glossy = studio.scene.objects["Plane"].visible_shadow = False
    studio.scene.objects["Plane"].is_shadow_catcher = True
    studio.scene.objects["Torch"].visible_glossy = False
    studio.scene.objects["Light"].light_linking.receiver_collection = bpy.data.collections.new("Lit")
    studio.scene.render.use_motion_blur = studio.scene.render.film_transparent = True
    studio.render()
    said = capfd.readouterr()
    said = said.out + said.err
    assert 'light "Light": the spread has no effect' in said
    assert 'light "Torch": the spot light is a point' in said
    assert 'light "Torch": a light without shadows casts shadows' in said
    for name in ("Plane", "Torch"):
        assert f'object "{name}": ray visibility has no effect' in said
    assert 'object "Light": light linking has no effect' in said
    assert 'object "Plane": is a shadow catcher, which has no effect' in said
    assert "render settings: motion blur has no effect" in said and "a transparent film has no effect" in said
