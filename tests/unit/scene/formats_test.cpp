// The scenes of tests/scenes/formats: together they contain every plug-in and every parameter that the tables of the formats
// list as supported. tests/program/formats_test.cpp renders them.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "readers/gltf.h"
#include "readers/mitsuba_xml.h"
#include "readers/pbrt.h"
#include "scene/builder.h"
#include "scene/mitsuba_manual.h"
#include "scene/settings.h"
#include "words.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_of(const char* folder) {
    std::vector<fs::path> files;
    for (const auto& entry :
         fs::directory_iterator(fs::path(ETENDUE_SOURCE_DIR) / "tests/scenes/formats" / folder))
        files.push_back(entry.path());
    EXPECT_FALSE(files.empty()) << folder;
    return files;
}

std::string text_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// Parameters by category and plug-in.
using Uses = std::map<std::pair<std::string, std::string>, std::set<std::string>>;

void expect_used(const Uses& uses, const std::string& category, const std::string& plugin,
                 const std::vector<std::string>& params) {
    const auto it = uses.find({category, plugin});
    if (it == uses.end()) {
        ADD_FAILURE() << "no scene has the " << category << " \"" << plugin << "\"";
        return;
    }
    for (const std::string& param : params)
        EXPECT_TRUE(it->second.count(param)) << "no scene has the parameter \"" << param << "\" of "
                                             << category << " \"" << plugin << "\"";
}

// ---- Mitsuba

/// Whether a plug-in's own table says that a parameter has no effect.
bool is_without_effect(const ManualEntry& entry, const std::string& param) {
    static const std::vector<PluginInfo> plugins = [] {
        std::vector<PluginInfo> all = scene_plugins();
        for (const IntegratorAlias& a : integrator_aliases()) all.push_back(a.info);
        return all;
    }();
    for (const PluginInfo& info : plugins) {
        const std::string_view category = info.category;
        if (category.substr(category.rfind('-') + 1) != entry.category ||
            std::string_view(info.name) != entry.name)
            continue;
        for (const ParamInfo& p : info.params)
            for (const char* word : {"Accepted", "Ignored", "Always"})
                if (p.name == param && std::string_view(p.doc).starts_with(word)) return true;
    }
    return false;
}

void expect_mitsuba(const char* folder, int manual) {
    Uses uses;
    std::string all_text;
    for (const fs::path& file : files_of(folder)) {
        SCOPED_TRACE(file);
        all_text += text_of(file);
        const SceneDescription scene = read_mitsuba_xml(file.string());
        for (const SceneObject& o : scene.objects) {
            std::set<std::string>& params = uses[{o.category, o.type}];
            for (const Param& p : o.params) params.insert(p.name);
            for (const auto& c : o.children) {
                params.insert(c.name);
                params.insert(scene.objects[size_t(c.object)].category);
            }
        }
    }
    for (const ManualEntry& e : mitsuba_manual()) {
        if (e.refused || !(e.manuals & manual)) continue;
        // A binary format, of which serialized_test.cpp writes files.
        if (std::string_view(e.name) == "serialized") continue;
        const std::string_view plugin = e.name;
        if (e.replacement || plugin == "tiledhdrfilm") {  // The reader gives them other names.
            EXPECT_NE(all_text.find(fmt::format("type=\"{}\"", e.name)), std::string::npos)
                << "no scene has the " << e.category << " \"" << e.name << '"';
            continue;
        }
        std::vector<std::string> params;
        for (const char* list : {e.params, manual == kMitsuba06 ? e.params_06 : e.params_3})
            for (const std::string& name : words(list)) {
                const bool is_renamed = plugin == "diffuse" && name == "diffuse_reflectance";
                if (!is_renamed && !find_manual_note(e.category, e.name, name) &&
                    !is_without_effect(e, name))
                    params.push_back(name);
            }
        expect_used(uses, e.category, e.name, params);
    }
}

TEST(Formats, ScenesHaveAllOfMitsuba06) {
    expect_mitsuba("mitsuba06", kMitsuba06);
}

TEST(Formats, ScenesHaveAllOfMitsuba3) {
    expect_mitsuba("mitsuba3", kMitsuba3);
}

// ---- pbrt

/// What the directives of a file without comments name.
void add_pbrt_uses(const std::string& text, Uses& uses) {
    static const std::map<std::string, std::string> kCategories = {
        {"Shape", "pbrt-shape"},
        {"Material", "pbrt-material"},
        {"MakeNamedMaterial", "pbrt-material"},
        {"Texture", "pbrt-texture"},
        {"LightSource", "pbrt-light"},
        {"AreaLightSource", "pbrt-area-light"},
        {"MakeNamedMedium", "pbrt-medium"},
        {"Camera", "pbrt-camera"},
        {"Film", "pbrt-film"},
        {"PixelFilter", "pbrt-filter"},
        {"Sampler", "pbrt-sampler"},
        {"Integrator", "pbrt-integrator"}};
    static const std::regex kToken("\"([^\"]*)\"|([A-Z]\\w+)");
    std::string directive;
    std::vector<std::string> strings;
    const auto finish = [&] {
        const auto category = kCategories.find(directive);
        if (category == kCategories.end()) return;
        size_t name = directive == "Texture" ? 2 : 0;
        if (directive.starts_with("MakeNamed"))
            name =
                size_t(std::find(strings.begin(), strings.end(), "string type") - strings.begin()) +
                1;
        std::set<std::string>& params = uses[{category->second, strings.at(name)}];
        for (const std::string& s : strings)
            if (const size_t blank = s.find(' '); blank != s.npos)
                params.insert(s.substr(blank + 1));
    };
    for (std::sregex_iterator it(text.begin(), text.end(), kToken), end; it != end; ++it) {
        if ((*it)[2].matched) {
            finish();
            directive = (*it)[2];
            strings.clear();
        } else {
            strings.push_back((*it)[1]);
        }
    }
    finish();
}

/// Whether a description is of this version; removes the version that it begins with.
bool is_of_version(std::string& doc, int version) {
    for (const int v : {3, 4}) {
        const std::string prefix = fmt::format("v{}: ", v);
        if (!doc.starts_with(prefix)) continue;
        doc.erase(0, prefix.size());
        return v == version;
    }
    return true;
}

bool has_effect(const std::string& doc) {
    return !doc.starts_with("Rejected") && !doc.starts_with("Accepted") &&
           !doc.starts_with("Ignored") && !doc.starts_with("Only for mappings that are rejected");
}

void expect_pbrt(const char* folder, int version) {
    Uses uses;
    for (const fs::path& file : files_of(folder)) add_pbrt_uses(text_of(file), uses);
    // All samplers have the parameters of all of them in one table.
    std::set<std::string> of_samplers;
    for (const auto& [plugin, params] : uses)
        if (plugin.first == "pbrt-sampler") of_samplers.insert(params.begin(), params.end());
    for (auto& [plugin, params] : uses)
        if (plugin.first == "pbrt-sampler") params = of_samplers;
    for (const PluginInfo& info : pbrt_plugins()) {
        std::string doc = info.doc;
        if (!is_of_version(doc, version) || !has_effect(doc)) continue;
        std::vector<std::string> params;
        for (const ParamInfo& p : info.params) {
            std::string param_doc = p.doc;
            if (is_of_version(param_doc, version) && has_effect(param_doc))
                params.emplace_back(p.name);
        }
        expect_used(uses, info.category, info.name, params);
    }
}

TEST(Formats, ScenesHaveAllOfPbrt3) {
    expect_pbrt("pbrt3", 3);
}

TEST(Formats, ScenesHaveAllOfPbrt4) {
    expect_pbrt("pbrt4", 4);
}

// ---- glTF

TEST(Formats, ScenesHaveAllExtensionsOfGltf) {
    std::string all_text;
    for (const fs::path& file : files_of("gltf")) all_text += text_of(file);
    for (const std::string& name : gltf_extensions())
        EXPECT_NE(all_text.find('"' + name + '"'), std::string::npos) << name;
}

}  // namespace
}  // namespace etendue::test
