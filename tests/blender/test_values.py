"""Nodes that compute values, against Cycles: colours of a plane, of which the left half has another texel than the right one."""

import bpy
import numpy as np
import pytest
from studio import looking

A, B = (0.8, 0.4, 0.1), (0.2, 0.5, 0.9)


class Tree:
    """A plane with a material to which a test links a value."""

    def __init__(self, studio, shader="ShaderNodeEmission"):
        self.studio = studio
        self.material, self.tree, self.shader = studio.material(shader)
        self.plane = studio.plane(4, self.material)
        studio.cam.matrix_world = looking((0, 0, 3), (0, 0, 0))
        studio.world()

    def node(self, kind, inputs=(), **settings):
        """A node; `inputs` are values or sockets by their identifiers or positions."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            setattr(node, key, value)
        for key, value in dict(inputs).items():
            found = [s for s in node.inputs if s.identifier == key] if isinstance(key, str) else [node.inputs[key]]
            self.put(value, found[0])
        return node

    def put(self, value, socket):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, tuple) and len(socket.default_value) == 4:
            socket.default_value = (*value, 1)
        else:
            socket.default_value = value

    def image(self, left=A, right=B, output="Color"):
        """The colour of an image of two halves."""
        node = self.node("TexImage", interpolation="Closest")
        node.image = self.studio.image(lambda u, v: left if u < 0.5 else right, color=False)
        return node.outputs[output]

    def constant(self, value):
        node = self.node("RGB" if isinstance(value, tuple) else "Value")
        node.outputs[0].default_value = (*value, 1) if isinstance(value, tuple) else value
        return node.outputs[0]


# name: the socket that is linked to Color, from a Tree.
VALUES = {
    "RGB": lambda t: t.constant(A),
    "value": lambda t: t.constant(0.3),
    "image, muted": lambda t: muted(t, t.node("Gamma", {0: t.image(), 1: 3.0})),
    "mix": lambda t: mix(t, 0.3, A, B),
    "mix, factor above 1": lambda t: mix(t, 1.7, A, B),
    "mix, factor in range without clamping": lambda t: mix(t, 0.3, A, B, clamp_factor=False),
    "mix of a texture": lambda t: mix(t, 0.3, t.image(), B),
    "mix by a texture": lambda t: mix(t, t.image((0.1,) * 3, (0.7,) * 3), A, B),
    "mix by the luminance of a texture": lambda t: mix(t, t.image(), A, B),
    "mix, multiplied": lambda t: mix(t, 0.6, A, B, "MULTIPLY"),
    "mix, multiplied texture": lambda t: mix(t, 0.6, t.image(), B, "MULTIPLY"),
    "mix, clamped": lambda t: mix(t, 1.0, (3.0, 0.2, 0.1), (2.0, 0.5, 1.0), "MULTIPLY", clamp_result=True),
    "mix of numbers": lambda t: t.node("Mix", {"Factor_Float": 0.3, "A_Float": 0.2, "B_Float": 0.9}).outputs[0],
    "mix of a number and a texture": lambda t: t.node("Mix", {"Factor_Float": 0.3, "A_Float": t.image(), "B_Float": 0.9}).outputs[0],
    "old mix": lambda t: t.node("MixRGB", {0: 0.3, 1: A, 2: B}).outputs[0],
    "old mix of a texture": lambda t: t.node("MixRGB", {0: 0.3, 1: t.image(), 2: B}).outputs[0],
    "old mix, multiplied": lambda t: t.node("MixRGB", {0: 1.0, 1: t.image(), 2: B}, blend_type="MULTIPLY").outputs[0],
    "ramp of a constant": lambda t: ramp(t, 0.4, [(0, A), (0.5, (0, 1, 0)), (1, B)]),
    "ramp of a texture": lambda t: ramp(t, t.image((0.2,) * 3, (0.9,) * 3), [(0, A), (1, B)]),
    "ramp of a coloured texture": lambda t: ramp(t, t.image(), [(0, (0, 0, 0)), (1, (1, 1, 1))]),
    "ramp, alpha": lambda t: ramp(t, t.image((0.2,) * 3, (0.9,) * 3), [(0, (*A, 0.7)), (1, (*B, 0.1))], "Alpha"),
    "ramp of a constant, alpha": lambda t: ramp(t, 0.4, [(0, (*A, 0.7)), (1, (*B, 0.1))], "Alpha"),
    "separate red": lambda t: t.node("SeparateColor", {0: t.image()}).outputs[0],
    "separate green of an alpha": lambda t: t.node("SeparateColor", {0: t.image((*A, 0.7), (*B, 0.4), "Alpha")}).outputs[1],
    "separate green": lambda t: t.node("SeparateColor", {0: t.image()}).outputs[1],
    "separate blue of a constant": lambda t: t.node("SeparateColor", {0: A}).outputs[2],
    "combine": lambda t: t.node("CombineColor", {0: 0.7, 1: 0.2, 2: t.constant(0.4)}).outputs[0],
    "combine separated": lambda t: t.node("CombineColor", dict(enumerate(t.node("SeparateColor", {0: A}).outputs))).outputs[0],
    "to grey": lambda t: t.node("RGBToBW", {0: A}).outputs[0],
    "to grey of a texture": lambda t: t.node("RGBToBW", {0: t.image()}).outputs[0],
    "invert": lambda t: t.node("Invert", {0: 0.7, 1: A}).outputs[0],
    "gamma": lambda t: t.node("Gamma", {0: A, 1: 2.2}).outputs[0],
    "alpha": lambda t: t.image((1, 1, 1, 0.2), (1, 1, 1, 0.7), "Alpha"),
    "product with a number": lambda t: t.node("Math", {0: t.image(), 1: 0.5}, operation="MULTIPLY").outputs[0],
    "product of textures": lambda t: t.node("Math", {0: t.image(), 1: t.image(B, A)}, operation="MULTIPLY").outputs[0],
    "one minus": lambda t: t.node("Math", {0: 1.0, 1: t.image()}, operation="SUBTRACT").outputs[0],
    "product, clamped": lambda t: t.node("Math", {0: 3.0, 1: 0.5}, operation="MULTIPLY", use_clamp=True).outputs[0],
    **{f"{o.lower()} of numbers": lambda t, o=o: t.node("Math", {0: 0.6, 1: 0.3}, operation=o).outputs[0] for o in (
        "ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "POWER", "MINIMUM", "MAXIMUM")},
}


def muted(t, node):
    node.mute = True
    return node.outputs[0]


def mix(t, factor, a, b, blend="MIX", **settings):
    node = t.node("Mix", {"Factor_Float": factor, "A_Color": a, "B_Color": b}, data_type="RGBA", blend_type=blend, **settings)
    return next(s for s in node.outputs if s.identifier == "Result_Color")


def ramp(t, factor, stops, output="Color"):
    node = t.node("ValToRGB", {0: factor})
    elements = node.color_ramp.elements
    while len(elements) < len(stops):
        elements.new(0.5)
    for element, (position, color) in zip(elements, stops):
        element.position, element.color = position, (*color, 1)[:4]
    return node.outputs[output]


def assert_halves(studio):
    """The colours of both halves, without what lies between them."""
    ours, reference = studio.render(), studio.render("CYCLES")
    for half in (np.s_[8:40, 8:28], np.s_[8:40, 36:56]):
        assert ours[half].mean(axis=(0, 1)) == pytest.approx(reference[half].mean(axis=(0, 1)), rel=0.02, abs=1e-3)


@pytest.mark.parametrize("name", VALUES)
def test_values_are_those_of_cycles(studio, name, capfd):
    t = Tree(studio)
    t.put(VALUES[name](t), t.shader.inputs["Color"])
    assert_halves(studio)
    assert "Warning: etendue" not in "".join(capfd.readouterr())


@pytest.mark.parametrize("name", ["to grey of a texture", "product of textures", "one minus", "mix of a number and a texture"])
def test_values_are_opacities(studio, name):
    """Where a number is taken, as well as where a colour is."""
    t = Tree(studio, "ShaderNodeBsdfPrincipled")
    t.put(VALUES[name](t), t.shader.inputs["Alpha"])
    assert_halves(studio)


@pytest.mark.parametrize("domain, kind", [("POINT", "FLOAT_COLOR"), ("CORNER", "BYTE_COLOR")])
@pytest.mark.parametrize("output", ["Color", "Alpha"])
def test_attributes(studio, domain, kind, output):
    t = Tree(studio)
    t.put(t.node("Attribute", attribute_name="Paint").outputs[output], t.shader.inputs["Color"])
    paint = t.plane.data.color_attributes.new("Paint", kind, domain)
    for item, color in zip(paint.data, [(1, 0, 0, 0.2), (0, 1, 0, 0.4), (0, 0, 1, 0.6), (0.5, 0.5, 0.5, 1)]):
        item.color = color
    assert_halves(studio)


UNKNOWN = {
    "mix, screen": lambda t: mix(t, 0.5, A, B, "SCREEN"),
    "mix, factor without clamping": lambda t: mix(t, 1.7, A, B, clamp_factor=False),
    "mix of a texture, clamped": lambda t: mix(t, 1.0, t.image(), (3.0, 1.0, 1.0), "MULTIPLY", clamp_result=True),
    "product of a texture, clamped": lambda t: t.node("Math", {0: t.image(), 1: 2.0}, operation="MULTIPLY", use_clamp=True).outputs[0],
    "ramp of three stops": lambda t: ramp(t, t.image(), [(0, A), (0.5, (0, 1, 0)), (1, B)]),
    "separate hue": lambda t: t.node("SeparateColor", {0: t.image()}, mode="HSV").outputs[0],
    "separate of a mixture": lambda t: t.node("SeparateColor", {0: mix(t, 0.3, t.image(), B)}).outputs[0],
    "combine of textures": lambda t: t.node("CombineColor", {0: t.image(), 1: 0.5, 2: 0.5}).outputs[0],
    "invert of a texture": lambda t: t.node("Invert", {1: t.image()}).outputs[0],
    "gamma of a texture": lambda t: t.node("Gamma", {0: t.image(), 1: 2.0}).outputs[0],
    "sum of textures": lambda t: t.node("Math", {0: t.image(), 1: 0.5}, operation="ADD").outputs[0],
    "sine": lambda t: t.node("Math", {0: 0.5}, operation="SINE").outputs[0],
    "attribute as a number": lambda t: t.node("Attribute", attribute_name="x").outputs["Fac"],
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_not_supported_is_a_warning_and_the_value_of_the_socket(studio, name, capfd):
    t = Tree(studio)
    t.shader.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
    t.put(UNKNOWN[name](t), t.shader.inputs["Color"])
    image = studio.render()
    assert image[8:40, 8:28].mean(axis=(0, 1)) == pytest.approx((0.5, 0.25, 0.125), rel=0.02)
    assert "not supported; Color is (0.5, 0.25, 0.125) instead" in "".join(capfd.readouterr())
