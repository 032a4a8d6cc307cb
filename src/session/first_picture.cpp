#include "session/first_picture.h"

#include "pathspace/walk.h"

namespace etendue {

FirstPicture first_picture(const Scene& scene) {
    const FilmGeometry& g = scene.film();
    FirstPicture picture;
    picture.width = (g.crop_width + kFirstPictureStep - 1) / kFirstPictureStep;
    picture.height = (g.crop_height + kFirstPictureStep - 1) / kFirstPictureStep;
    SubPath z;
    RenderStats stats;
    const TechniqueCounts counts;
    const WalkContext walk{scene, counts, stats, {}};
    Sampler sampler(SamplerKind::Sobol, 0);
    for (int y = 0; y < picture.height; ++y)
        for (int x = 0; x < picture.width; ++x) {
            const int column = std::min(x * kFirstPictureStep, g.crop_width - 1),
                      row = std::min(y * kFirstPictureStep, g.crop_height - 1);
            const uint64_t pixel = g.pixel_index(column, row);
            sampler.start(0, pixel);
            start_eye_path(walk, Film::PixelSample{g.pixel_center(pixel), 1}, Vec2{0.5f, 0.5f},
                           sampler, z);
            Rgb& value = picture.pixels.emplace_back();
            if (z.size() < 2 || z[1].kind != Vertex::Kind::Surface) continue;
            value =
                z[1].bsdf.albedo_estimate() * std::abs(dot(z[1].bsdf.shading_normal(), z[1].wo));
        }
    return picture;
}

}  // namespace etendue
