// Eye paths that are made in turns are those that are made one after the other.

#include "pathspace/eye_paths.h"

#include <filesystem>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "image/image_io.h"
#include "test_scenes.h"

namespace etendue {
namespace {

/// A small image of random colours, as a file.
class RandomImage {
public:
    RandomImage(const char* name, int width, int height)
        : path_((std::filesystem::path(::testing::TempDir()) / name).string()) {
        Image image(width, height, {"R", "G", "B"});
        Sampler sampler(SamplerKind::Independent, 7);
        sampler.start(0, 0);
        for (float& value : image.data) value = sampler.next_1d();
        write_image(path_, image);
    }
    ~RandomImage() { std::filesystem::remove(path_); }
    RandomImage(const RandomImage&) = delete;
    RandomImage& operator=(const RandomImage&) = delete;

    std::string parameter() const { return "<string name=\"filename\" value=\"" + path_ + "\"/>"; }

private:
    std::string path_;
};

std::string textured(const RandomImage& image, const std::string& options) {
    return "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" "
           "name=\"reflectance\">" +
           image.parameter() + options +
           "<transform name=\"to_uv\"><scale value=\"3\"/></transform></texture></bsdf></bsdf>";
}

struct EyePaths : ::testing::Test {
    static constexpr int kSize = 11;  // an odd number of pixels
    const TechniqueCounts bdpt{.hit = 1, .next_event = 1, .connect = 1, .splat = kSize * kSize};

    /// Compares the paths of all pixels, by any number of walks in turn.
    void expect_same(const Scene& scene, const TechniqueCounts& counts, WalkOptions options = {}) {
        const Film film(scene.film(), scene.filter());
        RenderStats together, alone;
        const WalkContext in_turns{scene, counts, together, options},
            one_by_one{scene, counts, alone, options};
        std::vector<SubPath> z(kWalksInTurn);
        SubPath expected;
        NoSink sink;
        size_t vertices = 0;
        for (uint64_t first = 0, n = 1; first < film.sample_count(); first += n, n = n % 8 + 1) {
            n = std::min(n, film.sample_count() - first);
            std::vector<Sampler> samplers(n, Sampler(SamplerKind::Sobol, 3));
            std::vector<SampleContext> contexts;
            for (uint64_t i = 0; i < n; ++i) {
                samplers[i].start(5, first + i);
                contexts.push_back(
                    {scene, film, film.expected(), first + i, 0, 1, 1, samplers[i], sink});
            }
            trace_eye_paths(in_turns, contexts, std::span(z).first(n));
            for (uint64_t i = 0; i < n; ++i) {
                trace_eye_path(one_by_one, contexts[i], expected);
                expect_same(z[i], expected);
                vertices += size_t(expected.size());
            }
        }
        EXPECT_GT(vertices, 3 * film.sample_count()) << "the paths are short";
        EXPECT_EQ(together.walk_rays, alone.walk_rays);
        EXPECT_EQ(together.vertices, alone.vertices);
        EXPECT_EQ(together.eye_paths, alone.eye_paths);
    }

private:
    struct NoSink final : ContributionSink {
        void add(const Join&, Rgb) override {}
    };

    static void expect_same(const SubPath& a, const SubPath& b) {
        ASSERT_EQ(a.size(), b.size());
        EXPECT_EQ(a.film, b.film);
        EXPECT_EQ(a.film_weight, b.film_weight);
        EXPECT_EQ(a.eta2, b.eta2);
        for (int i = 0; i < a.size(); ++i) {
            SCOPED_TRACE(i);
            EXPECT_EQ(a[i].kind, b[i].kind);
            EXPECT_EQ(length(a[i].p - b[i].p), 0);
            EXPECT_EQ(a[i].beta, b[i].beta);
            EXPECT_EQ(a[i].pdf_fwd, b[i].pdf_fwd);
            if (a[i].kind == Vertex::Kind::Surface) {
                EXPECT_EQ(a[i].to_predecessor, b[i].to_predecessor);
            }
            EXPECT_EQ(a[i].weight_sum, b[i].weight_sum);
            EXPECT_EQ(a[i].pdf_rev, b[i].pdf_rev);
            EXPECT_EQ(a[i].is_delta, b[i].is_delta);
            EXPECT_EQ(a[i].is_fixed_by_film, b[i].is_fixed_by_film);
            EXPECT_EQ(a[i].medium, b[i].medium);
            EXPECT_EQ(a[i].shape, b[i].shape);
            EXPECT_EQ(a[i].survival.steps(), b[i].survival.steps());
        }
    }
};

TEST_F(EyePaths, OfALensAreTheSameInTurns) {
    expect_same(test::build(test::mixed_room(test::lens_camera(kSize))), bdpt);
}

TEST_F(EyePaths, OfNextEventsAloneAreTheSameInTurns) {
    expect_same(test::build(test::mixed_room(test::front_camera(kSize))),
                {.hit = 1, .next_event = 1}, {.max_vertices = 5, .rr_depth = 2});
}

TEST_F(EyePaths, InALandscapeAreTheSameInTurns) {
    const RandomImage sky("sky.pfm", 16, 8), paint("paint.pfm", 5, 3);
    const std::string instance =
        "<shape type=\"shapegroup\" id=\"group\"><shape type=\"cube\">" + textured(paint, "") +
        "</shape></shape><shape type=\"instance\"><ref id=\"group\"/><transform "
        "name=\"to_world\"><scale value=\"0.3\"/><rotate y=\"1\" angle=\"30\"/><translate "
        "z=\"0.2\"/></transform></shape>";
    for (const char* projection : {"", "<string name=\"projection\" value=\"equalarea\"/>"}) {
        const RandomImage square("square.pfm", 8, 8);
        const std::string environment = "<emitter type=\"envmap\">" +
                                        (*projection ? square : sky).parameter() + projection +
                                        "</emitter>";
        expect_same(
            test::build(
                test::sensor("0,1,3", "0,0,0", kSize, "45", "", "orthographic") + instance +
                environment +
                test::rectangle(
                    "<scale value=\"3\"/><rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.5\"/>",
                    textured(paint, "<string name=\"wrap_mode\" value=\"zero\"/>")) +
                test::rectangle(
                    "<scale value=\"3\"/><translate z=\"-1\"/>",
                    textured(paint, "<string name=\"filter_type\" value=\"nearest\"/>"))),
            bdpt);
    }
}

TEST_F(EyePaths, ThroughMaskedMediaAreTheSameInTurns) {
    const std::string masked =
        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"><float "
        "name=\"color0\" value=\"0.2\"/><float name=\"color1\" value=\"0.9\"/></texture>" +
        test::diffuse("0.6,0.5,0.4") +
        "</bsdf><medium type=\"homogeneous\" name=\"interior\"><rgb name=\"sigma_t\" "
        "value=\"0.5,1.5,4\"/><float name=\"albedo\" value=\"0\"/></medium>";
    expect_same(test::build(test::front_camera(kSize) + test::room() + test::area_lamp() +
                            test::sphere("0,-0.4,0", "0.5", masked)),
                bdpt);
}

/// Nothing can be chosen where no emitter has power.
TEST_F(EyePaths, OfADarkLandscapeAreTheSameInTurns) {
    const RandomImage sky("dark.pfm", 4, 2);
    const std::string dark = "<emitter type=\"envmap\">" + sky.parameter() +
                             "<float name=\"scale\" value=\"0\"/></emitter>";
    const Scene scene =
        test::build(test::mixed_room(test::front_camera(kSize)) + dark +
                    "<emitter type=\"point\"><rgb name=\"intensity\" value=\"0\"/></emitter>");
    expect_same(scene, bdpt);
    const Scene unlit =
        test::build(test::front_camera(kSize) + test::room() + dark +
                    "<emitter type=\"point\"><rgb name=\"intensity\" value=\"0\"/></emitter>");
    EXPECT_FALSE(unlit.has_emitters());
    expect_same(unlit, bdpt);
}

}  // namespace
}  // namespace etendue
