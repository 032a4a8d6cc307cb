#include "session/opened_image.h"

#include <fmt/format.h>

#include "image/denoiser.h"
#include "image/image_io.h"
#include "render/checkpoint.h"
#include "session/run_folder.h"

namespace etendue {
namespace {

OpenedImage of_checkpoint(CheckpointFile checkpoint) {
    const CheckpointHeader& header = checkpoint.header();
    const RenderTotals totals = checkpoint.totals(false);
    const Film& film = *totals.film;
    const auto snapshot = std::make_shared<Snapshot>();
    snapshot->width = film.geometry().crop_width;
    snapshot->height = film.geometry().crop_height;
    fill_snapshot(film, *snapshot);
    const SamplerKind sampler = sampler_named(header.condition("sampler"), "its sampler");
    return {.file = checkpoint.name(),
            .note = fmt::format("{}, {} spp", header.integrator, film.passes()),
            .pixels = snapshot,
            .interval =
                interval_kind(estimator_named(header.estimator), sampler, film.has_groups(), 1)};
}

}  // namespace

OpenedImage opened_image(std::string bytes, const std::string& file) {
    if (file.ends_with(RunFolder::kExtension))
        return of_checkpoint(CheckpointFile(SectionReader(std::move(bytes), file)));
    const Image image = decode_image(bytes, file);
    const auto snapshot = std::make_shared<Snapshot>();
    snapshot->passes = 1;
    snapshot->width = image.width;
    snapshot->height = image.height;
    snapshot->mean = rgb_pixels(image);
    return {.file = file, .note = is_denoised(image) ? "denoised" : "", .pixels = snapshot};
}

}  // namespace etendue
