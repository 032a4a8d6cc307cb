// Image texture. (u, v) = (0, 0) is the upper left corner of the image, (1, 1) its lower right one, and texel centres
// lie at half-integers, as in Mitsuba 3 (which flips v in some mesh readers, not in textures).
//   filename (required)       .exr, .png, .jpg, .hdr, .pfm, .tga, .bmp, .pgm or .ppm
//   filter_type (bilinear)    or nearest
//   wrap_mode (repeat)        or mirror, clamp, zero, one; the last two: this constant outside the unit square
//   wrap_mode_v (wrap_mode)   the same along v, if it differs from that along u
//   raw (false)               whether integer formats contain linear data, not sRGB; floating-point ones always do
//   channel (all)             r, g, b or a: one channel as grey (alpha is linear); all: the colours without alpha
//   uv_set (0)                or 1: the second texture coordinates of a mesh
//   to_uv (identity)          affine map of (u, v) before the look-up; the upper 2D part of a 4×4 matrix
// eval_scalar() of colours is their luminance, as in Mitsuba 3 for opacity and roughness.

#include "texture/bitmap.h"

#include <array>
#include <string_view>

#include <fmt/format.h>

#include "color/srgb.h"
#include "description/resolve_file.h"
#include "math/prefetch.h"
#include "system/huge_pages.h"
#include "texture/texture_cache.h"

namespace etendue {
namespace {

std::array<float, 256> decoding_table(bool srgb) {
    std::array<float, 256> table;
    for (int i = 0; i < 256; ++i) table[i] = srgb ? srgb_to_linear(float(i) / 255) : float(i) / 255;
    return table;
}

const float* decoding(bool srgb) {
    static const std::array<float, 256> kLinear = decoding_table(false),
                                        kSrgb = decoding_table(true);
    return srgb ? kSrgb.data() : kLinear.data();
}

/// A coordinate wrapped to [0, 1], and the derivative of the wrapping.
template <class T>
struct Wrapped {
    T t;
    float slope;
};

template <class T>
Wrapped<T> wrap(T u, TextureWrap mode) {
    using std::floor;
    Wrapped<T> w = {u, 1};
    switch (mode) {
    case TextureWrap::Repeat: w.t = u - floor(u); break;
    case TextureWrap::Mirror:
        w.t = u - 2 * floor(u * 0.5f);
        if (w.t > 1) w = {2 - w.t, -1};
        break;
    case TextureWrap::Clamp: break;
    case TextureWrap::Zero:
    case TextureWrap::One: return {u > -1 ? std::min(u, T(2)) : T(-1), 1};
    }
    // NaN becomes zero, so that indices are valid for any mesh.
    return {w.t > 0 ? std::min(w.t, T(1)) : T(0), w.slope};
}

/// Two neighbouring texels along one axis and the weight of the second.
template <class T>
struct Neighbours {
    int i0, i1;
    T weight;
};

/// Index of a texel outside the unit square where its value is a constant.
constexpr int kOutside = -1;

bool is_bounded(TextureWrap mode) {
    return mode == TextureWrap::Zero || mode == TextureWrap::One;
}

template <class T>
inline Neighbours<T> neighbours(T t, int n, TextureWrap mode) {
    using std::floor;
    const T x = t * float(n) - 0.5f, cell = floor(x);
    int i0 = int(cell), i1 = i0 + 1;
    if (is_bounded(mode)) {
        const auto inside = [n](int i) { return i >= 0 && i < n ? i : kOutside; };
        return {inside(i0), inside(i1), x - cell};
    }
    const bool repeat = mode == TextureWrap::Repeat;
    // Beyond its edge a mirrored image continues with the edge texel itself, so mirroring clamps here too.
    if (i0 < 0) i0 = repeat ? n - 1 : 0;
    if (i1 >= n) i1 = repeat ? 0 : n - 1;
    return {i0, i1, x - cell};
}

}  // namespace

/// The four texels around a point, with ∂t/∂u of the wrapping.
template <class T>
struct BitmapTexture::Footprint {
    Neighbours<T> x, y;
    Vec2 slope;
};

BitmapTexture::BitmapTexture(const PixelBuffer& image, const Options& options)
    : image_(&image), options_(options), is_grey_(options.channel >= 0 || image.channels < 3),
      first_channel_(std::max(options.channel, 0)),
      is_bounded_(is_bounded(options.wrap) || is_bounded(options.wrap_v.value_or(options.wrap))),
      decode_(decoding(!options.raw && !(is_grey_ && first_channel_ == image.alpha_channel))) {
    std::visit(
        [&](const auto& texels) {
            mean_ = image_mean(texels);
            prefer_huge_pages(texels);
        },
        image.data);
}

template <class V>
inline auto BitmapTexture::footprint(V uv) const {
    using T = decltype(uv.x);
    const V p = options_.to_uv.point(uv);
    const TextureWrap along_u = options_.wrap, along_v = options_.wrap_v.value_or(along_u);
    const Wrapped<T> u = wrap(p.x, along_u), v = wrap(p.y, along_v);
    if (options_.filter == TextureFilter::Nearest) {
        const auto nearest = [](T t, int n, TextureWrap mode) {
            if (is_bounded(mode) && (t < 0 || t > 1)) return kOutside;
            return std::min(int(t * float(n)), n - 1);
        };
        const int x = nearest(u.t, image_->width, along_u);
        const int y = nearest(v.t, image_->height, along_v);
        return Footprint<T>{{x, x, 0}, {y, y, 0}, {}};
    }
    return Footprint<T>{neighbours(u.t, image_->width, along_u),
                        neighbours(v.t, image_->height, along_v),
                        {u.slope, v.slope}};
}

template <class Texels>
inline const auto& BitmapTexture::first_value(const Texels& texels, int x, int y) const {
    return texels[(size_t(y) * image_->width + x) * image_->channels + first_channel_];
}

template <class Texels>
inline Rgb BitmapTexture::texel(const Texels& texels, int x, int y) const {
    const auto* p = &first_value(texels, x, y);
    const auto value = [&](int c) {
        if constexpr (std::is_same_v<Texels, std::vector<uint8_t>>)
            return decode_[p[c]];
        else if constexpr (std::is_same_v<Texels, std::vector<Half>>)
            return float(p[c]);
        else
            return p[c];
    };
    return is_grey_ ? Rgb(value(0)) : Rgb(value(0), value(1), value(2));
}

template <class Texels>
Rgb BitmapTexture::texel_or_outside(const Texels& texels, int x, int y) const {
    if (x != kOutside && y != kOutside) return texel(texels, x, y);
    const TextureWrap mode =
        x == kOutside ? options_.wrap : options_.wrap_v.value_or(options_.wrap);
    return Rgb(mode == TextureWrap::One ? 1.0f : 0.0f);
}

template <class Texels, class T>
inline auto BitmapTexture::filtered(const Texels& texels, const Footprint<T>& f) const {
    using Color = decltype(lerp(f.y.weight, Rgb(), Rgb()));
    if (is_bounded_) [[unlikely]] {
        const auto at = [&](int x, int y) { return texel_or_outside(texels, x, y); };
        return lerp(f.y.weight, lerp(f.x.weight, at(f.x.i0, f.y.i0), at(f.x.i1, f.y.i0)),
                    lerp(f.x.weight, at(f.x.i0, f.y.i1), at(f.x.i1, f.y.i1)));
    }
    if (options_.filter == TextureFilter::Nearest) return Color(texel(texels, f.x.i0, f.y.i0));
    return lerp(f.y.weight,
                lerp(f.x.weight, texel(texels, f.x.i0, f.y.i0), texel(texels, f.x.i1, f.y.i0)),
                lerp(f.x.weight, texel(texels, f.x.i0, f.y.i1), texel(texels, f.x.i1, f.y.i1)));
}

Rgb BitmapTexture::eval(const TexturePoint& at) const {
    return std::visit([&](const auto& texels) { return filtered(texels, footprint(uv(at))); },
                      image_->data);
}

void BitmapTexture::prefetch(const TexturePoint& at) const {
    const Footprint<float> f = footprint(uv(at));
    std::visit(
        [&](const auto& texels) {
            for (const int y : {f.y.i0, f.y.i1})
                for (const int x : {f.x.i0, f.x.i1})
                    if (x != kOutside && y != kOutside)
                        etendue::prefetch(first_value(texels, x, y));
        },
        image_->data);
}

float BitmapTexture::eval_scalar(const TexturePoint& at) const {
    const Rgb c = eval(at);
    return is_grey_ ? c.r : luminance(c);
}

template <class V>
inline V BitmapTexture::gradient_at(V uv) const {
    const auto f = footprint(uv);
    const auto slopes = [&](const auto& texels) -> V {
        const auto scalar = [&](int x, int y) {
            const Rgb c = is_bounded_ ? texel_or_outside(texels, x, y) : texel(texels, x, y);
            return is_grey_ ? c.r : luminance(c);
        };
        const float h00 = scalar(f.x.i0, f.y.i0), h10 = scalar(f.x.i1, f.y.i0);
        const float h01 = scalar(f.x.i0, f.y.i1), h11 = scalar(f.x.i1, f.y.i1);
        return {lerp(f.y.weight, h10 - h00, h11 - h01) * float(image_->width) * f.slope.x,
                lerp(f.x.weight, h01 - h00, h11 - h10) * float(image_->height) * f.slope.y};
    };
    return options_.to_uv.gradient(std::visit(slopes, image_->data));
}

Vec2 BitmapTexture::gradient(const TexturePoint& at) const {
    return gradient_at(uv(at));
}

RgbDual BitmapTexture::eval_jet(const TextureJetPoint& at) const {
    return std::visit([&](const auto& texels) { return filtered(texels, footprint(uv(at))); },
                      image_->data);
}

Dual BitmapTexture::scalar_jet(const TextureJetPoint& at) const {
    const RgbDual c = eval_jet(at);
    return is_grey_ ? c.r : luminance(c);
}

Vec2Dual BitmapTexture::gradient_jet(const TextureJetPoint& at) const {
    return gradient_at(uv(at));
}

void BitmapTexture::resolution(int& width, int& height) const {
    width = image_->width;
    height = image_->height;
    options_.to_uv.resolution(width, height);
}

bool BitmapTexture::covers_whole_periods() const {
    const auto is_near = [](float a, float b) { return std::abs(a - b) < 1e-5f; };
    const auto is_whole = [&](float x) { return is_near(x, std::round(x)); };
    for (const int axis : {0, 1}) {
        const auto interval = options_.to_uv.interval(axis);
        if (!interval) return false;
        const auto [start, length] = *interval;
        if (!is_whole(length)) return false;
        switch (axis == 0 ? options_.wrap : options_.wrap_v.value_or(options_.wrap)) {
        case TextureWrap::Repeat: break;
        case TextureWrap::Mirror:
            // The image and its mirror image, or one of them from edge to edge.
            if (!is_whole(length / 2) && !is_whole(start)) return false;
            break;
        default:
            if (!is_near(std::min(start, start + length), 0) || !is_near(std::abs(length), 1))
                return false;
        }
    }
    return std::abs(options_.to_uv.determinant()) > 0.5f;  // not both axes along the same one
}

template <class Texels>
Rgb BitmapTexture::image_mean(const Texels& texels) const {
    const auto mean = [](int width, int height, const auto& value) {
        double sum[3] = {};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const Rgb c = value(x, y);
                for (int i = 0; i < 3; ++i) sum[i] += c[i];
            }
        const double n = double(width) * height;
        return Rgb(float(sum[0] / n), float(sum[1] / n), float(sum[2] / n));
    };
    // Over the unit square of the image every texel has the same weight, for any filter and wrapping.
    const auto of_image = [&] {
        return mean(image_->width, image_->height,
                    [&](int x, int y) { return texel(texels, x, y); });
    };
    if (covers_whole_periods()) return of_image();
    // Look-ups along each axis where `to_uv` maps the unit square to another part of the plane.
    constexpr int kGrid = 256;
    Rgb c = mean(kGrid, kGrid, [&](int x, int y) {
        return filtered(texels,
                        footprint(Vec2{(float(x) + 0.5f) / kGrid, (float(y) + 0.5f) / kGrid}));
    });
    // They may miss small bright spots. Emitters, and lobes of materials, with a mean of zero would never be sampled.
    if (c.r == 0 || c.g == 0 || c.b == 0) {
        const Rgb whole = of_image();
        for (int i = 0; i < 3; ++i)
            if (c[i] == 0) c[i] = whole[i];
    }
    return c;
}

std::optional<BitmapFile> bitmap_file(const Params& params) {
    if (params.has("image")) return {};
    try {
        return BitmapFile{resolve_file(params), params.flag("raw", false)};
    } catch (const SceneError&) {
        return {};
    }
}

namespace {

/// The opacity of an image without an alpha channel.
class Opaque final : public Texture {
public:
    Rgb eval(const TexturePoint&) const override { return Rgb(1); }
    Rgb mean() const override { return Rgb(1); }
};

const PixelBuffer& load_image(const Params& params, TextureContext& context, bool raw) {
    if (const EncodedImage* image = embedded_image(params))
        return context.images().decode(*image, raw);
    return context.images().load(resolve_file(params), raw);
}

std::unique_ptr<Texture> make_bitmap(const Params& params, TextureContext& context) {
    BitmapTexture::Options options;
    options.filter = TextureFilter(params.choice("filter_type", {"bilinear", "nearest"}, 0));
    const auto wrapping = [&](const char* name) {
        return TextureWrap(params.choice(name, {"repeat", "mirror", "clamp", "zero", "one"}, 0));
    };
    options.wrap = wrapping("wrap_mode");
    if (params.has("wrap_mode_v")) options.wrap_v = wrapping("wrap_mode_v");
    options.raw = params.flag("raw", false);
    options.to_uv = UvTransform(params.transform("to_uv"));
    options.is_of_second_uv = params.integer("uv_set", 0, 0, 1) == 1;
    const int channel = params.choice("channel", {"all", "r", "g", "b", "a", "opacity"}, 0);
    try {
        const PixelBuffer& image = load_image(params, context, options.raw);
        if (channel == 5 && image.alpha_channel < 0) return std::make_unique<Opaque>();
        if (channel >= 4)
            options.channel = image.alpha_channel;
        else if (channel > 0)
            options.channel = image.channels < 3 ? 0 : channel - 1;
        if (channel == 4 && options.channel < 0)
            params.fail("channel", "the image has no alpha channel");
        return std::make_unique<BitmapTexture>(image, options);
    } catch (const SceneError&) {
        throw;
    } catch (const std::runtime_error& e) {
        params.fail("filename", e.what());
    }
}

}  // namespace

TextureEntry bitmap_entry() {
    return {
        {"texture",
         "bitmap",
         "An image; (0, 0) is its upper left corner.",
         {{"filename", ParamKind::String, "",
           "Image file: .exr, .png, .jpg, .hdr, .pfm, .tga, .bmp, .pgm or .ppm."},
          {"filter_type", ParamKind::String, "bilinear", "Interpolation: bilinear or nearest."},
          {"wrap_mode", ParamKind::String, "repeat",
           "Outside the unit square: repeat, mirror, clamp, zero or one."},
          {"wrap_mode_v", ParamKind::String, "wrap_mode",
           "The same along v, if it differs from that along u."},
          {"raw", ParamKind::Bool, "false",
           "Whether integer formats hold linear data instead of sRGB."},
          {"channel", ParamKind::String, "all",
           "all (the colour); r, g, b or a (this channel as grey); or opacity (a, or 1 if the "
           "image has no a)."},
          {"image", ParamKind::Int, "",
           "Index of the image among those of the scene file, from 0, instead of filename."},
          {"uv_set", ParamKind::Int, "0", "0, or 1: the second texture coordinates of a mesh."},
          {"to_uv", ParamKind::Transform, "identity", "Affine map of (u, v) before the look-up."}}},
        make_bitmap};
}

}  // namespace etendue
