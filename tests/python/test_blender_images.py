"""The files of images that the add-on of Blender exports, without Blender."""

import importlib
import sys
import types
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def images(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of the add-on, whose package itself needs Blender."""
    package = types.ModuleType("etendue_addon")
    package.__path__ = [str(ROOT / "blender")]
    monkeypatch.setitem(sys.modules, package.__name__, package)
    for name in ("images", "report"):
        monkeypatch.delitem(sys.modules, f"{package.__name__}.{name}", raising=False)
    return importlib.import_module(f"{package.__name__}.images")


def described(*files: Path) -> dict[str, Any]:
    """A description with textures of these files."""
    return {"type": "scene", **{f"m{i}": {"type": "diffuse", "reflectance": {"type": "bitmap", "filename": str(f)}}
                                for i, f in enumerate(files)}}


def names_in(description: dict[str, Any]) -> list[str]:
    return [m["reflectance"]["filename"] for m in description.values() if isinstance(m, dict)]


def written(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


def test_copies_have_names_of_their_own(images: Any, tmp_path: Path) -> None:
    out = tmp_path / "out"
    one, other = written(tmp_path / "a", "wood.png", "one"), written(tmp_path / "b", "wood.png", "other")
    names = names_in(images.with_copies(described(one, other, one), out))
    assert [(out / n).read_text() for n in names] == ["one", "other", "one"] and names[0] == names[2]
    assert sorted(f.name for f in (out / "textures").iterdir()) == ["0-wood.png", "1-wood.png"]
    # Again, over the earlier copies.
    one.write_text("newer")
    assert names_in(images.with_copies(described(one, other), out)) == names[:2]
    assert (out / names[0]).read_text() == "newer"


def test_images_of_an_earlier_export_are_not_lost(images: Any, tmp_path: Path) -> None:
    """The scene uses files of the folder to which it is exported, one of which has the name that a copy would have."""
    out = tmp_path / "out"
    earlier = [written(out / "textures", name, name) for name in ("0-wood.png", "1-wood.png", "1-stone.png")]
    new = written(tmp_path, "wood.png", "new")
    names = names_in(images.with_copies(described(new, *earlier), out))
    assert [(out / n).read_text() for n in names] == ["new", "0-wood.png", "1-wood.png", "1-stone.png"]
    assert [f.read_text() for f in earlier] == ["0-wood.png", "1-wood.png", "1-stone.png"]


def test_all_images_are_copied_or_none(images: Any, tmp_path: Path) -> None:
    out = tmp_path / "out"
    earlier = written(out / "textures", "0-wood.png", "earlier")
    with pytest.raises(FileNotFoundError):
        images.with_copies(described(written(tmp_path, "wood.png", "new"), tmp_path / "missing.png"), out)
    assert earlier.read_text() == "earlier"
    assert [f.name for f in (out / "textures").iterdir()] == ["0-wood.png"]


def test_scenes_without_images_have_no_folder(images: Any, tmp_path: Path) -> None:
    assert images.with_copies({"type": "scene"}, tmp_path) == {"type": "scene"}
    assert list(tmp_path.iterdir()) == []
