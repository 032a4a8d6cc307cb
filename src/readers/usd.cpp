#include "readers/usd.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "readers/file_bytes.h"
#include "readers/mitsuba_xml.h"
#include "readers/ply.h"
#include "readers/scene_file.h"
#include "system/child_process.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// What the command has printed: one line for each warning and error.
struct Messages {
    std::vector<std::string> warnings;
    std::string error;  ///< Empty if there is none.
};

/// An error that the command does not name itself is the last line of a traceback.
Messages messages_of(const std::string& text, bool has_failed) {
    constexpr std::string_view kWarning = "warning: ", kError = "etendue.usd: ",
                               kOthers[] = {"RuntimeError: ", "ModuleNotFoundError: ",
                                            "python -m etendue.usd: error: "};
    Messages m;
    std::string last;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with(kWarning))
            m.warnings.push_back(line.substr(kWarning.size()));
        else if (line.starts_with(kError))
            m.error = line.substr(kError.size());
        if (line.find_first_not_of(" \r") != line.npos) last = line;
    }
    if (!has_failed || !m.error.empty()) return m;
    for (const std::string_view other : kOthers)
        if (last.starts_with(other)) last.erase(0, other.size());
    m.error = last;
    return m;
}

/// The Pythons that may have the package, the best first.
std::vector<std::string> pythons() {
    std::vector<std::string> all;
    std::error_code ignored;
    if (const char* environment = std::getenv("VIRTUAL_ENV"); environment && *environment)
        if (fs::path file = fs::path(environment) / "bin/python3"; fs::exists(file, ignored))
            all.push_back(file.string());
    if (const std::string of_path = find_program("python3");
        !of_path.empty() && (all.empty() || !fs::equivalent(all[0], of_path, ignored) ||
                             fs::path(of_path).parent_path() != fs::path(all[0]).parent_path()))
        all.push_back(of_path);
    return all;
}

/// Arguments of the command for values of parameters.
std::vector<std::string> arguments_of(const std::map<std::string, std::string>& defines) {
    std::vector<std::string> words;
    for (const auto& [name, value] : defines) {
        if (const size_t colon = name.rfind(':'); name.starts_with('/') && colon != name.npos) {
            words.push_back(fmt::format("--variant={}={}", name, value));
        } else if (name == "purpose") {
            std::istringstream purposes(value);
            for (std::string p; std::getline(purposes, p, ',');) words.push_back("--purpose=" + p);
        } else if (name == "camera" || name == "time" || name == "subdivision") {
            words.push_back(fmt::format("--{}={}", name, value));
        } else {
            throw UnusedDefines(
                fmt::format("scenes of USD have no parameter \"{}\"; there are camera, time, "
                            "subdivision, purpose, and /PRIM:SET for a variant",
                            name));
        }
    }
    return words;
}

bool is_missing(const std::string& error) {
    return error.find("No module named") != error.npos ||
           error.find("pip install usd-core") != error.npos;
}

std::string without(const std::string& text, const std::string& beginning) {
    return text.starts_with(beginning) ? text.substr(beginning.size()) : text;
}

/// Calls the command for the XML file `xml`; its log is written to `log`. Returns its warnings.
std::vector<std::string> convert(const std::string& file, const ReadOptions& options,
                                 const std::string& xml, const std::string& log) {
    const std::vector<std::string> more = arguments_of(options.defines);
    std::vector<std::string> missing;
    for (const std::string& python : pythons()) {
        // Not from the current folder, as Python would otherwise.
        std::vector<std::string> words = {
            python, "-c",
            "import sys; sys.path[:] = [p for p in sys.path if p]; "
            "from etendue.usd.__main__ import main; sys.exit(main())"};
        words.insert(words.end(), more.begin(), more.end());
        if (options.lenient) words.push_back("--lenient");
        words.insert(words.end(), {"--", file, xml});
        const int status = run_child(std::move(words), log);
        const Messages m = messages_of(read_file_bytes(log), status != 0);
        if (status == 0) return m.warnings;
        if (is_missing(m.error)) {
            missing.push_back(fmt::format("{}: {}", python, m.error));
            continue;
        }
        throw std::runtime_error(
            fmt::format("{}: {}", file,
                        m.error.empty() ? fmt::format("{} ended with the status {}", python, status)
                                        : without(m.error, file + ": ")));
    }
    throw std::runtime_error(fmt::format(
        "{}: stages of USD are read by the Python package etendue with usd-core, which {}. "
        "\"pip install '.[usd]'\" in the folder of etendue's sources installs both into an active "
        "virtual environment",
        file,
        missing.empty() ? "needs a python3 in PATH"
                        : fmt::format("cannot be used ({})", fmt::join(missing, "; "))));
}

bool is_inside(const fs::path& file, const fs::path& folder) {
    const auto [end, ignored] =
        std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
    return end == folder.end();
}

}  // namespace

void take_in_files(SceneDescription& scene, const std::string& folder, const std::string& base) {
    const fs::path own = fs::canonical(folder);
    std::map<std::string, int64_t> images;
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        SceneObject& o = scene.objects[i];
        const auto named = std::ranges::find(o.params, "filename", &Param::name);
        if (named == o.params.end() || !named->as<std::string>()) continue;
        const fs::path file = fs::canonical(resolve_file({scene, int(i)}));
        if (!is_inside(file, own)) {
            named->value = fs::proximate(file, fs::path(base)).string();
        } else if (o.type == "ply") {
            o.type = "mesh";
            named->name = "mesh";
            named->value = int64_t(scene.meshes.size());
            MeshData mesh = read_ply(file.string());
            mesh.name = o.id;
            scene.meshes.emplace_back(std::move(mesh));
        } else {
            const auto [at, is_new] = images.emplace(file.string(), int64_t(scene.images.size()));
            if (is_new)
                scene.images.emplace_back(
                    EncodedImage{file.filename().string(), read_file_bytes(file.string())});
            named->name = "image";
            named->value = at->second;
        }
    }
    scene.search_paths = {base};
}

SceneDescription read_usd(const std::string& file, const ReadOptions& options) {
    const HeldSignals signals;  // until the folder is deleted
    const TemporaryFolder folder;
    const std::string xml = (folder.path() / "scene.xml").string();
    std::vector<std::string> warnings =
        convert(file, options, xml, (folder.path() / "messages.txt").string());
    SceneDescription scene = read_mitsuba_xml(xml, {});
    take_in_files(scene, folder.path().string(), directory_of(file));
    scene.file = file;
    // Mitsuba's XML needs an integrator, and stages have none.
    std::erase_if(scene.roots,
                  [&](int root) { return scene.objects[size_t(root)].category == "integrator"; });
    // The ids are the paths of prims.
    for (SceneObject& o : scene.objects) {
        o.where = {o.id.empty() ? file : fmt::format("{}: {}", file, o.id), 0};
        for (Param& p : o.params) p.where = o.where;
        for (SceneObject::Child& c : o.children) c.where = o.where;
    }
    scene.warnings.insert(scene.warnings.begin(), warnings.begin(), warnings.end());
    return scene;
}

}  // namespace etendue
