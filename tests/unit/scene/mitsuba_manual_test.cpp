// Scenes as Mitsuba's manuals allow them, and the table of what the manuals document.

#include "scene/mitsuba_manual.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "error_of.h"
#include "scene/settings.h"
#include "test_scenes.h"
#include "words.h"

namespace etendue::test {
namespace {

std::vector<PluginInfo> all_plugins() {
    std::vector<PluginInfo> plugins = scene_plugins();
    for (const IntegratorAlias& a : integrator_aliases()) plugins.push_back(a.info);
    return plugins;
}

Scene read(const std::string& contents, bool lenient = false, const char* version = "3.0.0",
           const std::string& sensor = {}) {
    ReadOptions read_options;
    read_options.lenient = lenient;
    BuildOptions options;
    options.lenient = lenient;
    options.sensor = sensor;
    return build_scene(parse_mitsuba_xml("<scene version=\"" + std::string(version) + "\">" +
                                             contents + "</scene>",
                                         "test.xml", read_options),
                       options);
}

std::string error_of(const std::string& contents) {
    return test::error_of([&] { read(contents); });
}

bool has(const std::vector<std::string>& lines, const std::string& text) {
    return std::any_of(lines.begin(), lines.end(),
                       [&](const std::string& l) { return l.find(text) != l.npos; });
}

const std::string kBulb = "<emitter type=\"constant\"/>";

TEST(MitsubaManual, SaysWhatBecomesOfEveryParameter) {
    const std::vector<PluginInfo> plugins = all_plugins();
    for (const ManualEntry& e : mitsuba_manual()) {
        if (e.refused || std::string_view(e.name) == "batch") continue;
        const std::string_view name = e.replacement ? e.replacement : e.name;
        const auto plugin = std::find_if(plugins.begin(), plugins.end(), [&](const PluginInfo& p) {
            return p.category == std::string_view(e.category) && p.name == name;
        });
        if (name == "tiledhdrfilm") continue;  // becomes hdrfilm
        ASSERT_NE(plugin, plugins.end()) << e.category << " " << e.name;
        for (const char* list : {e.params, e.params_06, e.params_3})
            for (const std::string& p : words(list)) {
                const bool known = std::any_of(plugin->params.begin(), plugin->params.end(),
                                               [&](const ParamInfo& q) { return q.name == p; });
                // The reader converts these.
                const bool converted =
                    p == "diffuse_reflectance" || (e.replacement && p == "alpha");
                EXPECT_TRUE(known || converted || find_manual_note(e.category, e.name, p))
                    << e.category << " " << e.name << ": " << p;
            }
    }
}

TEST(MitsubaManual, RefusalsGiveTheReason) {
    EXPECT_NE(error_of(front_camera(4) + kBulb +
                       "<shape type=\"sphere\"><bsdf type=\"measured\"/></shape>")
                  .find("bsdf \"measured\" is not supported: measured materials"),
              std::string::npos);
    EXPECT_NE(error_of(front_camera(4) + "<emitter type=\"envmap\"><texture type=\"bitmap\" "
                                         "name=\"bitmap\"/></emitter>")
                  .find("parameter \"bitmap\" of emitter \"envmap\" is not supported"),
              std::string::npos);
}

TEST(MitsubaManual, ParametersWithoutEffectAreAccepted) {
    const Scene scene =
        read(front_camera(4) + "<emitter type=\"constant\"><float name=\"samplingWeight\" "
                               "value=\"2\"/></emitter>",
             false, "0.6.0");
    EXPECT_TRUE(scene.warnings().empty());
}

TEST(MitsubaScenes, AnythingAtTheTopCanBeReferredTo) {
    const Scene scene =
        read("<film type=\"hdrfilm\" id=\"f\"><integer name=\"width\" value=\"7\"/><ref "
             "id=\"r\"/></film>"
             "<rfilter type=\"box\" id=\"r\"/><sampler type=\"independent\" id=\"s\"><integer "
             "name=\"sample_count\" value=\"9\"/></sampler><integrator type=\"path\" id=\"i\"/>"
             "<integrator type=\"aov\"><ref id=\"i\"/></integrator>"
             "<emitter type=\"area\" id=\"e\"/><shape type=\"sphere\"><ref id=\"e\"/></shape>"
             "<sensor type=\"perspective\"><ref id=\"f\"/><ref id=\"s\"/></sensor>");
    EXPECT_EQ(scene.film().width, 7);
    EXPECT_EQ(scene.filter().name(), "box");
    EXPECT_EQ(scene.defaults().spp, 9);
    ASSERT_TRUE(scene.defaults().integrator);
    EXPECT_EQ(scene.defaults().integrator->type, "path");
    EXPECT_EQ(scene.emitters().size(), 1u);
    EXPECT_TRUE(has(scene.warnings(), "the one within it, \"path\", is rendered"));
}

TEST(MitsubaManual, SaysWhatIsReplaced) {
    const std::string table = mitsuba_manual_table(all_plugins());
    for (const char* row :
         {"| **`erpt`** |  | replaced by `path`, with a warning |",
          "|  | **`stokes`** | replaced by the integrator in it, with a warning |",
          "|  | **`prb`** | rendered by `path`: derivatives are not computed |",
          "| **`photonmapper`** |  | rendered by `pm` |", "| **`sppm`** |  | supported |",
          "| `initialRadius` |  | becomes radius |", "| `alpha` |  | supported |",
          "| `pLarge` |  | supported |", "| `luminanceSamples` |  | ignored, with a warning |",
          "| `lightImage` |  | always true; a warning says so otherwise |",
          "|  | `flip_invalid_normals` | refused if true: it would turn normals toward the viewer "
          "|"})
        EXPECT_NE(table.find(row), std::string::npos) << row;
}

TEST(MitsubaScenes, LenientLeavesOutWhatItCannotRender) {
    const Scene scene = read(front_camera(4) + kBulb +
                                 "<shape type=\"sphere\"/>"
                                 "<shape type=\"hair\"/>"  // 1
                                 "<shape type=\"obj\"><string name=\"filename\" "
                                 "value=\"no.obj\"/></shape>"  // 2
                                 "<shape type=\"shapegroup\" id=\"g\"><shape "
                                 "type=\"sdfgrid\"/></shape>"  // 3 and 4: empty
                                 "<shape type=\"instance\"><ref id=\"g\"/></shape>"
                                 "<shape type=\"sphere\"><bsdf type=\"hk\"/></shape>"  // 5
                                 "<shape type=\"sphere\"><medium type=\"heterogeneous\" "
                                 "name=\"interior\"/></shape>"           // 6
                                 "<emitter type=\"directionalarea\"/>",  // 7
                             true);
    EXPECT_EQ(scene.shapes().size(), 3u);
    ASSERT_FALSE(scene.warnings().empty());
    EXPECT_NE(scene.warnings().back().find("7 things are left out"), std::string::npos)
        << scene.warnings().back();
    EXPECT_TRUE(has(scene.warnings(), "(vacuum instead)"));
}

TEST(MitsubaScenes, WithLenientACoatingIsWhatItCovers) {
    const std::string coated = front_camera(4) + kBulb +
                               "<shape type=\"sphere\"><bsdf type=\"coating\"><bsdf "
                               "type=\"diffuse\"><rgb name=\"reflectance\" value=\"1 0 "
                               "0\"/></bsdf></bsdf></shape>";
    EXPECT_EQ(read(coated, true).shapes()[0].material->mean_albedo(), Rgb(1, 0, 0));
}

TEST(MitsubaScenes, SensorsAreChosenByNumberOrName) {
    const auto camera = [](const std::string& id, int width) {
        return "<sensor type=\"perspective\" id=\"" + id +
               "\"><film type=\"hdrfilm\"><integer "
               "name=\"width\" value=\"" +
               std::to_string(width) + "\"/></film></sensor>";
    };
    const std::string scene = camera("left", 5) + camera("right", 6) + kBulb;
    EXPECT_EQ(read(scene).film().width, 5);
    EXPECT_TRUE(has(read(scene).warnings(), "the scene has 2 sensors (left, right)"));
    EXPECT_EQ(read(scene, false, "3.0.0", "1").film().width, 6);
    EXPECT_EQ(read(scene, false, "3.0.0", "right").film().width, 6);
    EXPECT_THROW(read(scene, false, "3.0.0", "2"), SceneError);
    EXPECT_THROW(read(scene, false, "3.0.0", "up"), SceneError);
}

TEST(MitsubaScenes, GroupsCanBeNested) {
    const Scene scene = read(
        front_camera(4) + kBulb +
        "<shape type=\"shapegroup\" id=\"a\"><shape type=\"sphere\"/></shape>"
        "<shape type=\"shapegroup\" id=\"b\"><shape type=\"rectangle\"/><shape "
        "type=\"instance\"><ref "
        "id=\"a\"/><transform name=\"to_world\"><translate x=\"10\"/></transform></shape></shape>"
        "<shape type=\"instance\"><ref id=\"b\"/><transform name=\"to_world\"><scale "
        "value=\"2\"/></transform></shape>");
    EXPECT_EQ(scene.statistics().instances, 2u);
    EXPECT_FLOAT_EQ(scene.bounds().hi.x, 22);  // 2·(10 + 1)
    EXPECT_FLOAT_EQ(scene.bounds().lo.x, -2);
}

TEST(MitsubaScenes, StretchedQuadricsAreMeshes) {
    const std::string stretched = "<transform name=\"to_world\"><scale x=\"2\" y=\"1\" z=\"1\"/>"
                                  "</transform></shape>";
    for (const char* shape : {"sphere", "cylinder"}) {
        const Scene scene =
            read(front_camera(4) + kBulb + "<shape type=\"" + shape + "\">" + stretched);
        EXPECT_TRUE(scene.shapes()[0].is_mesh);
        EXPECT_NEAR(scene.bounds().hi.x, 2, 1e-5);
        EXPECT_NEAR(scene.bounds().hi.y, 1, 1e-5);
        EXPECT_TRUE(has(scene.warnings(), "becomes a mesh"));
        const SurfaceGeometry g = scene.shapes()[0].shape->surface(5000, 0.3f, 0.3f, false);
        EXPECT_GT(dot(g.ng, Vec3{g.p.x / 4, g.p.y, shape[0] == 's' ? g.p.z : 0}), 0);  // outward
        EXPECT_GT(dot(g.ns, g.ng), 0.99f);
    }
}

TEST(MitsubaScenes, In06AMediumAloneIsInvisible) {
    const std::string fog = front_camera(4) + kBulb +
                            "<shape type=\"cube\"><medium type=\"homogeneous\" name=\"interior\">"
                            "<float name=\"albedo\" value=\"0\"/></medium></shape>";
    EXPECT_EQ(read(fog, false, "0.6.0").shapes()[0].material->opacity(Vec2()), 0);
    EXPECT_EQ(read(fog).shapes()[0].material->opacity(Vec2()), 1);
}

// Seen from the front of the geometric surface, but from behind the shading surface.
TEST(MitsubaScenes, NormalsAreStrictWhereTheIntegratorSaysSo) {
    for (const bool strict : {false, true}) {
        const Scene scene =
            read(front_camera(4) + kBulb + "<shape type=\"rectangle\">" + diffuse("0.5,0.5,0.5") +
                 "</shape><integrator type=\"path\"><boolean name=\"strict_normals\" value=\"" +
                 (strict ? "true" : "false") + "\"/></integrator>");
        const Vec3 ns = normalize(Vec3{1, 0, 1}), wo = normalize(Vec3{-0.95f, 0, 0.3f}),
                   wi = normalize(Vec3{-0.9f, 0.1f, 0.4f}), behind = normalize(Vec3{-1, 0, -1});
        ComponentArena arena;
        const auto bsdf = [&](Vec3 from) {
            return scene.shapes()[0].material->bsdf(
                {{}, {0, 0, 1}, ns, {1, 0, 0}, {0, 1, 0}, {}, from}, arena);
        };
        for (const auto& [mode, adjoint] :
             {std::pair{TransportMode::Radiance, TransportMode::Importance},
              {TransportMode::Importance, TransportMode::Radiance}}) {
            const BsdfEval e = bsdf(wo).eval(wo, wi, mode);
            EXPECT_EQ(e.f.g > 0, !strict);
            // Both ends of the path see the same f̃.
            EXPECT_NEAR(e.f.g / wi.z, bsdf(wi).eval(wi, wo, adjoint).f.g / wo.z, 1e-5);
            // No light passes through the surface.
            EXPECT_EQ(bsdf(wo).eval(wo, behind, mode).f.g, 0);
        }
    }
}

}  // namespace
}  // namespace etendue::test
