#pragma once
// Reconstruction filters. A filter is the response of a pixel to light at an offset from the pixel's centre. Eye
// samples are drawn from it (filter importance sampling [Ernst et al. 2006]), and splats are weighted with it, so both
// estimate the same image.

#include <memory>
#include <vector>

#include "description/params.h"
#include "math/vec.h"

namespace etendue {

/// Separable filter h(x)·h(y), normalised so that its integral over the plane is 1. Units: pixels.
class ReconstructionFilter {
public:
    /// Tabulates `shape` (unnormalised, even, zero beyond `radius`).
    ReconstructionFilter(const char* name, float radius,
                         double (*shape)(double x, double a, double b), double a = 0, double b = 0);
    static ReconstructionFilter box();

    float radius() const { return radius_; }
    const std::string& name() const { return name_; }
    bool is_box() const { return box_; }

    /// h(x)·h(y).
    float eval(Vec2 offset) const;
    /// An offset with density |h(x) h(y)| / ∫|h h| and the factor h/density (negative in negative lobes).
    struct Sample {
        Vec2 offset;
        float weight;
    };
    Sample sample(Vec2 u) const;

private:
    float eval_1d(float x) const;
    float sample_1d(float u, float& sign) const;

    std::string name_;
    float radius_;
    bool box_ = false;
    double (*shape_)(double, double, double);
    double a_, b_, scale_ = 1;
    std::vector<double> cdf_;  ///< CDF of |h| over [-radius, radius], at equal steps.
};

struct FilterEntry {
    PluginInfo info;
    ReconstructionFilter (*make)(const Params& params);
};
const std::vector<FilterEntry>& filter_registry();

}  // namespace etendue
