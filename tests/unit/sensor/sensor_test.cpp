// Every sensor: rays through film points, and the way back from the scene to the film.

#include "sensor/sensor.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "sensor/orthographic.h"
#include "sensor/perspective.h"
#include "sensor/resized.h"

namespace etendue {
namespace {

constexpr FilmGeometry kWhole{64, 48, 0, 0, 64, 48};
constexpr FilmGeometry kCrop{64, 48, 20, 7, 16, 30};
constexpr float kFilterRadius = 2;

Transform somewhere() {
    return *Transform::look_at({1, 2, -3}, {0.5f, 0.3f, 4}, {0.1f, 1, 0});
}

struct Case {
    const char* name;
    FilmGeometry film;
    enum class Kind { Pinhole, Lens, Orthographic } kind;
    Vec2 offset{};
};

std::unique_ptr<Sensor> make(const Case& c) {
    if (c.kind == Case::Kind::Orthographic) {
        SceneDescription scene;
        SceneObject object;
        object.category = "sensor";
        object.type = "orthographic";
        object.params.push_back({"to_world", somewhere() * Transform::scale({2, 2, 1}), {}});
        scene.objects.push_back(object);
        return orthographic_entry().make({scene, 0}, {c.film, kFilterRadius, 5, {}});
    }
    PerspectiveCamera camera;
    camera.film = c.film;
    camera.half_width = 0.6f;
    camera.half_height = 0.6f * 48 / 64;
    camera.offset = c.offset;
    if (c.kind == Case::Kind::Lens) {
        camera.lens_radius = 0.2f;
        camera.focus_distance = 3;
    }
    return make_perspective(camera, somewhere(), kFilterRadius);
}

class Sensors : public ::testing::TestWithParam<Case> {
protected:
    Sensors() : sensor(make(GetParam())) {}

    float number() { return std::uniform_real_distribution<float>(0, 1)(random); }
    Vec2 lens_numbers() { return {number(), number()}; }
    Vec2 film_point() {
        const FilmGeometry& g = GetParam().film;
        return {float(g.crop_x) + number() * float(g.crop_width),
                float(g.crop_y) + number() * float(g.crop_height)};
    }
    static void expect_near(Vec3 a, Vec3 b, float tolerance) {
        EXPECT_LT(length(a - b), tolerance)
            << a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " " << b.z;
    }
    void expect_measured(const SensorSample& s, const SensorRay& ray, Vec2 film) const {
        // In pixels; of floats that count 64 of them.
        constexpr float kTolerance = 2e-3f;
        EXPECT_NEAR(s.film.x, film.x, kTolerance);
        EXPECT_NEAR(s.film.y, film.y, kTolerance);
        EXPECT_NEAR(s.pdf_dir, ray.pdf_dir, 1e-4f * ray.pdf_dir);
        EXPECT_EQ(s.pdf_pos, ray.pdf_pos);
        // An eye path's throughput at z_1 is 1.
        EXPECT_NEAR(s.We_cos, s.pdf_pos * s.pdf_dir, 1e-6f * s.We_cos);
        expect_near(s.p, ray.p, 1e-4f);
        expect_near(s.ng, ray.ng, 1e-6f);
    }

    std::mt19937 random{1};
    std::unique_ptr<Sensor> sensor;
};

TEST_P(Sensors, ConnectToTheFilmPointOfTheRay) {
    for (int i = 0; i < 1000; ++i) {
        const Vec2 film = film_point(), u = lens_numbers();
        const SensorRay ray = sensor->sample_ray(film, u);
        EXPECT_NEAR(length(ray.d), 1, 1e-6f);
        EXPECT_GT(dot(ray.ng, ray.d), 0);
        EXPECT_NEAR(sensor->pdf_direction(ray.p, ray.d), ray.pdf_dir, 1e-5f * ray.pdf_dir);
        const auto near =
            sensor->sample_connection(ray.p + ray.d * (0.5f + 9 * number()), false, u);
        ASSERT_TRUE(near) << film.x << " " << film.y;
        expect_measured(*near, ray, film);
        if (sensor->is_orthographic()) continue;  // which no emitter at infinity is joined to
        const auto far = sensor->sample_connection(ray.d, true, u);
        ASSERT_TRUE(far);
        expect_measured(*far, ray, film);
    }
}

TEST_P(Sensors, MeasureWhatHitsALens) {
    for (int i = 0; i < 1000; ++i) {
        const Vec2 film = film_point();
        const SensorRay ray = sensor->sample_ray(film, lens_numbers());
        const float t = 0.5f + 9 * number();
        const auto hit = sensor->hit_lens(ray.p + ray.d * t, -ray.d, kInf);
        ASSERT_EQ(hit.has_value(), sensor->has_finite_lens());
        if (!hit) continue;
        expect_measured(*hit, ray, film);
        EXPECT_TRUE(sensor->hit_lens(ray.p + ray.d * t, -ray.d, 1.01f * t));
        EXPECT_FALSE(sensor->hit_lens(ray.p + ray.d * t, -ray.d, 0.99f * t)) << "too short";
        EXPECT_FALSE(sensor->hit_lens(ray.p - ray.d * t, ray.d, kInf)) << "from behind";
        const Bounds3 b = sensor->lens_bounds();
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_GE(ray.p[axis], b.lo[axis] - 1e-5f);
            EXPECT_LE(ray.p[axis], b.hi[axis] + 1e-5f);
        }
    }
}

/// A film of another size shows the same, with larger pixels, and sees as far beyond its edges as the filter reaches.
TEST_P(Sensors, CanHaveAFilmOfAnotherSize) {
    constexpr int kColumns = 9, kRows = 5;
    const FilmGeometry& g = GetParam().film;
    const std::shared_ptr<const Sensor> whole = make(GetParam());
    constexpr float kMargin = 1.5f;
    const auto small = make_resized(*whole, g, kColumns, kRows, kMargin);
    const Vec2 pixel{float(g.crop_width) / kColumns, float(g.crop_height) / kRows};
    EXPECT_EQ(small->is_orthographic(), whole->is_orthographic());
    EXPECT_EQ(small->has_finite_lens(), whole->has_finite_lens());
    for (int i = 0; i < 1000; ++i) {
        const Vec2 film{number() * (kColumns + 2 * kMargin) - kMargin,
                        number() * (kRows + 2 * kMargin) - kMargin},
            u = lens_numbers();
        const SensorRay ray = small->sample_ray(film, u);
        const SensorRay same = whole->sample_ray(
            {float(g.crop_x) + film.x * pixel.x, float(g.crop_y) + film.y * pixel.y}, u);
        expect_near(ray.d, same.d, 1e-6f);
        expect_near(ray.p, same.p, 1e-5f);
        EXPECT_NEAR(ray.pdf_dir * pixel.x * pixel.y, same.pdf_dir, 1e-5f * same.pdf_dir);
        EXPECT_NEAR(small->pdf_direction(ray.p, ray.d), ray.pdf_dir, 1e-5f * ray.pdf_dir);
        expect_near(small->ray_from(ray.p, film).d, ray.d, 1e-5f);
        const Vec3 seen = ray.p + ray.d * (0.5f + 9 * number());
        const auto back = small->sample_connection(seen, false, u);
        ASSERT_TRUE(back);
        expect_measured(*back, ray, film);
        if (!whole->has_finite_lens()) continue;
        const auto connected = small->connection_to(ray.p, seen, false);
        ASSERT_TRUE(connected);
        expect_measured(*connected, ray, film);
        const auto hit = small->hit_lens(seen, -ray.d, kInf);
        ASSERT_TRUE(hit);
        expect_measured(*hit, ray, film);
    }
}

/// The density is the inverse of the solid angle of a pixel's rays, or of their area in a parallel projection.
TEST_P(Sensors, HaveTheDensityOfTheirRays) {
    constexpr float kHalf = 0.25f;
    for (int i = 0; i < 100; ++i) {
        const Vec2 film = film_point(), u = lens_numbers();
        const auto along = [&](Vec2 step) {
            const SensorRay a = sensor->sample_ray(film + step, u),
                            b = sensor->sample_ray(film - step, u);
            return (sensor->is_orthographic() ? a.p - b.p : a.d - b.d) / (2 * kHalf);
        };
        const float covered = length(cross(along({kHalf, 0}), along({0, kHalf})));
        EXPECT_NEAR(sensor->sample_ray(film, u).pdf_dir * covered, 1, 2e-3f);
    }
}

TEST_P(Sensors, SeeAsFarAsTheFilterReachesOverTheCrop) {
    const FilmGeometry& g = GetParam().film;
    const float reach = kFilterRadius - 0.5f;
    const float left = float(g.crop_x) - reach, right = float(g.crop_x + g.crop_width) + reach,
                top = float(g.crop_y) - reach, bottom = float(g.crop_y + g.crop_height) + reach;
    const float x = 0.5f * (left + right), y = 0.5f * (top + bottom);
    const auto is_seen = [&](Vec2 film) {
        const Vec2 u = lens_numbers();
        const SensorRay ray = sensor->sample_ray(film, u);
        return sensor->sample_connection(ray.p + ray.d * 2, false, u).has_value();
    };
    for (const Vec2 inside : {Vec2{left + 0.01f, y}, Vec2{right - 0.01f, y}, Vec2{x, top + 0.01f},
                              Vec2{x, bottom - 0.01f}})
        EXPECT_TRUE(is_seen(inside)) << inside.x << " " << inside.y;
    for (const Vec2 outside : {Vec2{left - 0.01f, y}, Vec2{right + 0.01f, y}, Vec2{x, top - 0.01f},
                               Vec2{x, bottom + 0.01f}})
        EXPECT_FALSE(is_seen(outside)) << outside.x << " " << outside.y;
}

TEST_P(Sensors, SeeNothingBehindThem) {
    const Vec2 u = lens_numbers();
    const SensorRay ray = sensor->sample_ray(film_point(), u);
    EXPECT_FALSE(sensor->sample_connection(ray.p - ray.d * 2, false, u));
    EXPECT_FALSE(sensor->sample_connection({std::nanf(""), 0, 0}, false, u));
}

INSTANTIATE_TEST_SUITE_P(
    All, Sensors,
    ::testing::Values(Case{"Pinhole", kWhole, Case::Kind::Pinhole},
                      Case{"PinholeShifted", kWhole, Case::Kind::Pinhole, {0.2f, -0.3f}},
                      Case{"PinholeCrop", kCrop, Case::Kind::Pinhole},
                      Case{"Lens", kWhole, Case::Kind::Lens},
                      Case{"LensShiftedCrop", kCrop, Case::Kind::Lens, {-0.1f, 0.4f}},
                      Case{"Orthographic", kWhole, Case::Kind::Orthographic},
                      Case{"OrthographicCrop", kCrop, Case::Kind::Orthographic}),
    [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace etendue
