#pragma once
// Whether two sets of independent images, of any programs, have the same expectation.
//
// Nothing is known of the paths behind the pixels. The number of independent contributions to a mean is therefore estimated
// from its spread over the images: n of them have a relative error of at least 1/√n.

#include <cstdint>
#include <map>
#include <string>

#include "image/image_io.h"
#include "verify/tile_means.h"
#include "verify/verify.h"

namespace etendue {

/// Independent images of the same size, of which only the means of tiles are kept.
class ImageSeries {
public:
    /// `tiles` is their number in each direction, at most.
    explicit ImageSeries(int tiles = VerifyOptions().tiles) : tiles_(tiles) {}

    /// Throws std::runtime_error, with the name of the image, where its size is another than that of the images before
    /// it, or its pixels are the same as those of one of them and not black.
    void add(const std::string& name, const RgbImage& image);
    /// Adds files, and those of folders; see read_radiance().
    void add_files(const std::vector<std::string>& files);

    int64_t count() const { return moments_.empty() ? 0 : moments_.back()[0].count(); }
    int width() const { return grid_.film.crop_width; }
    int height() const { return grid_.film.crop_height; }
    /// The first of its images, and their number.
    std::string describe() const;

private:
    friend VerifyReport verify_images(const ImageSeries&, const ImageSeries&, double);

    int tiles_;
    TileGrid grid_{};
    TileMoments moments_;
    std::map<uint64_t, std::string> names_;  ///< By hashes of the pixels, without black images.
    bool is_half_ = true;                    ///< Whether all values are half floats.
    std::string first_;
};

/// Tests image and tiles of two series, with `alpha` as in VerifyOptions. The report has one method, which stands for
/// `images`; `spp` is unknown. Throws std::runtime_error where a series has fewer than two images or is black, and where
/// their sizes differ or an image that is not black is in both. Where all values of a
/// series are half floats, that much more rounding is tolerated.
VerifyReport verify_images(const ImageSeries& images, const ImageSeries& against, double alpha);

}  // namespace etendue
