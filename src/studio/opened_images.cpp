#include "studio/opened_images.h"

#include <stdexcept>

#include <fmt/format.h>

#include "studio/http.h"
#include "studio/request_values.h"

namespace etendue {
namespace {

constexpr std::string_view kView = "opened:";

size_t bytes_of(const OpenedImage& image) {
    return (image.pixels->mean.size() + image.pixels->variance.size()) * sizeof(Rgb);
}

[[noreturn]] void fail_unknown(int id) {
    throw ApiError(404, fmt::format("there is no opened image {}", id));
}

}  // namespace

int OpenedImages::add(OpenedImage image) {
    const std::lock_guard lock(mutex_);
    size_t bytes = bytes_of(image);
    for (const auto& [id, other] : images_) bytes += bytes_of(*other);
    if (images_.size() >= kMost || bytes > kMostBytes)
        throw std::runtime_error(
            fmt::format("{}: {} images with {} MiB of pixels can be open at most; remove some",
                        image.file, kMost, kMostBytes >> 20));
    images_.emplace(++last_id_, std::make_shared<const OpenedImage>(std::move(image)));
    ++version_;
    return last_id_;
}

std::shared_ptr<const OpenedImage> OpenedImages::of_view(std::string_view view) const {
    if (!view.starts_with(kView)) return nullptr;
    const int id = integer_of(view.substr(kView.size()), "opened");
    const std::lock_guard lock(mutex_);
    const auto found = images_.find(id);
    if (found == images_.end()) fail_unknown(id);
    return found->second;
}

void OpenedImages::remove(int id) {
    const std::lock_guard lock(mutex_);
    if (images_.erase(id) == 0) fail_unknown(id);
    ++version_;
}

std::vector<std::pair<int, std::shared_ptr<const OpenedImage>>> OpenedImages::list() const {
    const std::lock_guard lock(mutex_);
    return {images_.begin(), images_.end()};
}

}  // namespace etendue
