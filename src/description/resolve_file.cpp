#include "description/resolve_file.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include <fmt/format.h>

namespace etendue {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> names_in(const fs::path& folder) {
    std::vector<std::string> names;
    std::error_code error;  // ignored: a folder that cannot be listed has no names
    for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, error))
        names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
}

bool equal_ignoring_case(std::string_view a, std::string_view b) {
    const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [&](char x, char y) { return lower(x) == lower(y); });
}

/// `file` with the case that its folders and itself have below `folder`, or "" where they differ in more.
std::string with_existing_case(const fs::path& folder, const std::string& file) {
    fs::path found;
    for (const fs::path& part : fs::path(file)) {
        std::error_code error;
        if (part == "." || part == ".." || fs::exists(folder / found / part, error)) {
            found /= part;
            continue;
        }
        const std::vector<std::string> names = names_in(folder / found);
        const auto it = std::find_if(names.begin(), names.end(), [&](const std::string& n) {
            return equal_ignoring_case(n, part.string());
        });
        if (it == names.end()) return "";
        found /= *it;
    }
    return found.string();
}

/// A file of this name in `folder` or one or two levels below, relative to `folder`.
std::string file_below(const fs::path& folder, const std::string& name) {
    constexpr int kDeepest = 2, kMost = 10'000;
    std::error_code error;  // ignored, as above
    int count = 0;
    for (fs::recursive_directory_iterator it(folder, error), end; it != end && count < kMost;
         it.increment(error), ++count) {
        if (equal_ignoring_case(it->path().filename().string(), name))
            return it->path().lexically_relative(folder).string();
        if (it.depth() >= kDeepest) it.disable_recursion_pending();
    }
    return "";
}

/// Whether a path is absolute, here or on Windows ("C:/…" or "//server/…").
bool is_absolute(const std::string& file) {
    return fs::path(file).is_absolute() ||
           (file.size() > 2 && std::isalpha(static_cast<unsigned char>(file[0])) &&
            file[1] == ':' && file[2] == '/');
}

}  // namespace

const EncodedImage* embedded_image(const Params& params) {
    const auto& images = params.scene().images;
    if (!params.has("image") || images.empty()) return nullptr;
    const EncodedImage& image =
        images[size_t(params.integer("image", 0, 0, int64_t(images.size()) - 1))];
    return &image;
}

std::vector<std::string> spellings(const std::string& file) {
    std::vector<std::string> all = {file};
    if (file.find('\\') != file.npos) {
        all.push_back(file);
        std::replace(all.back().begin(), all.back().end(), '\\', '/');
    }
    return all;
}

std::optional<std::string> find_file(const std::string& file,
                                     const std::vector<std::string>& folders,
                                     std::vector<std::string>* searched) {
    for (const std::string& spelling : spellings(file)) {
        std::vector<fs::path> places;
        if (fs::path(spelling).is_absolute())
            places.emplace_back(spelling);
        else if (folders.empty())
            places.push_back(fs::path(".") / spelling);
        else
            for (const std::string& folder : folders) places.push_back(fs::path(folder) / spelling);
        for (const fs::path& place : places) {
            std::error_code error;
            if (fs::is_regular_file(place, error)) return place.string();
            const fs::path folder = place.parent_path();
            if (searched) searched->push_back(folder.empty() ? "." : folder.string());
        }
    }
    return {};
}

std::string near_file_hint(const std::string& file, const std::vector<std::string>& folders) {
    const std::string slashes = spellings(file).back();
    const fs::path path = slashes;
    const auto meant = [](const std::string& near) {
        return fmt::format("; did you mean \"{}\"?", near);
    };
    if (path.is_absolute())
        if (const std::string near =
                nearest_name(path.filename().string(), names_in(path.parent_path()));
            !near.empty())
            return meant(near);
    for (const std::string& folder : folders) {
        std::error_code error;
        if (!file.empty() && fs::is_directory(fs::path(folder) / path, error))
            return "; it is a folder";
        if (is_absolute(slashes)) {
            if (const std::string near = file_below(folder, path.filename().string());
                !near.empty())
                return meant(near);
            continue;
        }
        if (const std::string near = with_existing_case(folder, slashes); !near.empty())
            return meant(near);
        const fs::path inside = path.parent_path();
        if (const std::string near =
                nearest_name(path.filename().string(), names_in(folder / inside));
            !near.empty())
            return meant((inside / near).string());
        if (const std::string near = file_below(folder, path.filename().string()); !near.empty())
            return meant(near);
    }
    return "";
}

std::string resolve_file(const Params& params, std::string_view name) {
    const std::string file = params.text(name, "");
    if (file.empty())
        params.fail(name, fmt::format("{} \"{}\" needs the parameter \"{}\"",
                                      params.object().category, params.object().type, name));
    std::vector<std::string> folders = params.scene().search_paths;
    if (folders.empty()) folders.emplace_back(".");
    std::vector<std::string> searched;
    if (const auto found = find_file(file, folders, &searched)) return *found;
    params.fail(name, fmt::format("there is no file \"{}\" (looked in {}{})", file,
                                  fmt::join(searched, ", "), near_file_hint(file, folders)));
}

}  // namespace etendue
