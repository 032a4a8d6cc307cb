#pragma once
// What a method with a guide learns before its first pass, for users who want to see why it helps or does not.

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "image/image.h"
#include "integrator/guiding.h"

namespace etendue {

/// Learned probability of an emitter.
struct EmitterChoice {
    std::string name;
    float learned, by_power;
};

/// The learned directions and lights at one place.
struct GuidedPlace {
    struct Lobe {
        Vec3 direction;  ///< Mean, as seen from the place.
        float share;     ///< Of the guided directions there.
        float weight;    ///< In the cell, without regard to the surface.
        float kappa;     ///< Concentration.
        float
            distance;  ///< From the centre of the cell to the origin of the lobe; kInf at infinity.
    };
    /// What eye walks, light walks, or light paths that start there, can choose from.
    struct Field {
        float share = 0;  ///< Of guided directions among all.
        GuideMixture mixture{};
        GuideView view{};
        std::vector<Lobe> lobes() const;  ///< By share, largest first.
    };
    bool is_surface = false;  ///< Otherwise the lens sees the environment there.
    std::string shape;        ///< Name of a surface.
    Vec3 p, normal;           ///< Of a surface; the normal on the side that is seen.
    Vec3 cell_center;
    int delta_events = 0;  ///< Mirrors and smooth glass on the way.
    int gloss_class = 0;   ///< See guide_class().
    Field eye, light, emission;
    /// The emitters that next events select there most often; empty where they select by power.
    std::vector<EmitterChoice> lights;

    /// The densities of directions, seen from the place like an environment of Mitsuba: rows from +y to -y, columns by
    /// azimuth from -z over +x. The colours are red for eye walks, green for light walks and blue for emission, each
    /// relative to its maximum; the layers eye, light and emission have the densities per steradian.
    Image directions(int width, int height) const;
};

/// Where no walk has met a surface.
struct NothingToLearn : std::runtime_error {
    using std::runtime_error::runtime_error;
};

class LearnedGuide {
public:
    /// Trains as a rendering by `spec` with guide=on (or guide=hp02, if it has this) does before its first pass. Throws
    /// std::runtime_error where the method has no guide, and NothingToLearn.
    LearnedGuide(const Scene& scene, IntegratorSpec spec, uint64_t seed, int threads);

    const Guide& guide() const { return *guiding_.guide(); }
    const std::string& method() const { return method_; }
    /// See Guiding::may_gain().
    bool may_gain() const;

    /// The emitters that light paths choose most often: at most so many, the most frequent one first; empty where light paths
    /// choose by power.
    std::vector<EmitterChoice> emitter_choices(size_t most) const;

    /// Shares of guided directions at the first surfaces: red for eye walks, green for light walks; the layer `cells` has a
    /// colour for each cell.
    Image shares() const;
    /// Mean of shares(), for eye walks and light walks.
    static std::array<double, 2> mean_shares(const Image& shares);

    /// What the lens sees at the centre of a pixel of the whole image, through mirrors and smooth glass. Throws
    /// std::runtime_error where the pixel lies outside, or nothing is seen there.
    GuidedPlace at_pixel(int x, int y) const;

private:
    /// The most probable emitters, where `pmf(emitter)` is the learned probability.
    template <class Pmf>
    std::vector<EmitterChoice> most_probable(size_t most, const Pmf& pmf) const;

    const Scene& scene_;
    std::string method_;
    uint64_t seed_;
    int threads_;
    Guiding guiding_;
};

}  // namespace etendue
