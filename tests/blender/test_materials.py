"""Nodes of materials against Cycles: means of a sphere within 2 % where the models are the same."""

import bpy
import numpy as np
import pytest
from studio import SIZE, looking

PRINCIPLED = "ShaderNodeBsdfPrincipled"
COLOR, WHITE = (0.8, 0.4, 0.2), (1.0, 1.0, 1.0)

# name: node, inputs, distribution, light, and the ratio to Cycles where the models differ (docs/blender.md says why).
NODES = {
    "diffuse": ("ShaderNodeBsdfDiffuse", dict(Color=COLOR), None, "sun", 1),
    "glossy GGX": ("ShaderNodeBsdfAnisotropic", dict(Color=COLOR, Roughness=0.5), "GGX", "sun", 1),
    "glossy Beckmann": ("ShaderNodeBsdfAnisotropic", dict(Color=COLOR, Roughness=0.5), "BECKMANN", "sun", 1),
    "glossy anisotropic": ("ShaderNodeBsdfAnisotropic", dict(Color=COLOR, Roughness=0.5, Anisotropy=0.5), "GGX", "world", 1),
    "mirror": ("ShaderNodeBsdfAnisotropic", dict(Color=COLOR, Roughness=0.0), "GGX", "world", 1),
    "metal F82": ("ShaderNodeBsdfMetallic", dict(Roughness=0.3), "GGX", "world", 1),
    "metal F82, dark edge": ("ShaderNodeBsdfMetallic", dict(Base_Color=COLOR, Edge_Tint=(0.4, 0.6, 0.8), Roughness=0.1), "GGX", "world", 1.04),
    "refraction": ("ShaderNodeBsdfRefraction", dict(Color=(0.8, 0.8, 0.8), Roughness=0.0), "GGX", "world", 1.01),
    "rough refraction": ("ShaderNodeBsdfRefraction", dict(Color=(0.8, 0.8, 0.8), Roughness=0.4), "GGX", "world", 1),
    "rough diffuse": ("ShaderNodeBsdfDiffuse", dict(Color=COLOR, Roughness=0.5), None, "sun", 1),
    "rougher diffuse": ("ShaderNodeBsdfDiffuse", dict(Color=COLOR, Roughness=1.0), None, "world", 1.03),
    "principled coat": (PRINCIPLED, dict(Base_Color=COLOR, Coat_Weight=1.0), "GGX", "world", 1),
    "glass": ("ShaderNodeBsdfGlass", dict(Color=COLOR, Roughness=0.0), "GGX", "world", 1),
    "rough glass": ("ShaderNodeBsdfGlass", dict(Color=COLOR, Roughness=0.4), "GGX", "world", 1),
    "rough glass, multiscatter": ("ShaderNodeBsdfGlass", dict(Color=COLOR, Roughness=0.4), "MULTI_GGX", "world", 1),
    "transparent": ("ShaderNodeBsdfTransparent", dict(Color=COLOR), None, "world", 1),
    "grey transparent": ("ShaderNodeBsdfTransparent", dict(Color=(0.5, 0.5, 0.5)), None, "world", 1),
    "subsurface": ("ShaderNodeSubsurfaceScattering", dict(Color=COLOR, Scale=0.05), None, "world", 1),
    "subsurface, sun": ("ShaderNodeSubsurfaceScattering", dict(Color=COLOR, Scale=0.05), None, "sun", 1),
    "translucent": ("ShaderNodeBsdfTranslucent", dict(Color=COLOR), None, "back", 1),
    "emission": ("ShaderNodeEmission", dict(Color=COLOR, Strength=2.0), None, None, 1),
    "principled": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5), "GGX", "world", 1),
    "principled metal": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.3, Metallic=1.0), "GGX", "sun", 1),
    "principled metal, multiscatter": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5, Metallic=1.0), "MULTI_GGX", "world", 1),
    "principled, sun": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5), "GGX", "sun", 1),
    "principled, multiscatter": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5), "MULTI_GGX", "world", 1),
    "principled, rough": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=1.0), "MULTI_GGX", "world", 1),
    "principled, black": (PRINCIPLED, dict(Base_Color=(0.0, 0.0, 0.0), Roughness=0.7), "MULTI_GGX", "world", 1.04),
    "principled rough glass": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.4, Transmission_Weight=1.0), "MULTI_GGX", "world", 1.03),
    "principled white glass": (PRINCIPLED, dict(Base_Color=WHITE, Roughness=0.4, Transmission_Weight=1.0), "MULTI_GGX", "world", 1.01),
    "principled half glass": (PRINCIPLED, dict(Base_Color=WHITE, Roughness=0.5, Transmission_Weight=0.5), "MULTI_GGX", "world", 1.02),
    "principled coat, tinted": (PRINCIPLED, dict(Base_Color=COLOR, Coat_Weight=1.0, Coat_Tint=(0.5, 0.8, 1.0), Coat_Roughness=0.3), "MULTI_GGX", "world", 1),
    "principled sheen": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5, Sheen_Weight=1.0), "MULTI_GGX", "world", 1.04),
    "principled sheen, tinted": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5, Sheen_Weight=1.0, Sheen_Tint=(0.1, 0.2, 0.05)), "MULTI_GGX", "world", 1),
    "principled metal, tinted": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.3, Metallic=1.0, Specular_Tint=(0.3, 0.5, 0.9)), "MULTI_GGX", "world", 1),
    "principled, anisotropic": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5, Metallic=1.0, Anisotropic=0.8), "MULTI_GGX", "world", 1.04),
    "principled rough metal": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=1.0, Metallic=1.0), "MULTI_GGX", "world", 0.97),
    "principled subsurface": (PRINCIPLED, dict(Base_Color=COLOR, Subsurface_Weight=1.0, Subsurface_Scale=0.05), "GGX", "world", 1.04),
    "principled glass": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.0, Transmission_Weight=1.0), "GGX", "world", 1),
    "principled alpha": (PRINCIPLED, dict(Base_Color=COLOR, Roughness=0.5, Alpha=0.5), "GGX", "world", 1),
    "principled emission": (PRINCIPLED, dict(Emission_Color=COLOR, Emission_Strength=2.0), "GGX", None, 1),
}


# The pixels of the sphere, without those at its edge, where the filters of the two renderers differ.
_Y, _X = np.indices((SIZE[1], SIZE[0])) + 0.5
SPHERE = np.hypot(_X - SIZE[0] / 2, _Y - SIZE[1] / 2) < 0.333 * SIZE[0]


def lit(studio, light):
    studio.cam.matrix_world = looking((0, -4.143, 1.69), (0, 0, 1))
    if light == "world":
        studio.world()
    elif light is not None:
        studio.light("SUN", energy=3, angle=0, at={"sun": (1, -1, 3), "back": (0, 3, 1.5)}[light])


def read(studio, material, report=None):
    """What the add-on makes of a material."""
    from etendue_addon.images import ImageFiles
    from etendue_addon.materials import read_material
    from etendue_addon.report import Report

    return read_material(material, ImageFiles(studio.folder), report or Report())


@pytest.mark.parametrize("name", NODES)
def test_nodes_reflect_what_they_do_in_cycles(studio, name):
    kind, inputs, distribution, light, expected = NODES[name]
    material, _, node = studio.material(kind, **inputs)
    if distribution:
        node.distribution = distribution
    studio.sphere(material)
    lit(studio, light)
    # Of 16 samples a single bright one, as of rough glass in Blender 4.5, would change the mean by 5 %.
    studio.scene.cycles.samples = 64
    assert studio.ratio(SPHERE) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(("kind", "name"), [
    (PRINCIPLED, "Metallic"), (PRINCIPLED, "Transmission Weight"), (PRINCIPLED, "Alpha"), (PRINCIPLED, "Base Color"),
    ("ShaderNodeBsdfDiffuse", "Color"), ("ShaderNodeBsdfTranslucent", "Color")])
def test_values_above_1_are_clamped(studio, kind, name):
    material, tree, node = studio.material(kind)
    value = tree.nodes.new("ShaderNodeValue")
    tree.links.new(value.outputs[0], node.inputs[name])
    studio.sphere(material)
    lit(studio, "world")
    images = []
    for value.outputs[0].default_value in (1.0, 1.5):
        images.append(studio.render())
    assert np.array_equal(*images)


@pytest.mark.parametrize("name", ["Specular Tint", "Specular IOR Level", "Emission Color", "Emission Strength"])
def test_values_below_0_are_clamped(studio, name):
    material, tree, node = studio.material(PRINCIPLED, Emission_Color=COLOR, Emission_Strength=0.5)
    value = tree.nodes.new("ShaderNodeValue")
    tree.links.new(value.outputs[0], node.inputs[name])
    studio.sphere(material)
    lit(studio, "world")
    images = []
    for value.outputs[0].default_value in (0.0, -1.0):
        images.append(studio.render())
    assert np.array_equal(*images)


LAYERS = {
    "Coat Tint": ((0.9, 0.4, 0.1), dict(Coat_Weight=1.0)), "Coat Roughness": (0.4, dict(Coat_Weight=1.0)),
    "Sheen Tint": ((0.1, 0.3, 0.9), dict(Sheen_Weight=1.0)), "Sheen Roughness": (0.3, dict(Sheen_Weight=1.0)),
    "Diffuse Roughness": (0.8, {})}


@pytest.mark.parametrize("name", LAYERS)
def test_textures_of_layers_are_those_of_their_texels(studio, name, capfd):
    """An image of one colour renders as the same constant; tables of textures differ by less than 1 %."""
    value, others = LAYERS[name]
    material, tree, node = studio.material(PRINCIPLED, Base_Color=COLOR, Roughness=0.6, **others)
    color = (*value, 1.0) if isinstance(value, tuple) else (value, value, value, 1.0)
    picture = bpy.data.images.new("Texels", 2, 2, float_buffer=True)
    picture.colorspace_settings.name = "Non-Color"
    picture.pixels = color * 4
    node.inputs[name].default_value = color if isinstance(value, tuple) else value
    studio.sphere(material)
    lit(studio, "sun")
    constant = studio.render().mean(axis=(0, 1))
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = picture
    tree.links.new(texture.outputs["Color"], node.inputs[name])
    node.inputs[name].default_value = (1.0, 1.0, 1.0, 1.0) if isinstance(value, tuple) else 1.0
    capfd.readouterr()
    assert studio.render().mean(axis=(0, 1)) == pytest.approx(constant, rel=0.01)
    assert "cannot be a texture" not in "".join(capfd.readouterr())
    tree.nodes.remove(texture)
    other = studio.render().mean(axis=(0, 1))
    assert abs(other / constant - 1).max() > 0.01  # so the texture does have an effect


def two_shaders(studio, mixer, second, factor=0.3):
    """A plane whose material mixes or adds a diffuse node and another one; returns the other node."""
    material, tree, node = studio.material(mixer)
    first, other = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new(second)
    first.inputs["Color"].default_value = (0.6, 0.3, 0.1, 1)
    shaders = [s for s in node.inputs if s.type == "SHADER"]
    tree.links.new(first.outputs[0], shaders[0])
    tree.links.new(other.outputs[0], shaders[1])
    if mixer == "ShaderNodeMixShader":
        node.inputs[0].default_value = factor
    studio.sphere(material)
    lit(studio, "world")
    return other


@pytest.mark.parametrize("mixer", ["ShaderNodeMixShader", "ShaderNodeAddShader"])
@pytest.mark.parametrize("second", ["ShaderNodeEmission", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfTranslucent"])
def test_mixtures_and_sums(studio, mixer, second):
    other = two_shaders(studio, mixer, second)
    if hasattr(other, "distribution"):
        other.distribution = "GGX"
    other.inputs["Color"].default_value = (0.2, 0.2, 0.4, 1)
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_mixtures_with_transparency_let_light_pass(studio):
    two_shaders(studio, "ShaderNodeMixShader", "ShaderNodeBsdfTransparent")
    studio.plane(material=studio.material("ShaderNodeBsdfDiffuse", "Ground")[0])
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_nodes_in_groups_and_behind_reroutes(studio):
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside = group.nodes.new("NodeGroupInput"), group.nodes.new("ShaderNodeBsdfDiffuse"), group.nodes.new("NodeGroupOutput")
    group.links.new(inside[0].outputs["Tint"], inside[1].inputs["Color"])
    group.links.new(inside[1].outputs[0], inside[2].inputs["Shader"])
    material, tree, node = studio.material("ShaderNodeGroup")
    node.node_tree = group
    reroute = tree.nodes.new("NodeReroute")
    tree.links.new(node.outputs["Shader"], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    node.inputs["Tint"].default_value = (0.1, 0.6, 0.2, 1)
    studio.sphere(material)
    lit(studio, "world")
    ours = studio.render().mean(axis=(0, 1))
    assert ours == pytest.approx(studio.render("CYCLES").mean(axis=(0, 1)), rel=0.02)


def test_names_that_differ_only_in_special_characters(studio):
    lit(studio, "world")
    for name, x, color in (("A.B", -0.6, (0.9, 0, 0)), ("A B", 0.6, (0, 0, 0.9))):
        studio.sphere(studio.material("ShaderNodeBsdfDiffuse", name, Color=color)[0], at=(x, 0, 1), radius=0.5)
    image = studio.render()
    left, right = image[20:28, 20:26].mean(axis=(0, 1)), image[20:28, 38:44].mean(axis=(0, 1))
    assert left[0] > 5 * left[2] and right[2] > 5 * right[0]


@pytest.mark.parametrize("kind", [PRINCIPLED, "ShaderNodeEmission", "ShaderNodeMixShader"])
def test_textures_that_emit_nothing_are_no_emitters(studio, kind):
    material, tree, node = studio.material(kind)
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = studio.image(lambda u, v: (u, v, 0.5))
    if kind == "ShaderNodeMixShader":
        tree.links.new(texture.outputs["Color"], node.inputs[0])
        for i, color in ((1, COLOR), (2, WHITE)):
            part = tree.nodes.new("ShaderNodeBsdfDiffuse")
            part.inputs["Color"].default_value = (*color, 1)
            tree.links.new(part.outputs[0], node.inputs[i])
    else:
        tree.links.new(texture.outputs["Color"], node.inputs["Emission Color" if kind == PRINCIPLED else "Color"])
        node.inputs["Emission Strength" if kind == PRINCIPLED else "Strength"].default_value = 0
    assert read(studio, material).emission is None


def test_the_coat_leaves_what_lies_below_as_it_is(studio):
    bsdf = read(studio, studio.material(PRINCIPLED, Coat_Weight=1.0, Coat_Roughness=0.5)[0]).bsdf["bsdf"]
    assert (bsdf["coat_affect_ior"], bsdf["coat_affect_roughness"]) == (0, 0)


def linked(studio, tree, node, name, value=0.5):
    """Links an image of one value to an input."""
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = studio.image(lambda u, v: (value, value, value), width=2, height=2, color=False)
    tree.links.new(texture.outputs["Color"], node.inputs[name])
    return texture


def parts(bsdf):
    """The openpbr materials of a blend, with their weights; textures stand for 0.5."""
    if bsdf["type"] == "blendbsdf":
        weight = bsdf["weight"] if isinstance(bsdf["weight"], float) else 0.5
        return [(share * w, p) for w, part in ((1 - weight, bsdf["bsdf"]), (weight, bsdf["bsdf_2"])) for share, p in parts(part)]
    return [(1.0, bsdf)] if bsdf["type"] == "openpbr" else parts(bsdf["bsdf"])


def shares(bsdf):
    """The weights of metal, glass and the opaque dielectric, and the parameters of the parts that have them."""
    sums, own = {"metal": 0.0, "glass": 0.0, "opaque": 0.0}, {"metal": [], "glass": [], "opaque": []}
    for weight, part in parts(bsdf):
        metal, glass = (0.5 if isinstance(part[n], dict) else part[n] for n in ("base_metalness", "transmission_weight"))
        for name, share in (("metal", metal), ("glass", (1 - metal) * glass), ("opaque", (1 - metal) * (1 - glass))):
            sums[name] += weight * share
            own[name] += [part] if share else []
    return sums, own


@pytest.mark.parametrize("inputs, textured", [
    (dict(Transmission_Weight=0.9), ()), (dict(Transmission_Weight=0.9, Metallic=0.25), ()), (dict(Metallic=0.25), ("Transmission Weight", )),
    (dict(Transmission_Weight=0.9), ("Metallic", )), ({}, ("Transmission Weight", "Metallic")), ({}, ("Transmission Weight", )),
    (dict(Transmission_Weight=1.0, Metallic=0.25), ())])
def test_glass_has_its_own_index_and_round_facets(studio, inputs, textured):
    """The level of the specular reflection and the anisotropy are of metal and of the opaque dielectric."""
    material, tree, node = studio.material(PRINCIPLED, Specular_IOR_Level=0.0, Anisotropic=0.5, Roughness=0.4, **inputs)
    for name in textured:
        linked(studio, tree, node, name)
    sums, own = shares(read(studio, material).bsdf)
    metal = 0.5 if "Metallic" in textured else inputs.get("Metallic", 0)
    glass = 0.5 if "Transmission Weight" in textured else inputs["Transmission_Weight"]
    assert sums == pytest.approx({"metal": metal, "glass": (1 - metal) * glass, "opaque": (1 - metal) * (1 - glass)})
    for part in own["glass"]:
        assert "specular_weight" not in part and "specular_roughness_anisotropy" not in part
        assert part["specular_roughness"] == pytest.approx(0.4)
    assert all(part["specular_roughness_anisotropy"] == pytest.approx(0.45) for part in own["metal"] + own["opaque"])
    assert all(part["specular_weight"] == 0 for part in own["opaque"])
    studio.sphere(material)
    lit(studio, "world")
    assert studio.render().mean() > 0.1


def test_plain_glass_is_one_material(studio):
    for inputs in (dict(Transmission_Weight=1.0, Specular_IOR_Level=0.0, Anisotropic=0.5), dict(Transmission_Weight=0.5)):
        bsdf = read(studio, studio.material(PRINCIPLED, **inputs)[0]).bsdf
        assert bsdf["type"] == "openpbr" and "specular_roughness_anisotropy" not in bsdf


def test_sheen_takes_no_more_than_its_colour(studio):
    material, tree, node = studio.material(PRINCIPLED, Sheen_Weight=0.5, Sheen_Tint=(0.2, 0.4, 0.1))
    bsdf = read(studio, material).bsdf["bsdf"]
    assert bsdf["fuzz_weight"] == pytest.approx(0.2) and bsdf["fuzz_color"]["value"] == pytest.approx([0.5, 1, 0.25])
    texture = linked(studio, tree, node, "Sheen Weight")
    weight = read(studio, material).bsdf["bsdf"]["fuzz_weight"]
    assert (weight["type"], weight["scale"]) == ("scale", pytest.approx(0.4))
    tree.nodes.remove(texture)
    linked(studio, tree, node, "Sheen Tint")
    bsdf = read(studio, material).bsdf["bsdf"]
    for name in ("fuzz_weight", "fuzz_color"):
        assert (bsdf[name]["type"], bsdf[name]["output"], bsdf[name]["color"]["scale"]) == ("sheen_to_fuzz", name, 0.5)
    studio.sphere(material)
    lit(studio, "world")
    assert studio.render().mean() > 0.1
    node.inputs["Sheen Weight"].default_value = 0
    assert "fuzz_weight" not in read(studio, material).bsdf["bsdf"]


@pytest.mark.parametrize("anisotropy", [-0.6, 0.0, 0.6])
def test_textured_metal_keeps_its_anisotropy(studio, anisotropy):
    """The squares of the roughnesses along u and v are those of the constant metal."""
    material, tree, node = studio.material("ShaderNodeBsdfMetallic", Roughness=0.4, Anisotropy=anisotropy)
    node.distribution = "GGX"
    constant = read(studio, material).bsdf
    while constant["type"] != "roughconductor":
        constant = constant["bsdf"]
    linked(studio, tree, node, "Base Color")
    bsdf = read(studio, material).bsdf["bsdf"]
    a = bsdf["specular_roughness_anisotropy"]
    aspect = 1 - a if a >= 0 else 1 / (1 + a)
    along_u = bsdf["specular_roughness"] ** 2 * (2 / (1 + aspect**2)) ** 0.5
    expected = [constant.get(name, constant.get("alpha")) for name in ("alpha_u", "alpha_v")]
    assert [along_u, aspect * along_u] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("kind, name, rotation", [
    (PRINCIPLED, "Anisotropic", "Anisotropic Rotation"), ("ShaderNodeBsdfAnisotropic", "Anisotropy", "Rotation"),
    ("ShaderNodeBsdfMetallic", "Anisotropy", "Rotation")])
def test_directions_of_highlights_have_no_effect(studio, kind, name, rotation):
    from etendue_addon.report import Report

    material, tree, node = studio.material(kind)
    tree.links.new(tree.nodes.new("ShaderNodeTangent").outputs[0], node.inputs["Tangent"])
    node.inputs[rotation].default_value = 0.25
    for anisotropy in (0.0, 0.5):
        node.inputs[name].default_value = anisotropy
        report = Report()
        read(studio, material, report)
        said = "".join(report.warnings)
        assert ("Tangent has no effect" in said) == (anisotropy > 0)
        assert anisotropy == 0 or f"{rotation} has no effect" in said


def test_textured_coats_over_other_normals(studio):
    """Their blend by the texture is that by its value."""
    material, tree, node = studio.material(PRINCIPLED, Base_Color=COLOR, Coat_Weight=0.5)
    bump = tree.nodes.new("ShaderNodeNormalMap")
    linked(studio, tree, bump, "Color", 0.6)
    tree.links.new(bump.outputs[0], node.inputs["Normal"])
    studio.sphere(material)
    lit(studio, "world")
    expected = studio.render().mean()
    node.inputs["Coat Weight"].default_value = 0
    linked(studio, tree, node, "Coat Weight")
    assert read(studio, material).bsdf["type"] == "blendbsdf"
    assert studio.render().mean() == pytest.approx(expected, rel=0.01)


POWERS = [("POWER", 0.0, -1.0), ("POWER", -0.5, 2.0), ("POWER", -0.5, 0.5), ("POWER", 1e30, 9.0), ("DIVIDE", 1.0, 0.0)]


@pytest.mark.parametrize("operation, a, b", POWERS)
def test_operations_without_a_result_are_those_of_cycles(studio, operation, a, b):
    material, tree, node = studio.material("ShaderNodeEmission")
    math = tree.nodes.new("ShaderNodeMath")
    math.operation, math.inputs[0].default_value, math.inputs[1].default_value = operation, a, b
    plus = tree.nodes.new("ShaderNodeMath")
    plus.inputs[1].default_value = 0.5
    tree.links.new(math.outputs[0], plus.inputs[0])
    tree.links.new(plus.outputs[0], node.inputs["Strength"])
    studio.sphere(material)
    if a in (0, 1e30):  # infinite in Cycles, whose image is black
        assert studio.render().max() == pytest.approx(0.5, rel=1e-3)
    else:
        assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_gamma_of_black(studio):
    material, tree, node = studio.material("ShaderNodeEmission")
    gamma = tree.nodes.new("ShaderNodeGamma")
    gamma.inputs["Color"].default_value, gamma.inputs["Gamma"].default_value = (0.25, 0, 0.5, 1), -1
    tree.links.new(gamma.outputs[0], node.inputs["Color"])
    studio.sphere(material)
    assert studio.ratio() == pytest.approx(1, abs=0.02)


def test_unknown_values_are_baked_with_a_warning(studio, capfd):
    material, tree, node = studio.material("ShaderNodeBsdfDiffuse", "Stone", Color=(0.5, 0.5, 0.5))
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], node.inputs["Color"])
    studio.sphere(material)
    lit(studio, "world")
    with_noise = studio.render().mean()
    said = "".join(capfd.readouterr())
    assert 'material "Stone": node "Noise Texture" (ShaderNodeTexNoise): not supported; Color is (0.5, 0.5, 0.5)' in said
    tree.nodes.remove(noise)
    assert studio.render().mean() == with_noise


def test_unknown_shaders_are_refused_by_name(studio):
    studio.sphere(studio.material("ShaderNodeBsdfToon", "Cartoon")[0])
    lit(studio, "world")
    with pytest.raises(RuntimeError, match=r'material "Cartoon": node "Toon BSDF" \(ShaderNodeBsdfToon\) is not supported'):
        studio.render()
