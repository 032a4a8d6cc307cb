#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "display_options.h"
#include "image/denoiser.h"
#include "image/image_io.h"
#include "messages.h"
#include "output_checks.h"
#include "system/output_file.h"

namespace etendue {
namespace {

struct DenoiseCommand {
    std::string input, output, albedo, normal;
    DisplayOptions display;
    int threads = 0;
    bool quiet = false;

    void run() const;

private:
    RgbImage read_like(const std::string& file, const Image& image) const;
};

RgbImage DenoiseCommand::read_like(const std::string& file, const Image& image) const {
    RgbImage guide = read_rgb(file);
    if (guide.width != image.width || guide.height != image.height)
        throw std::runtime_error(fmt::format("\"{}\" has {} x {} pixels, but \"{}\" has {} x {}",
                                             input, image.width, image.height, file, guide.width,
                                             guide.height));
    return guide;
}

void DenoiseCommand::run() const {
    check_image_extension(output);
    display.check();
    for (const std::string& file : {input, albedo, normal})
        refuse_same_file("image", file, "denoised image", output);
    OutputFile::check(output);
    Image image = read_image(input);
    // Files replace the layers.
    if (!albedo.empty()) {
        const RgbImage a = read_like(albedo, image);
        const RgbImage n = normal.empty() ? RgbImage() : read_like(normal, image);
        const std::vector<Rgb> color = rgb_pixels(image);
        std::vector<RgbLayer> layers{{"", color}, {"albedo", a.pixels}};
        if (!normal.empty()) layers.push_back({"normal", n.pixels});
        auto attributes = std::move(image.attributes);
        image = layered_image(image.width, image.height, layers);
        image.attributes = std::move(attributes);
    }
    const Denoiser denoiser;
    const auto denoised = [&] {
        try {
            return denoiser.denoise(image, threads);
        } catch (const std::runtime_error& e) {
            throw std::runtime_error(fmt::format("\"{}\": {}", input, e.what()));
        }
    };
    display.write(output, denoised(), threads);
    if (quiet) return;
    const bool is_guided = std::ranges::any_of(
        image.layers(), [](const std::string& l) { return l.ends_with("albedo"); });
    message("{}: denoised by {}{}\n", output, denoiser.name(),
            is_guided ? "" : ", without albedo and normal (see --aov of render)");
}

}  // namespace

void add_denoise_command(CLI::App& app) {
    auto command = std::make_shared<DenoiseCommand>();
    CLI::App& c = *app.add_subcommand(
        "denoise",
        "Remove the noise of an image by Intel Open Image Denoise, at the cost of a bias");
    c.add_option("INPUT", command->input,
                 "Image of radiance; its layers denoise_albedo and denoise_normal, or else albedo "
                 "and normal, are used")
        ->required();
    c.add_option("OUTPUT", command->output, "Image to write: .exr, .pfm, .hdr or .png")->required();
    CLI::Option* const albedo = c.add_option("--albedo", command->albedo,
                                             "Image of the reflectance, instead of the layers");
    c.add_option("--normal", command->normal, "Image of the normals, from -1 to 1")->needs(albedo);
    command->display.add_to(c);
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
