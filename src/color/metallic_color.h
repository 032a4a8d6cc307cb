#pragma once
// Materials of a diffuse and a specular colour, in the words of those that mix metal and dielectric.

#include "color/rgb.h"

namespace etendue {

/// Share of metal, base colour, and factor of the reflectance 0.04 of the dielectric at normal incidence.
struct MetallicColor {
    float metallic;
    Rgb base;
    float specular_weight;
};

/// A mixture of metal and dielectric that comes near to a material of this diffuse and this specular colour, of which
/// the latter hides the former.
MetallicColor metallic_color(Rgb diffuse, Rgb specular);

}  // namespace etendue
