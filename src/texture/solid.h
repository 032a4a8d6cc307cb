#pragma once

#include "math/transform.h"
#include "texture/texture.h"

namespace etendue {

/// A function of the position alone, in the texture's own space (parameter `to_texture`: world-to-texture transform).
class SolidTexture : public Texture {
public:
    explicit SolidTexture(const Params& params) : to_texture_(params.transform("to_texture")) {}

    /// Makes the step of gradients 0.0005, as in pbrt without a pixel footprint.
    void resolution(int& width, int& height) const override { width = height = 200; }

protected:
    Vec3 point(const TexturePoint& at) const { return to_texture_.point(at.p); }
    Vec3Dual point(const TextureJetPoint& at) const {
        const Vec3Dual& p = at.p;
        const auto coordinate = [&](const auto& row) {
            return row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3];
        };
        const Transform::Matrix& m = to_texture_.matrix();
        return {coordinate(m[0]), coordinate(m[1]), coordinate(m[2])};
    }

    static ParamInfo to_texture_info() {
        return {"to_texture", ParamKind::Transform, "identity", "World-to-pattern transform."};
    }

private:
    Transform to_texture_;
};

}  // namespace etendue
