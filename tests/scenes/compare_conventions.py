#!/usr/bin/env python3
"""Compare what plug-ins and parameters mean here and in Mitsuba 3: one small scene for each.

Each case is a scene of a few objects that shows one convention (the sign of an offset, the
orientation of a texture, the form of a lobe); both renderers make independent images of it by path
tracing, and the image mean and its tiles are compared as in compare_mitsuba.py, with 0.2 % of the
image's mean forgiven. A case that is known to differ says why; it fails if it agrees.
"""

import argparse
import json
import pathlib
import sys
import tempfile

import agreement

WIDTH, HEIGHT = 48, 36
TOLERANCE = 0.002

# Parts of scenes, put together in CASES below.
FILM = """<film type="hdrfilm"><integer name="width" value="{width}"/>
<integer name="height" value="{height}"/><boolean name="sample_border" value="true"/>{film}</film>"""
BOX = '<rfilter type="box"/>'
LOOK = '<lookat origin="0.3, 0.5, 4" target="0, 0, 0" up="0.1, 1, 0"/>'
CAMERA = '<float name="fov" value="40"/>'

# A wall that shines by a texture without symmetry: every pixel has a colour of its own.
WALL = """<shape type="rectangle"><transform name="to_world"><scale x="1.6" y="1.2"/></transform>
<emitter type="area"><texture name="radiance" type="bitmap">
<string name="filename" value="colours.exr"/></texture></emitter></shape>"""

# A lamp over, a wall behind and a bright sky around whatever is to be lit.
LIGHT = """<emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>
<shape type="rectangle"><transform name="to_world"><scale value="0.7"/>
<lookat origin="1, 2.5, 2" target="0, 0, 0" up="1, 0, 0"/></transform>
<emitter type="area"><rgb name="radiance" value="12, 10, 8"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-1.5"/></transform>
<bsdf type="diffuse"><texture name="reflectance" type="bitmap">
<string name="filename" value="colours.exr"/></texture></bsdf></shape>"""

FLOOR = """<shape type="rectangle"><transform name="to_world"><scale value="2"/>
<rotate y="1" angle="20"/></transform><bsdf type="diffuse">
<rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></shape>"""


def sensor(inner, kind="perspective", look=LOOK, **film):
    film = {"width": WIDTH, "height": HEIGHT, "film": BOX} | film
    return f"""<sensor type="{kind}"><transform name="to_world">{look}</transform>{inner}
{FILM.format(**film)}</sensor>"""


def texture(name, inner="", file="colours.exr"):
    return f"""<texture name="{name}" type="bitmap"><string name="filename" value="{file}"/>
{inner}</texture>"""


def glowing(shape, radiance=texture("radiance")):
    """A shape that emits and fills the view."""
    kind, inner = (shape.split("|") + [""])[:2]
    return f'<shape type="{kind}">{inner}<emitter type="area">{radiance}</emitter></shape>'


def seen(pattern):
    """A texture, named radiance, on a rectangle that shines by it."""
    return glowing('rectangle|<transform name="to_world"><scale x="1.6" y="1.2"/></transform>', pattern)


def bsdf(inner, kind):
    return LIGHT + f'<shape type="sphere"><bsdf type="{kind}">{inner}</bsdf></shape>'


def tilted(inner, kind):
    return LIGHT + f"""<shape type="rectangle"><transform name="to_world">
<rotate x="1" angle="-35"/><rotate y="1" angle="15"/></transform><bsdf type="{kind}">{inner}</bsdf></shape>"""


def numbers(**values):
    return "".join(f'<float name="{k}" value="{v}"/>' for k, v in values.items())


def rgb(name, value):
    return f'<rgb name="{name}" value="{value}"/>'


def string(name, value):
    return f'<string name="{name}" value="{value}"/>'


TURN = '<transform name="to_world"><rotate x="1" angle="30"/><rotate y="1" angle="50"/></transform>'
UV = """<transform name="to_uv"><scale x="2" y="1.5"/><rotate z="1" angle="25"/>
<translate x="0.3" y="0.1"/></transform>"""
METAL = rgb("eta", "0.2, 0.9, 1.1") + rgb("k", "3.9, 2.4, 2.2")
BASE = rgb("base_color", "0.8, 0.4, 0.2")
INNER = '<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.4, 0.2"/></bsdf>'
MIRROR = '<bsdf type="conductor"/>'
# Newer versions of Mitsuba add terms that depend on which direction is the view's.
PLAIN = """<boolean name="flip_invalid_normals" value="false"/>
<boolean name="use_shadowing_function" value="false"/>"""
STEP = '<transform name="to_uv"><scale x="3" y="3"/></transform>'
DISTRIBUTIONS = ("beckmann", "ggx")

# Name: (sensor or None for the usual, objects).
CASES = {
    # Sensors
    **{f"fov_axis {a}": (sensor(CAMERA + string("fov_axis", a)), WALL)
       for a in ("x", "y", "diagonal", "smaller", "larger")},
    **{f"fov_axis {a}, portrait": (sensor(CAMERA + string("fov_axis", a), width=36, height=48), WALL)
       for a in ("smaller", "larger")},
    "focal_length": (sensor(string("focal_length", "40mm")), WALL),
    "principal_point_offset_x": (sensor(CAMERA + numbers(principal_point_offset_x=0.2)), WALL),
    "principal_point_offset_y": (sensor(CAMERA + numbers(principal_point_offset_y=0.2)), WALL),
    "crop": (sensor(CAMERA, width=96, height=72, film=BOX + """<integer name="crop_offset_x" value="30"/>
<integer name="crop_offset_y" value="10"/><integer name="crop_width" value="48"/>
<integer name="crop_height" value="36"/>"""), WALL),
    "thinlens in focus": (sensor(
        CAMERA + numbers(aperture_radius=0.4, focus_distance=4.05), "thinlens"), WALL),
    "thinlens out of focus": (sensor(
        CAMERA + numbers(aperture_radius=0.4, focus_distance=2.5), "thinlens"), WALL),
    "orthographic": (sensor("", "orthographic", '<scale x="1.5" y="1.5"/>' + LOOK), WALL),
    "mirrored camera": (sensor(CAMERA, look='<scale x="-1"/>' + LOOK), WALL),
    **{f"rfilter {f}": (sensor(CAMERA, film=f'<rfilter type="{f}"/>'), WALL)
       for f in ("tent", "gaussian", "mitchell", "catmullrom", "lanczos")},
    # Emitters
    "point": (None, FLOOR + """<emitter type="point"><point name="position" x="1" y="1" z="1"/>
<rgb name="intensity" value="3, 2, 1"/></emitter>"""),
    "spot": (None, FLOOR + """<emitter type="spot"><transform name="to_world">
<lookat origin="1, 1, 2" target="0, 0, 0" up="0, 1, 0"/></transform></emitter>"""),
    "spot beam_width": (None, FLOOR + """<emitter type="spot"><float name="cutoff_angle" value="35"/>
<float name="beam_width" value="5"/><transform name="to_world">
<lookat origin="1, 1, 2" target="0, 0, 0" up="0, 1, 0"/></transform></emitter>"""),
    "directional": (None, FLOOR + """<emitter type="directional">
<vector name="direction" x="-1" y="-0.5" z="-1"/><rgb name="irradiance" value="3, 2, 1"/></emitter>"""),
    "directional to_world": (None, FLOOR + """<emitter type="directional"><transform name="to_world">
<lookat origin="1, 1, 2" target="0, 0, 0" up="0, 1, 0"/></transform></emitter>"""),
    "constant": (None, FLOOR + '<emitter type="constant"><rgb name="radiance" value="3, 2, 1"/></emitter>'),
    "constant, grey spectrum": (
        None, '<emitter type="constant"><spectrum name="radiance" value="1"/></emitter>'),
    "constant, spectrum": (None, """<emitter type="constant"><spectrum name="radiance"
value="400:0, 500:0.8, 600:1.5, 700:1.9"/></emitter>"""),
    "diffuse, spectrum": (None, bsdf("""<spectrum name="reflectance"
value="400:0.1, 500:0.3, 550:0.7, 600:0.5, 700:0.2"/>""", "diffuse")),
    "envmap": (None, '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'),
    "envmap to_world, scale": (None, f"""<emitter type="envmap"><string name="filename" value="sky.exr"/>
<float name="scale" value="2"/>{TURN}</emitter>"""),
    "envmap lights": (None, f"""<shape type="sphere">{INNER}</shape><emitter type="envmap">
<string name="filename" value="sky.exr"/>{TURN}</emitter>"""),
    "envmap of few rows": (None, f'''<emitter type="envmap">
<string name="filename" value="colours.exr"/>{TURN}</emitter>'''),
    # Textured emission: orientation of (u, v)
    "area on rectangle": (None, glowing("rectangle")),
    "area on sphere": (None, glowing(f"sphere|{TURN}")),
    "area on disk": (None, glowing("disk")),
    "area on cube": (None, glowing(f"cube|{TURN}")),
    "area on cylinder": (None, glowing(f"cylinder|{TURN}")),
    "area on cylinder, p0 p1": (None, glowing(
        'cylinder|<point name="p0" x="-1" y="-0.5" z="0"/><point name="p1" x="1" y="0.4" z="0.2"/>'
        '<float name="radius" value="0.6"/>')),
    "area on obj": (None, glowing('obj|<string name="filename" value="quad.obj"/>')),
    "area on obj, flip_tex_coords": (None, glowing(
        'obj|<string name="filename" value="quad.obj"/><boolean name="flip_tex_coords" value="false"/>')),
    "area on ply": (None, glowing('ply|<string name="filename" value="quad.ply"/>')),
    "flip_normals": (None, glowing(f'sphere|{TURN}<boolean name="flip_normals" value="true"/>')
                     + glowing('rectangle|<transform name="to_world"><scale value="3"/>'
                               '<translate z="-1.5"/></transform>')),
    "area lights": (None, FLOOR + """<shape type="rectangle"><transform name="to_world">
<lookat origin="1, 2.5, 2" target="0, 0, 0" up="1, 0, 0"/></transform><emitter type="area">"""
                    + texture("radiance") + "</emitter></shape>"),
    # Textures
    **{f"bitmap {w}, {f}": (None, seen(texture(
        "radiance", string("wrap_mode", w) + string("filter_type", f) + STEP)))
       for w in ("repeat", "mirror", "clamp") for f in ("bilinear", "nearest")},
    "bitmap to_uv": (None, seen(texture("radiance", UV))),
    "bitmap sRGB": (None, bsdf(texture("reflectance", file="colours.png"), "diffuse")),
    "bitmap raw": (None, bsdf(texture(
        "reflectance", '<boolean name="raw" value="true"/>', "colours.png"), "diffuse")),
    "checkerboard": (None, tilted(f"""<texture name="reflectance" type="checkerboard">
<rgb name="color0" value="0.9, 0.1, 0.1"/><rgb name="color1" value="0.1, 0.1, 0.9"/>{UV}
</texture>""", "diffuse")),
    # Materials
    "diffuse": (None, bsdf(rgb("reflectance", "0.8, 0.4, 0.2"), "diffuse")),
    "conductor": (None, bsdf(METAL, "conductor")),
    "conductor Au": (None, bsdf(string("material", "Au"), "conductor")),
    "conductor Al": (None, bsdf(string("material", "Al"), "conductor")),
    "conductor Cu": (None, bsdf(string("material", "Cu"), "conductor")),
    **{f"roughconductor {d}, {n}": (None, bsdf(METAL + string("distribution", d) + a, "roughconductor"))
       for d in DISTRIBUTIONS
       for n, a in (("alpha 0.3", numbers(alpha=0.3)),
                    ("anisotropic", numbers(alpha_u=0.4, alpha_v=0.1)))},
    "roughconductor rectangle, anisotropic": (None, tilted(
        METAL + string("distribution", "ggx") + numbers(alpha_u=0.4, alpha_v=0.05), "roughconductor")),
    "dielectric": (None, bsdf(numbers(int_ior=1.5, ext_ior=1.0), "dielectric")),
    "dielectric by name": (None, bsdf(string("int_ior", "diamond"), "dielectric")),
    "thindielectric": (None, tilted(numbers(int_ior=1.8, ext_ior=1.0), "thindielectric")),
    **{f"roughdielectric {d}": (None, bsdf(
        numbers(int_ior=1.5, ext_ior=1.0, alpha=0.3) + string("distribution", d), "roughdielectric"))
       for d in DISTRIBUTIONS},
    **{f"{k}{n}": (None, bsdf(
        rgb("diffuse_reflectance", "0.8, 0.4, 0.2") + numbers(int_ior=1.5) + extra, k))
       for k in ("plastic", "roughplastic")
       for n, extra in (("", ""), (", nonlinear", '<boolean name="nonlinear" value="true"/>'))},
    "roughplastic ggx, alpha 0.3": (None, bsdf(
        rgb("diffuse_reflectance", "0.8, 0.4, 0.2") + string("distribution", "ggx")
        + numbers(alpha=0.3), "roughplastic")),
    **{f"principled {n}": (None, bsdf(BASE + numbers(**p), "principled")) for n, p in {
        "defaults": {},
        "rough": {"roughness": 0.9},
        "metallic": {"metallic": 1.0, "roughness": 0.4},
        "metallic, anisotropic": {"metallic": 1.0, "roughness": 0.5, "anisotropic": 0.8},
        "spec_trans": {"spec_trans": 1.0, "roughness": 0.5},
        "half metallic": {"metallic": 0.7, "roughness": 0.5},
        "specular, spec_tint": {"specular": 0.9, "spec_tint": 1.0, "roughness": 0.3},
        "sheen": {"sheen": 1.0, "sheen_tint": 0.5},
        "flatness": {"flatness": 1.0},
        "clearcoat": {"clearcoat": 1.0, "clearcoat_gloss": 0.5},
    }.items()},
    "blendbsdf": (None, bsdf(
        numbers(weight=0.2) + INNER + f'<bsdf type="roughconductor">{METAL}</bsdf>', "blendbsdf")),
    "blendbsdf, smooth and mirror": (None, bsdf(numbers(weight=0.2) + INNER + MIRROR, "blendbsdf")),
    "mask": (None, bsdf(numbers(opacity=0.3) + INNER, "mask")),
    "mask texture": (None, tilted(texture("opacity") + INNER, "mask")),
    "twosided": (None, LIGHT + f"""<shape type="rectangle"><transform name="to_world">
<rotate y="1" angle="160"/></transform><bsdf type="twosided">{INNER}{MIRROR}</bsdf></shape>"""),
    "bumpmap": (None, tilted(
        texture("displacement", '<boolean name="raw" value="true"/>', "bumps.exr")
        + numbers(scale=0.3) + PLAIN + INNER, "bumpmap")),
    "normalmap": (None, tilted(
        texture("normalmap", '<boolean name="raw" value="true"/>', "normals.exr") + PLAIN + INNER,
        "normalmap")),
    "null": (None, bsdf("", "null")),
    # Shapes
    "cube": (None, LIGHT + f'<shape type="cube">{TURN}{INNER}</shape>'),
    "disk": (None, LIGHT + f'<shape type="disk">{TURN}{INNER}</shape>'),
    "cylinder": (None, LIGHT + f'<shape type="cylinder">{TURN}<bsdf type="twosided">{INNER}</bsdf></shape>'),
    "instance": (None, LIGHT + f"""<shape type="shapegroup" id="g"><shape type="cube">{INNER}</shape>
</shape><shape type="instance"><ref id="g"/><transform name="to_world"><scale value="0.5"/>
<rotate y="1" angle="30"/><translate x="-0.6"/></transform></shape><shape type="instance">
<ref id="g"/><transform name="to_world"><scale value="0.3"/><translate x="0.6"/></transform></shape>"""),
    **{f"mirrored instance, {n}": (None, LIGHT + f"""<shape type="shapegroup" id="g">{shape}</shape>
<shape type="instance"><ref id="g"/><transform name="to_world"><scale x="-0.5" y="0.5" z="0.5"/>
<rotate y="1" angle="30"/><translate x="-0.6"/></transform></shape><shape type="instance"><ref id="g"/>
<transform name="to_world"><scale x="0.4" y="0.3" z="-0.3"/><translate x="0.6"/></transform></shape>""")
       for n, shape in {
           "cube": f'<shape type="cube">{INNER}</shape>',
           "glass": '<shape type="sphere"><bsdf type="dielectric"/></shape>',
           "metal": f'<shape type="sphere"><bsdf type="conductor">{METAL}</bsdf></shape>',
           "rectangle": f'<shape type="rectangle">{INNER}</shape>',
           "mesh": f"""<shape type="obj"><string name="filename" value="quad.obj"/>
<boolean name="face_normals" value="true"/>{INNER}</shape>""",
           "bumpmap": f"""<shape type="rectangle"><bsdf type="bumpmap">
{texture("displacement", '<boolean name="raw" value="true"/>', "bumps.exr")}{numbers(scale=0.3)}{PLAIN}{INNER}
</bsdf></shape>""",
       }.items()},
    "absorbing glass": (None, LIGHT + """<shape type="sphere"><bsdf type="dielectric"/>
<medium name="interior" type="homogeneous"><rgb name="albedo" value="0"/>
<rgb name="sigma_t" value="0.2, 0.5, 0.9"/><float name="scale" value="1.5"/></medium></shape>"""),
}

# Cases that must differ, and why; docs/agreement.md says more.
DIFFERENT = {
    "constant, grey spectrum": "Mitsuba gives it the colour of a flat spectrum, (1.205, 0.948, 0.909)",
    "envmap of few rows": "Mitsuba puts the centres of the first and last rows on the poles",
    "blendbsdf, smooth and mirror": "Mitsuba loses light; here it has the closed form",
}


def write_files(folder):
    """The images and meshes that the cases name."""
    import numpy as np

    random = np.random.default_rng(1)
    colours = random.uniform(0.05, 0.95, (4, 6, 3)) ** 2
    agreement.write_image(folder / "colours.exr", colours)
    import mitsuba

    mitsuba.Bitmap((colours * 255).astype("uint8")).write(str(folder / "colours.png"))
    v, u = np.mgrid[0:512, 0:1024] / [[[512]], [[1024]]]
    wave = 1 + 0.8 * np.sin(2 * np.pi * u + 0.4) * np.sin(np.pi * v)
    sky = np.stack([wave, 0.2 + v, 0.3 + wave**4], axis=-1)
    agreement.write_image(folder / "sky.exr", sky)
    v, u = np.mgrid[0:64, 0:64] / 64
    bumps = 0.5 + 0.1 * np.sin(4 * np.pi * u) + 0.1 * np.sin(2 * np.pi * (v + 0.1))
    agreement.write_image(folder / "bumps.exr", np.repeat(bumps[..., None], 3, axis=-1))
    tilt = [0.4 * np.sin(4 * np.pi * u), 0.3 * np.sin(2 * np.pi * v + 1)]
    normal = np.stack([*tilt, np.sqrt(1 - tilt[0] ** 2 - tilt[1] ** 2)], axis=-1)
    agreement.write_image(folder / "normals.exr", (normal + 1) / 2)
    corners = [(-1.5, -1, 0, 0, 0), (1.5, -1, 0, 1, 0), (1.2, 1, 0, 1, 1), (-1.5, 1, 0, 0, 1)]
    (folder / "quad.obj").write_text(
        "".join("v %g %g %g\n" % c[:3] for c in corners)
        + "".join("vt %g %g\n" % c[3:] for c in corners)
        + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    (folder / "quad.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty float u\nproperty float v\nelement face 2\n"
        "property list uchar int vertex_index\nend_header\n"
        + "".join("%g %g %g %g %g\n" % c for c in corners)
        + "3 0 1 2\n3 0 2 3\n"
    )


def markdown_table(report):
    """The figures of a report for docs/agreement.md."""
    lines = ["| case | ratio of means ± standard error | largest tile difference, % | |"]
    lines.append("| --- | --- | --- | --- |")
    for name, c in report["cases"].items():
        lines.append(
            f"| {name} | {c['ratio']:.4f} ± {c['ratio_error']:.4f} "
            f"| {100 * c['largest_tile_difference']:.2f} | {'' if c['agrees'] else 'differs'} |"
        )
    return "\n".join(lines)


def run_case(name, mitsuba, ours, folder, args):
    import numpy as np

    camera, objects = CASES[name]
    kind = "volpath" if "<medium" in objects else "path"
    scene = f"""<scene version="3.0.0"><integrator type="{kind}"/>{camera or sensor(CAMERA)}
{objects}</scene>"""
    file = folder / "scene.xml"
    file.write_text(scene)
    images = []
    for renderer in (ours, mitsuba):
        renderer.open(file)
        images.append(np.array([renderer.render(args.spp, 1 + i) for i in range(args.runs)]))
    if args.pictures:
        for image, who in zip(images, ("etendue", "mitsuba")):
            picture = pathlib.Path(args.pictures) / f"{name.replace(' ', '-')}-{who}.exr"
            agreement.write_image(picture, image.mean(axis=0))
    return agreement.compare(*images, tolerance=TOLERANCE)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cases", nargs="*", help="parts of the names of cases (default: all)")
    agreement.add_arguments(parser)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--spp", type=int, default=128, help="samples per pixel of each run")
    args, mitsuba, report = agreement.start(parser, "cases", markdown_table)
    surprises = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        ours = agreement.Etendue("path", args, folder)
        write_files(folder)
        for name in CASES:
            if args.cases and not any(part in name for part in args.cases):
                continue
            try:
                result = run_case(name, mitsuba, ours, folder, args)
            except Exception as error:  # what one of the two cannot read
                result = {"error": str(error).strip().splitlines()[-1]}
                print(f"{name:38} ERROR {result['error'][:110]}", flush=True)
                report["cases"][name] = result
                surprises += 1
                continue
            agrees = result["tiles_failed"] == 0 and result["p"] >= agreement.FALSE_ALARM
            result |= {"agrees": agrees, "spp": args.spp * args.runs}
            surprises += agrees == (name in DIFFERENT)
            verdict = "agrees" if agrees else "DIFFERS"
            print(
                f"{name:38} {verdict:8} ratio {result['ratio']:.4f} ±{result['ratio_error']:.4f}"
                f"  tiles failed {result['tiles_failed']:2}, largest difference"
                f" {100 * result['largest_tile_difference']:5.2f} % of the mean  {DIFFERENT.get(name, '')}",
                flush=True,
            )
            report["cases"][name] = result
    args.json.write_text(json.dumps(report, indent=1) + "\n")
    sys.exit(1 if surprises else 0)


if __name__ == "__main__":
    main()
