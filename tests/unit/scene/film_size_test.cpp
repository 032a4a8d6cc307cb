// Scenes that are seen by a film of another size.

#include <optional>

#include <gtest/gtest.h>

#include "test_scenes.h"

namespace etendue::test {
namespace {

TEST(FilmSize, ShowsTheSameSceneAndSharesIt) {
    std::optional<Scene> small;
    {
        const Scene scene = build(mixed_room(front_camera(64)));
        small.emplace(scene.seen_by_film(8, 4));
        EXPECT_EQ(scene.film().width, 64);
        EXPECT_EQ(&small->emitters(), &scene.emitters());
        EXPECT_EQ(&small->accelerator(), &scene.accelerator());
        EXPECT_EQ(small->shapes().size(), scene.shapes().size());
        SurfaceHit a, b;
        for (int i = 0; i < 8; ++i) {
            const Vec2 film{float(i) + 0.5f, 1.75f};
            const SensorRay one = small->sensor().sample_ray(film, {}),
                            other = scene.sensor().sample_ray({film.x * 8, film.y * 16}, {});
            const bool hits = small->intersect({one.p, one.d, kInf}, 0.5f, a);
            ASSERT_EQ(scene.intersect({other.p, other.d, kInf}, 0.5f, b), hits);
            if (!hits) continue;
            EXPECT_NEAR(a.t, b.t, 1e-4f);
            EXPECT_EQ(a.location.shape, b.location.shape);
        }
    }
    // The other scene is gone.
    const FilmGeometry& g = small->film();
    EXPECT_EQ(g.width, 8);
    EXPECT_EQ(g.crop_height, 4);
    SurfaceHit hit;
    const SensorRay ray = small->sensor().sample_ray({4, 2}, {});
    EXPECT_TRUE(small->intersect({ray.p, ray.d, kInf}, 0.5f, hit));
    EXPECT_TRUE(small->has_emitters());
    EXPECT_GT(small->sample_emitter(0.5).power(), 0);
}

}  // namespace
}  // namespace etendue::test
