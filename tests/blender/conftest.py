"""Skips these tests by name where bpy or etendue is missing, and registers the add-on once."""

import importlib.util
import os
import sys
from pathlib import Path

import pytest

_ADDON = Path(__file__).parents[2] / "blender"
_MISSING = [name for name in ("bpy", "etendue") if importlib.util.find_spec(name) is None]
_STATUS = pytest.StashKey[int]()

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


def pytest_sessionfinish(session, exitstatus):
    session.config.stash[_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Ends the process without the destructors of Blender 4.5, one of which waits for ever."""
    sys.stdout.flush()
    if "bpy" in sys.modules:
        if "etendue_addon" in sys.modules:  # no one else does, without the end of Python
            sys.modules["etendue_addon.panorama"].forget()
        os._exit(config.stash.get(_STATUS, 1))


@pytest.fixture
def studio(tmp_path):
    """An empty scene, with what builds and renders scenes."""
    from studio import Studio

    return Studio(tmp_path)
