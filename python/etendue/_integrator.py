"""Integrators written in Python."""

import hashlib
import inspect
import pickle
from typing import Any

from . import core


class Integrator:
    """Base class of integrators written in Python, for teaching and research. They take about 10^4 samples per second, so
    use images of about 64 x 64 pixels. render(), compare() and verify() accept objects of such a class.

        class Hits(et.Integrator):
            def counts(self, light_paths):
                return et.core.Counts(hit=1)

            def sample(self, c):
                z = c.eye_path(max_vertices=6)
                for t in range(2, len(z) + 1):
                    for x in c.join(0, t):
                        c.add(x)

    Two further methods are for objects whose attributes change while they render: save(self) -> bytes and
    load(self, state: bytes) -> None, with which a checkpoint keeps them. Without these, such a rendering cannot be resumed.
    """

    traces_light_paths: bool = False
    """Whether sample() calls Sample.light_path(). If so, the number N_L of light paths in a pass is that of pixels."""
    estimator: str = "unbiased"
    """The property that the class claims to have: "unbiased", "consistent" or "biased"; verify() reports it."""

    @property
    def name(self) -> str:
        """The name in reports."""
        return type(self).__name__

    def counts(self, light_paths: int) -> core.Counts:
        """Returns the number of samples of each strategy, for the MIS weights. light_paths is N_L; 0 without light paths."""
        raise NotImplementedError(f"{type(self).__name__} needs a method counts(self, light_paths)")

    def sample(self, c: core.Sample) -> None:
        """Makes and adds the paths of one sample, which may trace one eye path of a pixel and one light path."""
        raise NotImplementedError(f"{type(self).__name__} needs a method sample(self, c)")


def attributes_of(integrator: Integrator) -> dict[str, bytes]:
    """The attributes of an object in a form that can be compared; of those that cannot be pickled, their types."""

    def comparable(value: Any) -> bytes:
        try:
            return pickle.dumps(value)
        except Exception:
            return repr(type(value)).encode()

    return {name: comparable(value) for name, value in vars(integrator).items()}


def changed_attributes(integrator: Integrator, before: dict[str, bytes]) -> list[str]:
    """The names of attributes that are not as attributes_of() gave them."""
    now = attributes_of(integrator)
    return sorted(name for name in now.keys() | before.keys() if now.get(name) != before.get(name))


def identity(integrator: Integrator) -> str:
    """The name of an integrator, and a hash of what decides its samples: the source of its classes, and its attributes if it
    has no method save().
    """
    seen = hashlib.blake2b(digest_size=8)
    for cls in type(integrator).__mro__:
        if cls is Integrator:
            break
        seen.update(_source(cls))
    if not hasattr(integrator, "save"):
        for name, value in sorted(attributes_of(integrator).items()):
            seen.update(name.encode() + b"\0" + value)
    return f"{integrator.name} in Python, {seen.hexdigest()}"


def _source(cls: type) -> bytes:
    try:
        return inspect.getsource(cls).encode()
    except (OSError, TypeError):  # made without a file
        codes = [getattr(value, "__code__", None) for _, value in sorted(vars(cls).items())]
        return b"".join(code.co_code + repr(code.co_consts).encode() for code in codes if code)
