#pragma once
// The images that pages have opened, which are shown beside the runs.

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "session/opened_image.h"

namespace etendue {

/// Views of these images are named opened:ID. All functions may be called from any thread.
class OpenedImages {
public:
    static constexpr size_t kMost = 32;               ///< Images at a time,
    static constexpr size_t kMostBytes = 2ull << 30;  ///< and their pixels.

    /// Returns the id. Throws std::runtime_error where the limits are exceeded.
    int add(OpenedImage image);
    /// The image of a view; nullptr if the view is another one. Throws ApiError for an unknown id.
    std::shared_ptr<const OpenedImage> of_view(std::string_view view) const;
    /// Throws ApiError for an unknown id.
    void remove(int id);
    /// With their ids, in the order in which they were opened.
    std::vector<std::pair<int, std::shared_ptr<const OpenedImage>>> list() const;
    /// A number that changes with the list.
    uint64_t version() const { return version_.load(); }

private:
    mutable std::mutex mutex_;
    std::map<int, std::shared_ptr<const OpenedImage>> images_;
    int last_id_ = 0;
    std::atomic<uint64_t> version_{0};
};

}  // namespace etendue
