#include "figures.h"

#include <cmath>

#include <fmt/format.h>

namespace etendue {

std::string format_seconds(double seconds) {
    if (seconds < 100) return fmt::format("{:.1f} s", seconds);
    const long t = std::lround(seconds);
    return t < 3600 ? fmt::format("{}:{:02}", t / 60, t % 60)
                    : fmt::format("{}:{:02}:{:02}", t / 3600, t / 60 % 60, t % 60);
}

std::string format_error(const ErrorEstimate& error) {
    if (!error.valid) return "";
    return fmt::format(", relative error {:.4f} (95 %: {:.4f} to {:.4f})", error.relative_rms,
                       error.low, error.high);
}

}  // namespace etendue
