#pragma once
// What pilot images of several methods say of the errors of whole renderings.
//
// All methods are rendered on the same small film, each in several independent images of equal cost. The predicted error
// of a rendering of N such images is the mean over tiles of two parts, relative to µ² + 0.01 m² as in the errors of
// `compare`; µ is the mean of the tile, and m that of the film.
//
// - Noise: the variance of an image between its pixels' values, divided by N. Of a difference d beyond V = µ max(16, N),
//   only V |d| counts instead of d². Such a value would still stand out from the rendering as a spike: whether a pilot has
//   met one is chance, and its square would decide the score. What counts is its energy, as if it were missing.
// - Passes that follow each other in a sequence of the sampler complement each other: their mean has less noise than the
//   mean of as many independent passes. The noise of single images is multiplied by how much less, on average over the film.
// - Missing light: where the mean of a method certainly lies below that of another one, it lacks light that the other one
//   has, and will find it in spikes. The lower limit δ of the difference counts V δ, like the energy of spikes that were
//   met. It is looked for in tiles, in groups of them, and in the whole film; the level with the largest sum counts. The
//   limits of two methods hold with a probability of 99 % in all tiles of a level. A method whose images are all black lacks
//   what another one has met, however rarely: light is never negative, so that this is certain.
//
// The images of chains are those of independent chains, so that the disagreement of chains is their noise. It depends on
// the size of pixels: states that follow each other are near each other, in one large pixel, but in several small ones. If
// the noise of neighbouring pixels were independent, the variance of the mean of four would be a quarter; where it is f
// times that, each division of a pixel's area by four is taken to divide the variance of chains by f, down to that of
// independent states.

#include <algorithm>
#include <span>
#include <vector>

namespace etendue {

/// Independent images of one method, row by row.
struct PilotImages {
    std::vector<std::vector<float>> images;
    double horizon = 1;  ///< N, the number of such images that the whole rendering is worth.
    /// Of chains: the number of pixels of the rendering in one of the pilot, at least 1. Of other methods 1, since their
    /// samples are independent.
    double pixels_in_one = 1;
    /// Of a pixel of an image of chains, relative, if its states were independent.
    double least_variance = 0;
    /// So many successive images are passes of one sequence, and depend on each other; those of other sequences do not.
    int in_sequence = 1;
};

struct PilotScore {
    double noise = 0, missing = 0;
    bool has_light = false;  ///< Whether any of its images has.
    double error() const { return noise + missing; }
};

/// The time after which the relMSE is `wanted`, where `error` is predicted for a rendering of `seconds`, of which the first
/// `start` have no samples.
inline double seconds_until(double wanted, double error, double seconds, double start) {
    return start + error / wanted * std::max(0.0, seconds - start);
}

/// The scores of methods, each with two images or more, on a film of this size.
std::vector<PilotScore> score_pilots(std::span<const PilotImages> methods, int width, int height);

/// The more light paths there are in a pass, the more of them gathers and merges find: with four times as many, their noise
/// is at most so many times smaller.
constexpr double kMostGainOfReuse = 2;

/// The noise of an image of one method, relative to the tiles, on the last two films of pilots.
struct NoiseOfFilms {
    enum class Kind { Independent, Reuse, Chains } kind = Kind::Independent;
    double before = 0, now = 0;  ///< 0: unknown.
    int like = -1;  ///< A method whose gain is taken instead of its own, which is unknown yet.
};
/// Factors of noise for the rendering, whose film has `ratio` times as many pixels as that of the pilots. From the last film
/// to this one, of `growth` times as many pixels, all methods gain the variation within pixels; the further gain of those that
/// reuse light paths goes on to the film of the rendering.
std::vector<double> reuse_factors(std::span<const NoiseOfFilms> methods, double growth,
                                  double ratio);

}  // namespace etendue
