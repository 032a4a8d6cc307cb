#include "bsdf/material.h"

namespace etendue {

MaterialEntry diffuse_entry();
MaterialEntry conductor_entry();
MaterialEntry roughconductor_entry();
MaterialEntry coatedconductor_entry();
MaterialEntry dielectric_entry();
MaterialEntry thindielectric_entry();
MaterialEntry roughdielectric_entry();
MaterialEntry plastic_entry();
MaterialEntry roughplastic_entry();
MaterialEntry orennayar_entry();
MaterialEntry fresnelblend_entry();
MaterialEntry lobesum_entry();
MaterialEntry diffusetransmission_entry();
MaterialEntry phong_entry();
MaterialEntry principled_entry();
MaterialEntry openpbr_entry();
MaterialEntry twosided_entry();
MaterialEntry mask_entry();
MaterialEntry blendbsdf_entry();
MaterialEntry mixturebsdf_entry();
MaterialEntry bumpmap_entry();
MaterialEntry normalmap_entry();
MaterialEntry null_entry();

const std::vector<MaterialEntry>& material_registry() {
    static const std::vector<MaterialEntry> entries = {
        diffuse_entry(),
        conductor_entry(),
        roughconductor_entry(),
        dielectric_entry(),
        plastic_entry(),
        thindielectric_entry(),
        roughdielectric_entry(),
        roughplastic_entry(),
        coatedconductor_entry(),
        phong_entry(),
        principled_entry(),
        openpbr_entry(),
        orennayar_entry(),
        fresnelblend_entry(),
        lobesum_entry(),
        diffusetransmission_entry(),
        twosided_entry(),
        mask_entry(),
        blendbsdf_entry(),
        mixturebsdf_entry(),
        bumpmap_entry(),
        normalmap_entry(),
        null_entry(),
    };
    return entries;
}

}  // namespace etendue
