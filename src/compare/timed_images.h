#pragma once
// Images of another program with their rendering times, which a report compares like methods.

#include <cstdint>
#include <string>
#include <vector>

#include "film/film_geometry.h"

namespace etendue {

/// Images in a folder. The name of each ends with its rendering time, which samples per pixel may precede: 2.5s.exr,
/// 64spp-2.5s.exr. What stands before them, with - or _ between, names its run: seed7-64spp-2.5s.exr.
struct TimedImages {
    struct File {
        std::string path;
        uint64_t spp = 0;  ///< 0 where it is unknown.
        double seconds = 0;
    };
    std::string name;  ///< In reports.
    std::string folder;
    std::vector<std::vector<File>> runs;  ///< Each in the order of their times.
};

/// Finds the files, and reads them as read_radiance() does. Throws std::runtime_error where the folder has none, a name has
/// no time, an image is of another size than the film, or two images of a run have the same time.
TimedImages find_timed_images(const std::string& name, const std::string& folder,
                              const FilmGeometry& film);

}  // namespace etendue
