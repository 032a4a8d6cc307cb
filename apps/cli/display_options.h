#pragma once
// How images are mapped for displays where a command writes a .png.

#include <optional>
#include <string>

#include "image/image.h"
#include "image/tonemap.h"

namespace CLI {
class App;
}

namespace etendue {

struct DisplayOptions {
    std::string op = "aces", exposure = "auto";
    float white = 0;  ///< See ToneMapping.

    /// Adds --tone and --exposure.
    void add_to(CLI::App& command);
    /// Adds --operator, --exposure with another default, and --white.
    void add_to_tonemap(CLI::App& command);
    /// Throws UsageError where they have no meaning.
    void check() const { stops(); }

    /// For an image with these luminances.
    ToneCurve curve(std::vector<float> luminances) const;
    /// Writes the image; a .png is mapped first.
    void write(const std::string& path, const ImageRows& image, int threads) const;
    void write(const std::string& path, const Image& image, int threads) const {
        write(path, rows_of(image), threads);
    }

private:
    /// Empty for "auto".
    std::optional<float> stops() const;
};

}  // namespace etendue
