import os
from pathlib import Path

import pytest

import etendue as et

ROOT = Path(__file__).resolve().parents[2]


class Hits(et.Integrator):
    """Emitted radiance that eye paths hit, times a factor."""

    def __init__(self, factor: float = 1) -> None:
        self.factor = factor

    def counts(self, light_paths: int) -> et.core.Counts:
        return et.core.Counts(hit=1)

    def sample(self, c: et.core.Sample) -> None:
        z = c.eye_path(max_vertices=4)
        for t in range(2, len(z) + 1):
            for x in c.join(0, t):
                c.add(x, factor=self.factor)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "long: takes minutes; chosen by -m long")
    config.addinivalue_line("markers", "clusters: an example for clusters; chosen by -m clusters")


@pytest.fixture(scope="session")
def program() -> str:
    """The command line, of the same build."""
    return os.environ["ETENDUE_PROGRAM"]


@pytest.fixture(scope="session")
def scenes() -> Path:
    return ROOT / "scenes"


@pytest.fixture(scope="session")
def cornell(scenes: Path) -> et.Scene:
    return et.load(scenes / "cornell.xml").build(resolution=(32, 24))


@pytest.fixture(scope="session")
def demo(scenes: Path) -> et.Scene:
    return et.load(scenes / "demo.xml").build(resolution=(40, 30))
