// Pane so thin that transmitted light goes straight on; internal reflections are included.
//   int_ior (bk7), ext_ior (air)   indices of the pane and of the medium around it; numbers or names
//   specular_reflectance (1), specular_transmittance (1)   factors; only 1 is physical

#include "bsdf/thindielectric.h"

#include "bsdf/clear_dielectric.h"

namespace etendue {

MaterialEntry thindielectric_entry() {
    return {
        {"bsdf", "thindielectric",
         "Thin pane of glass: reflects, and transmits straight ahead, with internal reflections.",
         dielectric_params()},
        make_material<ClearDielectric<ThinDielectricLobe>>};
}

}  // namespace etendue
