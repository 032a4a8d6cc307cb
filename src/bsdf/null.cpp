// An invisible surface that every ray passes unchanged; a boundary of media.

#include "bsdf/material.h"

namespace etendue {
namespace {

class Null final : public Material {
public:
    Null(const Params&, MaterialContext&) {}

    void append(const SurfacePoint&, const Frame&, float, ComponentList&) const override {}
    float opacity(const TexturePoint&) const override { return 0; }
    bool is_opaque() const override { return false; }
    bool may_be_smooth() const override { return false; }
    Rgb mean_albedo() const override { return Rgb(0); }
};

}  // namespace

MaterialEntry null_entry() {
    return {{"bsdf", "null", "An invisible surface that every ray passes unchanged.", {}},
            make_material<Null>};
}

}  // namespace etendue
