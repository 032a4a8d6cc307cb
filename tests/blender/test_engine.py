"""The engine: passes, cancelling, errors, settings; and exported scenes rendered by the program."""

import os
import re
import shutil
import subprocess
import sys
import time
import types
import weakref
import zipfile
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

import etendue as et

ROOT = Path(__file__).parents[2]


def furnished(studio):
    """A scene with an image, a group of instances, a lamp and glass."""
    material, tree, node = studio.material("ShaderNodeBsdfPrincipled", "Wood 1.0", Roughness=0.4)
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = studio.image(lambda u, v: (u, v, 0.3))
    tree.links.new(texture.outputs["Color"], node.inputs["Base Color"])
    studio.plane(6, material)
    first = studio.sphere(studio.material("ShaderNodeBsdfGlass", "Glass")[0], at=(-0.8, 0, 0.5), radius=0.5)
    studio._add("Second", first.data).location = (0.8, 0, 0.5)
    studio.sphere(studio.material("ShaderNodeEmission", "Lamp", Strength=8.0)[0], at=(0, 0.5, 2), radius=0.3)
    studio.world((0.1, 0.2, 0.3))


def passes(monkeypatch):
    """The passes of renderings to come, by name, as Blender has them."""
    seen = {}
    engine = sys.modules["etendue_addon.engine"]

    def fill(result, name, image, original=engine._fill):
        original(result, name, image)
        found = result.layers[0].passes.find_by_name(name, "")
        values = np.zeros(image.size, np.float32)
        found.rect.foreach_get(values)
        seen[name] = values.reshape(image.shape)[::-1]

    monkeypatch.setattr(engine, "_fill", fill)
    return seen


def test_passes(studio, monkeypatch):
    material, _, _ = studio.material("ShaderNodeBsdfDiffuse", Color=(0.8, 0.4, 0.2))
    studio.plane(3, material)
    studio.world()
    layer = bpy.context.view_layer
    layer.use_pass_normal = layer.use_pass_z = True
    seen = passes(monkeypatch)
    combined = studio.render()
    assert np.allclose(seen["Combined"][..., :3], combined) and (seen["Combined"][..., 3] == 1).all()
    assert seen["Normal"][24, 32] == pytest.approx([0, 0, 1], abs=1e-4)
    assert seen["Albedo"][24, 32] == pytest.approx([0.8, 0.4, 0.2], abs=1e-4)
    # The centre of the view is the origin, at a distance of √20 along the axis.
    assert seen["Depth"][23:25, 31:33].mean() == pytest.approx(np.sqrt(20), rel=0.01)
    assert seen["Depth"][0, 0] == pytest.approx(1e10)
    # Depths are along the axis, not distances: where the ray through row 36 and the left quarter meets the plane z = 0.
    axis, frame = Vector((0, 2, -1)).normalized(), studio.cam.data.view_frame(scene=studio.scene)
    low, left = min(v.y for v in frame), min(v.x for v in frame)
    ray = studio.cam.matrix_world.to_3x3() @ Vector((left * (1 - 33 / 64), low * (73 / 48 - 1), frame[0].z))
    hit = ray * (2 / -ray.z)
    assert abs(hit.length / hit.dot(axis) - 1) > 0.02
    assert seen["Depth"][36, 16] == pytest.approx(hit.dot(axis), rel=0.01)


def test_the_denoised_image_is_a_pass_of_its_own(studio, monkeypatch):
    furnished(studio)
    settings = studio.scene.etendue
    settings.integrator, settings.samples = "bdpt", 256
    reference = studio.render()
    settings.samples, settings.denoise = 4, True
    seen = passes(monkeypatch)
    noisy = studio.render()
    denoised = seen["Denoised"][..., :3]
    error = [np.abs(image - reference).mean() for image in (noisy, denoised)]
    assert 0 < error[1] < 0.7 * error[0]

    # Files have it, too.
    image, file = studio.scene.render.image_settings, studio.folder / "passes.exr"
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, studio.scene.render.filepath = "OPEN_EXR_MULTILAYER", str(file)
    for settings.denoise in (True, False):
        bpy.ops.render.render(write_still=True)
        assert (b"ViewLayer.Denoised.R" in file.read_bytes()) == settings.denoise


def test_a_denoiser_that_fails_leaves_the_image(studio, monkeypatch, capfd):
    furnished(studio)
    expected = studio.render()

    def fail(_):
        raise RuntimeError("no memory")

    studio.scene.etendue.denoise = True
    monkeypatch.setattr(et.Result, "denoised", fail)
    assert studio.render().mean() == pytest.approx(expected.mean(), rel=0.1)
    assert "etendue: the image is not denoised: no memory" in "".join(capfd.readouterr())


def test_denoising_without_a_library_is_an_error(studio, monkeypatch):
    furnished(studio)
    monkeypatch.setenv("ETENDUE_OIDN", str(studio.folder))
    studio.scene.etendue.denoise = True
    with pytest.raises(RuntimeError, match="OIDN|denoise"):
        studio.render()


def test_renderings_can_be_cancelled(studio, monkeypatch):
    furnished(studio)
    engine = sys.modules["etendue_addon"].EtendueEngine
    calls = []

    # Blender asks its window; there is none.
    monkeypatch.setattr(engine, "is_cancelled", lambda self: calls.append(None) or len(calls) >= 3)
    studio.scene.etendue.samples = 100000
    studio.render()
    assert len(calls) == 3


def test_cancelling_does_not_wait_for_the_end_of_a_pass(studio, monkeypatch):
    furnished(studio)
    jobs = []
    monkeypatch.setattr(et, "start", lambda *args, start=et.start, **kwargs: jobs.append(start(*args, **kwargs)) or jobs[0])
    monkeypatch.setattr(sys.modules["etendue_addon"].EtendueEngine, "is_cancelled", lambda self: True)
    studio.scene.render.resolution_x, studio.scene.render.resolution_y = 1200, 900
    assert not studio.render().any()
    assert jobs[0].done and jobs[0].progress.passes == 0


def test_a_pass_that_fails_leaves_those_before_it(studio, monkeypatch, capfd):
    furnished(studio)
    whole = studio.render()

    class Failing(et.Job):
        def result(self, timeout=None):
            raise et.RenderError("pass 3: not enough memory", super().result(timeout)) from MemoryError("no memory")

    module = sys.modules[et.start.__module__]
    monkeypatch.setattr(module, "Job", Failing)
    studio.scene.etendue.samples = 2
    broken = studio.render()
    assert "etendue: no memory; the image is that of 2 samples" in "".join(capfd.readouterr())
    assert broken.mean() == pytest.approx(whole.mean(), rel=0.2)


def test_unexpected_errors_end_the_rendering_with_a_message(studio, monkeypatch):
    furnished(studio)
    monkeypatch.setattr(sys.modules["etendue_addon.scene"], "read_camera", lambda *_: 1 / 0)
    with pytest.raises(RuntimeError, match="etendue: division by zero"):
        studio.render()


def test_the_time_ends_the_rendering(studio, monkeypatch):
    furnished(studio)
    seen = []
    monkeypatch.setattr(et, "start", lambda *args, start=et.start, **kwargs: seen.append(start(*args, **kwargs)) or seen[0])
    studio.scene.etendue.samples, studio.scene.etendue.time = 100000, 1
    studio.render()
    result = seen[0].result()
    assert result.stopped_by == "time" and result.seconds < 5


def test_integrators_and_their_parameters_come_from_the_tables():
    settings, addon = bpy.context.scene.etendue, sys.modules["etendue_addon.settings"]
    assert addon.integrators() == [p["name"] for p in et.plugins("integrator")]
    assert settings.bl_rna.properties["integrator"].default == "auto"
    settings.integrator, settings.depth = "upg+bdpt", 12
    group = addon.group_of(settings, "upg+bdpt")
    group.radius, group.guide = 0.05, "on"
    assert addon.integrator_text(settings) == "upg+bdpt:max_depth=12,radius=0.05,guide=on"
    for plugin in et.plugins("integrator"):
        settings.integrator, settings.depth = plugin["name"], -1
        if plugin["name"] != "upg+bdpt":
            assert addon.integrator_text(settings) == plugin["name"]


def test_seeds_change_the_noise_and_nothing_else(studio):
    furnished(studio)
    studio.scene.etendue.samples = 4
    images = []
    for seed in (0, 0, 1):
        studio.scene.etendue.seed = seed
        images.append(studio.render())
    assert (images[0] == images[1]).all() and (images[0] != images[2]).any()


def test_exported_scenes_give_the_same_image_in_the_program(studio, tmp_path):
    program = os.environ.get("ETENDUE_PROGRAM")
    if not program or not Path(program).exists():
        pytest.skip("the program etendue is missing (ETENDUE_PROGRAM)")
    furnished(studio)
    for kind in ("SPOT", "AREA", "SUN"):
        studio.light(kind, energy=1, name=kind)
    ours, folder = studio.render(), tmp_path / "exported"
    assert bpy.ops.export_scene.etendue(directory=str(folder)) == {"FINISHED"}
    assert studio.scene.render.engine == "ETENDUE"
    assert not [line for line in (folder / "scene.xml").read_text().splitlines() if str(tmp_path) in line]
    image = tmp_path / "program.exr"
    subprocess.run([program, "render", folder / "scene.xml", "-o", image], check=True, capture_output=True)
    again = et.read_image(image)
    assert again.mean() == pytest.approx(ours.mean(), rel=1e-3)
    assert np.abs(again - ours).mean() < 1e-3 * ours.mean()


_MITSUBA = """
import sys, mitsuba as mi, numpy as np
mi.set_variant("scalar_rgb")
np.save(sys.argv[2], np.array(mi.render(mi.load_file(sys.argv[1]), spp=64))[..., :3])
"""


BALL = np.s_[14:34, 22:42]  # pixels within the sphere


def in_mitsuba(studio, folder):
    """The image of an exported scene in Mitsuba 3, whose Python is in the environment."""
    python = os.environ.get("ETENDUE_MITSUBA_PYTHON")
    if not python:
        pytest.skip("the Python of Mitsuba 3 is not known (ETENDUE_MITSUBA_PYTHON)")
    assert bpy.ops.export_scene.etendue(directory=str(folder), target="MITSUBA") == {"FINISHED"}
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    run = subprocess.run([python, "-c", _MITSUBA, folder / "scene.xml", folder / "image.npy"], env=environment,
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return np.load(folder / "image.npy")


def test_exports_for_mitsuba_look_the_same_there(studio, tmp_path):
    """Meshes, instances, textures, all kinds of lights, and models that both programs have."""
    texture = studio.image(lambda u, v: (u, v, 0.3))
    for i, (kind, inputs) in enumerate((("ShaderNodeBsdfDiffuse", dict(Color=(0.7, 0.3, 0.2))), ("ShaderNodeBsdfGlass", {}),
                                        ("ShaderNodeBsdfAnisotropic", dict(Roughness=0.4)), ("ShaderNodeBsdfTranslucent", {}))):
        material, tree, node = studio.material(kind, f"Ball {i}", **inputs)
        if hasattr(node, "distribution"):
            node.distribution = "GGX"
        first = studio.sphere(material, at=(i - 1.5, 0, 0.4), radius=0.4)
        studio._add(f"Copy {i}", first.data).location = (i - 1.5, 1.2, 0.4)
    material, tree, node = studio.material("ShaderNodeBsdfDiffuse", "Ground")
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = texture
    tree.links.new(image.outputs["Color"], node.inputs["Color"])
    studio.plane(6, material)
    studio.sphere(studio.material("ShaderNodeEmission", "Lamp", Strength=8.0)[0], at=(0, 0.5, 2), radius=0.3)
    for i, kind in enumerate(("SPOT", "AREA", "SUN", "POINT")):
        studio.light(kind, at=(i - 1.5, -1, 3), energy=1 if kind == "SUN" else 20, name=kind).shadow_soft_size = 0
    tree, background = studio.world()
    environment = tree.nodes.new("ShaderNodeTexEnvironment")
    environment.image = studio.image(lambda u, v: (u, v, 1 - u), 64, 32, is_float=True)
    tree.links.new(environment.outputs["Color"], background.inputs["Color"])
    studio.scene.etendue.samples = 64
    ours = studio.render()
    theirs = in_mitsuba(studio, tmp_path / "exported")
    assert theirs.mean(axis=(0, 1)) == pytest.approx(ours.mean(axis=(0, 1)), rel=0.02)
    blocks = [image.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3)) for image in (theirs, ours)]
    assert np.abs(blocks[0] - blocks[1]).max() < 0.06 * blocks[1].max()


def test_skies_are_images_for_mitsuba(studio, tmp_path):
    """With their sun: the image is as bright as 32-bit numbers need."""
    tree, background = studio.world(strength=0.05)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_size = 0.6, 0.03
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    studio.plane(material=studio.material("ShaderNodeBsdfDiffuse")[0])
    studio.sphere(studio.material("ShaderNodeBsdfDiffuse", "Ball")[0], at=(0, 0, 0.5), radius=0.5)
    ours = studio.render()
    theirs = in_mitsuba(studio, tmp_path / "exported")
    assert theirs.mean(axis=(0, 1)) == pytest.approx(ours.mean(axis=(0, 1)), rel=0.02)


WHITE, COLOR = (1.0, 1.0, 1.0), (0.7, 0.3, 0.2)
# name: inputs, and the ratio of the image in Mitsuba 3 to ours.
PRINCIPLED = {
    "diffuse": (dict(Base_Color=COLOR, Roughness=0.5), 1.04),
    "metal": (dict(Base_Color=(0.9, 0.6, 0.2), Metallic=1.0, Roughness=0.3), 0.99),
    "rough metal": (dict(Base_Color=WHITE, Metallic=1.0, Roughness=0.8), 0.56),
    "glass": (dict(Base_Color=WHITE, Transmission_Weight=1.0, Roughness=0.1), 1.0),
    "half glass": (dict(Base_Color=WHITE, Transmission_Weight=0.5, Roughness=0.5), 0.74),
    "coat": (dict(Base_Color=COLOR, Coat_Weight=1.0), 1.05),
    "sheen": (dict(Base_Color=COLOR, Sheen_Weight=1.0), 0.98),
}


@pytest.mark.parametrize("name", PRINCIPLED)
def test_principled_materials_become_those_of_mitsuba(studio, tmp_path, capfd, name):
    """Its `principled` loses or gains energy, as docs/blender.md says."""
    settings, expected = PRINCIPLED[name]
    studio.sphere(studio.material("ShaderNodeBsdfPrincipled", "Ball", **settings)[0], at=(0, 0, 0), radius=1.2)
    studio.world()
    ours = studio.render()
    capfd.readouterr()
    theirs = in_mitsuba(studio, tmp_path / "exported")
    assert 'bsdf "principled" stands in for it' in "".join(capfd.readouterr())
    assert theirs[BALL].mean() / ours[BALL].mean() == pytest.approx(expected, abs=0.02)


def test_exports_for_etendue_keep_its_models(studio, tmp_path):
    studio.sphere(studio.material("ShaderNodeBsdfPrincipled", "Ball")[0])
    for target in ("ETENDUE", "MITSUBA"):
        folder = tmp_path / target
        assert bpy.ops.export_scene.etendue(directory=str(folder), target=target) == {"FINISHED"}
        text = (folder / "scene.xml").read_text()
        assert ('type="openpbr"' in text) == (target == "ETENDUE") and ('type="principled"' in text) == (target == "MITSUBA")


def test_viewports_render_what_the_camera_sees(studio):
    """Without a window there is no drawing; the sensor of a viewport is that of its matrices."""
    from etendue_addon.viewport import _sensor

    furnished(studio)

    class Region:
        width, height = 64, 48

    class View:
        is_perspective = True
        view_matrix = studio.cam.matrix_world.inverted()
        window_matrix = studio.cam.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=64, y=48)

    class Context:
        region, region_data = Region, View

    from etendue_addon.scene import SceneReader

    description = SceneReader(bpy.context.evaluated_depsgraph_get(), studio.folder).read(_sensor(Context))
    image = et.render(et.load_dict(description).build(), "path", spp=16, progress=False).image
    assert image.mean() == pytest.approx(studio.render().mean(), rel=0.02)


def test_orthographic_viewports_begin_behind_their_origin(studio):
    """Blender's matrices of a view from above, whose origin is the point that is looked at: within the sphere."""
    from etendue_addon.scene import SceneReader
    from etendue_addon.viewport import _sensor

    studio.world()
    studio.sphere(at=(0, 0, 0))
    end, half = 500, 2

    class View:
        is_perspective = False
        view_matrix = Matrix()
        window_matrix = Matrix(((1 / half, 0, 0, 0), (0, 64 / 48 / half, 0, 0), (0, 0, -1 / end, 0), (0, 0, 0, 1)))

    context = types.SimpleNamespace(region=types.SimpleNamespace(width=64, height=48), region_data=View)
    description = SceneReader(bpy.context.evaluated_depsgraph_get(), studio.folder).read(_sensor(context))
    result = et.render(et.load_dict(description).build(), "path", spp=1, aovs=["position"], progress=False)
    assert result.aov["position"][24, 32] == pytest.approx([0, 0, 1], abs=0.1)


class FakeEngine:
    """What a viewport calls of Blender's engine."""

    def __init__(self):
        self.redraws, self.said, self.fraction, self.shader = 0, "", 0.0, []

    def tag_redraw(self):
        self.redraws += 1

    def update_stats(self, _, text):
        self.said = text

    def update_progress(self, fraction):
        self.fraction = fraction

    def bind_display_space_shader(self, scene):
        self.shader.append(scene.name)

    def unbind_display_space_shader(self):
        self.shader.append(None)


def viewport(studio, monkeypatch, engine):
    """A viewport of the camera's view, and its context."""
    module = sys.modules["etendue_addon.viewport"]
    monkeypatch.setattr(module, "_draw", lambda *_: None)

    class View:
        is_perspective = True
        view_matrix = studio.cam.matrix_world.inverted()
        window_matrix = studio.cam.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=64, y=48)
        perspective_matrix = window_matrix @ view_matrix

    class Context:
        region, region_data = type("Region", (), {"width": 64, "height": 48}), View

    return module.Viewport(engine), Context


def wait(condition):
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("it has not come")


def test_viewports_render_until_blender_releases_them(studio, monkeypatch):
    furnished(studio)
    studio.scene.etendue.preview_samples = 1000000
    engine = FakeEngine()
    view, context = viewport(studio, monkeypatch, engine)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(context, depsgraph)
    view.draw(context, depsgraph)
    wait(lambda: view._run.image is not None)
    view.draw(context, depsgraph)
    assert engine.redraws > 0 and view._run.image.shape == (48, 64, 3)
    run = view._run
    released = weakref.ref(engine)
    del engine
    assert released() is None and not run._thread.is_alive() and not run.error


def test_viewports_say_how_far_they_are(studio, monkeypatch):
    """Samples, time and the fraction; nothing of the last image after a change of the view."""
    furnished(studio)
    studio.scene.etendue.preview_samples = 3
    engine = FakeEngine()
    view, context = viewport(studio, monkeypatch, engine)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(context, depsgraph)
    view.draw(context, depsgraph)
    assert engine.said == "Building the scene" or re.fullmatch(r"\d of 3 samples, \d+\.\d s", engine.said)
    wait(lambda: view._run.fraction == 1)
    view.draw(context, depsgraph)
    assert re.fullmatch(r"3 of 3 samples, \d+\.\d s", engine.said) and engine.fraction == 1
    monkeypatch.setattr(et, "load_dict", lambda *_: time.sleep(0.5))
    context.region.width = 32
    view.draw(context, depsgraph)
    assert engine.said == "Building the scene" and engine.fraction == 0 and view._run.image is None
    view.close()


def test_viewports_draw_the_newest_image_over_all_of_the_region(studio, monkeypatch):
    """Without a window there is no GPU: what the drawing gives to it is looked at instead."""
    calls = []
    gpu, presets = types.ModuleType("gpu"), types.ModuleType("gpu_extras.presets")
    gpu.types = types.SimpleNamespace(
        Buffer=lambda kind, size, data: calls.append((kind, size, data)) or data,
        GPUTexture=lambda size, format, data: calls.append((size, format)) or "texture")
    presets.draw_texture_2d = lambda *args: calls.append(args)
    monkeypatch.setitem(sys.modules, "gpu", gpu)
    monkeypatch.setitem(sys.modules, "gpu_extras.presets", presets)
    engine, region = FakeEngine(), types.SimpleNamespace(width=300, height=200)
    image = np.arange(18, dtype=np.float64).reshape(2, 3, 3)
    sys.modules["etendue_addon.viewport"]._draw(engine, types.SimpleNamespace(region=region), studio.scene, image)
    kind, size, data = calls[0]
    assert (kind, size, data.dtype, data.shape) == ("FLOAT", 24, np.float32, (24,)) and data.flags.c_contiguous
    assert data[:8].tolist() == [9, 10, 11, 1, 12, 13, 14, 1] and data[12:16].tolist() == [0, 1, 2, 1]
    assert calls[1:] == [((3, 2), "RGBA16F"), ("texture", (0, 0), 300, 200)]
    assert engine.shader == [studio.scene.name, None]


def test_the_engines_of_blender_can_be_referred_to_weakly(studio, monkeypatch):
    """By this, viewports know when they end."""
    furnished(studio)
    ended = []
    engine = sys.modules["etendue_addon"].EtendueEngine
    monkeypatch.setattr(engine, "_trace", lambda self, *_: weakref.finalize(self, ended.append, True) and None)
    studio.scene.render.engine = "ETENDUE"
    bpy.ops.render.render()
    assert ended == [True]


def test_viewports_say_why_there_is_no_image(studio, monkeypatch):
    furnished(studio)
    engine = FakeEngine()
    view, context = viewport(studio, monkeypatch, engine)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    view.update(context, depsgraph)
    monkeypatch.setattr(et, "load_dict", lambda *_: 1 / 0)
    view.draw(context, depsgraph)
    wait(lambda: view._run.error)
    view.draw(context, depsgraph)
    assert engine.said == "division by zero"


_INSTALL = """
import bpy
import addon_utils
addon_utils.enable("bl_pkg")
bpy.ops.extensions.package_install_files(filepath={zip!r}, repo="user_default", enable_on_install=True)
bpy.context.scene.render.engine = "ETENDUE"
print("engine:", bpy.context.scene.render.engine)
"""


def test_the_zip_is_an_extension_that_blender_installs(tmp_path):
    subprocess.run([ROOT / "scripts/blender-addon"], check=True, capture_output=True)
    file = ROOT / "out/etendue-blender.zip"
    with zipfile.ZipFile(file) as archive:
        assert {"blender_manifest.toml", "__init__.py", "LICENSE"} <= set(archive.namelist())
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)}
    code = _INSTALL.format(zip=str(file))
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert "engine: ETENDUE" in run.stdout, run.stdout + run.stderr


_RENDER = """
import os
import sys
import bpy
import addon_utils
assert not any("etendue" in p for p in sys.path), sys.path
addon_utils.enable("bl_pkg")
bpy.ops.extensions.package_install_files(filepath={zip!r}, repo="user_default", enable_on_install=True)
import etendue
print("package:", etendue.__file__)
bpy.ops.wm.open_mainfile(filepath={blend!r}, load_ui=False)
print("engine:", bpy.context.scene.render.engine)
bpy.context.scene.render.filepath = {image!r}
bpy.ops.render.render(write_still=True)
sys.stdout.flush()
os._exit(0)
"""


def test_the_zip_with_the_wheel_renders_without_anything_else(studio, tmp_path):
    """One file is installed in a Blender whose Python does not have etendue."""
    wheels = sorted((ROOT / "out/wheel").glob("*cp311*.whl"))
    wheel = os.environ.get("ETENDUE_WHEEL") or (str(wheels[-1]) if wheels else "")
    if not wheel:
        pytest.skip("there is no wheel for Python 3.11 in out/wheel (ETENDUE_WHEEL)")
    furnished(studio)
    ours = studio.render()
    blend, image, home = (tmp_path / name for name in ("scene.blend", "alone.exr", "home"))
    studio.scene.render.engine = "ETENDUE"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    subprocess.run([ROOT / "scripts/blender-addon", wheel], check=True, capture_output=True)
    file = shutil.move(ROOT / "out/etendue-blender.zip", tmp_path / "etendue-blender.zip")
    home.mkdir()
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "ETENDUE"))}
    environment["BLENDER_USER_RESOURCES"] = str(home)
    code = _RENDER.format(zip=str(file), blend=str(blend), image=str(image))
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=tmp_path)
    assert f"package: {home}" in run.stdout and "engine: ETENDUE" in run.stdout, run.stdout + run.stderr
    again = et.read_image(image)[..., :3]
    assert again.mean() == pytest.approx(ours.mean(), rel=1e-3) and np.abs(again - ours).mean() < 1e-3 * ours.mean()
