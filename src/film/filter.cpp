#include "film/filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace etendue {
namespace {

constexpr int kSteps = 2048;

double box_shape(double, double, double) {
    return 1;
}
double tent_shape(double x, double radius, double) {
    return std::max(0.0, 1 - std::fabs(x) / radius);
}
/// Gaussian of standard deviation `sigma`, shifted down so that it is zero at `radius`.
double gaussian_shape(double x, double sigma, double radius) {
    const double k = -0.5 / (sigma * sigma);
    return std::max(0.0, std::exp(k * x * x) - std::exp(k * radius * radius));
}
/// [Mitchell & Netravali 1988, eq. 8]
double mitchell_shape(double x, double b, double c) {
    x = std::fabs(x);
    const double x2 = x * x, x3 = x2 * x;
    if (x < 1) return ((12 - 9 * b - 6 * c) * x3 + (-18 + 12 * b + 6 * c) * x2 + (6 - 2 * b)) / 6;
    if (x < 2)
        return ((-b - 6 * c) * x3 + (6 * b + 30 * c) * x2 + (-12 * b - 48 * c) * x +
                (8 * b + 24 * c)) /
               6;
    return 0;
}
double lanczos_shape(double x, double lobes, double) {
    x = std::fabs(x);
    if (x < 1e-9) return 1;
    if (x >= lobes) return 0;
    const double px = x * std::numbers::pi;
    return std::sin(px) * std::sin(px / lobes) * lobes / (px * px);
}

}  // namespace

ReconstructionFilter::ReconstructionFilter(const char* name, float radius,
                                           double (*shape)(double, double, double), double a,
                                           double b)
    : name_(name), radius_(std::ceil(radius * kStepsPerPixel) / kStepsPerPixel),
      reach_(int(std::ceil(radius))), cdf_(kSteps + 1, 0.0) {
    const auto shape_at = [&](double x) {
        return std::fabs(x) < double(radius) ? shape(x, a, b) : 0.0;
    };
    // Of what is tabulated, which is linear between the points of the grid.
    double integral = 0;
    for (int i = 1 - kStepsPerPixel * reach_; i < kStepsPerPixel * reach_; ++i)
        integral += shape_at(double(i) / kStepsPerPixel) / kStepsPerPixel;

    for (int i = 0; i <= kStepsPerPixel; ++i) {
        const double f = double(i) / kStepsPerPixel;
        double sum = 0;
        for (int k = 1 - reach_; k <= reach_; ++k) sum += shape_at(f - k);
        for (int k = 1 - reach_; k <= reach_; ++k)
            table_.push_back(float(shape_at(f - k) / (is_wide() ? sum : integral)));
    }

    const double step = 2.0 * radius_ / kSteps;
    for (int i = 0; i < kSteps; ++i)
        cdf_[i + 1] =
            cdf_[i] + std::fabs(double(eval_1d(float(-double(radius_) + (i + 0.5) * step))));
    for (double& c : cdf_) c /= cdf_.back();
}

ReconstructionFilter ReconstructionFilter::box() {
    ReconstructionFilter f("box", 0.5f, box_shape);
    f.box_ = true;
    return f;
}

float ReconstructionFilter::eval_1d(float x) const {
    if (!(std::fabs(x) < radius_)) return 0;
    const float floor = std::floor(x);
    const float steps = (x - floor) * kStepsPerPixel;
    const int step = std::min(int(steps), kStepsPerPixel - 1);
    const int k = reach_ - 1 - int(floor);  // x = f - (k + 1 - reach)
    const float a = row(step)[k];
    return a + (steps - float(step)) * (row(step + 1)[k] - a);
}

float ReconstructionFilter::eval(Vec2 o) const {
    if (box_) return o.x >= -0.5f && o.x < 0.5f && o.y >= -0.5f && o.y < 0.5f ? 1.0f : 0.0f;
    return eval_1d(o.x) * eval_1d(o.y);
}

/// The inverse of the tabulated CDF. `factor` becomes h/density: exact, since the density is that of the table's cell.
float ReconstructionFilter::sample_1d(float u, float& factor) const {
    const auto it = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, double(u));
    const int i = int(it - cdf_.begin()) - 1;
    const double mass = cdf_[i + 1] - cdf_[i];
    const double f = mass > 0 ? std::min((u - cdf_[i]) / mass, 1.0) : 0.5;
    const double step = 2.0 * radius_ / kSteps;
    const float x = float(-double(radius_) + (i + f) * step);
    factor = mass > 0 ? float(double(eval_1d(x)) * step / mass) : 0.0f;
    return x;
}

ReconstructionFilter::Sample ReconstructionFilter::sample(Vec2 u) const {
    if (box_) return {{u.x - 0.5f, u.y - 0.5f}, 1.0f};
    float fx, fy;
    const float x = sample_1d(u.x, fx), y = sample_1d(u.y, fy);
    return {{x, y}, fx * fy};
}

const std::vector<FilterEntry>& filter_registry() {
    static const std::vector<FilterEntry> entries = {
        {{"rfilter", "box", "Box of one pixel.", {}},
         [](const Params&) { return ReconstructionFilter::box(); }},
        {{"rfilter",
          "tent",
          "Linear ramp from the pixel's centre.",
          {{"radius", ParamKind::Float, "1", "Half the width in pixels, above 0 and at most 16."}}},
         [](const Params& p) {
             const float r = p.number("radius", 1, 0.01f, 16);
             return ReconstructionFilter("tent", r, tent_shape, r);
         }},
        {{"rfilter",
          "gaussian",
          "Gaussian, truncated at four standard deviations and shifted to be zero there.",
          {{"stddev", ParamKind::Float, "0.5", "Standard deviation in pixels."}}},
         [](const Params& p) {
             const float sigma = p.number("stddev", 0.5f, 0.01f, 4);
             return ReconstructionFilter("gaussian", 4 * sigma, gaussian_shape, sigma, 4.0 * sigma);
         }},
        {{"rfilter",
          "mitchell",
          "Mitchell and Netravali's cubic; has negative lobes.",
          {{"b", ParamKind::Float, "0.333333", "Blur."},
           {"c", ParamKind::Float, "0.333333", "Ringing."},
           {"B", ParamKind::Float, "0.333333", "The same as b."},
           {"C", ParamKind::Float, "0.333333", "The same as c."}}},
         [](const Params& p) {
             const float third = 1.0f / 3;
             return ReconstructionFilter("mitchell", 2, mitchell_shape,
                                         p.number("b", p.number("B", third, 0, 1), 0, 1),
                                         p.number("c", p.number("C", third, 0, 1), 0, 1));
         }},
        {{"rfilter", "catmullrom", "Catmull–Rom spline; has negative lobes.", {}},
         [](const Params&) {
             return ReconstructionFilter("catmullrom", 2, mitchell_shape, 0, 0.5);
         }},
        {{"rfilter",
          "lanczos",
          "Windowed sinc; has negative lobes.",
          {{"lobes", ParamKind::Int, "3", "Number of lobes, 1 to 8."}}},
         [](const Params& p) {
             const int n = int(p.integer("lobes", 3, 1, 8));
             return ReconstructionFilter("lanczos", float(n), lanczos_shape, n);
         }},
    };
    return entries;
}

}  // namespace etendue
