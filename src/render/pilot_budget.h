#pragma once
// What pilots may take.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "math/vec.h"
#include "render/renderer.h"

namespace etendue {

/// The largest part of a rendering that pilots may take, by simulated time. They are planned to take a little less, since what
/// they take is not known before.
struct PilotShare {
    double most, planned;
};
/// A method can gain much more than a guide.
constexpr PilotShare kShareOfAuto{0.08, 0.075}, kShareOfGuideChoice{0.04, 0.0375};

/// Simulated seconds: of the rendering, and of the pilots, which may take a small part of it.
class Budget {
public:
    Budget(const RenderLimits& limits, int threads, PilotShare share, double pixels,
           double sample_seconds)
        : limits_(limits), share_(share), pixels_(pixels), sample_seconds_(sample_seconds) {
        if (limits_.seconds) *limits_.seconds *= threads;
    }

    /// Of the rendering: what the first limit takes that is reached.
    double seconds() const {
        double seconds = std::numeric_limits<double>::infinity();
        if (limits_.spp) seconds = double(*limits_.spp) * pixels_ * sample_seconds_;
        if (limits_.seconds) seconds = std::min(seconds, *limits_.seconds);
        if (limits_.error)
            seconds = std::min(seconds, error_seconds_.value_or(plausible_error_seconds()));
        return std::isfinite(seconds) ? seconds : kUnlimitedSeconds;
    }
    std::optional<double> error() const { return limits_.error; }
    /// What a sample of the cheapest method takes.
    void set_sample_seconds(double seconds) { sample_seconds_ = seconds; }
    /// The time in which the best method reaches error(): no more than that can be saved.
    void set_error_seconds(double seconds) { error_seconds_ = seconds; }

    bool can_spend(double seconds) const { return seconds <= planned(); }
    /// What is planned for further pilots.
    double planned() const { return std::max(0.0, share_.planned * seconds() - spent_); }
    /// What pilots may take at most.
    double left() const { return std::max(0.0, share_.most * seconds() - spent_); }
    /// Whether it would be a small part of the rendering.
    static bool is_small(double seconds, double of) { return seconds <= kShareOfAuto.most * of; }
    void spend(double seconds) { spent_ += seconds; }
    double spent() const { return spent_; }

private:
    /// Of a rendering without limits.
    static constexpr double kUnlimitedSeconds = 60;
    /// relMSE of an image with one sample per pixel, before there are pilots: of simple scenes.
    static constexpr double kPlausibleError = 1;

    double plausible_error_seconds() const {
        return std::max(1.0, kPlausibleError / sqr(*limits_.error)) * pixels_ * sample_seconds_;
    }

    RenderLimits limits_;
    PilotShare share_;
    double pixels_, sample_seconds_;
    std::optional<double> error_seconds_;
    double spent_ = 0;
};

}  // namespace etendue
