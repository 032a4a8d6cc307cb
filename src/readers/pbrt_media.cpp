// pbrt's media: absorption alone.

#include <fmt/format.h>

#include "readers/pbrt_scene.h"

namespace etendue {
namespace {

int make_homogeneous(PbrtScene& scene, const PbrtArguments& args) {
    // The defaults, per millimetre, scatter.
    const Rgb scattering =
        scene.colour(args, "sigma_s", Rgb(2.55f, 3.21f, 3.77f), PbrtSpectrum::Unbounded);
    if (!scattering.is_zero() || args.has("preset")) {
        scene.refuse(args.where(), "a medium that scatters is not supported (sigma_s must be 0)",
                     "vacuum");
        return -1;
    }
    if (args.has("Le"))
        scene.reject(args.find("Le")->where, "a medium that emits light is not supported");
    const int medium = scene.add("medium", "homogeneous", args.where());
    scene.set(
        medium, "sigma_a",
        scene.colour(args, "sigma_a", Rgb(0.0011f, 0.0024f, 0.014f), PbrtSpectrum::Unbounded) *
            args.number("scale", 1, 0));
    return medium;
}

}  // namespace

const std::vector<PbrtEntry>& pbrt_media() {
    constexpr const char* kGrid =
        "Rejected: media need volume transport, except those that absorb alone.";
    static const std::vector<PbrtEntry> entries = {
        {"homogeneous",
         kV3And4,
         "Becomes homogeneous, where sigma_s is 0; rejected where light scatters.",
         {{"sigma_a", ParamKind::Rgb, "0.0011 0.0024 0.014", "Absorption, 1/length."},
          {"sigma_s", ParamKind::Rgb, "2.55 3.21 3.77", "Scattering; must be 0."},
          {"scale", ParamKind::Float, "1", "Factor by which sigma_a and sigma_s are multiplied."},
          {"g", ParamKind::Float, "0", "Accepted; without effect."},
          {"preset", ParamKind::String, "", "Rejected: all of them scatter."},
          {"Le", ParamKind::Rgb, "", "Rejected.", kV4},
          {"Lescale", ParamKind::Float, "", "Accepted; without effect.", kV4}},
         make_homogeneous},
        {"heterogeneous", kV3, kGrid, {}, nullptr},
        {"uniformgrid", kV4, kGrid, {}, nullptr},
        {"rgbgrid", kV4, kGrid, {}, nullptr},
        {"cloud", kV4, kGrid, {}, nullptr},
        {"nanovdb", kV4, kGrid, {}, nullptr},
    };
    return entries;
}

}  // namespace etendue
