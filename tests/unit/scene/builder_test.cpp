// Limits and defaults of the scene builder.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "error_of.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

// Ids of media have 16 bits.
TEST(SceneBuilder, RefusesMoreMediaThanThereAreIds) {
    std::string media;
    for (int i = 0; i <= 0x7fff; ++i)
        media += "<medium type=\"homogeneous\"><float name=\"albedo\" value=\"0\"/></medium>";
    const std::string error = error_of([&] { build(front_camera(4) + room() + media); });
    EXPECT_NE(error.find("a scene can have at most 32767 media"), std::string::npos) << error;
}

TEST(SceneBuilder, RefusesCropsBeyondTheImage) {
    const SceneDescription scene = parse_mitsuba_xml(
        "<scene version=\"3.0.0\">" + front_camera(4) + room() + "</scene>", "test.xml");
    constexpr int kLargest = std::numeric_limits<int>::max();
    for (const auto& crop : {std::array{kLargest, 0, 2, 2}, {0, kLargest, 2, 2}, {1, 1, 4, 3}}) {
        BuildOptions options;
        options.crop = crop;
        const std::string error = error_of([&] { build_scene(scene, options); });
        EXPECT_NE(error.find("does not lie within the image"), std::string::npos) << error;
    }
}

TEST(SceneBuilder, MessagesStateTheValueThatIsRefused) {
    const std::string ball = "<shape type=\"sphere\">";
    const auto tiny_instance = [](const std::string& group, const std::string& scale) {
        return "<shape type=\"instance\"><ref id=\"" + group +
               "\"/><transform name=\"to_world\"><scale value=\"" + scale +
               "\"/></transform></shape>";
    };
    const auto bsdf = [&](const std::string& type, const std::string& params) {
        return ball + "<bsdf type=\"" + type + "\">" + params + "</bsdf></shape>";
    };
    for (const auto& [body, message] : std::vector<std::pair<std::string, std::string>>{
             {ball + "<medium type=\"homogeneous\" name=\"inside\"/></shape>",
              "must be named \"interior\" or \"exterior\", not \"inside\""},
             {ball + "<medium type=\"homogeneous\" name=\"interior\"><rgb name=\"albedo\" "
                     "value=\"0, 0.5, 0.25\"/></medium></shape>",
              "but its albedo is (0, 0.5, 0.25)"},
             {"<shape type=\"instance\"/>", "but contains 0 shapes"},
             {"<shape type=\"instance\">" + ball + "</shape></shape>",
              "but contains 1 shape, a \"sphere\""},
             {"<shape type=\"cylinder\"><point name=\"p0\" value=\"1, 2, 3\"/><point "
              "name=\"p1\" value=\"1, 2, 3\"/></shape>",
              "must differ, but both are (1, 2, 3)"},
             {"<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"20\"/><float "
              "name=\"beam_width\" value=\"30\"/></emitter>",
              "\"beam_width\" is 30, but must not exceed \"cutoff_angle\", which is 20"},
             {"<emitter type=\"sky\"><rgb name=\"albedo\" value=\"0.5, 2, 0\"/></emitter>",
              "\"albedo\" is (0.5, 2, 0)"},
             {"<emitter type=\"sky\"><transform name=\"to_world\"><scale z=\"4\"/></transform>"
              "</emitter>",
              "\"to_world\" of emitter \"sky\" may rotate, mirror, move and scale by the same "
              "factor"},
             {"<emitter type=\"sunsky\"><transform name=\"to_world\"><scale x=\"2\"/></transform>"
              "</emitter>",
              "\"to_world\" of emitter \"sunsky\" may rotate"},
             {"<emitter type=\"envmap\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
              "/tests/scenes/heights.pgm\"/><transform name=\"to_world\"><scale "
              "y=\"3\"/></transform>"
              "</emitter>",
              "\"to_world\" of emitter \"envmap\" may rotate"},
             {"<shape type=\"shapegroup\" id=\"g\">" + ball + "</shape></shape>" +
                  tiny_instance("g", "1e-13"),
              "must not be smaller than 1e-12 of its group, but the scale of this one is 1e-13"},
             {"<shape type=\"shapegroup\" id=\"g\">" + ball +
                  "</shape></shape><shape type=\"shapegroup\" id=\"h\">" +
                  tiny_instance("g", "1e-7") + "</shape>" + tiny_instance("h", "-1e-7"),
              "but the scale of this one is 1e-14"},
             {bsdf("plastic", "<float name=\"int_ior\" value=\"1e9\"/>"), "int_ior"},
             {bsdf("phong", "<float name=\"exponent\" value=\"1e9\"/>"),
              "\"exponent\" is (1000000000, 1000000000, 1000000000)"},
             {bsdf("coatedconductor", "<float name=\"int_ior\" value=\"1\"/><float "
                                      "name=\"ext_ior\" value=\"2\"/>"),
              "the index of the coat is 0.5 times that outside"}}) {
        const std::string error =
            error_of([&xml = body] { build(front_camera(4) + room() + xml); });
        EXPECT_NE(error.find(message), std::string::npos) << error << "\nexpected: " << message;
    }
}

// Columns of a camera's transform that are only scaled have the directions of the axes.
TEST(SceneBuilder, CamerasMayBeScaledButNotSheared) {
    for (const char* name : {"perspective", "thinlens"}) {
        const std::string type = name;
        const std::string lens = type == "thinlens"
                                     ? "<float name=\"aperture_radius\" value=\"0.1\"/><float "
                                       "name=\"focus_distance\" value=\"3\"/>"
                                     : "";
        const auto camera = [&](const std::string& transform) {
            return error_of([&] {
                build("<sensor type=\"" + type + "\">" + lens + "<transform name=\"to_world\">" +
                      transform + "</transform></sensor>" + room());
            });
        };
        const std::string look = "<lookat origin=\"1,0.5,4\" target=\"0,0,0\" up=\"0.5,1,0\"/>";
        EXPECT_EQ(camera(look), "");
        EXPECT_EQ(camera("<scale x=\"2\" z=\"3\"/>" + look), "");
        EXPECT_EQ(camera(look + "<scale x=\"-1\"/>"), "");
        const std::string error = camera(look + "<scale x=\"1.5\"/>");
        EXPECT_NE(error.find("\"to_world\" of sensor \"" + type + "\" shears"), std::string::npos)
            << error;
    }
}

TEST(SceneBuilder, DefaultFilterIsGaussianWithAndWithoutAFilm) {
    const std::string lamp = "<emitter type=\"constant\"/>";
    EXPECT_EQ(build("<sensor type=\"perspective\"/>" + lamp).filter().name(), "gaussian");
    EXPECT_EQ(build("<sensor type=\"perspective\"><film type=\"hdrfilm\"/></sensor>" + lamp)
                  .filter()
                  .name(),
              "gaussian");
}

// The default of diffuse is 0.5.
TEST(SceneBuilder, UnknownTextureIsReplacedByTheDefault) {
    BuildOptions options;
    options.lenient = true;
    const Scene scene =
        build_scene(parse_mitsuba_xml("<scene version=\"3.0.0\">" + front_camera(4) +
                                          "<shape type=\"sphere\"><bsdf type=\"diffuse\">"
                                          "<texture type=\"no_such\" name=\"reflectance\"/>"
                                          "</bsdf></shape></scene>",
                                      "test.xml"),
                    options);
    EXPECT_EQ(scene.shapes().at(0).material->mean_albedo(), Rgb(0.5f));
}

// A constant above 1 is refused.
TEST(SceneBuilder, TexturesAreClampedToTheBoundOfTheirParameter) {
    const auto scaled = [](const std::string& scale) {
        return build(front_camera(4) +
                     "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"scale\" "
                     "name=\"reflectance\"><texture type=\"checkerboard\"/><rgb name=\"scale\" "
                     "value=\"" +
                     scale + "\"/></texture></bsdf></shape>")
            .shapes()
            .at(0)
            .material->mean_albedo();
    };
    EXPECT_EQ(scaled("1, 2, 5").b, 1);
    EXPECT_LT(scaled("1, 2, 5").g, 0.7f);
}

TEST(SceneBuilder, RefusesGroupsThatMultiply) {
    // Each group has the one before it twice: 2^25 instances.
    std::string groups = "<shape type=\"shapegroup\" id=\"g0\"><shape type=\"sphere\"/></shape>\n";
    for (int i = 1; i <= 25; ++i) {
        const std::string nested =
            "<shape type=\"instance\"><ref id=\"g" + std::to_string(i - 1) + "\"/></shape>";
        groups += "<shape type=\"shapegroup\" id=\"g" + std::to_string(i) + "\">" + nested +
                  nested + "</shape>\n";
    }
    const std::string error = error_of([&] {
        build(front_camera(4) + groups + "<shape type=\"instance\"><ref id=\"g25\"/></shape>");
    });
    EXPECT_NE(error.find("nested groups amount to more than 4194304 instances"), std::string::npos)
        << error;
}

TEST(SceneBuilder, CountsInstancesInGroupsOnlyWhereTheyMultiply) {
    // Few shapes, used by many instances of the file itself.
    std::string scene = "<shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\"/></shape>"
                        "<shape type=\"shapegroup\" id=\"h\">";
    for (int i = 0; i < 10; ++i) scene += "<shape type=\"instance\"><ref id=\"g\"/></shape>";
    scene += "</shape>";
    for (int i = 0; i < 10; ++i) scene += "<shape type=\"instance\"><ref id=\"h\"/></shape>";
    EXPECT_EQ(build(front_camera(4) + room() + scene).statistics().instances, 100u);
}

TEST(SceneBuilder, RefusesWhatSinglePrecisionCannotHold) {
    const auto scaled = [](const std::string& shape, const std::string& transform) {
        return "<shape type=\"" + shape + "\"><transform name=\"to_world\">" + transform +
               "</transform></shape>";
    };
    const std::string far = "shapes must lie within ±1e18", entry = "out of range for single";
    for (const auto& [body, message] : std::vector<std::pair<std::string, std::string>>{
             {scaled("sphere", "<scale value=\"1e19\"/>"), far},
             {scaled("rectangle", "<scale value=\"1e20\"/>"), far},
             {scaled("cube", "<translate x=\"-2e18\"/>"), far},
             {scaled("disk", "<scale value=\"1e30\"/>"), far},
             {scaled("cylinder", "<translate z=\"1e30\"/>"), far},
             {scaled("cube", "<translate x=\"1e200\"/>"), entry},
             {"<shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\"/></shape>"
              "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\"><scale "
              "value=\"1e25\"/></transform></shape>",
              far},
             {"<sensor type=\"perspective\"><transform name=\"to_world\"><translate "
              "x=\"1e60\"/></transform></sensor>",
              entry}}) {
        const bool has_camera = body.find("sensor") != std::string::npos;
        const std::string error = error_of(
            [&, &xml = body] { build((has_camera ? "" : front_camera(4)) + room() + xml); });
        EXPECT_NE(error.find(message), std::string::npos) << error << "\nexpected: " << message;
    }
}

// However large the scene is, and with it the power of light from infinity, and however bright a lamp.
TEST(SceneBuilder, FiniteAndInfiniteEmittersAreBothChosen) {
    struct Share {
        double chosen = 0, of_power = 0;
    };
    const auto share_of_infinity = [](const std::string& objects, float intensity) {
        const Scene scene = build(
            front_camera(4) + "<emitter type=\"constant\"/><emitter type=\"directional\"/>" +
            fmt::format("<emitter type=\"point\"><rgb name=\"intensity\" value=\"{0},{0},{0}\"/>"
                        "</emitter>",
                        intensity) +
            objects);
        Share infinite;
        double pmf = 0, power = 0;
        for (const auto& e : scene.emitters()) {
            pmf += double(e->selection_pmf);
            power += e->power();
            if (!e->is_infinite()) continue;
            infinite.chosen += double(e->selection_pmf);
            infinite.of_power += e->power();
        }
        EXPECT_NEAR(pmf, 1, 1e-6);
        infinite.of_power /= power;
        return infinite;
    };
    const std::string room = sphere("0,0,0", "1", ""), distant = sphere("1e6,0,0", "1", "");
    EXPECT_NEAR(share_of_infinity(room + distant, 1).chosen, 0.75, 1e-6);
    EXPECT_NEAR(share_of_infinity(room, 1e6f).chosen, 0.25, 1e-6);
    const Share between = share_of_infinity(room, 20);
    EXPECT_NEAR(between.chosen, between.of_power, 1e-6);
    EXPECT_NEAR(between.of_power, 0.5, 0.2);
}

}  // namespace
}  // namespace etendue::test
