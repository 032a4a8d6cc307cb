"""etendue as a render engine of Blender."""

import bpy

from . import panels, panorama, settings
from .engine import EtendueEngine
from .export import ExportEtendueScene, menu


def register() -> None:
    settings.register()
    bpy.utils.register_class(EtendueEngine)
    bpy.utils.register_class(ExportEtendueScene)
    panels.register()
    bpy.types.TOPBAR_MT_file_export.append(menu)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(menu)
    panels.unregister()
    bpy.utils.unregister_class(ExportEtendueScene)
    bpy.utils.unregister_class(EtendueEngine)
    settings.unregister()
    panorama.forget()
