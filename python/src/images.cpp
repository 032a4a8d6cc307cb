// Images: files, errors, tone mapping.

#include <limits>
#include <memory>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "compare/embedded_image.h"
#include "compare/error_json.h"
#include "image/denoiser.h"
#include "image/flip.h"
#include "image/image_io.h"
#include "image/metrics.h"
#include "image/tonemap.h"
#include "system/output_file.h"
#include "values.h"

namespace etendue::python {

std::span<const Rgb> pixels_of(const ImageArgument& image) {
    constexpr size_t kMost = 1u << 30;
    if (image.size() == 0) throw nb::value_error("the image has no pixels");
    if (image.shape(0) > kMost || image.shape(1) > kMost)
        throw nb::value_error("the image is too large");
    return {reinterpret_cast<const Rgb*>(image.data()), image.shape(0) * image.shape(1)};
}

namespace {

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

using Codes = nb::ndarray<const uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

nb::ndarray<nb::numpy, uint8_t> tonemap(const ImageArgument& image, const std::string& op,
                                        float exposure, float white) {
    const std::span<const Rgb> pixels = pixels_of(image);
    const ToneMapping mapping = mapping_of(op, exposure, white);
    auto codes = std::make_unique<std::vector<uint8_t>>();
    {
        const nb::gil_scoped_release no_gil;
        *codes = srgb_codes(tone_map(pixels, mapping));
    }
    uint8_t* const data = codes->data();
    nb::capsule owner(codes.release(),
                      [](void* p) noexcept { delete static_cast<std::vector<uint8_t>*>(p); });
    return {data, {image.shape(0), image.shape(1), 3}, owner};
}

/// `codes` are those of a PNG, and stay where they are while it is encoded.
std::string encoded(const Codes& codes) {
    constexpr size_t kMost = 1u << 30;
    if (codes.shape(0) > kMost || codes.shape(1) > kMost)
        throw nb::value_error("the image is too large");
    const int width = int(codes.shape(1)), height = int(codes.shape(0));
    const std::span<const uint8_t> values{codes.data(), codes.size()};
    const nb::gil_scoped_release no_gil;
    return encode_png(width, height, values);
}

nb::bytes png(const Codes& codes) {
    const std::string bytes = encoded(codes);
    return nb::bytes(bytes.data(), bytes.size());
}

void write_png(const std::string& file, const Codes& codes) {
    const std::string bytes = encoded(codes);
    const nb::gil_scoped_release no_gil;
    write_file(file, bytes);
}

/// The errors as JSON, the map of FLIP, and that of relMSE.
std::tuple<std::string, std::optional<FloatArray>, FloatArray>
diff(const ImageArgument& image, const ImageArgument& reference,
     const std::optional<ImageArgument>& reference2, const std::string& flip, float ignore_above) {
    check_same_size(image, reference);
    if (reference2) check_same_size(image, *reference2);
    if (flip != "hdr" && flip != "ldr" && flip != "none")
        throw nb::value_error("flip must be \"hdr\", \"ldr\" or \"none\"");
    const auto x = pixels_of(image), r = pixels_of(reference);
    const std::span<const Rgb> r2 = reference2 ? pixels_of(*reference2) : std::span<const Rgb>();
    const int width = int(image.shape(1)), height = int(image.shape(0));
    std::string text;
    std::optional<std::vector<float>> flip_map;
    std::vector<float> errors;
    {
        const nb::gil_scoped_release no_gil;
        nlohmann::ordered_json j = to_json(image_errors(x, r, {r2, ignore_above}));
        if (flip != "none") {
            FlipResult result =
                flip == "hdr" ? hdr_flip(x, r, width, height) : ldr_flip(x, r, width, height);
            j[flip == "hdr" ? "flip_hdr" : "flip_ldr"] = result.mean;
            flip_map = std::move(result.map);
        }
        errors = relative_squared_errors(x, r, r2);
        text = j.dump();
    }
    return {text,
            flip_map ? std::optional(to_array(std::move(*flip_map), width, height)) : std::nullopt,
            to_array(std::move(errors), width, height)};
}

/// `albedo` and `normal` guide the denoiser; normals alone do not.
FloatArray denoise(const ImageArgument& image, const std::optional<ImageArgument>& albedo,
                   const std::optional<ImageArgument>& normal, int threads,
                   const std::string& library) {
    std::vector<RgbLayer> layers{{"", pixels_of(image)}};
    for (const auto& [name, guide] : {std::pair("albedo", &albedo), std::pair("normal", &normal)}) {
        if (!*guide) continue;
        check_same_size(image, **guide);
        layers.push_back({name, pixels_of(**guide)});
    }
    if (normal && !albedo) throw nb::value_error("normal needs albedo");
    const int width = int(image.shape(1)), height = int(image.shape(0));
    checked_threads(threads);
    use_threads();
    std::vector<Rgb> pixels;
    {
        const nb::gil_scoped_release no_gil;
        pixels =
            rgb_pixels(Denoiser(library).denoise(layered_image(width, height, layers), threads));
    }
    return to_array(std::move(pixels), width, height);
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
            RgbImage image;
            {
                const nb::gil_scoped_release no_gil;
                image = read_rgb(file, layer);
            }
            return to_array(std::move(image.pixels), image.width, image.height);
        },
        "file"_a, "layer"_a = "");
    m.def(
        "write_image",
        [](const std::string& file, const ImageArgument& image) {
            const std::span<const Rgb> pixels = pixels_of(image);
            const nb::gil_scoped_release no_gil;
            write_image(file, rgb_image(int(image.shape(1)), int(image.shape(0)), pixels));
        },
        "file"_a, "image"_a);
    m.def("tonemap", tonemap, "image"_a, "operator"_a, "exposure"_a, "white"_a);
    m.def("png", png, "codes"_a);
    m.def("write_png", write_png, "file"_a, "codes"_a);
    m.def(
        "write_text",
        [](const std::string& file, const std::string& text) {
            const nb::gil_scoped_release no_gil;
            write_file(file, text);
        },
        "file"_a, "text"_a);
    m.def("diff", diff, "image"_a, "reference"_a, "reference2"_a.none(), "flip"_a,
          "ignore_above"_a);
    m.def("denoise", denoise, "image"_a, "albedo"_a.none(), "normal"_a.none(), "threads"_a,
          "library"_a);
    m.def("magma", magma_colours, "values"_a);
}

}  // namespace etendue::python
