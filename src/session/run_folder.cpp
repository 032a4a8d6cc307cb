#include "session/run_folder.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "session/run_record.h"
#include "system/descriptor.h"
#include "system/failure.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// The text with a dash in place of all but letters and digits, and of what makes it longer than names may be.
std::string simple_name(std::string text) {
    constexpr size_t kLongest = 48;
    if (text.size() > kLongest) text.resize(kLongest);
    for (char& c : text) {
        const bool is_simple =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
        if (!is_simple) c = '-';
    }
    return text;
}

struct FoundFile {
    KeptRun run;
    fs::file_time_type changed;
};

}  // namespace

std::vector<KeptRun> RunFolder::list(const LoadedScene& scene) const {
    std::vector<FoundFile> found;
    std::error_code error;
    for (fs::directory_iterator at(folder_, error), end; !error && at != end; at.increment(error)) {
        const std::string name = at->path().filename().string();
        std::error_code unknown;
        // Links are not followed. An empty file is a name that is taken for a run.
        if (name.starts_with('.') || !name.ends_with(kExtension) ||
            !fs::is_regular_file(at->symlink_status(unknown)) || at->file_size(unknown) == 0 ||
            unknown)
            continue;
        FoundFile file;
        file.run.file = name;
        file.changed = at->last_write_time(unknown);
        try {
            CheckpointFile checkpoint(path_of(name));
            const CheckpointHeader& header = checkpoint.header();
            if (!is_of(header, scene.scene, scene.source)) continue;
            file.run.integrator = header.integrator;
            file.run.seed = header.ranges.front().seed;
            RunStatus record;
            load_record(checkpoint.sections(), record);
            file.run.seeds = record.seeds;
            file.run.finished_seeds = record.finished_seeds;
            file.run.passes = record.seeds > 1 ? record.passes : header.passes();
        } catch (...) {
            file.run.problem = caught();
        }
        found.push_back(std::move(file));
    }
    std::sort(found.begin(), found.end(), [](const FoundFile& a, const FoundFile& b) {
        return a.changed != b.changed ? a.changed > b.changed : a.run.file < b.run.file;
    });
    std::vector<KeptRun> runs;
    for (FoundFile& f : found) runs.push_back(std::move(f.run));
    return runs;
}

std::string RunFolder::take_name(const std::string& scene_file, const std::string& method) const {
    const std::string stem = fmt::format("{}-{}", simple_name(fs::path(scene_file).stem().string()),
                                         simple_name(method));
    for (int i = 1;; ++i) {
        const std::string name = fmt::format("{}-{}{}", stem, i, kExtension);
        // Exclusive, since other programs may take names in the same folder.
        constexpr mode_t kMode = 0666;  // as the user's mask allows
        const Descriptor file(
            ::open(path_of(name).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kMode));
        if (file.is_open()) return name;
        if (errno != EEXIST)
            throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path_of(name),
                                                 std::generic_category().message(errno)));
    }
}

void RunFolder::give_back(const std::string& name) const noexcept {
    try {
        const fs::path path = path_of(name);
        std::error_code ignored;
        if (fs::is_regular_file(fs::symlink_status(path, ignored)) &&
            fs::file_size(path, ignored) == 0)
            fs::remove(path, ignored);
    } catch (const std::bad_alloc&) {
        // The empty file stays.
    }
}

}  // namespace etendue
