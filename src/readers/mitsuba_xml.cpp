#include "readers/mitsuba_xml.h"

#include "readers/file_bytes.h"
#include "readers/mitsuba_reader.h"

namespace etendue {

SceneDescription read_mitsuba_xml(const std::string& file, const ReadOptions& options) {
    const ReadOptions all = with_disk(options);
    return parse_mitsuba_xml(read_scene_bytes(file, all), file, all);
}

SceneDescription parse_mitsuba_xml(std::string_view text, const std::string& file,
                                   const ReadOptions& options) {
    return MitsubaReader(file, options).read(text);
}

}  // namespace etendue
