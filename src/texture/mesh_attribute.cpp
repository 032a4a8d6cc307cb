// The interpolated vertex colours of a mesh, or their alpha; white, and 1, on other shapes.
//   name (vertex_color)  or vertex_alpha
//   scale (1)            factor

#include <algorithm>

#include <fmt/format.h>

#include "texture/texture.h"

namespace etendue {
namespace {

class MeshAttribute final : public Texture {
public:
    explicit MeshAttribute(const Params& params) : scale_(params.number("scale", 1, 0)) {
        const std::string name = params.text("name", "vertex_color");
        is_alpha_ = name == "vertex_alpha";
        if (!is_alpha_ && name != "vertex_color")
            params.fail("name", fmt::format("attribute \"{}\" is not supported: only "
                                            "\"vertex_color\" and \"vertex_alpha\" are",
                                            name));
    }
    Rgb eval(const TexturePoint& at) const override {
        if (is_alpha_) return Rgb(std::max(at.alpha * scale_, 0.0f));
        const auto component = [&](float c) { return std::max(c * scale_, 0.0f); };
        return {component(at.color.x), component(at.color.y), component(at.color.z)};
    }
    float eval_scalar(const TexturePoint& at) const override {
        return is_alpha_ ? eval(at).r : luminance(eval(at));
    }
    Rgb mean() const override { return Rgb(0.5f * scale_); }  // unknown

private:
    bool is_alpha_;
    float scale_;
};

}  // namespace

TextureEntry mesh_attribute_entry() {
    return {{"texture",
             "mesh_attribute",
             "The vertex colours of a mesh, or their alpha.",
             {{"name", ParamKind::String, "vertex_color", "vertex_color or vertex_alpha."},
              {"scale", ParamKind::Float, "1", "Factor."}}},
            [](const Params& params, TextureContext&) -> std::unique_ptr<Texture> {
                return std::make_unique<MeshAttribute>(params);
            }};
}

}  // namespace etendue
