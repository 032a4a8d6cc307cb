#pragma once
// Images of files that are shown beside the runs.

#include <memory>
#include <string>

#include "session/session.h"
#include "session/snapshot.h"

namespace etendue {

struct OpenedImage {
    std::string file;  ///< Its name.
    std::string note;  ///< Method and passes, where the file tells them.
    /// Those of an image file are one pass without a variance.
    std::shared_ptr<const Snapshot> pixels;
    IntervalKind interval = IntervalKind::None;
};

/// The image of a file with this name and these bytes: of a checkpoint if the name ends with RunFolder::kExtension, and of
/// an image file otherwise. Throws std::runtime_error.
OpenedImage opened_image(std::string bytes, const std::string& file);

}  // namespace etendue
