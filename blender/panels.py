"""Panels of the render properties."""

from __future__ import annotations

from typing import Any

import bpy

from .engine import EtendueEngine
from .export import ExportEtendueScene
from .settings import group_of, integrators, parameters_of

# Panels of Blender itself that hold nothing which etendue ignores as a whole.
_SHARED = (
    "RENDER_PT_format", "RENDER_PT_frame_range", "RENDER_PT_output", "RENDER_PT_output_color_management",
    "RENDER_PT_color_management", "DATA_PT_lens", "DATA_PT_camera", "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture",
    "DATA_PT_context_camera", "DATA_PT_context_light", "DATA_PT_light", "DATA_PT_area", "DATA_PT_spot",
    "DATA_PT_uv_texture", "DATA_PT_vertex_colors", "WORLD_PT_context_world", "EEVEE_WORLD_PT_surface",
    "EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface",
)


class _RenderPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == EtendueEngine.bl_idname


class EtendueSamplingPanel(_RenderPanel, bpy.types.Panel):
    bl_idname = "ETENDUE_PT_sampling"
    bl_label = "Sampling"

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.etendue
        layout.use_property_split = True
        if not integrators():
            layout.label(text="The Python package etendue is missing", icon="ERROR")
            return
        for name in ("samples", "time", "seed", "depth", "denoise", "preview_samples"):
            layout.prop(settings, name)
        layout.operator(ExportEtendueScene.bl_idname)


class EtendueIntegratorPanel(_RenderPanel, bpy.types.Panel):
    bl_idname = "ETENDUE_PT_integrator"
    bl_label = "Integrator"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and bool(integrators())

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.etendue
        layout.use_property_split = True
        layout.prop(settings, "integrator")
        group = group_of(settings, settings.integrator)
        for name in parameters_of(settings.integrator):
            layout.prop(group, name)


CLASSES = (EtendueSamplingPanel, EtendueIntegratorPanel)


def _shared_panels() -> list[Any]:
    found = (getattr(bpy.types, name, None) for name in _SHARED)
    return [panel for panel in found if hasattr(panel, "COMPAT_ENGINES")]


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(EtendueEngine.bl_idname)


def unregister() -> None:
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(EtendueEngine.bl_idname)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
