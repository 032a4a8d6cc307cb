#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "compare/error_json.h"
#include "image/denoiser.h"
#include "image/flip.h"
#include "image/image_io.h"
#include "image/metrics.h"
#include "image/tonemap.h"
#include "json_text.h"
#include "messages.h"
#include "number_checks.h"
#include "output_checks.h"
#include "system/output_file.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct DiffCommand {
    std::string image, reference, reference2, layer, map, map_metric = "flip", flip = "auto";
    float ignore_above = std::numeric_limits<float>::infinity();
    bool json = false;

    void run() const;

private:
    RgbImage read_like(const std::string& path, const RgbImage& first) const;
    bool is_hdr() const;
    void print(const ImageErrors& e, const std::optional<FlipResult>& flip_result) const;
    void print_json(const ImageErrors& e, const std::optional<FlipResult>& flip_result) const;
    void write_map(const std::vector<float>& errors, int width, int height) const;
};

RgbImage DiffCommand::read_like(const std::string& path, const RgbImage& first) const {
    RgbImage p = read_rgb(path, layer);
    if (p.width != first.width || p.height != first.height)
        throw std::runtime_error(fmt::format("\"{}\" has {} x {} pixels, but \"{}\" has {} x {}",
                                             image, first.width, first.height, path, p.width,
                                             p.height));
    return p;
}

bool DiffCommand::is_hdr() const {
    if (flip != "auto") return flip == "hdr";
    return std::ranges::all_of(std::initializer_list<std::string>{image, reference},
                               [](const std::string& path) {
                                   const std::string e = image_extension(path);
                                   return e == ".exr" || e == ".pfm" || e == ".hdr";
                               });
}

void DiffCommand::print(const ImageErrors& e, const std::optional<FlipResult>& flip_result) const {
    const auto line = [](const char* name, double value) {
        fmt::print("{:<16} {:.6g}\n", name, value);
    };
    line("RMSE", e.rmse);
    line("relMSE", e.rel_mse);
    line("relMSE, trimmed", e.rel_mse_trimmed);
    line("L1", e.l1);
    line("MAPE", e.mape);
    line("SMAPE", e.smape);
    line("spike", e.spike);
    if (flip_result) line(is_hdr() ? "FLIP (HDR)" : "FLIP (LDR)", flip_result->mean);
    line("mean ratio", e.mean_ratio);
    if (e.ignored > 0)
        fmt::print("{} of {} pixels are brighter than {} in the reference: they count only for "
                   "the mean ratio\n",
                   e.ignored, e.pixels, ignore_above);
    if (e.not_finite > 0)
        fmt::print("{} of {} pixels are infinite or NaN: left out\n", e.not_finite, e.pixels);
}

void DiffCommand::print_json(const ImageErrors& e,
                             const std::optional<FlipResult>& flip_result) const {
    nlohmann::ordered_json j = {{"image", image}, {"reference", reference}};
    j.update(to_json(e));
    if (flip_result) j[is_hdr() ? "flip_hdr" : "flip_ldr"] = flip_result->mean;
    fmt::print("{}", json_text(j));
}

// A .png file shows the errors in false colours; the other formats store their values.
void DiffCommand::write_map(const std::vector<float>& errors, int width, int height) const {
    Image out(width, height, {"Y"});
    out.data = errors;
    if (image_extension(map) == ".png") {
        std::vector<Rgb> colours;
        for (float v : errors) colours.push_back(magma(v));
        out = rgb_image(width, height, colours);
    }
    write_image(map, out);
}

void DiffCommand::run() const {
    if (!map.empty()) {
        check_image_extension(map);
        for (const std::string& file : {image, reference, reference2})
            refuse_same_file("image", file, "error map", map);
        OutputFile::check(map);
    }
    const RgbImage x = read_rgb(image, layer), r = read_like(reference, x);
    for (const std::string& file : {reference, reference2})
        if (!file.empty() && is_denoised(read_image(file)))
            print_warnings({fmt::format(
                "{}: the image is denoised; the errors contain the bias of the denoiser", file)});
    const RgbImage r2 = reference2.empty() ? RgbImage() : read_like(reference2, x);
    const ImageErrors errors = image_errors(x.pixels, r.pixels, {r2.pixels, ignore_above});
    const bool flip_map = !map.empty() && map_metric == "flip";
    std::optional<FlipResult> flip_result;
    if (flip != "none")
        flip_result = is_hdr() ? hdr_flip(x.pixels, r.pixels, x.width, x.height)
                               : ldr_flip(x.pixels, r.pixels, x.width, x.height);
    if (flip_map && !flip_result)
        throw UsageError("--map with --map-metric flip cannot be combined with --flip none");
    // The file first, since standard output may have gone.
    if (!map.empty())
        write_map(flip_map ? flip_result->map
                           : relative_squared_errors(x.pixels, r.pixels, r2.pixels),
                  x.width, x.height);
    json ? print_json(errors, flip_result) : print(errors, flip_result);
}

}  // namespace

void add_diff_command(CLI::App& app) {
    auto command = std::make_shared<DiffCommand>();
    CLI::App& c = *app.add_subcommand("diff", "Compare an image with a reference");
    c.add_option("IMAGE", command->image, "Image to evaluate")->required();
    c.add_option("REFERENCE", command->reference, "Reference image of the same size")->required();
    c.add_option("--reference2", command->reference2,
                 "Second, independent reference: removes the noise of both from squared errors");
    c.add_option("--layer", command->layer,
                 "Compare this layer, e.g. albedo, instead of the image");
    c.add_option("--ignore-above", command->ignore_above,
                 "Leave out pixels whose reference is brighter than this radiance, such as lamps")
        ->check(must_be_at_least_0);
    c.add_option("--flip", command->flip,
                 "Variant of FLIP: hdr, ldr or none; auto: hdr for .exr, .pfm and .hdr")
        ->capture_default_str()
        ->check(CLI::IsMember({"auto", "hdr", "ldr", "none"}));
    c.add_option("--map", command->map,
                 "Write an error map: false colours to .png, values to .exr or .pfm");
    c.add_option("--map-metric", command->map_metric,
                 "Error shown by --map: flip, or relse for each pixel's term of relMSE")
        ->capture_default_str()
        ->check(CLI::IsMember({"flip", "relse"}));
    c.add_flag("--json", command->json, "Print JSON");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
