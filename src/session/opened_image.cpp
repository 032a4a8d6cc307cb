#include "session/opened_image.h"

#include <fmt/format.h>

#include "image/denoiser.h"
#include "image/image_io.h"
#include "render/checkpoint.h"
#include "session/run_folder.h"
#include "session/run_record.h"
#include "system/section_mark.h"

namespace etendue {
namespace {

OpenedImage of_checkpoint(CheckpointFile checkpoint) {
    const CheckpointHeader& header = checkpoint.header();
    const RenderTotals totals = checkpoint.totals(false);
    const Film& film = *totals.film;
    const auto snapshot = std::make_shared<Snapshot>();
    snapshot->width = film.geometry().crop_width;
    snapshot->height = film.geometry().crop_height;
    RunStatus run;
    load_record(checkpoint.sections(), run);
    SavedSeeds seeds;
    std::string of_seeds;
    if (run.seeds > 1) {
        seeds =
            open_seeds(checkpoint.sections(), film.geometry().pixel_count(), run.finished_seeds);
        of_seeds = fmt::format(", {} of {} seeds", run.finished_seeds, run.seeds);
    }
    if (seeds.mean.count() > 0)
        seeds.mean.fill(seeds.is_counted ? nullptr : &film, *snapshot);
    else
        fill_snapshot(film, *snapshot);
    const SamplerKind sampler = sampler_named(header.condition("sampler"), "its sampler");
    return {.file = checkpoint.name(),
            .note = fmt::format("{}, {} spp{}", header.integrator, snapshot->passes, of_seeds),
            .pixels = snapshot,
            .interval = interval_kind(estimator_named(header.estimator), sampler, film.has_groups(),
                                      run.seeds)};
}

/// As far as the attributes of a rendering tell, see attributes_of().
std::string note_of(const Image& image) {
    std::vector<std::string> parts;
    const auto value = [&](const char* name, const auto& use) {
        if (const auto found = image.attributes.find(name); found != image.attributes.end())
            std::visit(use, found->second);
    };
    value("etendue.integrator", [&](const auto& v) { parts.push_back(fmt::format("{}", v)); });
    value("etendue.spp", [&](const auto& v) { parts.push_back(fmt::format("{} spp", v)); });
    if (is_denoised(image)) parts.push_back("denoised");
    return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

OpenedImage opened_image(std::string bytes, const std::string& file) {
    // The name, too, so that a checkpoint that is damaged from its first byte on is not called an image.
    if (bytes.starts_with(kSectionMark) || file.ends_with(RunFolder::kExtension))
        return of_checkpoint(CheckpointFile(SectionReader(std::move(bytes), file)));
    const Image image = decode_image(bytes, file);
    const auto snapshot = std::make_shared<Snapshot>();
    snapshot->passes = 1;
    snapshot->width = image.width;
    snapshot->height = image.height;
    snapshot->mean = rgb_pixels(image);
    return {.file = file,
            .note = note_of(image),
            .pixels = snapshot,
            .is_denoised = is_denoised(image)};
}

}  // namespace etendue
