#pragma once
// Indices of refraction and roughness: parsing of their parameters, and the rows of these in the tables of plug-ins.

#include "bsdf/material.h"
#include "bsdf/microfacet.h"

namespace etendue {

/// Index of refraction given by parameter `name`: a number above zero, or a name such as "water"
/// (table in ior.cpp).
float read_ior(const Params& params, const char* name, const char* fallback);

/// η inside over η outside, from "int_ior" (bk7) and "ext_ior" (air).
float read_relative_ior(const Params& params);
/// Rows for these two parameters, "specular_reflectance" and "specular_transmittance".
std::vector<ParamInfo> dielectric_params();

/// Complex index of a metal: "material" (a name of color/metals.h, or "none", a perfect mirror), or
/// "eta" and "k"; divided by "ext_eta".
struct ConductorIndex {
    TextureRef eta, k;
    ConductorIndex(const Params& params, MaterialContext& context);

private:
    void read(const Params& params, MaterialContext& context);
};
/// Rows for these parameters and "specular_reflectance".
std::vector<ParamInfo> conductor_params();

/// "distribution": beckmann (default) or ggx.
Microfacet::Kind read_distribution(const Params& params);

/// Roughness of a microfacet model: "distribution", and "alpha" or "alpha_u" and "alpha_v".
class Roughness {
public:
    Roughness(const Params& params, MaterialContext& context);
    Microfacet eval(const TexturePoint& at) const {
        return {kind_, alpha_u_.eval_scalar(at), alpha_v_.eval_scalar(at)};
    }
    bool is_constant() const { return alpha_u_.is_constant() && alpha_v_.is_constant(); }
    /// Whether both are the constant 0.
    bool is_zero() const {
        return is_constant() && alpha_u_.eval_scalar(Vec2()) == 0 &&
               alpha_v_.eval_scalar(Vec2()) == 0;
    }

private:
    Microfacet::Kind kind_;
    TextureRef alpha_u_, alpha_v_;
};
std::vector<ParamInfo> roughness_params();

}  // namespace etendue
