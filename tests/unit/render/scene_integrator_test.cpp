// Integrators that scene files name.

#include "render/scene_integrator.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "readers/pbrt.h"
#include "render/render_request.h"
#include "scene/settings.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kRest = front_camera(4) + sphere("0,0,0", "0.5", diffuse("0.5,0.5,0.5")) +
                          "<emitter type=\"constant\"/>";

Scene scene_with(const std::string& integrator, bool lenient = false,
                 const char* version = "3.0.0") {
    BuildOptions options;
    options.lenient = lenient;
    return build_scene(parse_mitsuba_xml("<scene version=\"" + std::string(version) + "\">\n" +
                                             integrator + kRest + "</scene>",
                                         "test.xml"),
                       options);
}
std::string integrator(const std::string& type, const std::string& params = "") {
    return "<integrator type=\"" + type + "\">" + params + "</integrator>";
}
std::string chosen_method(const Scene& scene, const std::string& text = "") {
    return choose_integrator(scene, text).to_string();
}
std::string error_of_scene(const Scene& scene) {
    try {
        return "no error: " + chosen_method(scene);
    } catch (const std::exception& e) {
        return e.what();
    }
}
bool has(const std::vector<std::string>& lines, const std::string& text) {
    return std::ranges::any_of(lines, [&](const std::string& l) { return l.find(text) != l.npos; });
}

/// A parameter of a scene file with the value of the table, or one that is valid.
std::string xml_of(const ParamInfo& p) {
    const std::string name = fmt::format("name=\"{}\"", p.name);
    switch (p.kind) {
    case ParamKind::Bool: return fmt::format("<boolean {} value=\"{}\"/>", name, p.fallback);
    case ParamKind::Int: return fmt::format("<integer {} value=\"{}\"/>", name, p.fallback);
    case ParamKind::Float: return fmt::format("<float {} value=\"{}\"/>", name, p.fallback);
    default: return fmt::format("<string {} value=\"{}\"/>", name, p.fallback);
    }
}

TEST(SceneIntegrator, EveryOneCanBeNamedWithAllItsParameters) {
    for (const IntegratorEntry& e : integrator_registry()) {
        std::string params;
        for (const ParamInfo& p : e.info.params)
            if (*p.fallback) params += xml_of(p);
        const Scene scene = scene_with(integrator(e.info.name, params));
        const SceneIntegrator found = scene_integrator(scene);
        EXPECT_EQ(found.spec.name, e.info.name);
        EXPECT_TRUE(found.warnings.empty()) << found.warnings.front();
        for (const ParamInfo& p : e.info.params) {
            if (*p.fallback) {
                EXPECT_EQ(found.spec.params.at(p.name), p.fallback) << e.info.name << ' ' << p.name;
            }
        }
    }
}

TEST(SceneIntegrator, NamesInCamelCaseAreThoseOfTheOldDialect) {
    const Scene scene = scene_with(
        integrator("vcm", "<integer name=\"lightPaths\" value=\"7\"/><integer name=\"maxDepth\" "
                          "value=\"5\"/><float name=\"radius\" value=\"0.25\"/><boolean "
                          "name=\"merges\" value=\"false\"/>"),
        false, "0.6.0");
    EXPECT_EQ(chosen_method(scene), "vcm:light_paths=7,max_depth=5,merges=false,radius=0.25");
}

TEST(SceneIntegrator, CounterpartsOfMitsubasParametersAreUsed) {
    const auto of = [&](const std::string& xml) {
        return chosen_method(scene_with(xml, false, "0.6.0"));
    };
    const std::string progressive = "<integer name=\"photonCount\" value=\"5000\"/><float "
                                    "name=\"initialRadius\" value=\"0.5\"/><float name=\"alpha\" "
                                    "value=\"0.7\"/>";
    EXPECT_EQ(of(integrator("sppm", progressive)), "sppm:alpha=0.7,light_paths=5000,radius=0.5");
    EXPECT_EQ(of(integrator("ppm", progressive)), "ppm:alpha=0.7,light_paths=5000,radius=0.5");
    EXPECT_EQ(of(integrator("pssmlt", "<float name=\"pLarge\" value=\"0.3\"/>")),
              "pssmlt:p_large=0.3");
    EXPECT_EQ(of(integrator("ptracer", "<integer name=\"rrDepth\" value=\"9\"/>")),
              "light:rr_depth=9");
    EXPECT_EQ(of(integrator("direct")), "path:max_depth=2");
    const Scene photons = scene_with(
        integrator("photonmapper", "<integer name=\"globalPhotons\" value=\"20000\"/><integer "
                                   "name=\"lookupSize\" value=\"1000\"/><float "
                                   "name=\"globalLookupRadius\" value=\"0.125\"/>"),
        false, "0.6.0");
    EXPECT_EQ(chosen_method(photons), fmt::format("pm:light_paths=20000,nearest=512,radius={}",
                                                  0.125f * photons.bounds().radius()));
    EXPECT_TRUE(has(warnings_of(photons), "nearest is at most 512"));
}

TEST(SceneIntegrator, WhatHasNoCounterpartIsSaid) {
    const auto warnings = [](const std::string& xml) {
        return scene_integrator(scene_with(xml, false, "0.6.0")).warnings;
    };
    EXPECT_EQ(warnings(integrator("mlt", "<integer name=\"luminanceSamples\" value=\"9\"/><float "
                                         "name=\"lambda\" value=\"40\"/><integer name=\"rrDepth\" "
                                         "value=\"3\"/><boolean name=\"lensPerturbation\" "
                                         "value=\"true\"/><boolean name=\"twoStage\" "
                                         "value=\"false\"/>")),
              std::vector<std::string>{
                  "test.xml:2: integrator \"mlt\": without counterpart here, and ignored: "
                  "luminance_samples=9, lambda=40, rr_depth=3"});
    EXPECT_TRUE(has(warnings(integrator("path", "<boolean name=\"hideEmitters\" value=\"true\"/>")),
                    "ignored: hide_emitters=true"));
    // What is done anyway, and what only divides the work.
    EXPECT_TRUE(warnings(integrator("bdpt", "<boolean name=\"lightImage\" value=\"true\"/><boolean "
                                            "name=\"hideEmitters\" value=\"false\"/>"))
                    .empty());
    EXPECT_TRUE(
        warnings(integrator("ptracer", "<integer name=\"granularity\" value=\"8\"/>")).empty());
    EXPECT_TRUE(has(warnings(integrator("bdpt", "<boolean name=\"lightImage\" value=\"false\"/>")),
                    "ignored: light_image=false"));
    const auto vpl = warnings(integrator("vpl", "<float name=\"clamping\" value=\"0.1\"/>"));
    EXPECT_EQ(vpl.size(), 1u);
    EXPECT_TRUE(has(vpl, "integrator \"vpl\" is not supported; path is rendered"));
}

TEST(SceneIntegrator, ErrorsSayWhereAndWhatIsNear) {
    const auto error = [](const std::string& xml) { return error_of_scene(scene_with(xml)); };
    EXPECT_EQ(error(integrator("upg+bdtp")), "test.xml:2: unknown integrator \"upg+bdtp\" (did you "
                                             "mean \"upg+bdpt\"?); choose another integrator");
    EXPECT_NE(error(integrator("photonmaper")).find("did you mean \"photonmapper\"?"),
              std::string::npos);
    EXPECT_NE(error(integrator("no_such"))
                  .find("unknown integrator \"no_such\" (known: auto, path, light"),
              std::string::npos);
    EXPECT_NE(error(integrator("vcm", "<float name=\"radios\" value=\"1\"/>"))
                  .find("test.xml:2: integrator \"vcm\" has no parameter \"radios\" (did you mean "
                        "\"radius\"?)"),
              std::string::npos);
    EXPECT_NE(error(integrator("vcm", "<string name=\"radius\" value=\"big\"/>"))
                  .find("test.xml:2: parameter \"radius\" of integrator \"vcm\" must be a float"),
              std::string::npos);
    EXPECT_NE(error(integrator("bdpt", "<float name=\"roulette\" value=\"7\"/>"))
                  .find("test.xml:2: bdpt: roulette must lie in [0, 1]"),
              std::string::npos);
    EXPECT_NE(error(integrator("direct", "<integer name=\"max_depth\" value=\"7\"/>"))
                  .find("has no parameter \"max_depth\""),
              std::string::npos);
}

TEST(SceneIntegrator, TablesHaveTheDefaultsThatHold) {
    int shared = 0;
    for (const IntegratorAlias& alias : integrator_aliases()) {
        if (!*alias.integrator) continue;
        const auto find = [](const auto& params, const char* name) {
            return std::ranges::find_if(
                params, [&](const ParamInfo& p) { return std::string_view(p.name) == name; });
        };
        const std::vector<ParamInfo>& own = integrator_entry(alias.integrator).info.params;
        for (const ParamInfo& p : alias.info.params) {
            const auto of_integrator = find(own, p.name);
            const bool is_foreign =
                std::ranges::any_of(alias.params, [&](const MitsubaIntegratorParam& f) {
                    return std::string_view(f.info.name) == p.name;
                });
            EXPECT_NE(of_integrator != own.end(), is_foreign) << alias.info.name << ' ' << p.name;
            if (of_integrator == own.end()) continue;
            EXPECT_STREQ(of_integrator->fallback, p.fallback) << alias.info.name << ' ' << p.name;
            EXPECT_EQ(of_integrator->kind, p.kind) << alias.info.name << ' ' << p.name;
            ++shared;
        }
        for (const MitsubaIntegratorParam& p : alias.params) {
            if (p.use != MitsubaIntegratorParam::Use::Counterpart) continue;
            EXPECT_NE(find(own, p.counterpart), own.end()) << alias.info.name << ' ' << p.info.name;
        }
    }
    EXPECT_GT(shared, 20);
}

TEST(SceneIntegrator, NeverStopsTheScene) {
    EXPECT_EQ(chosen_method(scene_with(integrator("no_such")), "bdpt"), "bdpt");
    EXPECT_EQ(chosen_method(scene_with("")), "auto");
    EXPECT_EQ(chosen_method(scene_with(integrator("adaptive"))), "path");
    const Scene lenient = scene_with(integrator("no_such"), true);
    EXPECT_EQ(chosen_method(lenient), "path");
    EXPECT_TRUE(has(warnings_of(lenient), "unknown integrator \"no_such\""));
    const Scene param = scene_with(
        integrator("vcm", "<float name=\"radios\" value=\"1\"/><integer name=\"max_depth\" "
                          "value=\"4\"/>"),
        true);
    EXPECT_EQ(chosen_method(param), "vcm:max_depth=4");
    EXPECT_TRUE(has(warnings_of(param), "has no parameter \"radios\""));
}

TEST(SceneIntegrator, AnotherMethodTakesOnlyWhatBelongsToTheScene) {
    const Scene scene = scene_with(
        integrator("bdpt", "<integer name=\"max_depth\" value=\"6\"/><integer name=\"rr_depth\" "
                           "value=\"9\"/><float name=\"roulette\" value=\"0.5\"/>"));
    EXPECT_EQ(chosen_method(scene), "bdpt:max_depth=6,roulette=0.5,rr_depth=9");
    EXPECT_EQ(chosen_method(scene, "bdpt"), "bdpt:max_depth=6,roulette=0.5,rr_depth=9");
    EXPECT_EQ(chosen_method(scene, "bdpt:rr_depth=3"), "bdpt:max_depth=6,roulette=0.5,rr_depth=3");
    EXPECT_EQ(chosen_method(scene, "vcm"), "vcm:max_depth=6");
    EXPECT_EQ(chosen_method(scene, "path:max_depth=3"), "path:max_depth=3");
    EXPECT_EQ(chosen_method(scene_with(integrator("direct")), "bdpt"), "bdpt:max_depth=2");
}

TEST(SceneIntegrator, RouletteOfFilesBeginsInTime) {
    const auto with = [](const std::string& params) {
        return scene_integrator(scene_with(integrator("path", params)));
    };
    const SceneIntegrator late = with("<integer name=\"rr_depth\" value=\"1000000\"/>");
    EXPECT_TRUE(has(late.warnings, "rr_depth is 1000000; 1000 is used"));
    EXPECT_EQ(late.spec.to_string(), "path:rr_depth=1000");
    const SceneIntegrator never = with("<integer name=\"max_depth\" value=\"6\"/>"
                                       "<integer name=\"rr_depth\" value=\"1000000\"/>");
    EXPECT_TRUE(never.warnings.empty());
    EXPECT_EQ(never.spec.to_string(), "path:max_depth=6,rr_depth=1000000");
}

TEST(SceneIntegrator, WarningsAreThoseOfTheMethodThatIsUsed) {
    const Scene scene = scene_with(integrator("mlt", "<float name=\"lambda\" value=\"40\"/>"));
    EXPECT_TRUE(has(warnings_of(scene), "lambda"));
    EXPECT_TRUE(has(warnings_of(scene, "mlt:chains=8"), "lambda"));
    EXPECT_FALSE(has(warnings_of(scene, "bdpt"), "lambda"));
}

TEST(SceneIntegrator, ThoseOfPbrtHaveTheirParameters) {
    const auto pbrt = [](const std::string& directives) {
        return build_scene(parse_pbrt(
            directives + " WorldBegin LightSource \"infinite\" Shape \"sphere\"", "test.pbrt"));
    };
    const Scene mlt =
        pbrt("Integrator \"mlt\" \"integer maxdepth\" 7 \"float largestepprobability\" 0.25 "
             "\"integer chains\" 64 \"integer mutationsperpixel\" 48 \"float sigma\" 0.02");
    EXPECT_EQ(chosen_method(mlt), "mmlt:chains=64,max_depth=8,p_large=0.25");
    EXPECT_EQ(default_spp(mlt), 48u);
    EXPECT_TRUE(has(mlt.warnings(), "ignored: sigma"));
    const Scene sppm = pbrt("Integrator \"sppm\" \"float radius\" 0.5 \"integer "
                            "photonsperiteration\" 5000");
    EXPECT_EQ(chosen_method(sppm), "sppm:light_paths=5000,max_depth=6,radius=0.5");
    EXPECT_TRUE(sppm.warnings().empty());
    EXPECT_EQ(chosen_method(pbrt("Integrator \"lightpath\"")), "light:max_depth=6");
    EXPECT_TRUE(has(pbrt("Integrator \"ambientocclusion\"").warnings(), "\"path\" instead"));
}

}  // namespace
}  // namespace etendue::test
