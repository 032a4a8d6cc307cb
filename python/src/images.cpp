// Images: files, errors, tone mapping.

#include <limits>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "compare/embedded_image.h"
#include "compare/error_json.h"
#include "image/flip.h"
#include "image/image_io.h"
#include "image/metrics.h"
#include "image/tonemap.h"

namespace etendue::python {
namespace {

std::span<const Rgb> pixels_of(const ImageArgument& image) {
    return {reinterpret_cast<const Rgb*>(image.data()), image.shape(0) * image.shape(1)};
}

void check_same_size(const ImageArgument& a, const ImageArgument& b) {
    if (a.shape(0) != b.shape(0) || a.shape(1) != b.shape(1))
        throw nb::value_error("the images differ in size");
}

ToneMapping mapping_of(const std::string& op, float exposure, float white) {
    ToneMapping m;
    const auto found = tone_operator(op);
    if (!found) throw nb::value_error("operator must be \"aces\", \"reinhard\" or \"srgb\"");
    m.op = *found;
    m.exposure = exposure;
    m.white = white;
    return m;
}

nb::ndarray<nb::numpy, uint8_t> tonemap(const ImageArgument& image, const std::string& op,
                                        float exposure, float white) {
    auto* codes = new std::vector<uint8_t>(
        srgb_codes(tone_map(pixels_of(image), mapping_of(op, exposure, white))));
    nb::capsule owner(codes,
                      [](void* p) noexcept { delete static_cast<std::vector<uint8_t>*>(p); });
    return {codes->data(), {image.shape(0), image.shape(1), 3}, owner};
}

nb::bytes png(nb::ndarray<const uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu> codes) {
    const std::string bytes =
        encode_png(int(codes.shape(1)), int(codes.shape(0)), {codes.data(), codes.size()});
    return nb::bytes(bytes.data(), bytes.size());
}

/// The errors as JSON, the map of FLIP, and that of relMSE.
std::tuple<std::string, std::optional<FloatArray>, FloatArray>
diff(const ImageArgument& image, const ImageArgument& reference,
     const std::optional<ImageArgument>& reference2, const std::string& flip, float ignore_above) {
    check_same_size(image, reference);
    if (reference2) check_same_size(image, *reference2);
    const auto x = pixels_of(image), r = pixels_of(reference);
    const std::span<const Rgb> r2 = reference2 ? pixels_of(*reference2) : std::span<const Rgb>();
    const int width = int(image.shape(1)), height = int(image.shape(0));
    nlohmann::ordered_json j = to_json(image_errors(x, r, {r2, ignore_above}));
    std::optional<FloatArray> flip_map;
    if (flip == "hdr" || flip == "ldr") {
        FlipResult result =
            flip == "hdr" ? hdr_flip(x, r, width, height) : ldr_flip(x, r, width, height);
        j[flip == "hdr" ? "flip_hdr" : "flip_ldr"] = result.mean;
        flip_map = to_array(std::move(result.map), width, height);
    } else if (flip != "none") {
        throw nb::value_error("flip must be \"hdr\", \"ldr\" or \"none\"");
    }
    return {j.dump(), flip_map, to_array(relative_squared_errors(x, r, r2), width, height)};
}

FloatArray magma_colours(nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu> v) {
    std::vector<Rgb> out;
    out.reserve(v.size());
    for (size_t i = 0; i < v.size(); ++i) out.push_back(magma(v.data()[i]));
    return to_array(std::move(out), int(v.shape(1)), int(v.shape(0)));
}

}  // namespace

void bind_images(nb::module_& m) {
    using namespace nb::literals;
    m.def(
        "read_image",
        [](const std::string& file, const std::string& layer) {
            RgbImage image = read_rgb(file, layer);
            return to_array(std::move(image.pixels), image.width, image.height);
        },
        "file"_a, "layer"_a = "");
    m.def(
        "write_image",
        [](const std::string& file, const ImageArgument& image) {
            write_image(file,
                        rgb_image(int(image.shape(1)), int(image.shape(0)), pixels_of(image)));
        },
        "file"_a, "image"_a);
    m.def("tonemap", tonemap, "image"_a, "operator"_a, "exposure"_a, "white"_a);
    m.def("png", png, "codes"_a);
    m.def("diff", diff, "image"_a, "reference"_a, "reference2"_a.none(), "flip"_a,
          "ignore_above"_a);
    m.def("magma", magma_colours, "values"_a);
}

}  // namespace etendue::python
