#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "image/image_io.h"
#include "image/tonemap.h"
#include "number_checks.h"

namespace etendue {
namespace {

struct TonemapCommand {
    std::string input, output, layer, op = "aces";
    ToneMapping mapping;

    void run() const {
        check_image_extension(output);
        const RgbImage image = read_rgb(input, layer);
        ToneMapping m = mapping;
        m.op = *tone_operator(op);
        write_image(output, rgb_image(image.width, image.height, tone_map(image.pixels, m)));
    }
};

}  // namespace

void add_tonemap_command(CLI::App& app) {
    auto command = std::make_shared<TonemapCommand>();
    CLI::App& c = *app.add_subcommand("tonemap", "Convert an image of radiance for displays");
    c.add_option("INPUT", command->input, "Image to read")->required();
    c.add_option("OUTPUT", command->output, "Image to write, usually .png")->required();
    c.add_option("--operator", command->op, "aces, reinhard, or srgb, which only clamps")
        ->capture_default_str()
        ->check(CLI::IsMember({"aces", "reinhard", "srgb"}));
    c.add_option("--exposure", command->mapping.exposure, "Exposure in stops")
        ->capture_default_str();
    c.add_option("--white", command->mapping.white,
                 "Luminance mapped to white by reinhard; 0: the largest in the image")
        ->capture_default_str()
        ->check(must_be_at_least_0);
    c.add_option("--layer", command->layer, "Read this layer, e.g. albedo, instead of the image");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
