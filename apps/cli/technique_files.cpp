#include "technique_files.h"

#include <fmt/format.h>

#include "image/image_io.h"
#include "system/output_file.h"

namespace etendue {

void check_technique_folder(const std::string& folder) {
    OutputFile::check(folder + "/length01_s00_t02_weighted.exr");
}

void write_techniques(const TechniqueImages& images, const FilmGeometry& film,
                      const std::string& folder) {
    for (const auto& t : images.images()) {
        const bool is_stored = t.technique.strategy == Strategy::Connect && t.technique.s == 1;
        const std::string stem =
            fmt::format("{}/length{:02}_s{:02}_t{:02}{}", folder, t.technique.vertices() - 1,
                        t.technique.s, t.technique.t,
                        is_stored                                    ? "_stored"
                        : t.technique.strategy == Strategy::Specular ? "_specular"
                                                                     : "");
        write_image(stem + "_weighted.exr",
                    rgb_image(film.crop_width, film.crop_height, t.weighted));
        write_image(stem + "_unweighted.exr",
                    rgb_image(film.crop_width, film.crop_height, t.unweighted));
    }
}

}  // namespace etendue
