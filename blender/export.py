"""The operator that writes the scene to a folder, for renderings by the program on other machines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from .engine import EtendueEngine


class ExportEtendueScene(bpy.types.Operator):
    """Write the scene as XML with PLY meshes, for the program etendue or for Mitsuba 3"""

    bl_idname = "export_scene.etendue"
    bl_label = "Export etendue scene"

    directory: StringProperty(name="Folder", description="Receives scene.xml, meshes and textures", subtype="DIR_PATH")
    target: EnumProperty(name="For", description="The program that reads the file", default="ETENDUE", items=[
        ("ETENDUE", "etendue", "The scene that F12 renders; etendue reads it, Mitsuba 3 does not have all of its models"),
        ("MITSUBA", "Mitsuba 3", "What Mitsuba 3 does not have is replaced, with warnings; etendue reads the file, too"),
    ])

    def invoke(self, context: Any, event: Any) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        folder, scene = Path(bpy.path.abspath(self.directory)), context.scene
        folder.mkdir(parents=True, exist_ok=True)
        previous = scene.render.engine
        EtendueEngine.destination, EtendueEngine.is_for_mitsuba = folder, self.target == "MITSUBA"
        scene.render.engine = EtendueEngine.bl_idname
        try:
            bpy.ops.render.render(scene=scene.name)
        except RuntimeError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        finally:
            EtendueEngine.destination, EtendueEngine.is_for_mitsuba = None, False
            scene.render.engine = previous
        self.report({"INFO"}, f"{folder / 'scene.xml'} is written")
        return {"FINISHED"}


def menu(self: Any, context: Any) -> None:
    for target, text in (("ETENDUE", "etendue scene (.xml)"), ("MITSUBA", "Mitsuba 3 scene (.xml)")):
        self.layout.operator(ExportEtendueScene.bl_idname, text=text).target = target
