"""Unbiased light transport with reused light paths.

A scene is loaded as a `Description`, which is plain data and can be edited. `Description.build` converts it to a `Scene`.
`render` returns a `Result`, whose images are NumPy arrays:

    import etendue as et
    d = et.load("scenes/cornell.xml")
    d["white.bsdf.reflectance"] = (0.9, 0.8, 0.7)
    result = et.render(d.build(resolution=(320, 320)), "upg+bdpt:max_depth=12", time=10)
    result.save("cornell.exr")

Images are arrays of shape (H, W, 3), float32, in linear RGB with the primaries of sRGB; the first row is the top one. With
the same seed, images are bit-identical to those of the program `etendue`.

Errors: SceneError, a ValueError, for the contents of a scene; ValueError, TypeError and IndexError for other arguments;
RuntimeError for files, and for names and parameters of integrators. The messages are those of the program. If a pass of a
rendering fails, the RenderError, a RuntimeError, has the result of the passes before it.
"""

from ._cpu import check_cpu as _check_cpu

_check_cpu()

from . import core
from ._etendue import Description, Scene, SceneError, __version__
from ._images import Diff, denoise, diff, read_image, tonemap, write_image
from ._integrator import Integrator
from ._job import Job, start
from ._memory import limit_memory
from ._method import integrator
from ._rays import RayHits
from ._render import FilmView, Progress, RenderError, Result, merge, render, render_sensors, resume
from ._reports import CompareReport, VerifyReport, compare, verify, verify_images
from ._scenes import (load, load_dict, load_string, look_at, plugins, rotate, scale, translate)
from ._scattering import Bsdfs, BsdfSamples, SensorRays
from ._show import show

SceneError.__module__ = "etendue"

__all__ = [
    "BsdfSamples", "Bsdfs", "CompareReport", "Description", "Diff", "FilmView", "Integrator", "Job", "Progress", "RayHits",
    "RenderError", "Result", "Scene", "SceneError", "SensorRays", "VerifyReport", "compare", "core", "denoise", "diff",
    "integrator", "limit_memory", "load", "load_dict", "load_string", "look_at", "merge", "plugins", "read_image", "render",
    "render_sensors", "resume", "rotate", "scale", "show", "start", "tonemap", "translate", "verify", "verify_images",
    "write_image",
]
