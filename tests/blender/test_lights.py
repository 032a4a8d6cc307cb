"""Each light, and the world, against Cycles: means of a diffuse plane within 2 %."""

import math

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
    "colour": dict(kind="POINT", energy=100, shadow_soft_size=0, color=(1, 0.5, 0.1)),
}


def gray(studio):
    return studio.material("ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5))[0]


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_have_the_power_that_cycles_gives_them(studio, name):
    studio.plane(material=gray(studio))
    studio.light(**LIGHTS[name])
    assert studio.ratio() == pytest.approx(1, abs=0.02)


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


def test_skies_of_hosek_and_wilkie(studio):
    """Cycles converts spectra to colours in another way: 5 %."""
    tree, background = studio.world()
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type, sky.turbidity, sky.sun_direction = "HOSEK_WILKIE", 3, (0.5, 0.3, 0.8)
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    studio.plane(material=gray(studio))
    ours, reference = studio.render(), studio.render("CYCLES")
    assert ours.mean() == pytest.approx(reference.mean(), rel=0.06)
    studio.cam.matrix_world = looking((0, 0, 0), (1, 1, 1))
    ours, reference = studio.render(), studio.render("CYCLES")
    assert ours[:, :32].mean() == pytest.approx(reference[:, :32].mean(), rel=0.06)


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
    studio.scene.render.use_motion_blur = studio.scene.render.film_transparent = True
    studio.render()
    said = capfd.readouterr()
    said = said.out + said.err
    assert 'light "Light": the spread has no effect' in said
    assert 'light "Torch": the spot light is a point' in said
    assert 'light "Torch": a light without shadows casts shadows' in said
    assert 'object "Plane": ray visibility has no effect' in said
    assert 'object "Plane": is a shadow catcher, which has no effect' in said
    assert "render settings: motion blur has no effect" in said and "a transparent film has no effect" in said
