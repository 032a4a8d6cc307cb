"""Integrators written in Python."""

from . import core


class Integrator:
    """Base class of integrators written in Python, for teaching and research: some 10^4 samples a second, so use images
    of about 64 x 64 pixels. render(), compare() and verify() take objects of such a class.

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
    """Whether sample() calls Sample.light_path(); N_L, the number of light paths of a pass, is then that of pixels."""
    estimator: str = "unbiased"
    """What the class claims to be: "unbiased", "consistent" or "biased"; verify() reports it."""

    @property
    def name(self) -> str:
        """The name in reports."""
        return type(self).__name__

    def counts(self, light_paths: int) -> core.Counts:
        """How many samples each strategy takes, for the MIS weights. light_paths is N_L, 0 where there are none."""
        raise NotImplementedError(f"{type(self).__name__} needs a method counts(self, light_paths)")

    def sample(self, c: core.Sample) -> None:
        """Makes the paths of one sample, which is one eye path of a pixel, and one light path, and adds them."""
        raise NotImplementedError(f"{type(self).__name__} needs a method sample(self, c)")
