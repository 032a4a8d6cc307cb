#pragma once
// What smooth and rough plastic read from a scene file.

#include "bsdf/material.h"

namespace etendue {

struct PlasticParams {
    TextureRef diffuse, specular;
    float eta;       ///< η of the coat over η outside.
    bool nonlinear;  ///< Whether interreflection under the coat saturates the colour.

    PlasticParams(const Params& params, MaterialContext& context);

    struct Colors {
        Rgb diffuse, specular;
        float
            specular_share;  ///< Share of the specular colour in the sum of both, before the coat.
    };
    /// Colours at `uv`, the diffuse one as the coat sends it out before the two transmittances:
    ///     ρ / (η² (1 − ρ' F_int)),
    /// F_int being the coat's reflectance for diffuse light from below. ρ' = ρ sums the
    /// interreflection of the colour (`nonlinear`); ρ' = 1 keeps the colours of textures.
    Colors eval(Vec2 uv, float F_int) const;
    Rgb mean_albedo() const;

    /// Rows for the tables of plug-ins that read these.
    static std::vector<ParamInfo> table();
};

}  // namespace etendue
