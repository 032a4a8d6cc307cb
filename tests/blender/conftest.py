"""Skips these tests by name where bpy or etendue is missing, and registers the add-on once."""

import importlib.util
import sys
from pathlib import Path

import pytest

_ADDON = Path(__file__).parents[2] / "blender"
_MISSING = [name for name in ("bpy", "etendue") if importlib.util.find_spec(name) is None]

if not _MISSING:
    spec = importlib.util.spec_from_file_location(
        "etendue_addon", _ADDON / "__init__.py", submodule_search_locations=[str(_ADDON)])
    addon = sys.modules["etendue_addon"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(addon)
    addon.register()


def pytest_collection_modifyitems(items):
    if _MISSING:
        for item in items:
            item.add_marker(pytest.mark.skip(reason=f"the Python package {_MISSING[0]} is missing"))


@pytest.fixture
def studio(tmp_path):
    """An empty scene, with what builds and renders scenes."""
    from studio import Studio

    return Studio(tmp_path)
