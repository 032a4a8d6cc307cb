#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "display_options.h"
#include "image/image_io.h"
#include "output_checks.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct TonemapCommand {
    std::string input, output, layer;
    DisplayOptions display;

    void run() const {
        check_image_extension(output);
        display.check();
        refuse_same_file("image", input, "image for displays", output);
        RgbImage image = read_rgb(input, layer);
        const ToneCurve map = display.curve(finite_luminances(image.pixels));
        for (Rgb& c : image.pixels) c = map(c);
        write_image(output, rgb_image(image.width, image.height, image.pixels));
    }
};

}  // namespace

void add_tonemap_command(CLI::App& app) {
    auto command = std::make_shared<TonemapCommand>();
    CLI::App& c = *app.add_subcommand("tonemap", "Convert an image of radiance for displays");
    c.add_option("INPUT", command->input, "Image to read")->required();
    c.add_option("OUTPUT", command->output, "Image to write, usually .png")->required();
    command->display.add_to_tonemap(c);
    c.add_option("--layer", command->layer, "Read this layer, e.g. albedo, instead of the image");
    const CLI::Option* const white = c.get_option("--white");
    c.callback([command, white] {
        if (white->count() > 0 && command->display.op != "reinhard")
            throw UsageError("--white applies to --operator reinhard only");
        command->run();
    });
}

}  // namespace etendue
