// Sums of octaves of noise in space: `fbm`, `wrinkled` and `windy` of pbrt.
//   octaves (8), roughness (0.5)   number of octaves, and ω, the ratio of their amplitudes; not for windy
//   to_texture (identity)          from the world to the space of the noise
// Values of heights may be negative; those of colours are clamped to [0, 1]. The noise is not filtered, and its lattice
// has etendue's own permutation: the pattern is not pbrt's, its statistics are.

#include "texture/noise.h"
#include "texture/solid.h"

namespace etendue {
namespace {

enum class Sum { Fbm, Wrinkled, Windy };

template <Sum kSum>
class NoiseSum final : public SolidTexture {
public:
    explicit NoiseSum(const Params& params)
        : SolidTexture(params), octaves_(int(params.integer("octaves", 8, 1, 64))),
          omega_(params.number("roughness", 0.5f, 0, 1)) {}

    Rgb eval(const TexturePoint& at) const override { return Rgb(clamp(eval_scalar(at), 0, 1)); }
    float eval_scalar(const TexturePoint& at) const override { return height(point(at)); }
    bool has_jet() const override { return true; }
    RgbDual eval_jet(const TextureJetPoint& at) const override {
        const Dual value = clamp(scalar_jet(at), 0, 1);
        return {value, value, value};
    }
    Dual scalar_jet(const TextureJetPoint& at) const override { return height(point(at)); }
    Rgb mean() const override { return Rgb(kSum == Sum::Wrinkled ? 0.5f : 0.1f); }  // roughly

    static TextureEntry entry(const char* name, const char* doc) {
        std::vector<ParamInfo> params = {to_texture_info()};
        if (kSum != Sum::Windy)
            params.insert(params.begin(),
                          {{"octaves", ParamKind::Int, "8", "Number of octaves, 1 to 64."},
                           {"roughness", ParamKind::Float, "0.5",
                            "Amplitude of an octave divided by that of the previous one, in [0, "
                            "1]."}});
        return {{"texture", name, doc, std::move(params)},
                [](const Params& p, TextureContext&) -> std::unique_ptr<Texture> {
                    return std::make_unique<NoiseSum>(p);
                },
                true};
    }

private:
    template <class V>
    auto height(V p) const {
        using std::fabs;
        if (kSum == Sum::Fbm) return fbm(p, omega_, octaves_);
        if (kSum == Sum::Wrinkled) return turbulence(p, omega_, octaves_);
        const auto wind = fbm(p * 0.1f, 0.5f, 3), waves = fbm(p, 0.5f, 6);
        return fabs(wind) * waves;
    }

    int octaves_;
    float omega_;
};

}  // namespace

TextureEntry fbm_entry() {
    return NoiseSum<Sum::Fbm>::entry("fbm", "Fractional Brownian motion in space, from noise.");
}
TextureEntry wrinkled_entry() {
    return NoiseSum<Sum::Wrinkled>::entry("wrinkled",
                                          "Sum of absolute values of noise in space: creases.");
}
TextureEntry windy_entry() {
    return NoiseSum<Sum::Windy>::entry("windy",
                                       "Waves of water in wind of varying strength, in space.");
}

}  // namespace etendue
