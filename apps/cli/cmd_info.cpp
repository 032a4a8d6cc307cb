#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "choice_info.h"
#include "commands.h"
#include "guide_info.h"
#include "image/denoiser.h"
#include "image/image_io.h"
#include "json_text.h"
#include "math/content_hash.h"
#include "number_checks.h"
#include "render/checkpoint.h"
#include "render/render_request.h"
#include "render/scene_integrator.h"
#include "scene_options.h"
#include "usage_error.h"

namespace etendue {
namespace {

/// Of files that read_image() reads.
constexpr const char* kImageExtensions[] = {".exr", ".png", ".jpg", ".jpeg", ".hdr",
                                            ".pfm", ".tga", ".bmp", ".pgm",  ".ppm"};

std::string mebibytes(size_t bytes) {
    return fmt::format("{:.1f} MiB", double(bytes) / (1 << 20));
}

/// The integrator of the scene file with its parameters, or what is wrong with it.
std::string integrator_text(const Scene& s) try {
    return scene_integrator(s).spec.to_string();
} catch (const std::exception& e) {
    return e.what();
}

/// Of a checkpoint, all of which is verified.
void checkpoint_info(const std::string& file, bool as_json) {
    CheckpointFile c(file);
    c.check();
    const CheckpointHeader& h = c.header();
    const RenderTotals totals = c.totals(false);
    const std::span<const PixelMoments> moments = totals.film->moments();
    const std::string bits = fmt::format(
        "{:016x}", ContentHash()
                       .add({reinterpret_cast<const char*>(moments.data()), moments.size_bytes()})
                       .value());
    const ErrorEstimate e = totals.film->error();
    const double mean = totals.film->mean_luminance().mean;
    if (as_json) {
        nlohmann::json j{{"checkpoint", file},
                         {"scene", h.scene},
                         {"integrator", h.integrator},
                         {"estimator", h.estimator},
                         {"width", h.film.crop_width},
                         {"height", h.film.crop_height},
                         {"spp", h.passes()},
                         {"seconds", totals.seconds},
                         {"merged", h.is_merged},
                         {"mean_luminance", mean},
                         {"bits", bits}};
        if (e.valid) j["relative_error"] = e.relative_rms;
        for (const PassRange& r : h.ranges)
            j["passes"].push_back(
                {{"seed", r.seed}, {"first_pass", r.first}, {"passes", r.passes}});
        for (const auto& [name, value] : h.conditions) j["conditions"][name] = value;
        fmt::print("{}", json_text(j));
        return;
    }
    const auto line = [](const std::string& name, const std::string& value) {
        fmt::print("  {:<24} {}\n", name, value);
    };
    fmt::print("{}: {}\n", file,
               h.is_merged     ? "sum of renderings"
               : c.has_state() ? "state of a rendering"
                               : "sums of a rendering");
    line("scene", h.scene);
    for (const PassRange& r : h.ranges) line("contains", to_string(r));
    line("time", fmt::format("{:.1f} s", totals.seconds));
    line("mean luminance", fmt::format("{:.6g}", mean));
    if (e.valid) line("relative error", fmt::format("{:.4f}", e.relative_rms));
    line("estimator", h.estimator);
    for (const auto& [name, value] : h.conditions) line(name, value);
    line("bits of the sums", bits);
}

bool is_image(const std::string& file) {
    const std::string e = image_extension(file);
    return std::ranges::any_of(kImageExtensions, [&](const char* known) { return e == known; });
}

void image_info(const std::string& file, bool as_json) {
    const Image image = read_image(file);
    if (as_json) {
        nlohmann::json j{{"image", file},
                         {"width", image.width},
                         {"height", image.height},
                         {"channels", image.channels},
                         {"denoised", is_denoised(image)},
                         {"attributes", nlohmann::json::object()}};
        for (const auto& a : image.attributes)
            std::visit([&](const auto& v) { j["attributes"][a.first] = v; }, a.second);
        fmt::print("{}", json_text(j));
        return;
    }
    fmt::print("{}{}\n  size      {} x {}\n  channels  {}\n", file,
               is_denoised(image) ? ": denoised image" : "", image.width, image.height,
               fmt::join(image.channels, ", "));
    for (const auto& a : image.attributes)
        std::visit([&](const auto& v) { fmt::print("  {}  {}\n", a.first, v); }, a.second);
}

/// Of `info`.
struct InfoOptions {
    SceneOptions scene;
    GuideInfo guide;
    ChoiceInfo choice;
    /// Of --guide and --choice.
    std::string integrator;
    uint64_t seed = 0;
    int threads = 0;
    bool json = false;
};

void info(const InfoOptions& o) {
    const bool as_json = o.json;
    const GuideInfo& guide = o.guide;
    const bool is_checkpoint = SectionReader::is_one(o.scene.file);
    if (is_checkpoint || is_image(o.scene.file)) {
        if (guide.is_wanted || o.choice.is_wanted)
            throw UsageError(fmt::format("{} needs a scene, but {} is {}",
                                         guide.is_wanted ? "--guide" : "--choice", o.scene.file,
                                         is_checkpoint ? "a checkpoint" : "an image"));
        return is_checkpoint ? checkpoint_info(o.scene.file, as_json)
                             : image_info(o.scene.file, as_json);
    }
    guide.check();
    o.choice.check(o.integrator);
    SceneOptions loading = o.scene;
    loading.threads = o.threads;
    const Scene s = load_scene(loading);
    const nlohmann::json learned =
        guide.is_wanted ? guide.run(s, o.integrator, o.seed, o.threads) : nlohmann::json();
    const nlohmann::json choice =
        o.choice.is_wanted ? o.choice.run(s, o.integrator, o.seed, o.threads) : nlohmann::json();
    const Scene::Statistics& st = s.statistics();
    const Bounds3& b = s.bounds();
    double power = 0;
    for (const auto& e : s.emitters()) power += e->power();
    if (as_json) {
        nlohmann::json j{{"scene", s.file()},
                         {"shapes", s.shapes().size()},
                         {"triangles", st.triangles},
                         {"quadrics", st.quadrics},
                         {"instances", st.instances},
                         {"materials", st.materials},
                         {"textures", st.textures},
                         {"emitters", s.emitters().size()},
                         {"emitters_at_infinity", s.infinite_emitters().size()},
                         {"emitted_power", power},
                         {"bounds", {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}}},
                         {"width", s.film().width},
                         {"height", s.film().height},
                         {"filter", s.filter().name()},
                         {"sensors", s.sensor_names()},
                         {"sensor", s.sensor_index()},
                         {"geometry_bytes", st.geometry_bytes},
                         {"texture_bytes", st.texture_bytes},
                         {"accelerator_bytes", st.accelerator_bytes},
                         {"integrator", integrator_text(s)},
                         {"spp", default_spp(s)},
                         {"warnings", warnings_of(s)}};
        if (guide.is_wanted) j["guide"] = learned;
        if (o.choice.is_wanted) j["choice"] = choice;
        fmt::print("{}", json_text(j));
        return;
    }
    fmt::print("{}\n", s.file());
    fmt::print("  image       {} x {}", s.film().width, s.film().height);
    if (s.film().pixel_count() != uint64_t(s.film().width) * s.film().height)
        fmt::print(", crop {} x {} at ({}, {})", s.film().crop_width, s.film().crop_height,
                   s.film().crop_x, s.film().crop_y);
    fmt::print(", {} filter\n", s.filter().name());
    if (s.sensor_names().size() > 1)
        for (size_t i = 0; i < s.sensor_names().size(); ++i)
            fmt::print("  {}    {}: {}{}\n", i == 0 ? "sensors " : "        ", i,
                       s.sensor_names()[i], i == s.sensor_index() ? " (used)" : "");
    fmt::print("  rendering   {}, {} spp\n", integrator_text(s), default_spp(s));
    fmt::print("  shapes      {}: {} triangles, {} quadrics, {} instances\n", s.shapes().size(),
               st.triangles, st.quadrics, st.instances);
    fmt::print("  materials   {}\n", st.materials);
    fmt::print("  textures    {}\n", st.textures);
    fmt::print("  emitters    {}, of them {} at infinity; {:.6g} W (luminance)\n",
               s.emitters().size(), s.infinite_emitters().size(), power);
    if (!b.is_empty())
        fmt::print("  bounds      ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g})\n", b.lo.x,
                   b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z);
    fmt::print("  memory      geometry {}, hierarchy {}, textures {}\n",
               mebibytes(st.geometry_bytes), mebibytes(st.accelerator_bytes),
               mebibytes(st.texture_bytes));
    if (guide.is_wanted) fmt::print("{}", guide_text(learned));
    if (o.choice.is_wanted) fmt::print("{}", choice_text(choice));
    for (const std::string& w : warnings_of(s)) fmt::print("  warning     {}\n", w);
}

}  // namespace

void add_info_command(CLI::App& app) {
    auto options = std::make_shared<InfoOptions>();
    CLI::App& c = *app.add_subcommand("info", "Summarise a scene, a checkpoint or an image");
    options->scene.add_to(c);
    options->guide.add_to(c);
    options->choice.add_to(c);
    c.get_option("--choice")->excludes(c.get_option("--guide"));
    std::vector<CLI::Option*> of_both{
        c.add_option(
            "-i,--integrator", options->integrator,
            "Method with parameters: of --guide the one whose guide is trained (default: "
            "the scene's), of --choice `auto` with parameters, or a method with guide=auto"),
        c.add_option("--seed", options->seed, "Seed of the training, or of the choice")
            ->capture_default_str()
            ->check(must_be_unsigned),
        c.add_option("--threads", options->threads, "Number of threads; 0: one per core")
            ->capture_default_str()
            ->check(CLI::Range(0, 4096))};
    c.add_flag("--json", options->json, "Print JSON");
    std::vector<const CLI::Option*> of_scenes;
    for (const char* name :
         {"--define", "--lenient", "--watertight", "--sensor", "--resolution", "--crop"})
        of_scenes.push_back(c.get_option(name));
    c.callback([options, of_both, of_scenes] {
        for (const CLI::Option* option : of_both)
            if (option->count() > 0 && !options->guide.is_wanted && !options->choice.is_wanted)
                throw UsageError(
                    fmt::format("{} requires --guide or --choice", option->get_name()));
        // Those of scenes.
        const std::string& file = options->scene.file;
        const bool is_checkpoint = SectionReader::is_one(file);
        if (is_checkpoint || is_image(file))
            for (const CLI::Option* option : of_scenes)
                if (option->count() > 0)
                    throw UsageError(fmt::format("{} needs a scene, but {} is {}",
                                                 option->get_name(), file,
                                                 is_checkpoint ? "a checkpoint" : "an image"));
        info(*options);
    });
}

}  // namespace etendue
