"""Integrators written in Python."""

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
