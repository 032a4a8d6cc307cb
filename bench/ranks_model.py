"""How long the processes of an MPI job, the ranks, take together for one image.

Passes are independent within a generation. Generations end after 1, 4, 16, 64 ... passes. Each rank renders whole passes. After
each of them, a round, the ranks exchange its pixels. Before each generation, they gather the sums of the film and the learned
state. They do the same for a checkpoint and for an image, which the first rank writes while the others wait;
both are due once a minute, or less often if they would take more than 1 % of the time. A checkpoint is due at least every
quarter of an hour.

Assumptions: a pass takes half the time on twice as many cores; a rank sends and receives at the full rate of its network; passes
take different times, normally distributed, and all ranks wait for the slowest one in each round; all costs grow with the number
of pixels; what each rank repeats, such as learning, is a part of the time of passes."""

import dataclasses
import math
import statistics

# Bytes of a pixel; tests/unit/render/ranks_test.cpp counts them.
EXCHANGED = 12  # Of a pass: three floats.
GATHERED = 44  # Of the film: sums and deviations of three channels, the deviation of the luminance, the luminance of a pass.
INTERVAL = 60  # Seconds between two checkpoints, or two images.
MOST_OF_TIME = 0.01  # That they take; otherwise there are fewer of them.
LONGEST_WAIT = 900  # Seconds to the next checkpoint.
SMALLEST_JITTER = 0.03


@dataclasses.dataclass
class Job:
    """A method on a machine and a network; bytes and seconds are those of the whole image."""

    pass_seconds: float
    jitter: float  # Standard deviation of the time of a pass, relative to its mean.
    exchanged_bytes: float = 0
    film_bytes: float = 0
    learned_bytes: float = 0
    bytes_a_second: float = math.inf
    checkpoint_seconds: float = 0
    image_seconds: float = 0

    def seconds(self, ranks, passes):
        """Until all passes are done."""
        others = (ranks - 1) / ranks  # A rank has its own part already.
        slowest = statistics.NormalDist().inv_cdf((ranks - 0.375) / (ranks + 0.25))  # of `ranks` standard normal numbers
        round_ = (1 + self.jitter * slowest) * self.pass_seconds + others * self.exchanged_bytes / self.bytes_a_second
        gather = (others * self.film_bytes + (ranks > 1) * self.learned_bytes) / self.bytes_a_second
        rounds = sum(math.ceil(size / ranks) for size in generations(passes))
        rendering = rounds * round_ + sum(1 for _ in generations(passes)) * gather
        # Seconds of writing by second of rendering.
        writing = sum(seconds / max(INTERVAL, min(seconds / MOST_OF_TIME, longest), round_)
                      for seconds, longest in ((gather + self.checkpoint_seconds, LONGEST_WAIT), (gather + self.image_seconds, math.inf))
                      if seconds > 0)
        return rendering * (1 + writing)

    def efficiency(self, ranks, passes):
        """Time of one rank over that of several, times their number."""
        return self.seconds(1, passes) / (ranks * self.seconds(ranks, passes))


def generations(passes):
    """Numbers of passes of the generations."""
    end, done = 1, 0
    while done < passes:
        yield min(end, passes) - done
        done, end = end, 4 * end


def jitter_of(pass_seconds):
    """That of the measured passes, or 3 % if that is more."""
    return max(SMALLEST_JITTER, statistics.pstdev(pass_seconds) / statistics.mean(pass_seconds))
