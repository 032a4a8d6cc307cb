// The interpolated vertex colours of a mesh; white on other shapes.
//   name (vertex_color)  the only attribute that is supported
//   scale (1)            factor

#include <algorithm>

#include <fmt/format.h>

#include "texture/texture.h"

namespace etendue {
namespace {

class MeshAttribute final : public Texture {
public:
    explicit MeshAttribute(const Params& params) : scale_(params.number("scale", 1, 0)) {
        if (const std::string name = params.text("name", "vertex_color"); name != "vertex_color")
            params.fail("name", fmt::format("attribute \"{}\" is not supported: only "
                                            "\"vertex_color\" is",
                                            name));
    }
    Rgb eval(const TexturePoint& at) const override {
        const auto component = [&](float c) { return std::max(c * scale_, 0.0f); };
        return {component(at.color.x), component(at.color.y), component(at.color.z)};
    }
    Rgb mean() const override { return Rgb(0.5f * scale_); }  // unknown

private:
    float scale_;
};

}  // namespace

TextureEntry mesh_attribute_entry() {
    return {{"texture",
             "mesh_attribute",
             "The vertex colours of a mesh.",
             {{"name", ParamKind::String, "vertex_color", "Must be vertex_color."},
              {"scale", ParamKind::Float, "1", "Factor on the colours."}}},
            [](const Params& params, TextureContext&) -> std::unique_ptr<Texture> {
                return std::make_unique<MeshAttribute>(params);
            }};
}

}  // namespace etendue
