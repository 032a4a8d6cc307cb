// Smooth boundary between two dielectrics: the surface of glass or water.
//   int_ior (bk7), ext_ior (air)   indices behind and in front of the surface; numbers or names
//   specular_reflectance (1), specular_transmittance (1)   factors; only 1 is physical

#include "bsdf/dielectric.h"

#include "bsdf/clear_dielectric.h"

namespace etendue {

MaterialEntry dielectric_entry() {
    return {{"bsdf", "dielectric",
             "Smooth boundary between two dielectrics, such as glass and air.",
             dielectric_params()},
            make_material<ClearDielectric<DielectricLobe>>};
}

}  // namespace etendue
