#pragma once

#include <optional>
#include <string>

#include "image/image.h"
#include "texture/texture.h"
#include "texture/uv_transform.h"

namespace etendue {

/// The image file of a bitmap, and whether it is read as linear data.
struct BitmapFile {
    std::string name;
    bool raw;
};
/// Empty where the scene file holds the image itself, or where there is no such file.
std::optional<BitmapFile> bitmap_file(const Params& params);

enum class TextureFilter { Bilinear, Nearest };
/// What lies outside the unit square; Zero and One: a constant.
enum class TextureWrap { Repeat, Mirror, Clamp, Zero, One };

/// An image over the unit square; (0, 0) is the upper left corner of its first row. See bitmap.cpp.
class BitmapTexture final : public Texture {
public:
    struct Options {
        TextureFilter filter = TextureFilter::Bilinear;
        TextureWrap wrap = TextureWrap::Repeat;
        std::optional<TextureWrap> wrap_v = {};  ///< Along v, if it differs from that along u.
        bool raw = false;  ///< Whether 8-bit codes are linear values instead of sRGB.
        int channel =
            -1;  ///< The one channel to use; -1: the colours, or the first channel of grey images.
        UvTransform to_uv = {};
        bool is_of_second_uv = false;  ///< Whether it is a function of TexturePoint::second_uv.
    };

    BitmapTexture(const PixelBuffer& image,
                  const Options& options);  ///< The image must outlive the texture.

    Rgb eval(const TexturePoint& at) const override;
    float eval_scalar(const TexturePoint& at) const override;
    Vec2 gradient(const TexturePoint& at) const override;
    bool has_jet() const override { return true; }
    RgbDual eval_jet(const TextureJetPoint& at) const override;
    Dual scalar_jet(const TextureJetPoint& at) const override;
    Vec2Dual gradient_jet(const TextureJetPoint& at) const override;
    /// Asks for the memory that these functions read at `at`.
    void prefetch(const TexturePoint& at) const;
    Rgb mean() const override { return mean_; }
    void resolution(int& width, int& height) const override;
    size_t memory_bytes() const override { return sizeof(*this); }

private:
    template <class T>
    struct Footprint;

    template <class Point>
    auto uv(const Point& at) const {
        return options_.is_of_second_uv ? at.second_uv : at.uv;
    }
    /// `V`: a pair of numbers.
    template <class V>
    auto footprint(V uv) const;
    template <class Texels>
    const auto& first_value(const Texels& texels, int x, int y) const;
    template <class Texels>
    Rgb texel(const Texels& texels, int x, int y) const;
    template <class Texels>
    Rgb texel_or_outside(const Texels& texels, int x, int y) const;
    template <class Texels, class T>
    auto filtered(const Texels& texels, const Footprint<T>& f) const;
    template <class V>
    V gradient_at(V uv) const;
    /// Whether `to_uv` maps the unit square to whole images, so that all texels have the same share of it.
    bool covers_whole_periods() const;
    template <class Texels>
    Rgb image_mean(const Texels& texels) const;

    const PixelBuffer* image_;
    Options options_;
    bool is_grey_;
    int first_channel_;
    bool is_bounded_;      ///< Whether a constant lies outside the unit square.
    const float* decode_;  ///< Of 8-bit codes: 256 linear values.
    Rgb mean_;
};

}  // namespace etendue
