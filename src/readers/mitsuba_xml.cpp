#include "readers/mitsuba_xml.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "readers/mitsuba_reader.h"

namespace etendue {
namespace {

std::optional<std::string> read_from_disk(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return {};
    std::ifstream in(path, std::ios::binary);
    if (!in) return {};
    std::string contents((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    if (in.bad()) return {};
    return contents;
}

}  // namespace

SceneDescription read_mitsuba_xml(const std::string& file, const ReadOptions& options) {
    ReadOptions with_disk = options;
    if (!with_disk.read_file) with_disk.read_file = read_from_disk;
    const auto text = with_disk.read_file(file);
    if (!text) throw SceneError({file, 0}, "cannot read the scene file");
    return parse_mitsuba_xml(*text, file, with_disk);
}

SceneDescription parse_mitsuba_xml(std::string_view text, const std::string& file,
                                   const ReadOptions& options) {
    return MitsubaReader(file, options).read(text);
}

}  // namespace etendue
