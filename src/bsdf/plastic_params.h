#pragma once
// Parameters shared by smooth and rough plastic.

#include "bsdf/material.h"

namespace etendue {

struct PlasticParams {
    TextureRef diffuse, specular;
    float eta;        ///< η of the coat over η outside.
    bool nonlinear;   ///< Whether interreflection under the coat saturates the colour.
    float thickness;  ///< Optical thickness of the coat.

    PlasticParams(const Params& params, MaterialContext& context);

    struct Colors {
        Rgb diffuse, specular;
        float
            specular_share;  ///< Share of the specular colour in the sum of both, without the coat.
    };
    /// Colours at `at`. The diffuse one includes interreflection below the coat, but not the two transmittances:
    ///     ρ / (η² (1 − ρ' F_int)) = ρ / (η² (1 − ρ' + ρ' loss)),
    /// where F_int = 1 − `loss` is the coat's reflectance for diffuse light from below, see loss_below_coat(). With
    /// `nonlinear` ρ' = ρ, which saturates the colour; otherwise ρ' = 1, which keeps the hue of textures.
    Colors eval(const TexturePoint& at, float loss) const;
    Rgb mean_albedo() const;

    /// Rows for the tables of plug-ins with these parameters.
    static std::vector<ParamInfo> table();
};

}  // namespace etendue
