#include "description/view.h"

#include <charconv>
#include <cmath>
#include <numbers>
#include <string_view>

#include <fmt/format.h>

#include "math/vec.h"

namespace etendue {

std::vector<ParamInfo> view_params(const char* aspect) {
    return {{"fov", ParamKind::Float, "", "Field of view in degrees along fov_axis."},
            {"fov_axis", ParamKind::String, "x", "Axis of fov: x, y, diagonal, smaller or larger."},
            {"aspect", ParamKind::Float, aspect,
             "Width over height of the view; pixels are not square if it differs from this."},
            {"focal_length", ParamKind::String, "50mm",
             "Focal length for a 35 mm film, instead of fov."}};
}

double view_half_width(const Params& params, double aspect) {
    const std::string focal = params.text("focal_length", "");
    if (!params.has("fov")) {
        // The diagonal is that of 35 mm film (43.27 mm) for any aspect ratio.
        const std::string text = focal.empty() ? "50mm" : focal;
        double mm = 0;
        const char* const text_end = text.data() + text.size();
        const auto [end, error] = std::from_chars(text.data(), text_end, mm);
        const std::string_view unit(end, size_t(text_end - end));
        if (error != std::errc() || (unit != "mm" && unit != "") || !(mm > 0) || !std::isfinite(mm))
            params.fail(
                "focal_length",
                fmt::format("parameter \"focal_length\" is \"{}\", but must be a length in mm, "
                            "like \"50mm\"",
                            focal));
        const double half_diagonal = std::hypot(36.0, 24.0) / 2 / mm;
        return half_diagonal * aspect / std::hypot(aspect, 1.0);
    }
    if (!focal.empty())
        params.fail("focal_length", "give either \"fov\" or \"focal_length\", not both");
    const double tangent =
        std::tan(params.number("fov", 0, 1e-3f, 179.9f) * std::numbers::pi / 360);
    switch (params.choice("fov_axis", {"x", "y", "diagonal", "smaller", "larger"}, 0)) {
    case 0: return tangent;
    case 1: return tangent * aspect;
    case 2: return tangent * aspect / std::hypot(aspect, 1.0);
    case 3: return aspect > 1 ? tangent * aspect : tangent;
    default: return aspect > 1 ? tangent : tangent * aspect;
    }
}

}  // namespace etendue
