#pragma once
// Images of files that are shown beside the runs.

#include <memory>
#include <string>

#include "session/session.h"
#include "session/snapshot.h"

namespace etendue {

struct OpenedImage {
    std::string file;  ///< Its name.
    /// Method, passes and seeds, and whether it is denoised, as far as the file tells.
    std::string note;
    /// Those of an image file are one pass without a variance.
    std::shared_ptr<const Snapshot> pixels;
    IntervalKind interval = IntervalKind::None;
    bool is_denoised = false;
};

/// The image of a file with this name and these bytes, which are those of a checkpoint or of an image file. Of a run with
/// several seeds it is the mean of all of them. Throws std::runtime_error.
OpenedImage opened_image(std::string bytes, const std::string& file);

}  // namespace etendue
